"""Logs a robot's pose, state, sensors, navigation and doors while the robot has a mission."""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from executive.words.schemas import DOORS, JOINTS, NAVIGATION, POSE, SCAN, STATE, pose_values, stamp
from skills.api import LocalisationEstimate, ObstacleLayerView, ParticleView, SkillContext
from skills.doorway import Doorway, SeenDoor
from skills.robot import Pose2D

POSE_PERIOD_S: Final = 0.5
SENSORS_PERIOD_S: Final = 1.0
DOORS_PERIOD_S: Final = 10.0
"""Steps of time in which the log has the age of what is known of a door."""
MOST_PARTICLES: Final = 30
_EPSILON_S: Final = 1e-9
_NOTHING: Final = np.empty((0, 2))


class RobotLog:
    """Writer of a robot's log: pose, state and navigation twice a second, sensors and doors once a second."""

    def __init__(self, name: str, context: SkillContext) -> None:
        self._name, self._context = name, context
        self._pose_due_s = self._sensors_due_s = context.clock.now()
        self._navigation: Mapping[str, object] = {}
        self._known_doors: tuple[tuple[str, float], ...] = ()

    def write(self) -> None:
        """Writes all messages that are due; call it after the estimators were updated."""
        context, estimate = self._context, self._context.localiser.estimate()
        if context.clock.now() >= self._pose_due_s - _EPSILON_S:
            self._pose_due_s += POSE_PERIOD_S
            self._publish_pose(estimate)
            self._publish_state(estimate)
            self._publish_navigation()
        if context.clock.now() >= self._sensors_due_s - _EPSILON_S:
            self._sensors_due_s += SENSORS_PERIOD_S
            self._publish_sensors()
            self._publish_doors()

    def _publish_pose(self, estimate: LocalisationEstimate) -> None:
        X_WB = self._context.X_WB()
        flat = Pose2D.from_transform(X_WB)
        self._context.publish(
            POSE,
            {
                "timestamp": stamp(self._context.clock.now()),
                "frame_id": "world",
                "robot": self._name,
                "pose": pose_values(X_WB),
                "yaw_rad": flat.yaw_rad,
                "covariance": estimate.covariance.ravel().tolist(),
            },
        )

    def _publish_state(self, estimate: LocalisationEstimate) -> None:
        """Logs the robot's own faults, the gripper, the battery, the speed, and the quality of the localisation."""
        robot = self._context.robot
        gripper = robot.gripper()
        self._context.publish(
            STATE,
            {
                "robot": self._name,
                "faults": robot.faults(),
                "holding": gripper.holding,
                "grip_n": round(gripper.force_n, 1),
                "charge": round(robot.battery().charge, 4),
                "speed_m_s": round(math.hypot(*robot.odometry().velocity[:2]), 3),
                "localised": estimate.localised,
                "localisation_health": round(estimate.health, 3),
                "position_sigma_m": round(math.sqrt(estimate.covariance[0, 0] + estimate.covariance[1, 1]), 4),
            },
        )

    def _publish_sensors(self) -> None:
        """Logs the joints and the latest LiDAR scan."""
        robot = self._context.robot
        self._context.publish(JOINTS, {"robot": self._name, "joints": robot.joints()})
        if (scan := robot.scan()) is not None:
            self._context.publish(SCAN, {"robot": self._name, "scan": scan})

    def _publish_navigation(self) -> None:
        """Logs the localiser's particles and obstacles that are not on the map (x, y in m), when either changed."""
        localiser, costmap = self._context.localiser, self._context.costmap
        particles = localiser.particles_W(MOST_PARTICLES) if isinstance(localiser, ParticleView) else _NOTHING
        seen = costmap.obstacle_cells() if isinstance(costmap, ObstacleLayerView) else _NOTHING
        columns = np.round(np.concatenate([particles[:, :2].T, seen.T], axis=1), 2)
        (x, y), count = columns.tolist(), len(particles)
        new = {"particle_x": x[:count], "particle_y": y[:count], "seen_x": x[count:], "seen_y": y[count:]}
        if new != self._navigation:
            self._navigation = new
            self._context.publish(NAVIGATION, {"robot": self._name, **new})

    def _publish_doors(self) -> None:
        """Logs the states of all doors when a state has changed, or the age of one by `DOORS_PERIOD_S`."""
        doors, memory = self._context.doors, self._context.door_memory
        seen = [memory.last_seen(door) for door in doors]
        known = tuple((one.state.value, max(one.seen_s, 0.0) // DOORS_PERIOD_S) for one in seen)
        if known != self._known_doors:
            self._known_doors = known
            self._context.publish(DOORS, {"robot": self._name, "doors": list(map(_door_message, doors, seen))})


def _door_message(door: Doorway, seen: SeenDoor) -> Mapping[str, object]:
    """Message on a door for the log: its two ends (x, y) in metres, its state, and when the robot saw it (s)."""
    ends = [[round(float(value), 3) for value in end] for end in door.ends()]
    seen_s = round(seen.seen_s, 1) if math.isfinite(seen.seen_s) else None
    return {"between": list(door.between), "ends": ends, "state": seen.state.value, "seen_s": seen_s}
