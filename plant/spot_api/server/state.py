"""What clients read: state, hardware, pictures, point clouds, objects; and services that only answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import count
from threading import Lock
from typing import Any, Final

import cv2
import numpy as np
from bosdyn.api import (
    data_buffer_pb2,
    estop_pb2,
    image_pb2,
    payload_pb2,
    point_cloud_pb2,
    robot_state_pb2,
    service_fault_pb2,
    world_object_pb2,
)
from bosdyn.api.spot import inverse_kinematics_pb2
from numpy.typing import NDArray

from plant.spot_api.server.arm import JOINTS, READY_RAD, X_HAND
from plant.spot_api.server.calls import Call, Service
from plant.spot_api.server.computer import Computer, Motors, Snapshot, sensor_frame
from plant.spot_api.server.identity import DOMAIN
from plant.spot_api.server.messages import (
    InvalidRequestError,
    duration,
    frame_tree,
    timestamp,
    transform,
    vec3,
    velocity,
)
from skills.robot import CameraCapabilities, Image, Intrinsics, NoImageError

RUNTIME_S: Final = 5400.0
_PICTURE_TIMEOUT_S: Final = 5.0
_FEET: Final = ("fl", "fr", "hl", "hr")


def api_joint(name: str) -> str:
    """Name of a joint in the API: `fl_hx` is `fl.hx`, `arm_sh0` is `arm0.sh0`."""
    limb, _, joint = name.partition("_")
    return f"{'arm0' if limb == 'arm' else limb}.{joint}"


class RobotStateService(Service):
    """Tells the robot's state and its hardware."""

    name, type, authority = "robot-state", "bosdyn.api.RobotStateService", f"state.{DOMAIN}"

    def __init__(self, computer: Computer) -> None:
        self._computer = computer

    def GetRobotState(self, _request: Any, _call: Call) -> Any:
        """Returns the state after the last step."""
        made, snapshot = robot_state_pb2.RobotStateResponse(), self._computer.snapshot
        state, stamp = made.robot_state, timestamp(snapshot.time_s)
        self._power(state, snapshot)
        state.kinematic_state.CopyFrom(kinematic_state(snapshot))
        state.system_fault_state.SetInParent()
        for number, fault in enumerate(snapshot.faults):
            state.system_fault_state.faults.add(name=fault, uid=number, error_message=fault).onset_timestamp.CopyFrom(
                stamp
            )
        state.behavior_fault_state.SetInParent()
        state.service_fault_state.SetInParent()
        state.terrain_state.SetInParent()
        self._estop(state, stamp)
        self._feet(state, snapshot)
        if self._computer.capabilities.gripper is not None:
            self._manipulator(state, snapshot)
        return made

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
        names = ["body", *(f"{foot}.{part}" for foot in _FEET for part in ("hip", "uleg", "lleg"))]
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
        power.shore_power_state = State.SHORE_POWER_STATE_OFF
        power.robot_power_state = State.ROBOT_POWER_STATE_ON
        power.payload_ports_power_state = State.PAYLOAD_PORTS_POWER_STATE_ON
        power.wifi_radio_power_state = State.WIFI_RADIO_POWER_STATE_ON
        power.locomotion_charge_percentage.value = charge
        power.locomotion_estimated_runtime.CopyFrom(duration(RUNTIME_S * snapshot.battery.charge))
        battery = state.battery_states.add(identifier="simulated")
        battery.timestamp.CopyFrom(stamp)
        battery.charge_percentage.value = charge
        battery.estimated_runtime.CopyFrom(duration(RUNTIME_S * snapshot.battery.charge))
        battery.voltage.value, battery.current.value = 52.0, -6.0
        battery.temperatures.append(30.0)
        battery.status = robot_state_pb2.BatteryState.STATUS_DISCHARGING

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
        height_m = float(snapshot.odometry.X_OB.translation()[2])
        for foot in _FEET:
            x = 0.32 if foot.startswith("f") else -0.32
            y = 0.17 if foot.endswith("l") else -0.17
            made = state.foot_state.add(contact=robot_state_pb2.FootState.CONTACT_MADE)
            made.foot_position_rt_body.CopyFrom(vec3((x, y, -height_m)))
            made.terrain.frame_name = "odom"
            made.terrain.ground_mu_est = 0.8

    def _manipulator(self, state: Any, snapshot: Snapshot) -> None:
        can, State = self._computer.capabilities, robot_state_pb2.ManipulatorState
        assert can.gripper is not None and can.arm is not None
        made = state.manipulator_state
        made.gripper_open_percentage = 100.0 * snapshot.gripper.opening / can.gripper.widest
        made.is_gripper_holding_item = snapshot.gripper.holding
        made.estimated_end_effector_force_in_hand.CopyFrom(vec3((0.0, 0.0, 0.0)))
        stowed = np.abs(self._computer.arm_rad(snapshot.joints) - np.array(can.arm.stowed_rad)).max() < 0.1
        made.stow_state = State.STOWSTATE_STOWED if stowed else State.STOWSTATE_DEPLOYED
        made.carry_state = State.CARRY_STATE_CARRIABLE if snapshot.gripper.holding else State.CARRY_STATE_NOT_CARRIABLE
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


