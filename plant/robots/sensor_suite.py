"""All sensors of one robot, cameras included: measurements of the plant's state, with noise from the seed."""

from __future__ import annotations

import math
import zlib
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import FrameId
from pydrake.math import RigidTransform
from pydrake.multibody.tree import RigidBody

from plant.rendering import RENDERER, MountedCamera, Scene
from plant.robots.robot_kind import RobotBody, SensorOptions
from plant.robots.servos import ActuatedJoints
from plant.saved_state import Stateful
from plant.sensors.camera_spec import CameraSpec, colour_render_camera, depth_render_camera
from plant.sensors.lidar import Lidar, LidarSpec
from plant.sensors.noise import DepthDegrader, DepthNoise, NoisySensor, PictureDegrader, PictureNoise
from plant.sensors.proprioception import (
    BatteryModel,
    BatterySpec,
    GripperModel,
    GripperNoise,
    ImuModel,
    JointModel,
    OdometryModel,
)
from skills.robot import Battery, FloatArray, FrameTree, Gripper, Image, Imu, Joints, Odometry, Scan

_NO_PICTURE = np.zeros((0, 0), dtype=np.uint8)
_NO_DEPTH = np.zeros((0, 0), dtype=np.float32)


class Camera(NoisySensor):
    """Camera of one robot; the same seed and the same order of pictures give the same noise."""

    def __init__(
        self,
        spec: CameraSpec,
        link_frame: FrameId,
        rng: np.random.Generator,
        *,
        scene: Scene | None = None,
        work: Counter[str] | None = None,
        picture_noise: PictureNoise | None = None,
        depth_noise: DepthNoise | None = None,
    ) -> None:
        """`link_frame` is the geometry frame of the link (`MultibodyPlant.GetBodyFrameIdOrThrow`).

        Without a `scene`, the camera takes no pictures. `work` counts the rendered pictures by size.
        """
        super().__init__(rng)
        self._work = Counter() if work is None else work
        self.spec = spec
        picture, depth = spec.intrinsics(), spec.depth_intrinsics()
        self._scene, self._number = scene, -1
        if scene is not None:
            cameras = colour_render_camera(picture, RENDERER), depth_render_camera(depth, RENDERER, spec.depth_range_m)
            self._number = scene.mount(MountedCamera(*cameras, link_frame, spec.X_link_camera()))
        self._picture = PictureDegrader(
            rng, picture.height, picture.width, picture_noise or PictureNoise(), spec.picture_shrink
        )
        self._depth = DepthDegrader(rng, depth, spec.depth_range_m, depth_noise or DepthNoise())

    def take(
        self,
        positions: FloatArray,
        stamp_s: float,
        frames: FrameTree,
        *,
        visual: bool = True,
        depth: bool = True,
    ) -> Image:
        """Takes a picture, its depth, or both, with the plant at `positions`; `frames` are of the same time.

        The array that is not requested is empty. Raises LookupError without a scene.
        """
        if self._scene is None:
            raise LookupError("there is no scene for cameras: build the Diagram with render=True")
        lens, colour = self.spec.intrinsics(), None
        if visual:
            self._work[f"pictures_{lens.width}x{lens.height}"] += 1
            colour = self._picture.colour(self._scene.picture(positions, self._number, depth=False, time_s=stamp_s))
        grey = _NO_PICTURE if colour is None else np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        return Image(
            stamp_s=stamp_s,
            source=self.spec.name,
            camera_frame=self.spec.frame,
            intrinsics=lens,
            depth_intrinsics=self.spec.depth_intrinsics(),
            colour=colour if self.spec.colour else None,
            grey=grey,
            depth_m=self._take_depth(self._scene, positions, grey, stamp_s) if depth else _NO_DEPTH,
            frames=frames,
        )

    def _take_depth(
        self, scene: Scene, positions: FloatArray, grey: NDArray[np.uint8], time_s: float
    ) -> NDArray[np.float32]:
        """Renders noisy depth; too dark and too shiny spots of the picture are lost, if there is one."""
        lens = self.spec.depth_intrinsics()
        small = np.asarray(cv2.resize(grey, (lens.width, lens.height)), dtype=np.uint8) if grey.size else None
        self._work[f"depth_pictures_{lens.width}x{lens.height}"] += 1
        return self._depth.depth(scene.picture(positions, self._number, depth=True, time_s=time_s), small)


