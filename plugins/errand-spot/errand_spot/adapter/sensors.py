"""Sensors of a Spot through its API: the last state and scan, and pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from bosdyn.api import gripper_camera_param_pb2, image_pb2, point_cloud_pb2
from bosdyn.api.graph_nav import graph_nav_pb2
from pydrake.math import RigidTransform

from errand_spot.adapter.connection import Connection, LostError, RobotClock
from errand_spot.adapter.readings import (
    COLUMNS,
    DEPTH_RANGE_M,
    RINGS_RAD,
    Readings,
    depth_scan,
    picture,
    readings,
    sensor_pose,
    unfit,
)
from errand_spot.adapter.statuses import response_trouble
from errand_spot.messages import frames_of, pose_between, seconds, transform
from skills.estimate.scan_points import scan_of_points
from skills.robot import (
    Capabilities,
    CommandCause,
    FloatArray,
    FrameTree,
    Image,
    NoImageError,
    OwnLocalisation,
    Pose2D,
    Scan,
)

OLD_STATE_S: Final = 0.5
_JUMP_S: Final = 0.7
_LIDAR: Final = "velodyne-point-cloud"
_GRAPH_NAV: Final = "graph-nav-service"
_LIDAR_S, _DEPTH_S = 0.09, 0.3
_PICTURE_S, _AGAIN_S = 2.0, 0.25


class Sensors:
    """Sensors of one robot. Stamps are on the clock of the protocol."""

    def __init__(self, connection: Connection, clock: RobotClock, capabilities: Capabilities) -> None:
        """Reads the first state. Raises LostError."""
        self._connection, self._clock, self._capabilities = connection, clock, capabilities
        self.scan: Scan | None = None
        self.place: OwnLocalisation | None = None
        self.localises = False
        self.clock_jumped, self._failed_s = False, -math.inf
        self._height_m: float | None = None
        self.readings: Readings
        self.read_state()

    @property
    def arm_rad(self) -> FloatArray:
        """Joint angles (J,) of the arm."""
        names = () if self._capabilities.arm is None else self._capabilities.arm.joint_names
        return np.array([self.readings.joints.position_rad[name] for name in names])

    @property
    def notes(self) -> Sequence[str]:
        """Sentences for the report on the sensors that make the scan."""
        if self._connection.has(_LIDAR):
            return ()
        return (f"There is no LiDAR: the scan is that of the depth cameras, which see {DEPTH_RANGE_M:g} m far.",)

    def missing(self) -> str | None:
        """Returns the missing parts by the robot's last state; None when it has arm and joints."""
        return unfit(self._state, self._capabilities)

    def silent_s(self) -> float:
        """Age of the last state."""
        return self._clock.now() - self.readings.stamp_s

    def read_state(self) -> None:
        """Reads the state. Raises LostError, also for a state that cannot be used."""
        answer = self._connection.state()
        off_s = seconds(answer.header.response_timestamp) - self._clock.robot_time_s()
        self.clock_jumped = abs(off_s) > _JUMP_S
        state, self._state = answer.robot_state, answer.robot_state
        stamp_s = min(self._clock.now(), self._stamp(state.kinematic_state.acquisition_timestamp))
        try:
            self.readings = readings(state, stamp_s, self._capabilities, self._height_m)
        except (KeyError, ValueError) as error:
            raise LostError(f"the robot's state cannot be used: {error}", CommandCause.FAULT) from error
        self._height_m = float(self.readings.odometry.X_OB.translation()[2])

    def read_scan(self) -> None:
        """Reads the LiDAR, or without one the depth cameras, when the last scan is old. Raises LostError."""
        lidar, now_s = self._connection.has(_LIDAR), self._clock.now()
        old = self.scan is None or now_s - self.scan.stamp_s > (_LIDAR_S if lidar else _DEPTH_S)
        if not old or now_s < self._failed_s + _AGAIN_S:
            return
        try:
            self.scan = self._lidar_scan() if lidar else self._depth_scan()
        except (LostError, KeyError, ValueError, NoImageError) as error:
            self._failed_s = self._clock.now()
            raise LostError(f"the scan cannot be used: {error}", CommandCause.FAULT) from error

    def read_place(self) -> None:
        """Reads where GraphNav localises the robot, if anybody asks. Raises LostError."""
        if not self.localises:
            return
        request = graph_nav_pb2.GetLocalizationStateRequest()
        answer = self._connection.call(_GRAPH_NAV, "GetLocalizationState", request)
        place, kinematics = answer.localization, answer.robot_kinematics
        self.place = None
        if place.waypoint_id and place.HasField("seed_tform_body") and not answer.lost_detector_state.is_lost:
            try:
                X_OB = pose_between(frames_of(kinematics.transforms_snapshot), "odom", "body")
                X_SO = transform(place.seed_tform_body, "seed_tform_body") @ X_OB.inverse()
            except (KeyError, ValueError) as error:
                raise LostError(f"the place cannot be used: {error}", CommandCause.FAULT) from error
            self.place = OwnLocalisation(self._stamp(kinematics.acquisition_timestamp), Pose2D.from_transform(X_SO))

    def image(self, source: str, *, visual: bool, depth: bool) -> Image:
        """Takes a picture with depth, or only one of the two. Raises ValueError and NoImageError."""
        camera = next((each for each in self._capabilities.cameras if each.source == source), None)
        if camera is None:
            raise ValueError(f"there is no camera {source!r}")
        hand = source == "hand"
        names = ["hand_color_image" if hand else f"{source}_fisheye_image"] if visual else []
        own = f"{source}_depth_in_visual_frame" if visual else f"{source}_depth"  # with a picture it has its pose
        names += ["hand_depth_in_hand_color_frame" if hand else own] if depth else []
        try:
            answers = self._pictures(names, _PICTURE_S)
        except LostError as error:
            raise NoImageError(f"{source}: {error}") from error
        first = answers[0].shot
        frames = self._frame_tree(frames_of(first.transforms_snapshot))
        parent, api_parent = ("hand", "arm0.link_wr1") if camera.on_hand else ("body", "body")
        frames[f"{source}_camera"] = (parent, sensor_pose(answers[0], api_parent))
        stamp_s = self._stamp(first.acquisition_time)
        return picture(source, f"{source}_camera", answers, stamp_s, FrameTree(frames), coloured=hand)

    def fix_focus(self) -> None:
        """Fixes the focus of the hand's camera, because intrinsics change with it. Raises LostError."""
        if self._connection.has("gripper-camera-param"):
            request = gripper_camera_param_pb2.GripperCameraParamRequest()
            request.params.focus_auto.value = False
            self._connection.call("gripper-camera-param", "SetParams", request)

    def _pictures(self, names: Sequence[str], timeout_s: float) -> Sequence[Any]:
        """Takes pictures of image sources. Raises LostError."""
        Pixels, request = image_pb2.Image, image_pb2.GetImageRequest()
        for name in names:
            form = Pixels.FORMAT_RAW if "_depth" in name else Pixels.FORMAT_JPEG
            request.image_requests.add(image_source_name=name, image_format=form, quality_percent=95.0)
        answers = self._connection.call("image", "GetImage", request, timeout_s).image_responses
        if len(answers) != len(names):
            raise LostError(f"the robot gives {len(answers)} pictures, not {len(names)}", CommandCause.FAULT)
        for answer in answers:
            if (wrong := response_trouble(answer)) is not None:
                raise LostError(wrong.text, wrong.cause)
        return list(answers)

    def _frame_tree(self, frames: Any) -> dict[str, tuple[str, RigidTransform]]:
        """The protocol's frames from those of the API; heights are over the feet."""
        X_OB = self.readings.odometry.X_OB if "odom" not in frames else pose_between(frames, "odom", "body")
        x, y, _ = X_OB.translation()
        made = {"body": ("odom", RigidTransform(X_OB.rotation(), [x, y, self._height_m or 0.0]))}
        if "arm0.link_wr1" in frames:
            made["hand"] = ("body", pose_between(frames, "body", "arm0.link_wr1"))
        for camera in self._capabilities.cameras:
            made[f"{camera.source}_camera"] = ("hand" if camera.on_hand else "body", camera.X_FC)
        return made

    def _depth_scan(self) -> Scan:
        names = [f"{camera.source}_depth" for camera in self._capabilities.body_cameras]
        answers = self._pictures(names, OLD_STATE_S)
        stamp_s = self._stamp(answers[0].shot.acquisition_time)
        return depth_scan(answers, stamp_s, self._X_BL(), self.readings.odometry.X_OB)

    def _lidar_scan(self) -> Scan:
        request = point_cloud_pb2.GetPointCloudRequest()
        request.point_cloud_requests.add(
            point_cloud_source_name=_LIDAR, cloud_type=point_cloud_pb2.PointCloudRequest.CLOUD_TYPE_POINTS
        )
        (answer,) = self._connection.call(_LIDAR, "GetPointCloud", request).point_cloud_responses
        if (wrong := response_trouble(answer)) is not None:
            raise LostError(wrong.text, wrong.cause)
        cloud, source = answer.point_cloud, answer.point_cloud.source
        frames = frames_of(source.transforms_snapshot)
        points = np.frombuffer(cloud.data, np.float32).reshape(-1, 3).astype(np.float64)
        X_BF = pose_between(frames, "body", source.frame_name_sensor)
        points_L = (self._X_BL().inverse() @ X_BF @ points.T).T
        stamp_s, X_OB = self._stamp(source.acquisition_time), pose_between(frames, "odom", "body")
        return scan_of_points(points_L, RINGS_RAD, COLUMNS, stamp_s, self._X_BL(), X_OB)

    def _X_BL(self) -> RigidTransform:
        """Pose of the LiDAR on the rear rails, as in the description."""
        height_m = (self._capabilities.lidar_height_m or 0.0) - self._capabilities.standing_height_m
        return RigidTransform([-0.2, 0.0, height_m])

    def _stamp(self, message: Any) -> float:
        """Time of a message on the protocol's clock."""
        return self._clock.now() - (self._clock.robot_time_s() - seconds(message))
