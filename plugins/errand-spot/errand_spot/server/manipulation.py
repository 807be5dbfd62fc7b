"""Manipulation: walks to the object at a pixel or a ray, and picks it up; clients' statements on a held item."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import count
from typing import Any, Final, Protocol

import numpy as np
from bosdyn.api import geometry_pb2, lease_pb2, manipulation_api_pb2, robot_state_pb2
from pydrake.math import RigidTransform, RotationMatrix

from errand_spot.messages import InvalidRequestError, frame_tree, frames_of, pose_between, transform, vector
from errand_spot.server.calls import Call, Service
from errand_spot.server.computer import Computer, Snapshot
from errand_spot.server.identity import DOMAIN
from errand_spot.server.leases import LeaseService
from errand_spot.server.rays import depth_points_O, first_hit_m
from errand_spot.server.task import WHOLE, Steps, Task, stow, walk
from skills.robot import FloatArray, Lease, Pose2D

Api: Final = manipulation_api_pb2
_USUAL_OFFSET_M, _NEARER_M = 0.9, 0.76
_AHEAD_RAD: Final = 0.4
_REACHING_M, _GRASPING_M = 0.3, 0.12
_REMEMBERED: Final = 100
Aim = Callable[[FloatArray], FloatArray | None]
"""Returns the point that a request means, among points (N, 3); all in `odom`. None when nothing is there."""
Sizes = Mapping[tuple[str, float], tuple[int, int]]
"""Columns and rows of pictures, by the frame of the camera and the focal length (pixels)."""
Allows = Callable[[RotationMatrix], bool]
"""Returns whether the hand may grasp with a rotation in `odom`."""


class Picker(Protocol):
    """Picks up an object with arm, body and gripper; only the computer's thread calls it."""

    @property
    def no_plan(self) -> bool:
        """Returns whether it failed because there is no grasp."""

    def begin(self, lease: Lease, point_O: FloatArray, points_O: FloatArray, allows: Allows) -> None:
        """Starts to pick up the object at a point of a cloud (N, 3), in `odom`."""

    def step(self) -> bool | None:
        """Goes on; returns None until the attempt is over, then whether the object is held."""

    def end(self) -> None:
        """Stops the pick."""