_DOCKED_WITHIN_M = 0.2
_STILL_M_S = 0.02


@dataclass(frozen=True)
class LidarMount:
    """LiDAR on a link: its pose in the link, its specification, and the duration of a revolution (s)."""

    link: RigidBody
    X_LinkL: RigidTransform
    spec: LidarSpec
    period_s: float


class SensorSuite(
    Stateful,
    ABC,
    saved=("_odometry_model", "_imu_model", "_joint_model", "_gripper_model", "_battery_model", "_lidar", "_cameras"),
):
    """All sensors of one robot: `update` stores the measurements in attributes; `image` takes pictures.

    Each kind of robot implements the measurement of its gripper.
    """

    def __init__(
        self,
        body: RobotBody,
        joints: ActuatedJoints,
        options: SensorOptions,
        *,
        lidar: LidarMount,
        cameras: Mapping[str, CameraSpec],
        runtime_s: float,
        gripper_noise: GripperNoise | None = None,
    ) -> None:
        """`cameras` are mounted on the links that their specifications name."""
        self._body, self._index = body, joints
        self._dock, self._context = body.robot.dock, options.context
        self._kinematics = body.plant.CreateDefaultContext()
        seeds = np.random.SeedSequence([options.seed, zlib.crc32(body.name.encode())]).spawn(6 + len(cameras))
        rngs = map(np.random.default_rng, seeds)
        self._odometry_model = OdometryModel(next(rngs))
        self._imu_model = ImuModel(next(rngs))
        self._joint_model = JointModel(next(rngs), joints.names)
        self._gripper_model = GripperModel(next(rngs), gripper_noise)
        self._battery_model = BatteryModel(next(rngs), body.robot.charge, BatterySpec(runtime_s=runtime_s))
        self._lidar_period_s = lidar.period_s
        mount = body.plant, options.scene_graph.model_inspector(), lidar.link, lidar.X_LinkL
        self._lidar = Lidar(*mount, next(rngs), unseen=body.instances(), spec=lidar.spec, work=options.work)
        self._cameras = {
            name: Camera(spec, self._link_frame(spec.link), next(rngs), scene=options.scene, work=options.work)
            for name, spec in cameras.items()
        }
        self.power_up(0.0)

    def _link_frame(self, link: str) -> FrameId:
        plant = self._body.plant
        return plant.GetBodyFrameIdOrThrow(plant.GetBodyByName(link, self._body.instance).index())

    def power_up(self, now_s: float) -> None:
        """Starts the sensors and makes the first measurements."""
        self._scan: Scan | None = None
        self._revolution: Callable[[], Scan] | None = None
        self._scanned_s = -math.inf
        self.update(now_s)

    def update(self, now_s: float) -> None:
        """Updates all sensors except the cameras."""
        plant, index = self._body.plant, self._index
        self._now_s = now_s
        X_WB = plant.EvalBodyPoseInWorld(self._context, self._body.body)
        V_WB = plant.EvalBodySpatialVelocityInWorld(self._context, self._body.body)
        w_WB, v_WB = V_WB.rotational(), V_WB.translational()
        self.odometry: Odometry = self._odometry_model.update(now_s, self._reckoned(X_WB), w_WB, v_WB)
        self.imu: Imu = self._imu_model.update(now_s, X_WB, w_WB, v_WB)
        self._whole = plant.GetPositions(self._context)
        positions = self._whole[index.positions]
        rates = plant.GetVelocities(self._context)[index.velocities]
        efforts = self._efforts(positions, rates)
        self.joints: Joints = self._joint_model.update(now_s, positions, rates, efforts)
        self.gripper: Gripper = self._gripper_model.update(now_s, *self._gripper_feels(positions, rates, efforts))
        load = min(1.0, math.sqrt(v_WB @ v_WB) + float(np.abs(rates[self._index.arm]).sum()) / 4.0)
        self.battery: Battery = self._battery_model.update(now_s, load, docked=self._docked(X_WB, v_WB))
        if now_s - self._scanned_s >= self._lidar_period_s - 1e-6:
            self._scanned_s = now_s
            self._revolution = self._lidar.revolution(self._context, now_s, self.odometry.X_OB, self._X_BL())

    def tell_held(self, holding: bool) -> None:
        """Tells the gripper's sensor whether it holds an object that it does not feel."""
        self._gripper_model.tell(holding)

    @property
    def scan(self) -> Scan | None:
        """Latest LiDAR revolution, computed when it is first read; the plant may have stepped since."""
        if self._revolution is not None:
            self._scan, self._revolution = self._revolution(), None
        return self._scan

    def _reckoned(self, X_WB: RigidTransform) -> RigidTransform:
        """Pose of the body as odometry measures it, before errors are added."""
        return X_WB

    @abstractmethod
    def _gripper_feels(self, positions: FloatArray, rates: FloatArray, efforts: FloatArray) -> tuple[float, float]:
        """True opening of the gripper, and the force at its tip (N); 0 while it moves freely."""

    @abstractmethod
    def _X_BL(self) -> RigidTransform:
        """Pose of the LiDAR in the body frame, according to the robot."""

    @cached_property
    def _chains(self) -> Mapping[str, tuple[str, tuple[str, ...]]]:
        """Links of hand and head, each with the name of its frame and its joints."""
        can, plant, instance = self._body.kind.capabilities(), self._body.plant, self._body.instance
        chains = {"hand": can.arm.joint_names if can.arm else (), "head": can.head.joint_names if can.head else ()}
        moved = {frame: joints for frame, joints in chains.items() if joints}
        last = {frame: plant.GetJointByName(joints[-1], instance) for frame, joints in moved.items()}
        return {last[frame].child_body().name(): (frame, joints) for frame, joints in moved.items()}

    def _efforts(self, positions: FloatArray, rates: FloatArray) -> FloatArray:
        """Efforts of the motors: the servo law with its limits, as in the solver at the end of a step."""
        plant, instance = self._body.plant, self._body.instance
        servos = plant.get_desired_state_input_port(instance)
        if not servos.HasValue(self._context):
            return np.zeros(len(positions))
        desired = servos.Eval(self._context)
        feed_forward = plant.get_actuation_input_port(instance).Eval(self._context)
        return self._index.efforts_of(desired, feed_forward, positions, rates)

    def _docked(self, X_WB: RigidTransform, v_WB: FloatArray) -> bool:
        """Returns whether the body stands still at the dock."""
        if self._dock is None:
            return False
        p_WB = X_WB.translation()
        off_m = math.hypot(p_WB[0] - self._dock.x_m, p_WB[1] - self._dock.y_m)
        return off_m < _DOCKED_WITHIN_M and math.hypot(v_WB[0], v_WB[1]) < _STILL_M_S

    def image(self, source: str, *, visual: bool, depth: bool) -> Image:
        """Renders a picture, its depth, or both, at the state of the last `update`.

        Raises:
            ValueError: the source is unknown.
            LookupError: the Diagram has no scene for cameras.
        """
        if source not in self._cameras:
            raise ValueError(f"{self._body.name} has no camera {source!r}; it has {', '.join(self._cameras)}")
        return self._cameras[source].take(self._whole, self._now_s, self._frames(), visual=visual, depth=depth)

    def _frames(self) -> FrameTree:
        """Builds the frame tree from odometry and joint encoders."""
        plant, context, instance = self._body.plant, self._kinematics, self._body.instance
        positions, body = plant.GetPositions(context), self._body.body.body_frame()
        for name in (name for _, names in self._chains.values() for name in names):
            positions[plant.GetJointByName(name, instance).position_start()] = self.joints.position_rad[name]
        plant.SetPositions(context, positions)
        edges = {"body": ("odom", self.odometry.X_OB), "lidar": ("body", self._X_BL())}
        for link, (frame, _) in self._chains.items():
            link_frame = plant.GetBodyByName(link, instance).body_frame()
            edges[frame] = ("body", plant.CalcRelativeTransform(context, body, link_frame))
        for camera in self._cameras.values():
            frame = self._chains[camera.spec.link][0] if camera.spec.link in self._chains else "body"
            edges[camera.spec.frame] = (frame, camera.spec.X_link_camera())
        return FrameTree(edges)
