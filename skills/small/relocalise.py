"""The relocalise skill: searches the whole map for the robot's pose; first standing, then turning, then driving."""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from skills.api import Cause, LocalisationEstimate, Localiser, Part, Running, SearchingLocaliser, Succeeded
from skills.navigate.base import MovingSkill
from skills.navigate.sensor_watch import WatchOptions, low_points
from skills.perception.fiducials import look_for_tags
from skills.quantities import Delay, Height, Length, Margin, Share, Speed, Tries, Turn, TurnRate
from skills.robot import Capabilities, FloatArray, NoImageError, Pose2D, Scan
from skills.routine import PATIENCE_S, Routine, SkillFailure

_TAG_VARIANCES = (0.05**2, 0.05**2, 0.03**2)
"""Variances of a pose by a tag: x, y (m^2) and yaw (rad^2)."""
_BEYOND_M = 5.0
"""Distance beyond which points are ignored."""


@dataclass(frozen=True)
class FreeSpaceOptions:
    """Range of heights that count as obstacles, and the body's clearance from obstacles (m)."""

    heights_m: tuple[Height, Height] = (0.1, 1.2)
    side_m: Margin = 0.15
    ahead_m: Margin = 0.3
    turning_m: Margin = 0.04


def obstacles_B(scan: Scan, capabilities: Capabilities, options: FreeSpaceOptions) -> FloatArray:
    """Returns the scan points (N, 2) in the body frame that the body could hit, without its own outline."""
    points = scan.points_B()
    heights = points[:, 2] + scan.X_OB.translation()[2]
    x, y = points[:, 0], points[:, 1]
    corners = np.asarray(capabilities.footprint_m)
    own = np.all((points[:, :2] > corners.min(axis=0)) & (points[:, :2] < corners.max(axis=0)), axis=1)
    low, high = options.heights_m
    near = ~own & (heights > low) & (heights < high) & (np.hypot(x, y) < _BEYOND_M)
    return np.ascontiguousarray(points[near, :2])


def free_m(obstacles: FloatArray, heading_rad: float, capabilities: Capabilities, options: FreeSpaceOptions) -> float:
    """Returns how far (m) the body can drive straight after it has turned to a heading in the body frame."""
    corners = np.asarray(capabilities.footprint_m)
    front, half = corners[:, 0].max(), np.abs(corners[:, 1]).max() + options.side_m
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    along, across = c * obstacles[:, 0] + s * obstacles[:, 1], c * obstacles[:, 1] - s * obstacles[:, 0]
    ahead = along[(np.abs(across) < half) & (along > 0.0)]
    return float(max(0.0, ahead.min() - front - options.ahead_m)) if len(ahead) else _BEYOND_M


def can_turn(obstacles: FloatArray, capabilities: Capabilities, options: FreeSpaceOptions) -> bool:
    """Returns whether the body can turn on the spot."""
    radius = max(math.hypot(x, y) for x, y in capabilities.footprint_m) + options.turning_m
    return not len(obstacles) or float(np.hypot(obstacles[:, 0], obstacles[:, 1]).min()) > radius


_SCAN_PATIENCE_S = PATIENCE_S
_LEAST_STEP_M = 0.15
"""Shortest step of a drive."""


@dataclass(frozen=True)
class RelocaliseInputs:
    """Maximum numbers of headings to search from, an eighth of a turn apart, and of drives to other places."""

    turns: Tries = 8
    drives: Tries = 3


@dataclass(frozen=True)
class RelocaliseOptions:
    """Latency of a search (s), and speed and angle of the turns between searches.

    `drive_m` and `step_m`: between rounds of turns the robot drives up to this far, in steps with a look ahead before
    each. `agree_s` and `good_health`: the pose is accepted once scans have agreed for this time and the estimate's
    health is at least this.
    """

    search_latency_s: Delay = 1.0
    turn_rad_s: TurnRate = 0.4
    turn_rad: Turn = math.pi / 4
    agree_s: Delay = 1.0
    good_health: Share = 0.5
    drive_m: Length = 2.0
    step_m: Length = 0.5
    drive_m_s: Speed = 0.3
    free_space: FreeSpaceOptions = field(default_factory=FreeSpaceOptions)
    low: WatchOptions = field(default_factory=WatchOptions)