class _ObjectTask(Task):
    """Finds an object, walks there and, on request, picks it up. Other threads read `found_O`."""

    broken = Api.MANIP_STATE_GRASP_FAILED

    def __init__(self, aim: Aim, offset_m: float | None, picker: Picker | None, allows: Allows, *, walks: bool) -> None:
        self._aim, self._offset_m, self._picker, self._allows, self._walks = aim, offset_m, picker, allows, walks
        self.found_O: FloatArray | None = None
        self._points_O = np.empty((0, 3))
        super().__init__(Api.MANIP_STATE_ATTEMPTING_RAYCASTING)

    def _run(self, computer: Computer) -> Steps:
        stands = computer.stand_first()
        while not stands():
            yield
        self._points_O = np.vstack([self._points_O, depth_points_O(computer)])
        self.found_O = point_O = self._aim(self._points_O) if self.found_O is None else self.found_O
        if point_O is None:
            return int(Api.MANIP_STATE_GRASP_FAILED_TO_RAYCAST_INTO_MAP)
        if self._walks and not self._near(computer, point_O):
            self.state = Api.MANIP_STATE_WALKING_TO_OBJECT
            yield from stow(computer)
            if not (yield from walk(computer, self._before(computer, point_O))):
                return int(Api.MANIP_STATE_GRASP_FAILED)
            self._points_O = np.vstack([self._points_O, depth_points_O(computer)])
        if self._picker is None:
            return int(Api.MANIP_STATE_DONE)
        self._picker.begin(computer.lease, point_O, self._points_O, self._allows)
        try:
            while (held := self._picker.step()) is None:
                self.state = self._phase(computer, point_O)
                yield
        finally:
            self._picker.end()
        if self._picker.no_plan and self._walks and self._offset_m is None:
            self._offset_m = _NEARER_M  # once more, from nearer
            return (yield from self._run(computer))
        lacks = Api.MANIP_STATE_GRASP_PLANNING_NO_SOLUTION if self._picker.no_plan else Api.MANIP_STATE_GRASP_FAILED
        return int(Api.MANIP_STATE_GRASP_SUCCEEDED if held else lacks)

    def _near(self, computer: Computer, point_O: FloatArray) -> bool:
        """Returns whether the arm picks from here; a walk has its own distance, so it always walks."""
        arm = computer.capabilities.arm
        if self._picker is None or arm is None or self._offset_m is not None:
            return False
        x, y, _ = computer.snapshot.X_AB("body", "odom") @ point_O
        least_m, most_m = arm.comfortable_m
        if is_only_from_above(self._allows):
            least_m, most_m = min(arm.nearer_m), max(arm.nearer_m)
        return least_m < math.hypot(x, y) < most_m and abs(math.atan2(y, x)) < _AHEAD_RAD

    def _before(self, computer: Computer, point_O: FloatArray) -> Pose2D:
        """Pose on the line to a point, facing it at the task's distance from the body's middle."""
        arm, pose, offset_m = computer.capabilities.arm, computer.snapshot.odometry.pose, self._offset_m
        if offset_m is None:
            above = self._picker is not None and is_only_from_above(self._allows)
            offset_m = _USUAL_OFFSET_M if arm is None else (arm.nearer_m if above else arm.standing_m)[0]
        x_m, y_m = float(point_O[0]), float(point_O[1])
        yaw_rad = math.atan2(y_m - pose.y_m, x_m - pose.x_m)
        return Pose2D(x_m - offset_m * math.cos(yaw_rad), y_m - offset_m * math.sin(yaw_rad), yaw_rad)

    def _phase(self, computer: Computer, point_O: FloatArray) -> int:
        """State of a pick by the hand's position: on its path to the object, at it, or holding it."""
        off_m = float(np.linalg.norm(computer.snapshot.X_AB("hand", "odom") @ point_O))
        if computer.snapshot.gripper.holding or off_m < _GRASPING_M:
            return int(Api.MANIP_STATE_GRASPING_OBJECT)
        return int(Api.MANIP_STATE_MOVING_TO_GRASP if off_m < _REACHING_M else Api.MANIP_STATE_SEARCHING_FOR_GRASP)


