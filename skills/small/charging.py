"""Skills at the dock: locate_dock finds the dock by its tag before the robot docks, charge waits on the dock."""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from skills.api import Cause, Failed, Part, Running, Skill, Step, Succeeded, Tag
from skills.quantities import Count, Duration, Share
from skills.robot import Pose2D
from skills.routine import Routine, RoutineSkill, SkillFailure

_MESSAGE: Final = "looking for the dock's tag"


@dataclass(frozen=True)
class ChargeInputs:
    """State of charge (0 to 1) to wait for."""

    level: Share = 0.8


@dataclass(frozen=True)
class ChargeOptions:
    """Limits on charging: a battery that gains less than the fraction `least_gain` in `no_gain_s` does not charge."""

    no_gain_s: Duration = 30.0
    least_gain: Share = 0.005


class Charge(Skill[ChargeInputs]):
    """Waits on the dock until the battery is charged, and checks that the charge rises. Commands no motion."""

    name: ClassVar[str] = "charge"
    Inputs: ClassVar[type] = ChargeInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    Options: ClassVar[type] = ChargeOptions
    options: ChargeOptions
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "the level is not from 0 to 1",
        Cause.POSTCONDITION: "the charge does not rise: the robot does not stand on its dock, or the dock is dead",
    }
    default_timeout_s: ClassVar[float] = 7200.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"battery": 10.0}

    def begin(self, inputs: ChargeInputs) -> None:
        """Resets the state of an earlier attempt."""
        self._level = inputs.level
        self._begun_at = self._best = self.context.robot.battery().charge
        self._best_s = self.context.clock.now()

    def step(self) -> Step:
        """Checks the battery."""
        if not 0.0 <= self._level <= 1.0:
            return Failed(Cause.PRECONDITION, f"a charge is from 0 to 1, not {self._level:g}")
        charge, now_s = self.context.robot.battery().charge, self.context.clock.now()
        if charge >= self._level:
            return Succeeded(f"the battery is at {charge:.0%}")
        if charge > self._best + self.options.least_gain:
            self._best, self._best_s = charge, now_s
        if now_s - self._best_s > self.options.no_gain_s:
            return Failed(Cause.POSTCONDITION, f"the battery does not charge here; it stays at {charge:.0%}")
        done = (charge - self._begun_at) / max(self._level - self._begun_at, 1e-6)
        return Running(f"charging, {charge:.0%} of {self._level:.0%}", min(1.0, max(0.0, done)))


@dataclass(frozen=True)
class LocateDockInputs:
    """The dock's tag, and the robot's pose on the dock, both according to the map."""

    tag: Tag
    dock: Pose2D


@dataclass(frozen=True)
class LocateDockOptions:
    """Number of `pictures` from each camera that faces the tag."""

    pictures: Count = 3


class LocateDock(RoutineSkill[LocateDockInputs]):
    """Looks for the dock's tag with the body cameras, and returns the robot's pose on the dock. Commands no motion.

    When no camera shows the tag, it returns the pose according to the map.
    """

    name = "locate_dock"
    Inputs = LocateDockInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    Options: ClassVar[type] = LocateDockOptions
    options: LocateDockOptions
    outputs: ClassVar[Mapping[str, type]] = {"dock": Pose2D}
    causes: ClassVar[Mapping[Cause, str]] = {Cause.PRECONDITION: "the robot does not know where it is"}
    default_timeout_s = 60.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 5.0, "localisation": 5.0}

    def run(self, inputs: LocateDockInputs) -> Routine[Succeeded]:
        """Takes the pictures, and averages over those that show the tag."""
        from skills.perception.fiducials import look_for_tags

        context, tag, mapped = self.context, inputs.tag, inputs.dock
        if not context.localiser.estimate().localised:
            raise SkillFailure(Cause.PRECONDITION, "the robot does not know where it is")
        p_BT = context.X_WB().inverse() @ tag.X_WT().translation()
        X_TD, docks = tag.X_WT().inverse() @ mapped.transform(), list[Pose2D]()
        for camera in context.robot.capabilities().body_cameras:
            if camera.looks_towards(math.atan2(p_BT[1], p_BT[0])):
                with suppress(SkillFailure):  # a camera that gives no picture shows no tag
                    for _ in range(self.options.pictures):
                        seen = yield from look_for_tags(self, camera.source, {tag.id: tag.size_m}, _MESSAGE)
                        X_WO = context.localiser.estimate().X_WO
                        docks += [Pose2D.from_transform(X_WO @ each.X_OT @ X_TD) for each in seen]
        if not docks:
            return Succeeded("no camera shows the dock's tag; the dock is where the map has it", {"dock": mapped})
        x, y, c, s = np.mean([(d.x_m, d.y_m, math.cos(d.yaw_rad), math.sin(d.yaw_rad)) for d in docks], axis=0)
        off_m = math.hypot(x - mapped.x_m, y - mapped.y_m)
        said = f"the dock's tag shows the dock {off_m:.2f} m from where the map has it"
        return Succeeded(said, {"dock": Pose2D(float(x), float(y), math.atan2(s, c))})
