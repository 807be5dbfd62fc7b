"""A question to the people around, or to the operator, whose answer the mission goes by."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from py_trees.common import Status

from executive.tree.behaviours.answer import ANSWER_TOPIC
from executive.tree.behaviours.context import RunContext
from executive.tree.behaviours.decisions import Keys, View
from executive.tree.behaviours.explained import ExplainedLeaf
from executive.tree.node import NodeKind
from executive.words.expression import LARGEST, ExpressionError, Template, Value
from skills.api import Asked, Cause, Failed, Question

SPEECH_TOPIC: Final = "speech"
_FILLERS: Final = re.compile(
    r"^(the|a|an|in|to|at|some|please|i want|i would like|it is)\s+|\s+(please|thanks|thank you)$"
)


@dataclass(kw_only=True, eq=False, repr=False)
class AskPeople(ExplainedLeaf):
    """Puts a question, aloud and on the page, and leaves the answer under `key`.

    RUNNING until it is answered; an answer that means nothing is asked for again. SUCCESS with the answer, which is one
    of `names` (what may be said, in lower case, and what it means), or a number or any text where it `gives` that.
    Nobody answers within `limit_s`: SUCCESS with `default`, FAILURE with TIMEOUT where there is none. A text without a
    value: FAILURE with PRECONDITION. The answer is published under `ANSWER_TOPIC`.
    """

    text: Template
    keys: Keys
    options: tuple[str, ...]
    names: Mapping[str, str]
    gives: type
    limit_s: float
    default: Value | None
    key: str
    context: RunContext
    _asked: Asked | None = field(default=None, init=False)
    _false_start: Failed | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._view = View(self.context)

    def initialise(self) -> None:
        """Put the question."""
        self.clear_explanation()
        self._false_start = None
        self._until_s = self.context.clock.now() + self.limit_s
        try:
            self._text = self.text.filled(self._view.values(self.keys))
        except ExpressionError as error:
            self._false_start = Failed(Cause.PRECONDITION, f"{self.text.text}: {error.message}")
            return
        self._put(self._text)

    def update(self) -> Status:
        """Act on the answer once it is there."""
        if self._false_start is not None or self._asked is None:
            failure = self._false_start or Failed(Cause.ERROR, "the question was not put")
            return self._failed(failure)
        if not self._asked.done():
            return Status.RUNNING
        said, self._asked = self._asked.result(), None
        if not said and self.default is None:
            return self._failed(Failed(Cause.TIMEOUT, f"nobody answered '{self._text}' within {self.limit_s:g} s"))
        answer = self._meant(said)
        if answer is not None:
            return self._answered(answer)
        self._put(f"I did not understand '{said[:60]}'. {self._text}")
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        """Take an open question back when it is stopped from outside."""
        if new_status != Status.INVALID:
            return
        if self._asked is not None:
            self._asked.withdraw()
            self._asked = None
            self.explain_cancelled()
        else:
            self.clear_explanation()

    def _put(self, text: str) -> None:
        now_s = self.context.clock.now()
        left_s = max(0.0, self._until_s - now_s)
        default = "" if self.default is None else _as_text(self.default)
        self._asked = self.context.ask(Question(self.path_id, text, self.options, default, left_s))
        message = {"t": round(now_s, 6), "robot": self.context.robot.name, "text": text, "asked": True}
        self.context.publish(SPEECH_TOPIC, message)
        self.message = f"asks: {text}"

    def _meant(self, said: str) -> Value | None:
        """What an answer means; None when it means nothing."""
        if self.default is not None and said == _as_text(self.default):
            return self.default
        plain = said.strip().lower()
        if plain in self.names:
            return self.names[plain]
        plain = " ".join(plain.replace(",", " ").split()).strip(".!? ")
        while (shorter := _FILLERS.sub("", plain)) != plain:
            plain = shorter
        if self.gives is float:
            return _number(plain)
        if not self.names:
            return said.strip() or None
        return self.names.get(plain)

    def _answered(self, answer: Value) -> Status:
        self.context.board.put(self.key, answer)
        self.cause, self.message = None, f"{self._text}: {answer}"
        note = {"node": self.path_id, "question": self._text, "answer": answer, "message": self.message}
        self.context.publish(ANSWER_TOPIC, note)
        return Status.SUCCESS

    def _failed(self, failure: Failed) -> Status:
        self.cause, self.message = failure.cause, failure.message
        return Status.FAILURE


def _number(said: str) -> float | None:
    """A number that expressions can hold."""
    try:
        number = float(said)
    except ValueError:
        return None
    return number if abs(number) <= LARGEST else None


def _as_text(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _writes(options: Mapping[str, Any]) -> Mapping[str, Any]:
    return {options["key"]: options["gives"]}


KINDS: Final[Mapping[str, NodeKind]] = {"question": NodeKind(AskPeople, ("context",), writes=_writes)}
