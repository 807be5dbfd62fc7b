"""State and hardware of the robot, objects, reach, and services that only take or list something."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import count
from threading import Lock
from typing import Any, Final

import numpy as np
from bosdyn.api import data_buffer_pb2, estop_pb2, payload_pb2, robot_state_pb2, service_fault_pb2, world_object_pb2
from bosdyn.api.log_status import log_status_pb2
from bosdyn.api.spot import inverse_kinematics_pb2

from errand_spot.messages import (
    InvalidRequestError,
    api_joint,
    duration,
    frame_tree,
    pose,
    seconds,
    timestamp,
    transform,
    vec3,
    velocity,
)
from errand_spot.server.arm import JOINTS, READY_RAD
from errand_spot.server.calls import Call, Service
from errand_spot.server.computer import Computer, Motors, Snapshot
from errand_spot.server.graph_map import Perception, SeenTag
from errand_spot.server.hand import X_HAND, solutions
from errand_spot.server.identity import DOMAIN
from errand_spot.server.mobility import FEET_M
from errand_spot.server.obstacles import region_of
from errand_spot.server.scan_points import Region
from skills.robot import Mount, NoImageError

RUNTIME_S: Final = 5400.0
_LOOK_S, _PICTURES_S = 0.5, 5.0
_FIRST_TAG: Final = 1_000_000
"""Id of the object of tag 0; those of clients' objects are smaller."""
_Kinds = world_object_pb2.WorldObjectType
_ActiveLogs, _Log = log_status_pb2.GetActiveLogStatusesResponse, log_status_pb2.GetLogStatusResponse
_FIELDS: Final[Mapping[int, str]] = {
    _Kinds.WORLD_OBJECT_DRAWABLE: "drawable_properties",
    _Kinds.WORLD_OBJECT_APRILTAG: "apriltag_properties",
    _Kinds.WORLD_OBJECT_IMAGE_COORDINATES: "image_properties",
    _Kinds.WORLD_OBJECT_DOCK: "dock_properties",
    _Kinds.WORLD_OBJECT_USER_NOGO: "nogo_region_properties",
}
"""Field of an object of each type; others are never listed."""