class ManipulationService(Service):
    """Takes tasks on objects, tells how far they have come, and takes clients' word on the item in the gripper."""

    name, type, authority = "manipulation", "bosdyn.api.ManipulationApiService", f"manipulation.{DOMAIN}"

    def __init__(self, computer: Computer, leases: LeaseService, picker: Picker | None, sizes: Sizes) -> None:
        """`sizes` are those of the pictures that clients have seen."""
        self._computer, self._leases, self._picker, self._sizes = computer, leases, picker, sizes
        self._ids, self._tasks = count(1), dict[int, _ObjectTask]()

    def ManipulationApi(self, request: Any, _call: Call) -> Any:
        """Starts a manipulation task, which ends all motions; refuses an impossible task as invalid."""
        used = self._leases.use(request.lease, WHOLE)
        if used.status != lease_pb2.LeaseUseResult.STATUS_OK:
            return Api.ManipulationApiResponse(lease_use_result=used)
        if not self._computer.able:
            raise InvalidRequestError("the motors are off, the robot has fallen, or an E-stop is pressed")
        if self._computer.docked():
            raise InvalidRequestError("the robot is docked: undock it first")
        task, number = self._task(request), next(self._ids)
        self._tasks[number] = task
        self._tasks.pop(number - _REMEMBERED, None)
        self._computer.do(lambda: self._computer.move(dict.fromkeys(WHOLE, task)))
        return Api.ManipulationApiResponse(lease_use_result=used, manipulation_cmd_id=number)

    def ManipulationApiFeedback(self, request: Any, _call: Call) -> Any:
        """Tells how far a task has come; `walkto_raycast_intersection` is the point that was found."""
        number = request.manipulation_cmd_id
        if (task := self._tasks.get(number)) is None:
            raise InvalidRequestError(f"manipulation_cmd_id: there is no task {number}")
        made = Api.ManipulationApiFeedbackResponse(manipulation_cmd_id=number, current_state=task.state)
        frames = dict(self._computer.snapshot.frames)
        if task.found_O is not None:
            frames["walkto_raycast_intersection"] = ("odom", RigidTransform(task.found_O))
        made.transforms_snapshot_manipulation_data.CopyFrom(frame_tree(frames))
        return made

    def OverrideGrasp(self, request: Any, _call: Call) -> Any:
        """Accepts a client's statement on whether an item is held, and how it may be carried."""
        Override, grip = Api.ApiGraspOverride, self._computer.grip
        word, carry = request.api_grasp_override.override_request, request.carry_state_override.override_request
        known = (Override.OVERRIDE_HOLDING, Override.OVERRIDE_NOT_HOLDING)
        if request.HasField("api_grasp_override") and word not in known:
            raise InvalidRequestError("api_grasp_override.override_request is unknown")
        if request.HasField("carry_state_override"):
            if word == Override.OVERRIDE_NOT_HOLDING:
                raise InvalidRequestError("carry_state_override: there is no item to carry")
            if carry not in robot_state_pb2.ManipulatorState.CarryState.values()[1:]:
                raise InvalidRequestError("carry_state_override.override_request is unknown")
            grip.carry = carry
        if request.HasField("api_grasp_override"):
            grip.holding = word == Override.OVERRIDE_HOLDING
        self._computer.do(self._computer.tell_carried)
        return Api.ApiGraspOverrideResponse()

    def _task(self, request: Any) -> _ObjectTask:
        """Returns the task of a request. Raises InvalidRequestError."""
        which, snapshot = request.WhichOneof("manipulation_cmd"), self._computer.snapshot
        given = getattr(request, which or "pick_object_execute_plan")
        aims: dict[str | None, Callable[[Any, Snapshot], Aim]] = {
            "walk_to_object_in_image": self._pixel_aim,
            "walk_to_object_ray_in_world": _ray_aim,
            "pick_object_in_image": self._pixel_aim,
            "pick_object_ray_in_world": _ray_aim,
            "pick_object": _point_aim,
        }
        if which not in aims:
            raise InvalidRequestError(f"manipulation_cmd: {which or 'no command'} is not simulated")
        aim = aims[which](given, snapshot)
        if which.startswith("walk_to"):
            offset_m = given.offset_distance.value if given.HasField("offset_distance") else None
            return _ObjectTask(aim, offset_m, None, _any, walks=True)
        if self._picker is None or self._computer.capabilities.gripper is None:
            raise InvalidRequestError(f"manipulation_cmd: {which} needs an arm that plans grasps")
        mode = getattr(given, "walk_gaze_mode", Api.PICK_AUTO_WALK_AND_GAZE)
        if mode == Api.PICK_PLAN_ONLY:
            raise InvalidRequestError("walk_gaze_mode: PICK_PLAN_ONLY is not simulated")
        walks = mode in (Api.PICK_WALK_GAZE_UNKNOWN, Api.PICK_AUTO_WALK_AND_GAZE)
        return _ObjectTask(aim, None, self._picker, grasp_test(given.grasp_params, snapshot), walks=walks)

    def _pixel_aim(self, given: Any, _snapshot: Snapshot) -> Aim:
        """Aim of a pixel from the camera's pose in the frames of the request. Raises InvalidRequestError."""
        k, sensor = given.camera_model.intrinsics, given.frame_name_image_sensor
        fx, fy, u, v = k.focal_length.x, k.focal_length.y, given.pixel_xy.x, given.pixel_xy.y
        if min(fx, fy) <= 0.0:
            raise InvalidRequestError("camera_model.intrinsics.focal_length must be positive")
        middle = 2.0 * k.principal_point.x, 2.0 * k.principal_point.y
        for name, at, most in zip("xy", (u, v), self._sizes.get((sensor, round(fx, 3)), middle), strict=True):
            if not 0.0 <= at <= most:
                raise InvalidRequestError(f"pixel_xy.{name} is {at:g}; it must be 0 to {most:g}, within the picture")
        frames = frames_of(given.transforms_snapshot_for_camera)
        try:
            X_OC = pose_between(frames, "odom" if "odom" in frames else "vision", sensor)
        except KeyError as error:
            raise InvalidRequestError(f"transforms_snapshot_for_camera: there is no frame {error}") from error
        x, y = (u - k.principal_point.x) / fx, (v - k.principal_point.y) / fy
        direction_O = X_OC.rotation() @ _unit((x, y, 1.0), "pixel_xy")
        return _along(np.asarray(X_OC.translation()), np.asarray(direction_O))