class Relocalise(MovingSkill[RelocaliseInputs]):
    """Recovers the robot's pose on the map. A pose is accepted once new scans agree with it for `agree_s`."""

    name: ClassVar[str] = "relocalise"
    Inputs: ClassVar[type] = RelocaliseInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "there are no new scans, or this robot's localiser cannot search",
        Cause.EXECUTION: "the robot refuses to move, or a camera gives no picture",
        Cause.POSTCONDITION: "no pose on the map fits what the robot sees",
    }
    default_timeout_s: ClassVar[float] = 240.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"localisation": 1.0}
    Options: ClassVar[type] = RelocaliseOptions
    options: RelocaliseOptions

    def run(self, inputs: RelocaliseInputs) -> Routine[Succeeded]:
        """Searches the whole map; turns a little and searches again; after a full round drives to another place."""
        localiser = self.context.localiser
        if not isinstance(localiser, SearchingLocaliser):
            raise SkillFailure(Cause.PRECONDITION, "the localiser of this robot cannot search the map")
        if (yield from self._agreed(localiser)):
            return Succeeded("the scans agree with the map already")
        for drive in range(inputs.drives + 1):
            if drive and not (yield from self._drive()):
                break
            for turn in range(max(1, inputs.turns)):
                found = (yield from self._agreed(localiser)) or (yield from self._found_by_tag(localiser))
                if found or (yield from self._found(localiser)):
                    pose = self.context.pose()
                    return Succeeded(f"found itself at ({pose.x_m:.2f}, {pose.y_m:.2f}) m")
                if turn + 1 < inputs.turns:
                    yield from self._turn(self.options.turn_rad)
        raise SkillFailure(Cause.POSTCONDITION, "no place on the map fits what the robot sees")

    def _found(self, localiser: SearchingLocaliser) -> Routine[bool]:
        """Searches with a new scan, adopts the pose found, and checks whether the next scans agree."""
        message = "searching the whole map"
        scan = yield from self._new_scan(message)
        belief = localiser.estimate()
        found: LocalisationEstimate | None = yield from self.compute(
            lambda: localiser.search(scan, belief, None),
            latency_s=self.options.search_latency_s,
            name="search the map",
            message=message,
        )
        if found is None:
            return False
        localiser.accept(found)
        return (yield from self._agreed(localiser))

    def _found_by_tag(self, localiser: SearchingLocaliser) -> Routine[bool]:
        """Looks for tags on walls; adopts the pose that puts a tag where the map has it, if scans agree."""
        walls = {tag.id: tag for tag in self.context.tags if tag.on is None}
        sizes_m = {tag.id: tag.size_m for tag in walls.values()}
        for camera in self.context.robot.capabilities().body_cameras if walls else ():
            with suppress(SkillFailure):  # a camera that gives no picture shows no tag
                seen = yield from look_for_tags(self, camera.source, sizes_m, "looking for tags")
                for tag in sorted(seen, key=lambda each: each.ambiguity):
                    X_WO = Pose2D.from_transform(walls[tag.id].X_WT() @ tag.X_OT.inverse()).transform()
                    localiser.accept(LocalisationEstimate(tag.stamp_s, X_WO, np.diag(_TAG_VARIANCES), True))
                    if (yield from self._agreed(localiser)):
                        return True
        return False

    def _agreed(self, localiser: Localiser) -> Routine[bool]:
        """Returns whether the scans agree with the map for `agree_s`."""
        context = self.context
        begun_s = context.clock.now()
        while (estimate := localiser.estimate()).localised:
            if estimate.stamp_s >= begun_s + self.options.agree_s:
                return estimate.health >= self.options.good_health
            if context.clock.now() > begun_s + self.options.agree_s + _SCAN_PATIENCE_S:
                raise SkillFailure(Cause.PRECONDITION, "there are no new scans to find the place by")
            yield Running("seeing whether scans agree")
        return False

    def _new_scan(self, message: str) -> Routine[Scan]:
        """Returns the first scan taken from now on."""
        context = self.context
        begun_s = context.clock.now()
        while (scan := context.robot.scan()) is None or scan.stamp_s < begun_s - 0.11:
            if context.clock.now() > begun_s + _SCAN_PATIENCE_S:
                raise SkillFailure(Cause.PRECONDITION, "there are no new scans to find the place by")
            yield Running(message)
        return scan

    def _turn(self, turn_rad: float) -> Routine[None]:
        """Turns slowly on the spot by a signed angle, if there is space, and comes to rest."""
        scan = yield from self._new_scan("looking for space to turn")
        capabilities, free_space = self.context.robot.capabilities(), self.options.free_space
        if not can_turn(obstacles_B(scan, capabilities, free_space), capabilities, free_space):
            return
        rate = math.copysign(self.options.turn_rad_s, turn_rad)
        enough = self._well_localised
        yield from self.move((0.0, 0.0, rate), abs(turn_rad / rate), "turning slowly to see more", enough=enough)

    def _drive(self) -> Routine[bool]:
        """Turns to the direction with the most free space and drives there step by step; returns whether it drove."""
        options = self.options
        scan = yield from self._new_scan("looking for space to drive")
        body, free_space = self.context.robot.capabilities(), options.free_space
        seen = obstacles_B(scan, body, free_space)
        turns = range(-3, 5) if can_turn(seen, body, free_space) else (0,)
        headings = sorted((turn * options.turn_rad for turn in turns), key=abs)
        heading = max(headings, key=lambda each: min(options.drive_m, free_m(seen, each, body, free_space)))
        if abs(heading) > 0.0:
            yield from self._turn(heading)
        left_m, driven_m = options.drive_m, 0.0
        while left_m > 0.05:
            free_ahead_m = yield from self._free_ahead_m()
            step_m = min(options.step_m, left_m, free_ahead_m)
            if step_m < min(_LEAST_STEP_M, left_m):
                break
            ahead, message = (options.drive_m_s, 0.0, 0.0), "driving to see more"
            yield from self.move(ahead, step_m / options.drive_m_s, message, enough=self._well_localised)
            left_m, driven_m = left_m - step_m, driven_m + step_m
        return driven_m > 0.0

    def _free_ahead_m(self) -> Routine[float]:
        """Returns how far (m) the robot can drive straight, from a new scan and a depth image of each front camera."""
        message, robot, low = "looking ahead", self.context.robot, self.options.low
        scan = yield from self._new_scan(message)
        capabilities, free_space = robot.capabilities(), self.options.free_space
        points = [obstacles_B(scan, capabilities, free_space)]
        for camera in capabilities.body_cameras:
            if camera.looks_towards(0.0):
                X_BO = robot.odometry().X_OB.inverse()
                points_O = yield from self._low_points(camera.source, low)
                points.append(X_BO.multiply(points_O.T).T[:, :2])
        return free_m(np.concatenate(points), 0.0, capabilities, free_space)

    def _low_points(self, source: str, low: WatchOptions) -> Routine[FloatArray]:
        """Returns points (N, 3) low above the floor from a depth camera, in the odom frame."""
        robot = self.context.robot
        job = self.context.worker.sense(
            lambda: robot.image(source, visual=False),
            lambda image: low_points(image, low),
            latency_s=low.latency_s,
            name=f"look for low obstacles by {source}",
        )
        try:
            return (yield from self._awaited(job, "looking ahead"))
        except NoImageError as error:
            raise SkillFailure(Cause.EXECUTION, str(error)) from error

    def _well_localised(self) -> bool:
        estimate = self.context.localiser.estimate()
        return estimate.localised and estimate.health >= self.options.good_health