class RobotStateService(Service):
    """Tells the robot's state and its hardware."""

    name, type, authority = "robot-state", "bosdyn.api.RobotStateService", f"state.{DOMAIN}"

    def __init__(self, computer: Computer, service_faults: Callable[[], Iterable[Any]]) -> None:
        """`service_faults` gives the faults of services."""
        self._computer, self._service_faults = computer, service_faults

    def GetRobotState(self, _request: Any, _call: Call) -> Any:
        """Returns the state after the last step."""
        made, snapshot = robot_state_pb2.RobotStateResponse(), self._computer.snapshot
        state, stamp = made.robot_state, timestamp(snapshot.time_s)
        self._power(state, snapshot)
        state.kinematic_state.CopyFrom(kinematic_state(snapshot))
        state.system_fault_state.SetInParent()
        for number, fault in enumerate(snapshot.faults):
            made_fault = state.system_fault_state.faults.add(name=fault, uid=number, error_message=fault)
            made_fault.onset_timestamp.CopyFrom(stamp)
        state.behavior_fault_state.faults.extend([] if self._computer.fault is None else [self._computer.fault])
        state.behavior_state.state = self._behaviour(snapshot)
        state.service_fault_state.SetInParent()
        state.service_fault_state.faults.extend(self._service_faults())
        state.terrain_state.SetInParent()
        self._estop(state, stamp)
        self._feet(state, snapshot)
        if self._computer.capabilities.gripper is not None:
            self._manipulator(state, snapshot)
        return made

    def _behaviour(self, snapshot: Snapshot) -> int:
        """State of the body: a robot that cannot move, or sits, is not ready."""
        State, computer = robot_state_pb2.BehaviorState, self._computer
        if not computer.able or (computer.sits and snapshot.sitting):
            return int(State.STATE_NOT_READY)
        if not computer.upright:
            return int(State.STATE_TRANSITION)
        steps = computer.feet_O is None and computer.base_moves(shifted=True)
        return int(State.STATE_STEPPING if steps else State.STATE_STANDING)

    def body_in(self, frame: str) -> Any:
        """The message of the body's pose in a frame."""
        return pose(self._computer.snapshot.X_AB(frame, "body"))

    def GetRobotMetrics(self, _request: Any, _call: Call) -> Any:
        """Returns the time that the robot has been on."""
        made = robot_state_pb2.RobotMetricsResponse()
        made.robot_metrics.timestamp.CopyFrom(timestamp(self._computer.now_s()))
        made.robot_metrics.metrics.add(label="operation_time", units="s", float_value=self._computer.clock.now())
        return made

    def GetRobotHardwareConfiguration(self, _request: Any, _call: Call) -> Any:
        """Returns the links and the description (URDF) of the robot."""
        made = robot_state_pb2.RobotHardwareConfigurationResponse()
        made.hardware_configuration.skeleton.urdf = self._computer.capabilities.description
        names = ["body", *(f"{foot}.{part}" for foot in FEET_M for part in ("hip", "uleg", "lleg"))]
        arm = self._computer.capabilities.arm
        names += [f"arm0.link_{joint}" for joint in (*JOINTS, "fngr")] if arm is not None else []
        for name in names:
            made.hardware_configuration.skeleton.links.add(name=name)
        return made

    def GetRobotLinkModel(self, request: Any, _call: Call) -> Any:
        """Returns an empty mesh: the looks of the maker's robot are not ours to give."""
        made = robot_state_pb2.RobotLinkModelResponse()
        made.link_model.file_name, made.link_model.file_contents = f"{request.link_name}.obj", "# no mesh\n"
        return made

    def _power(self, state: Any, snapshot: Snapshot) -> None:
        charge, stamp = 100.0 * snapshot.battery.charge, timestamp(snapshot.time_s)
        power, State = state.power_state, robot_state_pb2.PowerState
        power.timestamp.CopyFrom(stamp)
        power.motor_power_state = {
            Motors.OFF: State.MOTOR_POWER_STATE_OFF,
            Motors.STARTING: State.MOTOR_POWER_STATE_POWERING_ON,
            Motors.ON: State.MOTOR_POWER_STATE_ON,
        }[snapshot.motors]
        docked = self._computer.docked()
        power.shore_power_state = State.SHORE_POWER_STATE_ON if docked else State.SHORE_POWER_STATE_OFF
        power.robot_power_state = State.ROBOT_POWER_STATE_ON
        power.payload_ports_power_state = State.PAYLOAD_PORTS_POWER_STATE_ON
        power.wifi_radio_power_state = State.WIFI_RADIO_POWER_STATE_ON
        power.locomotion_charge_percentage.value = charge
        power.locomotion_estimated_runtime.CopyFrom(duration(RUNTIME_S * snapshot.battery.charge))
        battery = state.battery_states.add(identifier="simulated")
        battery.timestamp.CopyFrom(stamp)
        battery.charge_percentage.value = charge
        battery.estimated_runtime.CopyFrom(duration(RUNTIME_S * snapshot.battery.charge))
        battery.voltage.value, battery.current.value = 52.0, 6.0 if docked else -6.0
        battery.temperatures.append(30.0)
        Battery = robot_state_pb2.BatteryState
        battery.status = Battery.STATUS_CHARGING if docked else Battery.STATUS_DISCHARGING

    def _estop(self, state: Any, stamp: Any) -> None:
        State = robot_state_pb2.EStopState
        stopped = self._computer.estop.level() != estop_pb2.ESTOP_LEVEL_NONE
        for name, kind, stops in (
            ("hardware_estop", State.TYPE_HARDWARE, False),
            ("software_estop", State.TYPE_SOFTWARE, stopped),
        ):
            made = state.estop_states.add(name=name, type=kind)
            made.state = State.STATE_ESTOPPED if stops else State.STATE_NOT_ESTOPPED
            made.timestamp.CopyFrom(stamp)

    def _feet(self, state: Any, snapshot: Snapshot) -> None:
        feet_O = self._computer.feet_O or snapshot.odometry.pose
        X_BF = snapshot.odometry.X_OB.InvertAndCompose(feet_O.transform())
        for x, y in FEET_M.values():
            made = state.foot_state.add(contact=robot_state_pb2.FootState.CONTACT_MADE)
            made.foot_position_rt_body.CopyFrom(vec3(X_BF @ np.array([x, y, 0.0])))
            made.terrain.frame_name = "odom"
            made.terrain.ground_mu_est = 0.8

    def _manipulator(self, state: Any, snapshot: Snapshot) -> None:
        can, State = self._computer.capabilities, robot_state_pb2.ManipulatorState
        assert can.gripper is not None and can.arm is not None
        made = state.manipulator_state
        made.gripper_open_percentage = 100.0 * min(max(snapshot.gripper.opening / can.gripper.widest, 0.0), 1.0)
        made.is_gripper_holding_item = self._computer.grip.holds(snapshot.gripper)
        made.estimated_end_effector_force_in_hand.CopyFrom(vec3((0.0, 0.0, 0.0)))
        stowed = np.abs(self._computer.arm_rad(snapshot.joints) - np.array(can.arm.stowed_rad)).max() < 0.1
        made.stow_state = State.STOWSTATE_STOWED if stowed else State.STOWSTATE_DEPLOYED
        made.carry_state = self._computer.grip.carry_state(snapshot.gripper)
        made.velocity_of_hand_in_odom.SetInParent()
        made.velocity_of_hand_in_vision.SetInParent()


