"""A base that follows velocities at once: the plant's LiDAR and odometry, without its dynamics."""

import math

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from plant.robots.spot.model import spot_facts
from plant.sensors.lidar import Lidar
from plant.sensors.proprioception import OdometryModel
from skills.geometry import compose
from skills.robot import Pose2D


class GlidingBase:
    """Spot's base and LiDAR at a `true` pose; odometry follows the `believed` one, and notices no carrying off."""

    def __init__(self, simulation, rng):
        world = simulation.engine.world
        self._context, self._model = simulation.engine.context, world.robots["Alice"]
        X_BL, inspector = RigidTransform(spot_facts()["lidar"]["xyz"]), world.scene_graph.model_inspector()
        self._lidar = Lidar(world.plant, inspector, self._model.body, X_BL, rng, unseen=self._model.instances())
        self._odometry = OdometryModel(rng)
        self.true = self.believed = simulation.starts["Alice"]
        self.now_s = 0.0

    def move(self, velocity, dt_s):
        step = Pose2D(*(velocity * dt_s).tolist())
        self.true, self.believed = compose(self.true, step), compose(self.believed, step)
        self.now_s += dt_s
        self.sense(velocity)

    def sense(self, velocity=np.zeros(3)):  # noqa: B008
        self._model.place(self._context, self.true)
        here, height_m = self.believed, spot_facts()["capabilities"]["standing_height"]
        c, s = math.cos(here.yaw_rad), math.sin(here.yaw_rad)
        vx, vy, wz = velocity
        moved = np.array([c * vx - s * vy, s * vx + c * vy, 0.0])
        X_WB = RigidTransform(RollPitchYaw(0.0, 0.0, here.yaw_rad), [here.x_m, here.y_m, height_m])
        self._reading = self._odometry.update(self.now_s, X_WB, np.array([0.0, 0.0, wz]), moved)
        self._scan = self._lidar.revolution(self._context, self.now_s, self._reading.X_OB)()

    def odometry(self):
        return self._reading

    def scan(self):
        return self._scan
