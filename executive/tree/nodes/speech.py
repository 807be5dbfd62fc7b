"""Says a text, or asks a question whose answer the mission uses: the plans and the node."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from types import MappingProxyType
from typing import Any, Final

from py_trees.common import Status

from executive.tree.assembly import Assembler, StepPlans
from executive.tree.behaviour import ExplainedLeaf
from executive.tree.board import FromBoard
from executive.tree.context import ANSWER_TOPIC, RunContext
from executive.tree.node import NodeSpec
from executive.tree.nodes.decision_nodes import Keys, Values, View
from executive.tree.nodes.values import set_plan
from executive.tree.plan import Assembled, PlanBuilder, StepPart
from executive.words import steps as model
from executive.words.expression import LARGEST, ExpressionError, Kind, Template, Value, kind_of
from executive.words.leaf_steps import Speak
from executive.words.slug import slug
from skills.api import Asked, Cause, Failed, Question
from skills.inputs.errors import InputError, suggestion

SPEECH_TOPIC: Final = "speech"
_FILLERS: Final = re.compile(r"^(the|an?|in|to|at|some|please|i want|i would like|it is)\s+|\s+(please|thank(s| you))$")


class AskPeople(ExplainedLeaf):
    """Leaf that asks a question aloud and on the page, in a silent zone only on the page; writes the answer to `key`.

    | case | status |
    |---|---|
    | not answered yet | RUNNING |
    | an answer that is not understood | RUNNING; the question is asked again, without more time |
    | an answer that is understood | SUCCESS |
    | no answer that is understood within `limit_s` | SUCCESS with `default`; FAILURE with TIMEOUT without one |
    | the text reads a missing value | FAILURE with PRECONDITION |
    | halted | INVALID with CANCELLED; the question is withdrawn |

    The answer is one of `names` (which maps spoken forms in lower case), or, by the type `gives`, a number or any text.
    The node publishes the answer under `ANSWER_TOPIC`.
    """

    kind = "question"
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

    @classmethod
    def writes(cls, options: Mapping[str, Any]) -> Mapping[str, Any]:
        """Returns the key of the answer, and its type."""
        return {options["key"]: options["gives"]}

    def initialise(self) -> None:
        """Asks the question."""
        self._false_start, self._heard = None, ""
        self._until_s = self.context.clock.now() + self.limit_s
        try:
            self._text = self.text.fill(Values(self._view, self.keys))
        except ExpressionError as error:
            self._false_start = Failed(Cause.PRECONDITION, f"{self.text.text}: {error.message}")
            return
        self._put(self._text)

    def update(self) -> Status:
        """Acts on the answer once there is one."""
        if self._false_start is not None or self._asked is None:
            return self.fail(self._false_start or Failed(Cause.ERROR, "the question was not put"))
        if not self._asked.done():
            return Status.RUNNING
        said, self._asked = self._asked.result(), None
        if not said and self.default is None:
            heard = f"; '{self._heard}' was not understood" if self._heard else ""
            return self.fail(Failed(Cause.TIMEOUT, f"nobody answered '{self._text}' within {self.limit_s:g} s{heard}"))
        answer = self._meant(said)
        if answer is not None:
            self.context.board.put(self.key, answer)
            self.cause, self.message = None, f"{self._text}{'' if self._text.endswith('?') else ':'} {answer}"
            self.report(answer)
            return Status.SUCCESS
        self._heard = said[:60]
        self._put(f"I did not understand '{self._heard}'. {self._text}")
        return Status.RUNNING

    def report(self, answer: Value) -> None:
        """Publishes the answer as a finding of the mission."""
        note = {"node": self.path_id, "question": self._text, "answer": answer, "message": self.message}
        self.context.publish(ANSWER_TOPIC, note)

    def terminate(self, new_status: Status) -> None:
        """Withdraws an open question when the node is stopped from outside."""
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
        if silent := self.context.silent_zone():
            message["silent"] = silent
        self.context.publish(SPEECH_TOPIC, message)
        self.message = f"asks: {text}"

    def _meant(self, said: str) -> Value | None:
        """Returns the value of an answer; None if it is not understood."""
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


def _number(said: str) -> float | None:
    """Parses a number within the range that expressions allow; None for any other text."""
    try:
        number = float(said)
    except ValueError:
        return None
    return number if abs(number) <= LARGEST else None


def _as_text(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _speak_plan(assembler: Assembler, block: Speak, builder: PlanBuilder) -> Assembled:
    assembler.check_template(block.text, builder)
    if not block.text.names:
        return Assembled((builder.skill("speak", {"text": block.text.fill({})}),))
    key = builder.key("text")
    fill = set_plan(assembler.flow, builder, {key: block.text}, {key: str}, "fill", "put the values in")
    return Assembled((builder.sequence("speak", fill, builder.skill("speak", {"text": FromBoard(key)})),))


def _ask_plan(assembler: Assembler, block: model.Ask, builder: PlanBuilder) -> Assembled:
    assembler.check_template(block.text, builder)
    kind = float if block.match == "number" else str
    key = assembler.give(block.answer_name, builder.key("answer"), kind, builder)
    choices = block.choices or {}
    names = {choice.lower(): choice for choice in choices} or _spoken(block.match, builder)
    default = _default(block, names, builder)
    leaf = builder.node(
        "question",
        f"ask: {block.text.text}",
        part="question",
        text=block.text,
        keys=MappingProxyType(dict(assembler.flow.keys_of(block.text))),
        options=tuple(choices),
        names=MappingProxyType(names),
        gives=kind,
        limit_s=block.limit_s,
        default=default,
        key=key,
    )
    if not any(choices.values()):
        return Assembled((leaf,))
    flow, afters, branches = assembler.flow, [], dict[Value, NodeSpec]()
    parts: tuple[StepPart, ...] = ()
    for choice, steps in choices.items():
        branch, after = assembler.branch(steps, builder.at(f"answer-{slug(choice)}"), f"if {choice}", flow)
        afters.append(after)
        parts += branch.parts
        if branch.nodes:
            branches[choice] = branch.node
    flow.join(afters)
    return Assembled((builder.chosen("by the answer", leaf, branches, key),), parts)


def _spoken(match: str | None, builder: PlanBuilder) -> dict[str, str]:
    """Returns the names of the world by their spoken forms in lower case."""
    knowledge = builder.knowledge
    groups: Mapping[str, tuple[Sequence[str], Callable[[str], str | None]]] = {
        "place": (knowledge.place_names(), knowledge.place),
        "person": (tuple(knowledge.people), knowledge.person),
        "object": (knowledge.object_names(), knowledge.object_name),
    }
    if match is None or match not in groups:
        return {}
    known, meaning = groups[match]
    spoken = {word.lower(): meaning(word) for word in knowledge.spellings(known)}
    return {word: name for word, name in spoken.items() if name is not None}


def _default(block: model.Ask, names: Mapping[str, str], builder: PlanBuilder) -> Value | None:
    """Converts the default to the type of the answer. Raises InputError when it is no answer."""
    default = block.default
    if default is None or block.choices:
        return default
    if block.match == "number":
        if kind_of(default) is not Kind.NUMBER:
            raise InputError.at(builder.source, f"the default {default!r} is no number", hint="give a number")
        return float(default)
    if names and str(default).lower() not in names:
        known = sorted(set(names.values()))
        raise InputError.at(builder.source, f"the default '{default}' is unknown", hint=suggestion(str(default), known))
    return names.get(str(default).lower(), str(default))


PLANS: Final[StepPlans] = {Speak: _speak_plan, model.Ask: _ask_plan}
