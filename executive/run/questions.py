"""Questions to the operator that wait for an answer or for their time to be over."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Condition

from skills.api import Question
from skills.files.errors import InputError
from skills.files.texts import LONGEST_ANSWER, plain_text
from skills.robot import Clock


@dataclass(frozen=True)
class OpenQuestion:
    """A robot's question and until when it may be answered, on the robot's clock."""

    question: Question
    until_s: float
    robot: str = ""

    @property
    def id(self) -> str:
        """The question's id."""
        return self.question.id

    @property
    def options(self) -> tuple[str, ...]:
        """The answers to choose from; empty when any text will do."""
        return self.question.options


class QuestionManager:
    """The open questions. Its owner holds the lock whenever it calls."""

    def __init__(self) -> None:
        self._open: dict[str, PendingAnswer] = {}

    @property
    def open(self) -> tuple[OpenQuestion, ...]:
        """What waits for an answer, the oldest first."""
        return tuple(pending.open for pending in self._open.values())

    def ask(
        self, question: Question, clock: Clock, lock: Condition, over: Callable[[str], None], robot: str = ""
    ) -> PendingAnswer:
        """Open a robot's question; `over` is told when nobody answers. Raises ValueError: its id is open already."""
        if question.id in self._open:
            raise ValueError(f"the question '{question.id}' is open already")
        opened = OpenQuestion(question, clock.now() + question.limit_s, robot)
        pending = PendingAnswer(opened, clock, lock, self._leave, over)
        self._open[question.id] = pending
        return pending

    def answer(self, question_id: str, text: str) -> None:
        """Answer one. Raises ValueError: it is not open, or `text` is none of its options or no plain text."""
        pending = self._open.get(question_id)
        if pending is None:
            raise ValueError(f"the question '{question_id[:80]}' is not open (any more)")
        try:
            text = plain_text(text, what="the answer", longest=LONGEST_ANSWER)
        except InputError as error:
            raise ValueError(str(error)) from error
        options = pending.open.options
        text = next((option for option in options if option.lower() == text.strip().lower()), text)
        if options and text not in options:
            raise ValueError(f"'{text}' is no answer to '{question_id}'; choose one of: {', '.join(options)}")
        pending.take(text)
        self._leave(question_id)

    def postpone(self, by_s: float) -> None:
        """Give all open questions more time."""
        for pending in self._open.values():
            pending.open = replace(pending.open, until_s=pending.open.until_s + by_s)

    def close(self) -> None:
        """Nobody waits for answers any more."""
        self._open.clear()

    def _leave(self, question_id: str) -> None:
        self._open.pop(question_id, None)


class PendingAnswer:
    """A `skills.api.Asked`: done when answered or when its time is over, which makes the default the answer."""

    def __init__(
        self,
        open_question: OpenQuestion,
        clock: Clock,
        lock: Condition,
        leave: Callable[[str], None],
        over: Callable[[str], None],
    ) -> None:
        self.open = open_question
        self._clock, self._lock, self._leave, self._over = clock, lock, leave, over
        self._answer: str | None = None

    def take(self, text: str) -> None:
        """The answer is here."""
        self._answer = text

    def done(self) -> bool:
        """True when answered; the default is taken when the time is over."""
        with self._lock:
            if self._clock.now() >= self.open.until_s - 1e-9:
                self._take_default(f"nobody answered in time, so '{self.open.question.default}'")
            return self._answer is not None

    def result(self) -> str:
        """The answer. Raises RuntimeError before there is one."""
        if self._answer is None:
            raise RuntimeError(f"the question '{self.open.id}' is not answered yet")
        return self._answer

    def withdraw(self) -> None:
        """Take the question back."""
        with self._lock:
            self._take_default("taken back")

    def _take_default(self, why: str) -> None:
        if self._answer is None:
            self._answer = self.open.question.default
            self._leave(self.open.id)
            self._over(f"{self.open.id}: {why}")
