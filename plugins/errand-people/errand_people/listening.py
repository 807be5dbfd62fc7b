"""Base of skills that hear what people say to the robot, and ask them who they are."""

from collections.abc import Callable, Iterable

from skills.api import InputsT, Job, Question, Running
from skills.routine import Routine, RoutineSkill


class ListeningSkill(RoutineSkill[InputsT]):
    """Routine that hears what people say to the robot, except while it is suspended."""

    _heard: Job[str] | None = None

    @property
    def remark(self) -> str | None:
        """Words that somebody has said; None when nobody has spoken."""
        return self._heard.result() if self._heard is not None and self._heard.done() else None

    def ask_for_name(
        self, person: str, answer_s: float, tick: Callable[[], Iterable[Running]], enough: Callable[[], bool]
    ) -> Routine[str | None]:
        """Asks "Are you Robin?"; returns "yes", "no", or "" when nobody answers within answer_s.

        Yields from `tick` while it waits; returns None once `enough` holds.
        """
        name = f"{self.name} of {self.context.robot.name}"
        asked = self.context.ask(Question(name, f"Are you {person}?", ("yes", "no"), "", answer_s))
        try:
            while not asked.done():
                yield from tick()
                if enough():
                    return None
        finally:
            asked.withdraw()
        return asked.result()

    def begin(self, inputs: InputsT) -> None:
        """Starts to listen; see `RoutineSkill.begin`."""
        super().begin(inputs)
        self._heard = self.context.listen()

    def suspend(self) -> None:
        """Stops listening; see `RoutineSkill.suspend`."""
        self._stop_listening()
        super().suspend()

    def resume(self, inputs: InputsT) -> None:
        """Listens again; see `RoutineSkill.resume`."""
        super().resume(inputs)
        self._heard = self.context.listen()

    def end(self) -> None:
        """Stops listening; see `RoutineSkill.end`."""
        self._stop_listening()
        super().end()

    def _stop_listening(self) -> None:
        if self._heard is not None:
            self._heard.withdraw()
        self._heard = None
