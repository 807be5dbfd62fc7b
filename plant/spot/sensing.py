"""Spot's sensors: snapshots taken from the plant's state, with noise from the seed."""

from __future__ import annotations

import math
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np
from pydrake.geometry import FrameId
from pydrake.math import RigidTransform

from plant.kinds import SensorOptions
from plant.models.spot.description import CAMERAS, arm_joint_names, spot_facts
from plant.scene import RENDERER
from plant.sensors.battery import BatteryModel, BatterySpec
from plant.sensors.camera import Camera
from plant.sensors.camera_spec import load_cameras
from plant.sensors.gripper import GripperModel
from plant.sensors.imu import ImuModel
from plant.sensors.joints import JointModel
from plant.sensors.lidar import Lidar
from plant.sensors.noisy import NoisySensor
from plant.sensors.odometry import OdometryModel
from plant.snapshot.values import State
from plant.spot.kind import HAND_LINK
from plant.spot.model import SpotModel
from skills.robot import Battery, FloatArray, FrameTree, Gripper, Image, Imu, Joints, Odometry, Scan

_FRAME_OF_LINK = {"body": "body", HAND_LINK: "hand"}
_LIDAR_PERIOD_S = 0.1
_GRIPPER_MOVES_RAD_S = 0.05
_DOCKED_WITHIN_M = 0.2
_STILL_M_S = 0.02