class _Source:
    """One source of the image service: a camera, its picture or its depth, and how pictures are coded."""

    def __init__(self, name: str, camera: CameraCapabilities, *, coloured: bool = False) -> None:
        self.name, self.camera, self.coloured = name, camera, coloured
        self.depth = "_depth" in name
        self._as_picture = name.endswith("_frame")

    def intrinsics(self, image: Image) -> Intrinsics:
        return image.depth_intrinsics if self.depth and not self._as_picture else image.intrinsics

    def pixels(self, image: Image) -> NDArray[Any]:
        """Depth (H, W) in mm as uint16, perhaps with the picture's size, or the picture (H, W) or (H, W, 3) RGB."""
        if not self.depth:
            return image.grey if image.colour is None else image.colour
        depth: NDArray[Any] = np.clip(np.nan_to_num(image.depth_m, posinf=0.0) * 1000.0, 0.0, 65535.0).astype(np.uint16)
        size = (image.intrinsics.width, image.intrinsics.height)
        return np.asarray(cv2.resize(depth, size, interpolation=cv2.INTER_NEAREST)) if self._as_picture else depth


def _sources(cameras: tuple[CameraCapabilities, ...]) -> Mapping[str, _Source]:
    """The sources of a real Spot that the cameras have."""
    made: list[_Source] = []
    for camera in cameras:
        if camera.source == "hand":
            made.append(_Source("hand_color_image", camera, coloured=True))
            made += [_Source(name, camera) for name in ("hand_image", "hand_depth", "hand_depth_in_hand_color_frame")]
        else:
            kinds = ("fisheye_image", "depth", "depth_in_visual_frame")
            made += [_Source(f"{camera.source}_{kind}", camera) for kind in kinds]
    return {source.name: source for source in made}


class ImageService(Service):
    """Takes pictures. Each camera is a pinhole here, and depth is registered to the picture."""

    name, type, authority = "image", "bosdyn.api.ImageService", f"api.{DOMAIN}"

    def __init__(self, computer: Computer) -> None:
        self._computer, self._sources = computer, _sources(computer.capabilities.cameras)
        self._seen: dict[str, Intrinsics] = {}

    def ListImageSources(self, _request: Any, _call: Call) -> Any:
        """Lists all sources."""
        made = image_pb2.ListImageSourcesResponse(transforms_snapshot=frame_tree(self._computer.snapshot.frames))
        for source in self._sources.values():
            if source.name not in self._seen:
                self._seen[source.name] = source.intrinsics(self._take(source))
            made.image_sources.append(self._described(source, self._seen[source.name]))
        return made

    def GetImage(self, request: Any, _call: Call) -> Any:
        """Takes the pictures that are asked for; each has a status of its own."""
        made = image_pb2.GetImageResponse()
        for each in request.image_requests:
            self._answer(made.image_responses.add(), each)
        return made

    def _take(self, source: _Source) -> Image:
        """Takes a picture between two steps. Raises NoImageError or TimeoutError."""
        taken = self._computer.do(
            lambda: self._computer.robot.image(source.camera.source, visual=not source.depth, depth=source.depth)
        )
        return taken.result(_PICTURE_TIMEOUT_S)

    def _answer(self, made: Any, request: Any) -> None:
        Response, source = image_pb2.ImageResponse, self._sources.get(request.image_source_name)
        if source is None:
            made.status = Response.STATUS_UNKNOWN_CAMERA
            return
        ratio = request.resize_ratio or 1.0
        if not 0.0 < ratio <= 1.0:
            made.status = Response.STATUS_UNSUPPORTED_RESIZE_RATIO_REQUESTED
            return
        try:
            image = self._take(source)
        except (NoImageError, TimeoutError):
            made.status = Response.STATUS_IMAGE_DATA_ERROR
            return
        snapshot = self._computer.snapshot
        pixels, coded = _converted(source, source.pixels(image), request)
        if pixels is None:
            made.status = Response.STATUS_UNSUPPORTED_PIXEL_FORMAT_REQUESTED
            return
        if ratio < 1.0:
            size = (max(1, round(pixels.shape[1] * ratio)), max(1, round(pixels.shape[0] * ratio)))
            pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_NEAREST if source.depth else cv2.INTER_AREA)
        self._seen[source.name] = source.intrinsics(image)
        made.status = Response.STATUS_OK
        made.source.CopyFrom(self._described(source, self._seen[source.name], ratio))
        made.shot.acquisition_time.CopyFrom(timestamp(snapshot.time_s))
        made.shot.transforms_snapshot.CopyFrom(frame_tree(snapshot.frames))
        made.shot.frame_name_image_sensor = sensor_frame(source.camera.source)
        _encode(made.shot.image, pixels, coded, request)

    def _described(self, source: _Source, lens: Intrinsics, ratio: float = 1.0) -> Any:
        """The message of a source, with its intrinsics at a size."""
        made = image_pb2.ImageSource(name=source.name, cols=round(lens.width * ratio), rows=round(lens.height * ratio))
        k = made.pinhole.intrinsics
        k.focal_length.x, k.focal_length.y = lens.fx * ratio, lens.fy * ratio
        k.principal_point.x, k.principal_point.y = lens.cx * ratio, lens.cy * ratio
        Source, Pixels = image_pb2.ImageSource, image_pb2.Image
        made.image_type = Source.IMAGE_TYPE_DEPTH if source.depth else Source.IMAGE_TYPE_VISUAL
        if source.depth:
            made.depth_scale = 1000.0
            made.pixel_formats.append(Pixels.PIXEL_FORMAT_DEPTH_U16)
            made.image_formats.append(Pixels.FORMAT_RAW)
        else:
            made.pixel_formats.append(
                Pixels.PIXEL_FORMAT_RGB_U8 if source.coloured else Pixels.PIXEL_FORMAT_GREYSCALE_U8
            )
            made.image_formats.extend([Pixels.FORMAT_JPEG, Pixels.FORMAT_RAW])
        return made


