"""Clears a place: the robot takes away one object after another, until a look finds none."""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import field, replace
from typing import ClassVar, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import MemoryComposite, cause_of, message_of
from executive.tree.board import Board, FromBoardOr
from executive.tree.node import NodeSpec
from executive.tree.nodes.carry import put_down_plan
from executive.tree.nodes.pick_up import pick_up_plan
from executive.tree.nodes.policies import FINAL_CAUSES
from executive.tree.nodes.search import detect_plan, look_plans, place_phrase, required_surfaces
from executive.tree.plan import PlanBuilder
from executive.words.command import START, Command
from executive.words.knowledge import EVERYTHING
from skills.api import Cause, ObjectKind, ObjectObservation
from skills.class_forms import ANY_OBJECT
from skills.descriptions import count_of
from skills.inputs.errors import listing
from skills.robot import Robot

SAME_PLACE_M: Final = 0.15
"""An object within this distance of a missed object is the same object."""
Seen = tuple[ObjectObservation, ...]
MOST_OBJECTS: Final = 12
MOST_MISSES: Final = 3


class ForEachFound(MemoryComposite):
    """Composite of a look (first child, which writes the found object under `key`) and an action on each found object.

    | look | action | status |
    |---|---|---|
    | RUNNING | idle | RUNNING |
    | SUCCESS | ticked in the same tick | as below |
    | SUCCESS after `limit` objects | idle | FAILURE with POSTCONDITION |
    | FAILURE with POSTCONDITION, none missed | idle | SUCCESS: no object is left |
    | FAILURE with POSTCONDITION, some missed | idle | FAILURE with POSTCONDITION |
    | FAILURE with another cause | idle | FAILURE with its cause |
    | SUCCESS | RUNNING | RUNNING |
    | SUCCESS | SUCCESS | RUNNING: the object is `done`; the next tick looks again |
    | SUCCESS | FAILURE | RUNNING: the object is `missed`; the next tick looks again |
    | SUCCESS | FAILURE with ERROR, CANCELLED or a held object, or the `misses`th FAILURE | FAILURE with its cause |
    | halted | halted | INVALID with CANCELLED |

    A success at the position of a missed object removes it from `missed`. `done` and `missed` are blackboard keys,
    cleared at a new start if they are in `forgets`. `did` names the action ("moved", "to the bench"), `where` the
    cleared place.
    """

    kind = "for each found"
    usually_found: ClassVar[int] = 3
    """Assumed number of objects, since their true number is unknown before the run."""
    output_types: ClassVar = {"done": Seen, "missed": Seen}
    key: str
    done: str
    missed: str
    did: tuple[str, str]
    where: str
    limit: int
    misses: int
    board: Board
    robot: Robot
    forgets: tuple[str, ...] = ()
    _failures: int = field(default=0, init=False)
    _why: str = field(default="", init=False)

    @classmethod
    def usual_children(cls, node: NodeSpec) -> tuple[NodeSpec, ...]:
        """Returns the children, repeated for the usual number of objects."""
        return node.children * cls.usually_found

    def _tick(self) -> Iterator[Behaviour]:
        """Looks again in each round; the results of the round before stay visible until then."""
        if self._index == 0 and self.children[0].status != Status.RUNNING:
            self._reset_children()
        yield from super()._tick()

    def _following(self, child: Behaviour) -> int | None:
        found = child.status == Status.SUCCESS and len(self._noted(self.done)) < self.limit
        return 1 if self._index == 0 and found else None

    def _restart(self) -> None:
        super()._restart()
        self._failures, self._why = 0, "before the restart"

    def _forget(self) -> None:
        self.board.forget(self.forgets)

    def _take_over(self, child: Behaviour) -> None:
        look, action = self.children
        if child.status == Status.RUNNING:
            self._go_on(message_of(child))
        elif child is action:
            self._action_ended(action)
        elif look.status == Status.SUCCESS:
            self._end(Cause.POSTCONDITION, f"{self._report()}, and something is left {self.where}")
        elif cause_of(look) is Cause.POSTCONDITION:
            self._nothing_left()
        else:
            self._end(cause_of(look), f"{self._report()}, then {message_of(look)}")

    def _action_ended(self, action: Behaviour) -> None:
        """Records the object as done or missed, and begins the next look."""
        seen: ObjectObservation = self.board.get(self.key)
        x, y, _ = seen.position_W
        missed = self._noted(self.missed)
        elsewhere = tuple(each for each in missed if math.dist(each.position_W[:2], (x, y)) > SAME_PLACE_M)
        if action.status == Status.SUCCESS:
            self.board.put(self.missed, elsewhere)
            self.board.put(self.done, (*(each for each in self._noted(self.done) if each != seen), seen))
            self._index = 0
            self._go_on(self._report())
            return
        cause, why = cause_of(action), message_of(action)
        self._failures += 1
        self._why = f"the {seen.kind}: {why}"
        self.board.put(self.missed, (*elsewhere, seen))
        if cause in FINAL_CAUSES or self._failures >= self.misses or self.robot.gripper().holding:
            self._end(cause, f"{self._report()}, then {why}")
        else:
            self._index = 0
            self._go_on(f"looks again, since {why}")

    def _nothing_left(self) -> None:
        """Ends with SUCCESS, unless a missed object can no longer be found."""
        if missed := self._noted(self.missed):
            gone = listing(f"the {each.kind}" for each in missed)
            self._end(Cause.POSTCONDITION, f"{self._report()}, but {gone} is gone from there ({self._why})")
            return
        done = self._noted(self.done)
        self._end(None, f"{self._report()}; nothing is left {self.where}" if done else f"nothing is {self.where}")

    def _report(self) -> str:
        """Returns a report such as "moved one cube and two beers to the bench"."""
        verb, to = self.did
        kinds = Counter(str(each.kind) for each in self._noted(self.done))
        return f"{verb} {listing(count_of(count, kind) for kind, count in kinds.items())} {to}"

    def _noted(self, key: str) -> Seen:
        noted: Seen = self.board.get(key, ())
        return noted