class SpotSensors:
    """All sensors of one Spot. Pictures are taken when asked for; `update` takes the readings, which are attributes."""

    def __init__(self, model: SpotModel, options: SensorOptions) -> None:
        """`options.context` is the plant's."""
        self._model, self._scene_graph, self._dock = model, options.scene_graph, options.dock
        self._scene, self._context = options.scene, options.context
        self._index = model.index()
        self._kinematics = model.plant.CreateDefaultContext()
        rngs = _generators(options.seed, model.name)
        body = spot_facts()["capabilities"]
        self._odometry_model = OdometryModel(next(rngs))
        self._imu_model = ImuModel(next(rngs))
        self._joint_model = JointModel(next(rngs), self._index.names)
        self._gripper_model = GripperModel(next(rngs))
        self._battery_model = BatteryModel(next(rngs), options.charge, BatterySpec(runtime_s=body["runtime"]))
        self._lidar = self._make_lidar(next(rngs), options.work)
        self._cameras = {
            name: Camera(spec, self._link_frame(spec.link), next(rngs), renderer=RENDERER, work=options.work)
            for name, spec in load_cameras(CAMERAS).items()
        }
        self.scan: Scan | None = None
        self.update(0.0)

    def _make_lidar(self, rng: np.random.Generator, work: Counter[str]) -> Lidar:
        plant, X_BL = self._model.plant, RigidTransform(spot_facts()["lidar"]["xyz"])
        inspector = self._scene_graph.model_inspector()
        return Lidar(plant, inspector, self._model.body, X_BL, rng, unseen=self._model.instances(), work=work)

    def _link_frame(self, link: str) -> FrameId:
        plant = self._model.plant
        return plant.GetBodyFrameIdOrThrow(plant.GetBodyByName(link, self._model.instance).index())

    def update(self, now_s: float) -> None:
        """Take new readings of all but the cameras."""
        plant, index = self._model.plant, self._index
        self._now_s = now_s
        X_WB = plant.EvalBodyPoseInWorld(self._context, self._model.body)
        V_WB = plant.EvalBodySpatialVelocityInWorld(self._context, self._model.body)
        w_WB, v_WB = _array(V_WB.rotational()), _array(V_WB.translational())
        self.odometry: Odometry = self._odometry_model.update(now_s, X_WB, w_WB, v_WB)
        self.imu: Imu = self._imu_model.update(now_s, X_WB, w_WB, v_WB)
        positions = _array(plant.GetPositions(self._context)[index.positions])
        rates = _array(plant.GetVelocities(self._context)[index.velocities])
        efforts = self._efforts(positions, rates)
        self.joints: Joints = self._joint_model.update(now_s, positions, rates, efforts)
        self.gripper: Gripper = self._gripper_model.update(
            now_s, -float(positions[index.gripper]), self._clamp_force_n(rates, efforts)
        )
        load = min(1.0, float(np.linalg.norm(v_WB)) + float(np.abs(rates[index.arm]).sum()) / 4.0)
        self.battery: Battery = self._battery_model.update(now_s, load, docked=self._docked(X_WB, v_WB))
        if self.scan is None or now_s - self.scan.stamp_s >= _LIDAR_PERIOD_S - 1e-6:
            self.scan = self._lidar.scan(self._context, now_s, self.odometry.X_OB)

    def _efforts(self, positions: FloatArray, rates: FloatArray) -> FloatArray:
        """What the motors do: the servos' law with limits, as the plant's solver has it at the end of a step."""
        plant, instance = self._model.plant, self._model.instance
        servos = plant.get_desired_state_input_port(instance)
        if not servos.HasValue(self._context):
            return np.zeros(len(positions))
        desired = _array(servos.Eval(self._context))
        feed_forward = _array(plant.get_actuation_input_port(instance).Eval(self._context))
        return self._index.efforts_of(desired, feed_forward, positions, rates)

    def _docked(self, X_WB: RigidTransform, v_WB: FloatArray) -> bool:
        """Whether the body stands still at the dock."""
        if self._dock is None:
            return False
        p_WB = X_WB.translation()
        off_m = math.hypot(p_WB[0] - self._dock.x_m, p_WB[1] - self._dock.y_m)
        return off_m < _DOCKED_WITHIN_M and float(np.linalg.norm(v_WB[:2])) < _STILL_M_S

    def state(self) -> State:
        """What changes from one reading to the next; the readings themselves are taken anew."""
        return {name: part.state() for name, part in self._parts().items()}

    def restore(self, state: State, now_s: float) -> None:
        """Go on from such a state, and take readings."""
        for name, part in self._parts().items():
            part.restore(state[name])
        self.scan = None
        self.update(now_s)

    def _parts(self) -> Mapping[str, NoisySensor]:
        return {
            "odometry": self._odometry_model,
            "imu": self._imu_model,
            "joints": self._joint_model,
            "gripper": self._gripper_model,
            "battery": self._battery_model,
            "lidar": self._lidar,
            **{f"camera {name}": camera for name, camera in self._cameras.items()},
        }

    def _clamp_force_n(self, rates: FloatArray, efforts: FloatArray) -> float:
        """Force at the gripper's tip from its motor's torque, 0 while the gripper moves."""
        if abs(float(rates[self._index.gripper])) > _GRIPPER_MOVES_RAD_S:
            return 0.0
        return max(0.0, float(efforts[self._index.gripper])) / float(spot_facts()["gripper"]["tip_radius"])

    def image(self, source: str, *, visual: bool, depth: bool) -> Image:
        """Render a picture, its depth, or both.

        Raises:
            ValueError: the source is unknown.
            LookupError: nothing is rendered.
        """
        if source not in self._cameras:
            raise ValueError(f"{self._model.name} has no camera {source!r}; it has {', '.join(self._cameras)}")
        if self._scene is None:
            raise LookupError("nothing is rendered: build the Diagram with render=True")
        query = self._scene.query_at(self._model.plant.GetPositions(self._context))
        return self._cameras[source].take(query, self._now_s, self._frames(), visual=visual, depth=depth)

    def _frames(self) -> FrameTree:
        """The frame tree from odometry and joint encoders."""
        edges = {
            "body": ("odom", self.odometry.X_OB),
            "hand": ("body", self._X_BHand()),
            "lidar": ("body", RigidTransform(spot_facts()["lidar"]["xyz"])),
        }
        for camera in self._cameras.values():
            edges[camera.spec.frame] = (_FRAME_OF_LINK[camera.spec.link], camera.spec.X_link_camera())
        return FrameTree(edges)

    def _X_BHand(self) -> RigidTransform:
        plant = self._model.plant
        for name in arm_joint_names():
            plant.GetJointByName(name, self._model.instance).set_angle(self._kinematics, self.joints.position_rad[name])
        hand = plant.GetBodyByName(HAND_LINK, self._model.instance).body_frame()
        X_BHand: RigidTransform = plant.CalcRelativeTransform(self._kinematics, self._model.body.body_frame(), hand)
        return X_BHand


def _generators(seed: int, robot_name: str) -> Iterator[np.random.Generator]:
    """Independent generators, the same for the same seed and name."""
    sequence = np.random.SeedSequence([seed, zlib.crc32(robot_name.encode())])
    while True:
        (child,) = sequence.spawn(1)
        yield np.random.default_rng(child)


def _array(values: object) -> FloatArray:
    return np.asarray(values, dtype=np.float64)