def kinematic_state(snapshot: Snapshot) -> Any:
    """The message of joints, frames and velocities."""
    made = robot_state_pb2.KinematicState(transforms_snapshot=frame_tree(snapshot.frames))
    joints = snapshot.joints
    for name, position in joints.position_rad.items():
        joint = made.joint_states.add(name=api_joint(name))
        joint.position.value, joint.velocity.value = position, joints.velocity_rad_s[name]
        joint.acceleration.value, joint.load.value = 0.0, joints.effort_nm[name]
    vx, vy, wz = snapshot.odometry.velocity
    linear_O = snapshot.odometry.X_OB.rotation().matrix() @ np.array([vx, vy, 0.0])
    moving = velocity(linear_O, (0.0, 0.0, wz))
    made.velocity_of_body_in_odom.CopyFrom(moving)
    made.velocity_of_body_in_vision.CopyFrom(moving)
    made.acquisition_timestamp.CopyFrom(timestamp(snapshot.time_s))
    return made


class WorldObjectService(Service):
    """Lists objects added by clients, and the known AprilTags in view of the body's cameras."""

    name, type, authority = "world-objects", "bosdyn.api.WorldObjectService", f"api.{DOMAIN}"

    def __init__(self, computer: Computer, perception: Perception | None) -> None:
        """No tags are seen without `perception`."""
        self._computer, self._perception = computer, perception
        self._lock, self._ids, self._objects = Lock(), count(1), dict[int, Any]()
        self._ends_s, self._regions = dict[int, float](), dict[int, Region | None]()
        self._looking, self._looked_s, self._seen = Lock(), -math.inf, dict[int, SeenTag]()

    def ListWorldObjects(self, request: Any, _call: Call) -> Any:
        """Lists the objects of the types that are asked for, and not older than asked for."""
        fields = [_FIELDS[kind] for kind in request.object_type if kind in _FIELDS]
        since_s, made = seconds(request.timestamp_filter), world_object_pb2.ListWorldObjectResponse()
        for each in self.objects(look=not fields or "apriltag_properties" in fields):
            has = not request.object_type or any(field.name in fields for field, _ in each.ListFields())
            if has and not 0.0 < seconds(each.acquisition_time) < since_s:
                made.world_objects.append(each)
        return made

    def objects(self, *, look: bool = True) -> list[Any]:
        """All objects; `look` takes pictures first."""
        seen = [self._described(tag) for tag in self.tags()] if look else []
        with self._lock:
            now_s = self._computer.snapshot.time_s
            return [*(each for number, each in self._objects.items() if self._ends_s[number] > now_s), *seen]

    def tags(self) -> Sequence[SeenTag]:
        """The tags that the body's cameras see now, or saw a moment ago."""
        computer, perception = self._computer, self._perception
        if perception is None:
            return ()
        with self._looking:
            if computer.now_s() - self._looked_s > _LOOK_S:
                cameras = [each.source for each in computer.capabilities.cameras if each.mount is Mount.BODY]
                taken = computer.do(lambda: [computer.robot.image(source) for source in cameras])
                with suppress(NoImageError, TimeoutError):
                    found = [tag for image in taken.result(_PICTURES_S) for tag in perception.tags(image)]
                    self._seen = {tag.number: tag for tag in found}
                self._looked_s = computer.now_s()
            return list(self._seen.values())

    def _described(self, tag: SeenTag) -> Any:
        """The message of a tag; the frame `filtered_fiducial` is the same one."""
        made = world_object_pb2.WorldObject(id=_FIRST_TAG + tag.number, name=f"world_obj_apriltag_{tag.number}")
        made.acquisition_time.CopyFrom(timestamp(self._looked_s))
        frames, described = dict(self._computer.snapshot.frames), made.apriltag_properties
        described.tag_id, described.dimensions.x, described.dimensions.y = tag.number, tag.size_m, tag.size_m
        described.frame_name_fiducial = f"fiducial_{tag.number}"
        described.frame_name_fiducial_filtered = f"filtered_fiducial_{tag.number}"
        for name in (described.frame_name_fiducial, described.frame_name_fiducial_filtered):
            frames[name] = ("odom", tag.X_OT)
        described.fiducial_pose_status = described.fiducial_filtered_pose_status = described.STATUS_OK
        made.transforms_snapshot.CopyFrom(frame_tree(frames))
        return made

    def MutateWorldObjects(self, request: Any, _call: Call) -> Any:
        """Adds, changes or deletes an object of a client, which lasts as long as it says."""
        Response, Mutation = world_object_pb2.MutateWorldObjectResponse, world_object_pb2.MutateWorldObjectRequest
        action, given = request.mutation.action, request.mutation.object
        snapshot = self._computer.snapshot
        lasts_s = seconds(given.object_lifetime) if given.HasField("object_lifetime") else math.inf
        stored = world_object_pb2.WorldObject()
        stored.CopyFrom(given)
        with self._lock:
            if action == Mutation.ACTION_ADD:
                number = next(self._ids)
            elif given.id in self._objects:
                number = given.id
            else:
                return Response(status=Response.STATUS_INVALID_MUTATION_ID)
            if action == Mutation.ACTION_DELETE:
                del self._objects[number]
                self._regions.pop(number, None)
            else:
                region = region_of(given, snapshot.time_s + lasts_s, snapshot)
                stored.id = number
                self._objects[number], self._ends_s[number] = stored, snapshot.time_s + lasts_s
                self._regions[number] = region
            self._computer.regions = [each for each in self._regions.values() if each is not None]
        return Response(status=Response.STATUS_OK, mutated_object_id=number)