def is_clearing(get: Command, bring: Command | None) -> bool:
    """Returns whether two adjacent commands get everything from a place and bring everything somewhere."""
    if bring is None or not get.takes or get.object is None or get.object.name != EVERYTHING:
        return False
    return (bring.task is None or bring.puts) and get.object == (bring.item if bring.task is None else bring.object)


def clear_plan(builder: PlanBuilder, bring: Command) -> NodeSpec:
    """Looks for an object and takes it away, until none is left; `builder` belongs to the command to get everything.

    Raises InputError when a place is missing, the goal is a person, or the goal is among the sources.
    """
    get, goal = builder.command, bring.goal
    assert get.object is not None
    item = ObjectKind(ANY_OBJECT, get.object.attributes)
    if get.goal is None or goal is None:
        raise builder.error("it is not said from where to where everything is to be taken", "name both places")
    if goal == START or builder.knowledge.person(goal) is not None:
        raise builder.error("everything cannot be handed over: there is one gripper", "name a place with a surface")
    place, to = builder.place(get.goal), builder.place(goal)
    surfaces = required_surfaces(builder, item, place)
    if shared := set(surfaces) & set(builder.knowledge.surfaces_in(to)):
        raise builder.error(f"everything that is on the {min(shared)} is to be brought there", "name two surfaces")
    key, missed = builder.key("detection"), builder.key("missed")
    extra = builder.optional_ports("detect", {"avoid": FromBoardOr(missed, ())})
    looks = (look for _, look in look_plans(builder.at("left"), item, surfaces, key, extra))
    look = builder.at("left").first_of(f"is anything left {place_phrase(builder.knowledge, place)}?", *looks)
    again = detect_plan(builder.at("find"), item, surfaces, key, extra)
    around = tuple(map(builder.surface, surfaces))
    carry = replace(builder.at("bring"), command=bring)
    put = carry.at("tidy").stow_after(put_down_plan(carry, item, to)[0], only_after_failure=True)
    take = pick_up_plan(builder, item, again, key, around, seen=True)
    move = builder.at("move").sequence("move it", take, put)
    return builder.node(
        "for each found",
        f"clear the {place} onto the {to}, one object at a time",
        look,
        move,
        key=key,
        done=(done := builder.key("moved")),
        missed=missed,
        did=("moved", f"to the {to}"),
        where=place_phrase(builder.knowledge, place),
        limit=MOST_OBJECTS,
        misses=MOST_MISSES,
        forgets=(done, missed),
    )


def refuse_everything(builder: PlanBuilder) -> None:
    """Raises InputError for a single command about everything."""
    command = builder.command
    if any(item is not None and item.name == EVERYTHING for item in (command.item, command.object)):
        hint = "say from where to where in one step: 'move everything from the desk to the shelf'"
        raise builder.error("everything cannot be taken in one go", hint)
