"""Skills that turn or drive a little by themselves, and look about in between."""

from __future__ import annotations

from collections.abc import Callable

from skills.api import Cause, InputsT, Running, SkillContext
from skills.navigate.base import Base
from skills.routine import Routine, RoutineSkill, SkillFailure


class MovingSkill(RoutineSkill[InputsT]):
    """A routine that moves the base at a velocity for a time; `end` stops it."""

    def __init__(self, context: SkillContext) -> None:
        super().__init__(context)
        self._base = Base(context)

    def begin(self, inputs: InputsT) -> None:
        """Forgets an earlier attempt and prepares a new one."""
        super().begin(inputs)
        self._base = Base(self.context)

    def suspend(self) -> None:
        """Stops the base at once; see `RoutineSkill.suspend`."""
        self._base.stop()
        super().suspend()

    def end(self) -> None:
        """Stops what this skill set in motion."""
        self._base.stop()
        super().end()

    def move(
        self,
        velocity: tuple[float, float, float],
        for_s: float,
        message: str,
        *,
        settle_s: float = 0.5,
        enough: Callable[[], bool] = lambda: False,
    ) -> Routine[None]:
        """Moves at a body-frame velocity (m/s, m/s, rad/s) for a time, or until it is `enough`; then rest.

        Raises SkillFailure: the robot refused.
        """
        end_s = self.context.clock.now() + for_s
        while self.context.clock.now() < end_s and not enough():
            end_s += yield from self.drive(velocity, Running(message))
        self._base.stop()
        yield from self.pause(settle_s, "coming to rest")

    def drive(self, velocity: tuple[float, float, float], running: Running) -> Routine[float]:
        """Moves at a body-frame velocity for one tick; for how long (s) the robot refused to. Raises SkillFailure."""
        self._base.drive(velocity)
        yield running
        begun_s = self.context.clock.now()
        while (refusal := self._base.refusal()) is not None:
            if not self._base.asks_again():
                raise SkillFailure(Cause.EXECUTION, f"The robot refused to drive: {refusal}.")
            yield Running(f"{running.message}; the robot refuses to drive: {refusal}")
        return self.context.clock.now() - begun_s
