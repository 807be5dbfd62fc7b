"""The skill that finds the robot's place on the whole map: standing still first, then turning slowly."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, LocalisationEstimate, Localiser, Running, SearchingLocaliser, SkillContext, Succeeded
from skills.arm.routine import Routine, RoutineSkill, SkillFailure
from skills.navigate.base import Base
from skills.quantities import Delay, Tries, Turn, TurnRate
from skills.robot import Scan

_SCAN_PATIENCE_S = 2.0


@dataclass(frozen=True)
class RelocaliseInputs:
    """`turns`: the most headings to search in, an eighth of a turn apart."""

    turns: Tries = 8


@dataclass(frozen=True)
class RelocaliseOptions:
    """How long a search takes (s), how fast and how far the robot turns between searches."""

    search_latency_s: Delay = 1.0
    turn_rad_s: TurnRate = 0.4
    turn_rad: Turn = math.pi / 4
    agree_s: Delay = 1.0


class Relocalise(RoutineSkill[RelocaliseInputs]):
    """Finds the robot's pose on the map again. A pose counts once new scans agree with it for a second."""

    name: ClassVar[str] = "relocalise"
    Inputs: ClassVar[type] = RelocaliseInputs
    Options: ClassVar[type] = RelocaliseOptions
    options: RelocaliseOptions
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "there are no new scans, or this robot's localiser cannot search",
        Cause.EXECUTION: "the robot refuses to turn",
        Cause.POSTCONDITION: "no pose on the map fits what the robot sees",
    }
    default_timeout_s: ClassVar[float] = 120.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"localisation": 1.0}

    def __init__(self, context: SkillContext) -> None:
        super().__init__(context)
        self._base = Base(context)

    def run(self, inputs: RelocaliseInputs) -> Routine[Succeeded]:
        """Search the whole map; turn a little, and again."""
        self._base = Base(self.context)
        localiser = self.context.localiser
        if not isinstance(localiser, SearchingLocaliser):
            raise SkillFailure(Cause.PRECONDITION, "the localiser of this robot cannot search the map")
        if (yield from self._agreed(localiser)):
            return Succeeded("the scans agree with the map already")
        for turn in range(max(1, inputs.turns)):
            if (yield from self._found(localiser)):
                pose = self.context.pose()
                return Succeeded(f"found itself at ({pose.x_m:.2f}, {pose.y_m:.2f}) m")
            if turn + 1 < inputs.turns:
                yield from self._turn()
        raise SkillFailure(Cause.POSTCONDITION, "no place on the map fits what the robot sees")

    def end(self) -> None:
        """Stop what this skill set in motion."""
        self._base.stop()
        super().end()

    def _found(self, localiser: Localiser) -> Routine[bool]:
        """Search with a new scan, believe what is found, and see whether the next scans agree."""
        message = "searching the whole map"
        scan = yield from self._new_scan(message)
        assert isinstance(localiser, SearchingLocaliser)
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

    def _agreed(self, localiser: Localiser) -> Routine[bool]:
        """Whether the scans of a whole second agree with the map."""
        context = self.context
        begun_s = context.clock.now()
        while (estimate := localiser.estimate()).localised:
            if estimate.stamp_s >= begun_s + self.options.agree_s:
                return True
            if context.clock.now() > begun_s + self.options.agree_s + _SCAN_PATIENCE_S:
                raise SkillFailure(Cause.PRECONDITION, "there are no new scans to find the place by")
            yield Running("seeing whether scans agree")
        return False

    def _new_scan(self, message: str) -> Routine[Scan]:
        """A scan that was taken since now."""
        context = self.context
        begun_s = context.clock.now()
        while (scan := context.robot.scan()) is None or scan.stamp_s < begun_s - 0.11:
            if context.clock.now() > begun_s + _SCAN_PATIENCE_S:
                raise SkillFailure(Cause.PRECONDITION, "there are no new scans to find the place by")
            yield Running(message)
        return scan

    def _turn(self) -> Routine[None]:
        """An eighth of a turn, slowly, on the spot; then rest."""
        context = self.context
        end_s = context.clock.now() + self.options.turn_rad / self.options.turn_rad_s
        while context.clock.now() < end_s:
            self._base.drive((0.0, 0.0, self.options.turn_rad_s))
            yield Running("turning slowly to see more")
            refusal = self._base.refusal()
            if refusal is not None:
                raise SkillFailure(Cause.EXECUTION, f"the robot refused to turn: {refusal}")
        self._base.stop()
        yield from self.pause(0.5, "coming to rest")
