"""Plan and node to compare the objects at a place by size or weight."""

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import ClassVar, Final

from py_trees.common import Status

from errand_home.facts import FACTS_FILE, facts_of
from errand_home.orders import ORDERS, Order, order_of
from executive.tree.board import FromBoard
from executive.tree.context import ANSWER_TOPIC
from executive.tree.node import NodeSpec
from executive.tree.nodes.command_plans import go_to_goal
from executive.tree.nodes.search import Answer, find_plan, place_phrase
from executive.tree.plan import PlanBuilder
from executive.words.command import START, Command
from executive.words.task import basic
from skills.api import Cause, Failed, ObjectKind, ObjectObservation
from skills.class_forms import ANY_OBJECT
from skills.descriptions import describe_unknown, distinct_objects, plural
from skills.inputs.errors import listing

_NUMBERS: Final = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


class Comparison(Answer):
    """Decorator that turns the objects of a search into the answer which of them come first in an `order`.

    | child | surfaces | status |
    |---|---|---|
    | ended | some not seen | FAILURE with the cause that prevented the look |
    | ended, nothing found | all seen | SUCCESS, answer False |
    | ended, an object that comes first is not recognised | all seen | FAILURE with POSTCONDITION |
    | ended, of an object to weigh the weight is not known | all seen | FAILURE with PRECONDITION |
    | ended, objects found | all seen | SUCCESS, answer True; the sentence is under the key `text` |

    `most` is the number of objects asked for, `weights` are known weights (kg) by class. For the rest see `Answer`.
    """

    kind = "comparison"
    output_types: ClassVar = {**Answer.output_types, "text": str}
    superlative: str
    most: int
    weights: Mapping[str, float] = field(default_factory=dict)
    text: str = ""

    def _counted(self, unseen: Sequence[str]) -> Status:
        if unseen:
            return self._not_looked(unseen)
        found, unknown = (
            distinct_objects(self.board.get(key, ()) for key in keys.values()) for keys in (self.tallies, self.doubts)
        )
        order, every = ORDERS[self.superlative], (*found, *unknown)
        lacking = [one.kind.name for one in every if order.weighs and one.kind.name not in self.weights]
        if lacking := [name for name in dict.fromkeys(lacking) if name != ANY_OBJECT]:
            named = listing(f"the {ObjectKind(name)}" for name in lacking)
            return self.fail(Failed(Cause.PRECONDITION, f"the weight of {named} is not known; add it to {FACTS_FILE}"))
        first = sorted(every, key=lambda one: self._key(one, order))[: self.most]
        if strange := [one for one in first if one.kind.name == ANY_OBJECT]:
            what = f"I cannot tell what is {self.affirmed}: {listing(map(describe_unknown, strange))}"
            return self.fail(Failed(Cause.POSTCONDITION, what))
        return self._say(first, order)

    def _key(self, one: ObjectObservation, order: Order) -> float:
        return order.key(one.size_m, self.weights.get(one.kind.name, float("inf") if order.descends else 0.0))

    def _say(self, first: Sequence[ObjectObservation], order: Order) -> Status:
        """Writes the sentence, and publishes it as the answer."""
        names = listing(f"the {one.kind.plain}" for one in first)
        source = ", by the weights in my notes" if order.weighs else ""
        said = f"{self.affirmed} {'is' if len(first) == 1 else 'are'} {names}{source}" if first else self.denied
        self.answer, self.cause, self.message = bool(first), None, said
        self.board.put(self.key, bool(first))
        self.board.put(self.text, said)
        note = {"node": self.path_id, "question": self.affirmed, "answer": bool(first), "message": said}
        self.publish(ANSWER_TOPIC, note)
        return Status.SUCCESS


def compare_plan(builder: PlanBuilder) -> NodeSpec:
    """Looks at all objects at the place, goes back to the speaker, and says which come first in the order."""
    command, knowledge = builder.command, builder.knowledge
    item, place = builder.required_object(command.object), builder.place(str(command.goal))
    superlative = order_of(item.attributes)
    if not superlative:
        hint = f"say {listing(ORDERS, last='or')}"
        raise builder.error(f"it is not said by what to compare the {item.name}", hint)
    kind = ObjectKind(item.name)
    asked = Command(goal=place, task=basic().look, object=kind, object_count=0)
    tidied = find_plan(replace(builder.at("look"), command=asked))
    answer, *stow = tidied.children
    most = max(1, command.object_count)
    number = "" if most == 1 else f"{_NUMBERS[most] if most < len(_NUMBERS) else most} "
    where, text = place_phrase(knowledge, place), builder.key("text")
    question = f"the {number}{superlative} {item.name if most == 1 else plural(item.name)} {where}"
    options = {"affirmed": question, "denied": f"there is no {item.name} {where}", "superlative": superlative}
    weights = facts_of(knowledge).weights if ORDERS[superlative].weighs else {}
    compared = replace(answer, kind=Comparison.kind, name=f"compare: {question}").with_options(
        **options, most=most, weights=weights, text=text
    )
    look = replace(tidied, name=f"look for {question}", children=(compared, *stow))
    back = go_to_goal(replace(builder.at("back"), command=Command(goal=START)))
    return builder.sequence(f"say what is {question}", look, back, builder.skill("speak", {"text": FromBoard(text)}))