def _converted(source: _Source, pixels: NDArray[Any], request: Any) -> tuple[NDArray[Any] | None, int]:
    """Pixels in the format that is asked for, or that of the source; None for one that it does not have."""
    Pixels, wanted = image_pb2.Image, request.pixel_format
    own = (
        Pixels.PIXEL_FORMAT_DEPTH_U16
        if source.depth
        else Pixels.PIXEL_FORMAT_RGB_U8
        if source.coloured
        else Pixels.PIXEL_FORMAT_GREYSCALE_U8
    )
    asked = wanted or own
    if source.depth:
        return (pixels if asked == own else None), own
    if asked == Pixels.PIXEL_FORMAT_RGB_U8:
        return (pixels if pixels.ndim == 3 else cv2.cvtColor(pixels, cv2.COLOR_GRAY2RGB)), asked
    if asked == Pixels.PIXEL_FORMAT_GREYSCALE_U8:
        return (pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)), asked
    return None, asked


def _encode(made: Any, pixels: NDArray[Any], pixel_format: int, request: Any) -> None:
    """Fills in the data of an image: JPEG by default, raw for depth and on request."""
    Pixels = image_pb2.Image
    made.rows, made.cols, made.pixel_format = pixels.shape[0], pixels.shape[1], pixel_format
    raw = pixels.dtype == np.uint16 or request.image_format in (Pixels.FORMAT_RAW, Pixels.FORMAT_RLE)
    if raw:
        made.format, made.data = Pixels.FORMAT_RAW, np.ascontiguousarray(pixels).tobytes()
        return
    quality = int(min(100.0, max(1.0, request.quality_percent or 75.0)))
    bgr = pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
    made.format, made.data = Pixels.FORMAT_JPEG, data.tobytes()


class PointCloudService(Service):
    """Gives the last revolution of the LiDAR as points."""

    name, type, authority = "velodyne-point-cloud", "bosdyn.api.PointCloudService", f"velodyne.{DOMAIN}"
    SOURCE: Final = "velodyne-point-cloud"

    def __init__(self, computer: Computer) -> None:
        self._computer = computer

    def ListPointCloudSources(self, _request: Any, _call: Call) -> Any:
        """Lists the LiDAR."""
        return point_cloud_pb2.ListPointCloudSourcesResponse(point_cloud_sources=[self._source()])

    def GetPointCloud(self, request: Any, _call: Call) -> Any:
        """Returns points (N, 3) as 32-bit floats in the frame `odom`."""
        made, Response = point_cloud_pb2.GetPointCloudResponse(), point_cloud_pb2.PointCloudResponse
        for each in request.point_cloud_requests:
            one, scan = made.point_cloud_responses.add(), self._computer.snapshot.scan
            if each.point_cloud_source_name != self.SOURCE:
                one.status = Response.STATUS_UNKNOWN_SOURCE
            elif scan is None:
                one.status = Response.STATUS_SOURCE_DATA_ERROR
            else:
                points = (scan.X_OB @ scan.points_B().T).T.astype(np.float32)
                one.status = Response.STATUS_OK
                one.point_cloud.source.CopyFrom(self._source())
                one.point_cloud.num_points = len(points)
                one.point_cloud.encoding = point_cloud_pb2.PointCloud.ENCODING_XYZ_32F
                one.point_cloud.data = np.ascontiguousarray(points).tobytes()
        return made

    def _source(self) -> Any:
        snapshot = self._computer.snapshot
        made = point_cloud_pb2.PointCloudSource(name=self.SOURCE, frame_name_sensor="odom")
        made.acquisition_time.CopyFrom(timestamp(snapshot.time_s))
        made.transforms_snapshot.CopyFrom(frame_tree(snapshot.frames))
        return made