class InverseKinematicsService(Service):
    """Returns whether the arm reaches a pose from the body's present pose."""

    name, type, authority = "inverse-kinematics", "bosdyn.api.spot.InverseKinematicsService", f"api.{DOMAIN}"

    def __init__(self, computer: Computer) -> None:
        self._computer = computer

    def InverseKinematics(self, request: Any, _call: Call) -> Any:
        """Returns joint angles for a pose of the tool."""
        Response = inverse_kinematics_pb2.InverseKinematicsResponse
        snapshot, solver = self._computer.snapshot, self._computer.solver
        if not request.HasField("tool_pose_task") or solver is None:
            raise InvalidRequestError("task_specification: only a tool_pose_task is served")
        if request.root_frame_name not in snapshot.frames:
            raise InvalidRequestError(f"root_frame_name: {request.root_frame_name!r} is unknown")
        X_WT = X_HAND
        if request.HasField("wrist_mounted_tool"):
            X_WT = transform(request.wrist_mounted_tool.wrist_tform_tool, "wrist_tform_tool")
        X_RS, X_ST = (transform(getattr(request, name), name) for name in ("root_tform_scene", "scene_tform_task"))
        X_RTool = X_RS @ X_ST @ transform(request.tool_pose_task.task_tform_desired_tool, "task_tform_desired_tool")
        X_BW = snapshot.X_AB("body", request.root_frame_name) @ X_RTool @ X_WT.inverse()
        found = solutions(solver, X_BW)
        if not found:
            return Response(status=Response.STATUS_NO_SOLUTION_FOUND)
        best = min(found, key=lambda q: float(np.abs(q - np.array(READY_RAD)).max()))
        made = Response(status=Response.STATUS_OK, robot_configuration=kinematic_state(snapshot))
        wanted = {f"arm0.{name}": float(value) for name, value in zip(JOINTS, best, strict=True)}
        for joint in made.robot_configuration.joint_states:
            joint.position.value = wanted.get(joint.name, joint.position.value)
        return made