def _any(_rotation: RotationMatrix) -> bool:
    return True


def grasp_test(params: Any, snapshot: Snapshot) -> Allows:
    """Returns the test of a grasp's rotation by the parameters. Raises InvalidRequestError."""
    if params.position_constraint == Api.GRASP_POSITION_CONSTRAINT_FIXED_AT_USER_POSITION:
        raise InvalidRequestError("grasp_params.position_constraint: a fixed position is not simulated")
    R_OF, tests = _frame(params.grasp_params_frame_name or "odom", snapshot).rotation(), list[Allows]()
    for each in params.allowable_orientation:
        which = each.WhichOneof("constraint")
        if which == "rotation_with_tolerance":
            tests.append(_rotation_test(each.rotation_with_tolerance, R_OF))
        elif which == "vector_alignment_with_tolerance":
            tests.append(_alignment_test(each.vector_alignment_with_tolerance, R_OF))
        elif not each.squeeze_grasp.squeeze_grasp_disallowed:
            raise InvalidRequestError("grasp_params.allowable_orientation: a squeeze grasp is not simulated")
    return (lambda R_OH: any(test(R_OH) for test in tests)) if tests else _any


def is_only_from_above(allows: Allows) -> bool:
    """Returns whether the hand may point straight down, and not level with its fingers closing sideways."""
    turns = [RotationMatrix.MakeZRotation(yaw_rad) for yaw_rad in np.linspace(-math.pi, math.pi, 24)]
    down, aside = RotationMatrix.MakeYRotation(0.5 * math.pi), RotationMatrix.MakeXRotation(0.5 * math.pi)
    level = (allows(R @ roll) for R in turns for roll in (aside, aside.inverse()))
    return any(allows(R @ down) for R in turns) and not any(level)


def _rotation_test(given: Any, R_OF: RotationMatrix) -> Allows:
    wanted = geometry_pb2.SE3Pose(rotation=given.rotation_ewrt_frame)
    R_OW = R_OF @ transform(wanted, "rotation_ewrt_frame").rotation()
    return lambda R_OH: R_OW.InvertAndCompose(R_OH).ToAngleAxis().angle() <= given.threshold_radians


def _alignment_test(given: Any, R_OF: RotationMatrix) -> Allows:
    least = math.cos(given.threshold_radians)
    axis_H = _unit(vector(given.axis_on_gripper_ewrt_gripper, "axis_on_gripper"), "axis_on_gripper")
    axis_O = R_OF @ _unit(vector(given.axis_to_align_with_ewrt_frame, "axis_to_align_with"), "axis_to_align_with")
    return lambda R_OH: float((R_OH @ axis_H) @ axis_O) >= least


def _unit(values: Sequence[float], field: str) -> FloatArray:
    length = float(np.linalg.norm(values))
    if length < 1e-6:
        raise InvalidRequestError(f"{field} has no length")
    return np.array(values) / length


def _ray_aim(given: Any, snapshot: Snapshot) -> Aim:
    """Aim of a ray in a frame. Raises InvalidRequestError."""
    X_OF = _frame(given.frame_name, snapshot)
    start_O = np.asarray(X_OF @ np.array(vector(given.ray_start_rt_frame, "ray_start_rt_frame")))
    end_O = X_OF @ np.array(vector(given.ray_end_rt_frame, "ray_end_rt_frame"))
    return _along(start_O, _unit(end_O - start_O, "the ray"))


def _along(start_O: FloatArray, direction_O: FloatArray) -> Aim:
    def aim(points_O: FloatArray) -> FloatArray | None:
        far_m = first_hit_m(start_O, direction_O, points_O)
        return None if far_m is None else start_O + far_m * direction_O

    return aim


def _point_aim(given: Any, snapshot: Snapshot) -> Aim:
    """Aim of a point in a frame. Raises InvalidRequestError."""
    point_O = _frame(given.frame_name, snapshot) @ np.array(vector(given.object_rt_frame, "object_rt_frame"))
    return lambda _points_O: np.asarray(point_O)


def _frame(name: str, snapshot: Snapshot) -> RigidTransform:
    if name not in snapshot.frames:
        raise InvalidRequestError(f"frame_name: {name!r} is unknown")
    return snapshot.X_AB("odom", name)