class WorldObjectService(Service):
    """Lists the objects that clients have added; the simulated robot adds none of its own."""

    name, type, authority = "world-objects", "bosdyn.api.WorldObjectService", f"api.{DOMAIN}"

    def __init__(self) -> None:
        self._lock, self._ids, self._objects = Lock(), count(1), dict[int, Any]()

    def ListWorldObjects(self, _request: Any, _call: Call) -> Any:
        """Lists the objects."""
        with self._lock:
            return world_object_pb2.ListWorldObjectResponse(world_objects=self._objects.values())

    def MutateWorldObjects(self, request: Any, _call: Call) -> Any:
        """Adds, changes or deletes an object of a client."""
        Response, Mutation = world_object_pb2.MutateWorldObjectResponse, world_object_pb2.MutateWorldObjectRequest
        action, given = request.mutation.action, request.mutation.object
        with self._lock:
            if action == Mutation.ACTION_ADD:
                number = next(self._ids)
            elif given.id in self._objects:
                number = given.id
            else:
                return Response(status=Response.STATUS_INVALID_MUTATION_ID)
            if action == Mutation.ACTION_DELETE:
                del self._objects[number]
            else:
                stored = world_object_pb2.WorldObject()
                stored.CopyFrom(given)
                stored.id = number
                self._objects[number] = stored
        return Response(status=Response.STATUS_OK, mutated_object_id=number)


class InverseKinematicsService(Service):
    """Answers whether the arm reaches a pose with the body where it stands."""

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
        X_RT = transform(request.root_tform_scene, "root_tform_scene") @ transform(
            request.scene_tform_task, "scene_tform_task"
        )
        X_RTool = X_RT @ transform(request.tool_pose_task.task_tform_desired_tool, "task_tform_desired_tool")
        X_BW = snapshot.X_AB("body", request.root_frame_name) @ X_RTool @ X_WT.inverse()
        found = list(solver.inverse(X_BW))
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

    def __init__(self) -> None:
        self._lock, self._active = Lock(), set[tuple[str, str]]()

    def TriggerServiceFault(self, request: Any, _call: Call) -> Any:
        """Stores a fault."""
        Response, key = service_fault_pb2.TriggerServiceFaultResponse, _fault_key(request.fault.fault_id)
        with self._lock:
            known = key in self._active
            self._active.add(key)
        return Response(status=Response.STATUS_FAULT_ALREADY_ACTIVE if known else Response.STATUS_OK)

    def ClearServiceFault(self, request: Any, _call: Call) -> Any:
        """Removes a fault."""
        Response, key = service_fault_pb2.ClearServiceFaultResponse, _fault_key(request.fault_id)
        with self._lock:
            known = key in self._active
            self._active.discard(key)
        return Response(status=Response.STATUS_OK if known else Response.STATUS_FAULT_NOT_ACTIVE)


def _fault_key(fault_id: Any) -> tuple[str, str]:
    return fault_id.service_name, fault_id.fault_name


class PayloadService(Service):
    """Lists the payloads: none but the LiDAR, which the robot knows already."""

    name, type, authority = "payload", "bosdyn.api.PayloadService", f"payload.{DOMAIN}"

    def ListPayloads(self, _request: Any, _call: Call) -> Any:
        """Lists no payloads."""
        return payload_pb2.ListPayloadsResponse()


class DataBufferService(Service):
    """Takes what clients log, and keeps none of it."""

    name, type, authority = "data-buffer", "bosdyn.api.DataBufferService", f"buffer.{DOMAIN}"

    def __init__(self) -> None:
        self._ids = count(1)
        for call in ("TextMessages", "OperatorComments", "DataBlobs", "Events", "SignalTicks"):
            response = getattr(data_buffer_pb2, f"Record{call}Response")
            setattr(self, f"Record{call}", self._taker(response))

    @staticmethod
    def _taker(response: Callable[[], Any]) -> Callable[[Any, Call], Any]:
        return lambda _request, _call: response()

    def RegisterSignalSchema(self, _request: Any, _call: Call) -> Any:
        """Gives a schema its number."""
        return data_buffer_pb2.RegisterSignalSchemaResponse(schema_id=next(self._ids))