class FaultService(Service):
    """Takes the faults of clients' services."""

    name, type, authority = "fault", "bosdyn.api.FaultService", f"fault.{DOMAIN}"

    def __init__(self, now: Callable[[], float], silent: Callable[[], Iterable[str]]) -> None:
        """`now` gives the robot's time, `silent` the registered services that have fallen silent."""
        self._now, self._silent = now, silent
        self._lock, self._active = Lock(), dict[tuple[str, str], Any]()

    def faults(self) -> list[Any]:
        """All faults, with those of silent services."""
        with self._lock:
            made = list(self._active.values())
        for service in self._silent():
            fault = service_fault_pb2.ServiceFault(severity=service_fault_pb2.ServiceFault.SEVERITY_CRITICAL)
            fault.fault_id.fault_name, fault.fault_id.service_name = "liveness", service
            fault.error_message = f"{service} has not updated its entry in the directory in time"
            made.append(fault)
        return made

    def TriggerServiceFault(self, request: Any, _call: Call) -> Any:
        """Stores a fault."""
        Response, key = service_fault_pb2.TriggerServiceFaultResponse, _fault_key(request.fault.fault_id)
        stored = service_fault_pb2.ServiceFault()
        stored.CopyFrom(request.fault)
        stored.onset_timestamp.CopyFrom(timestamp(self._now()))
        with self._lock:
            known = key in self._active
            self._active.setdefault(key, stored)
        return Response(status=Response.STATUS_FAULT_ALREADY_ACTIVE if known else Response.STATUS_OK)

    def ClearServiceFault(self, request: Any, _call: Call) -> Any:
        """Removes a fault."""
        Response, key = service_fault_pb2.ClearServiceFaultResponse, _fault_key(request.fault_id)
        with self._lock:
            known = self._active.pop(key, None) is not None
        return Response(status=Response.STATUS_OK if known else Response.STATUS_FAULT_NOT_ACTIVE)


def _fault_key(fault_id: Any) -> tuple[str, str]:
    return fault_id.service_name, fault_id.fault_name


def _answering(Response: Any, **fields: Any) -> Callable[[Any, Any, Call], Any]:
    """Returns a call that keeps nothing of its request and always gives the same answer."""
    return lambda _service, _request, _call: Response(**fields)


class PayloadService(Service):
    """Lists the payloads: none but the LiDAR, which the robot knows already."""

    name, type, authority = "payload", "bosdyn.api.PayloadService", f"payload.{DOMAIN}"
    ListPayloads = _answering(payload_pb2.ListPayloadsResponse)


class DataBufferService(Service):
    """Accepts and discards the logs of clients."""

    name, type, authority = "data-buffer", "bosdyn.api.DataBufferService", f"buffer.{DOMAIN}"

    def __init__(self) -> None:
        self._ids = count(1)

    RecordTextMessages = _answering(data_buffer_pb2.RecordTextMessagesResponse)
    RecordOperatorComments = _answering(data_buffer_pb2.RecordOperatorCommentsResponse)
    RecordDataBlobs = _answering(data_buffer_pb2.RecordDataBlobsResponse)
    RecordEvents = _answering(data_buffer_pb2.RecordEventsResponse)
    RecordSignalTicks = _answering(data_buffer_pb2.RecordSignalTicksResponse)

    def RegisterSignalSchema(self, _request: Any, _call: Call) -> Any:
        """Gives a schema its number."""
        return data_buffer_pb2.RegisterSignalSchemaResponse(schema_id=next(self._ids))


class LogStatusService(Service):
    """Tells that no logs are written: the simulated robot keeps none, and starts none."""

    name, type, authority = "log-status", "bosdyn.api.log_status.LogStatusService", f"log.{DOMAIN}"
    GetActiveLogStatuses = _answering(_ActiveLogs, status=_ActiveLogs.STATUS_OK)
    GetLogStatus = _answering(_Log, status=_Log.STATUS_ID_NOT_FOUND)
