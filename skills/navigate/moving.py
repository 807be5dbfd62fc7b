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
        """Forget an earlier attempt and prepare a new one."""
        super().begin(inputs)
        self._base = Base(self.context)

    def end(self) -> None:
        """Stop what this skill set in motion."""
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
        """Move at a body-frame velocity (m/s, m/s, rad/s) for a time, or until it is `enough`; then rest.

        Raises SkillFailure: the robot refused.
        """
        end_s = self.context.clock.now() + for_s
        while self.context.clock.now() < end_s and not enough():
            self._base.drive(velocity)
            begun_s = self.context.clock.now()
            yield Running(message)
            while (refusal := self._base.refusal()) is not None:
                if not self._base.asks_again():
                    raise SkillFailure(Cause.EXECUTION, f"the robot refused to move: {refusal}")
                yield Running(f"{message}; the robot refuses to move: {refusal}")
                end_s, begun_s = end_s + self.context.clock.now() - begun_s, self.context.clock.now()
        self._base.stop()
        yield from self.pause(settle_s, "coming to rest")
