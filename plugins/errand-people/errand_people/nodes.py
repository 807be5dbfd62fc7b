"""Plans and nodes to find a person, and to go to, follow, guide and greet people.

The robot recognises no faces. Among several people, it asks each "Are you Robin?".
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import ExplainedLeaf, cause_of, message_of
from executive.tree.board import Board, Constant, FromBoard, FromBoardOr
from executive.tree.context import RunContext
from executive.tree.node import NodeSpec
from executive.tree.nodes.carry import goal_in_words, goal_pose
from executive.tree.nodes.clearing import ForEachFound
from executive.tree.nodes.pick_up import go_near_plan
from executive.tree.nodes.policies import FINAL_CAUSES
from executive.tree.nodes.recovery import OnlyIfKnown
from executive.tree.nodes.speech import AskPeople
from executive.tree.plan import PlanBuilder
from executive.words.command import SPEAKER, START
from executive.words.expression import Template, Value
from executive.words.knowledge import ANYBODY, Place
from executive.words.outlines import distance_m, inside
from skills.api import Cause, Failed, ObjectObservation
from skills.quantities import Coordinate
from skills.robot import Pose2D

MOST_PEOPLE: Final = 12
NEAR_ROOM_M: Final = 1.2
GREETS_WITHIN_M: Final = 2.35
"""Greatest distance of a greeting, where no pose nearer to the person is free."""
ANSWER_WITHIN_S: Final = 12.0
"""Time for the answer to "Are you Robin?"."""
STILL_NEAR_M: Final = 3.5
STILL_NEAR_S: Final = 120.0
"""Distance and time within which a person is still the one of an earlier meeting."""


@dataclass(frozen=True)
class PlaceOf(FromBoard):
    """Binding of a port to the position (x, y) of the person whose observation is under a blackboard key."""

    gives: ClassVar[Any] = tuple[Coordinate, Coordinate]

    def read(self, board: Board) -> tuple[float, float]:
        """Returns the position. Raises KeyError when no person was observed yet."""
        seen: ObjectObservation = board.get(self.key)
        return seen.position_W[0], seen.position_W[1]


@dataclass(frozen=True)
class PlaceIfMet(FromBoardOr):
    """Binding of a port to the position (x, y) of the person under a blackboard key; None before anybody was met."""

    gives: ClassVar[Any] = tuple[Coordinate, Coordinate] | None
    default: Any = None

    def read(self, board: Board) -> tuple[float, float] | None:
        """Returns the position, or None."""
        seen: ObjectObservation | None = board.get(self.key, self.default)
        return None if seen is None else (seen.position_W[0], seen.position_W[1])


class OnlyIfNear(OnlyIfKnown):
    """Composite that applies while the robot is near the person under `key` and saw them a short time ago, in `area_W`.

    Has the status of its only child. Without an area, any place will do.
    """

    kind = "only if near"
    context: RunContext
    area_W: tuple[tuple[float, float], ...] = ()

    def applies(self) -> bool:
        """Returns whether the robot is near where it saw the person a short time ago."""
        if not super().applies():
            return False
        met, here = self.board.get(self.key), self.context.pose()
        near = math.dist(met.position_W[:2], (here.x_m, here.y_m)) <= STILL_NEAR_M
        if self.area_W and not inside(self.area_W, met.position_W[:2]):
            return False
        return near and self.context.clock.now() - met.stamp_s <= STILL_NEAR_S


class AskWhoItIs(AskPeople):
    """Leaf that checks that the person before the robot, detected under `seen`, is `person`.

    | case | status |
    |---|---|
    | not `always`, and only one person is among `observations` | SUCCESS: taken for `person` |
    | not answered yet | RUNNING |
    | yes | SUCCESS |
    | no | FAILURE with POSTCONDITION |
    | nobody answers within `limit_s` | FAILURE with TIMEOUT |
    | halted | INVALID with CANCELLED; the question is withdrawn |

    After a success, the person's observation is written under `met`, and the robot's pose beside them under `beside`.
    """

    kind = "who is it"
    person: str
    seen: str
    observations: str
    met: str
    beside: str
    always: bool

    @classmethod
    def writes(cls, options: Mapping[str, Any]) -> Mapping[str, Any]:
        """Returns the keys of the answer, of the person and of the robot's pose, with their types."""
        return {**super().writes(options), options["met"]: ObjectObservation, options["beside"]: Pose2D}

    def initialise(self) -> None:
        """Asks the person, unless there is no doubt."""
        self._asks = self.always or len(self.context.board.get(self.observations, ())) > 1
        if self._asks:
            super().initialise()

    def update(self) -> Status:
        """Acts on the person's answer once there is one."""
        if not self._asks:
            return self._met(f"{describe_seen(self._here())}, taken for {self.person}, since nobody else is known")
        status = super().update()
        if status == Status.RUNNING:
            return status
        where = describe_seen(self._here())
        if status == Status.FAILURE:
            why = f"{where} did not say whether they are {self.person}"
            return self.fail(Failed(self.cause or Cause.TIMEOUT, why if self.cause is Cause.TIMEOUT else self.message))
        if self.context.board.get(self.key) != "yes":
            return self.fail(Failed(Cause.POSTCONDITION, f"{where} is not {self.person}"))
        return self._met(f"{where} is {self.person}")

    def report(self, answer: Value) -> None:
        """Adds no finding, because the mission's claim says who was met."""

    def _here(self) -> ObjectObservation:
        here: ObjectObservation = self.context.board.get(self.seen)
        return here

    def _met(self, message: str) -> Status:
        self.context.board.put(self.met, self._here())
        self.context.board.put(self.beside, self.context.pose())
        return self.say(message)


def describe_seen(seen: ObjectObservation) -> str:
    """Text of a person whom the robot sees: "somebody at (1.20, 3.40) in the kitchen"."""
    place = f" in the {seen.surface}" if seen.surface else ""
    return f"somebody at ({seen.position_W[0]:.2f}, {seen.position_W[1]:.2f}){place}"


class EachInTurn(ForEachFound):
    """Composite like `ForEachFound`, but for people or rooms: a look writes the next under `key`, an action goes there.

    The people or rooms that had their turn are written under `done`. Status as there, except:

    | look | action | status |
    |---|---|---|
    | FAILURE with POSTCONDITION, nobody found, or some without success | idle | FAILURE with POSTCONDITION |
    | SUCCESS | SUCCESS, with `first` | SUCCESS |
    | SUCCESS | FAILURE other than ERROR or CANCELLED | RUNNING; the next tick looks again |

    With `first` and `expected`, if a single person gave no answer, that person counts as found; the message says so.
    """

    kind = "each in turn"
    usually_found = 1
    first: bool
    met: str = ""
    beside: str = ""
    whom: str = ""
    expected: bool = False
    context: RunContext
    _whys: tuple[str, ...] = field(default=(), init=False)
    _silent: tuple[ObjectObservation, ...] = field(default=(), init=False)

    def _restart(self) -> None:
        super()._restart()
        self._whys, self._silent = (), ()

    def _action_ended(self, action: Behaviour) -> None:
        seen = self.board.get(self.key)
        self.board.put(self.done, (*(each for each in self._noted(self.done) if each != seen), seen))
        cause, why = cause_of(action), message_of(action)
        if action.status == Status.SUCCESS and self.first:
            self._end(None, why)
        elif action.status == Status.FAILURE and cause in FINAL_CAUSES:
            self._end(cause, why)
        else:
            failed = action.status == Status.FAILURE
            self._whys += (why,) * failed
            self._silent += (seen,) * (failed and cause is Cause.TIMEOUT)
            self._index = 0
            self._go_on("looks on")

    def _nothing_left(self) -> None:
        people, silent = len(self._noted(self.done)), self._silent
        if not people:
            self._end(Cause.POSTCONDITION, message_of(self.children[0]))
        elif self.first and self.expected and people == len(silent) == 1:
            self.board.put(self.met, silent[0])
            self.board.put(self.beside, self.context.pose())
            self._end(None, f"{describe_seen(silent[0])}, taken for {self.whom}, which nobody confirmed")
        elif self._whys:
            more = f"; and {len(self._whys) - 4} more" if len(self._whys) > 4 else ""
            self._end(Cause.POSTCONDITION, "; ".join(self._whys[:4]) + more)
        else:
            self._end(None, self._report())

    def _report(self) -> str:
        people = len(self._noted(self.done))
        return f"{self.did[0]} {people} {'person' if people == 1 else 'people'} {self.where}"


class NearRoom(ExplainedLeaf):
    """Leaf that checks that the robot is in a room, or at most `NEAR_ROOM_M` from it, with a view of its people.

    SUCCESS if the robot is there, else FAILURE with EXECUTION.
    """

    kind = "near room"
    area: Constant | FromBoard
    context: RunContext

    def update(self) -> Status:
        """Compares the robot's pose with the outline."""
        area, pose = self.area.read(self.context.board), self.context.pose()
        here = (pose.x_m, pose.y_m)
        if inside(area, here) or distance_m(area, here) <= NEAR_ROOM_M:
            return self.say("looks from here")
        return self.fail(Failed(Cause.EXECUTION, "the robot is not near the room"))


class NextRoom(ExplainedLeaf):
    """Leaf that chooses the nearest of `places` that is not in `over`, and writes its name, pose and outline.

    SUCCESS while such a place is left, else FAILURE with POSTCONDITION.
    """

    kind = "next room"
    output_types: ClassVar = {"room": str, "pose": Pose2D, "area": tuple[tuple[Coordinate, Coordinate], ...]}
    places: Mapping[str, Place]
    room: str
    pose: str
    area: str
    over: str
    context: RunContext

    def update(self) -> Status:
        """Chooses the next room."""
        board, here = self.context.board, self.context.pose()
        over = board.get(self.over, ())
        left = {name: place.pose.pose_2d() for name, place in self.places.items() if name not in over}
        if not left:
            return self.fail(Failed(Cause.POSTCONDITION, "there is no other room"))
        room = min(left, key=lambda name: math.hypot(left[name].x_m - here.x_m, left[name].y_m - here.y_m))
        board.put(self.room, room)
        board.put(self.pose, left[room])
        board.put(self.area, self.places[room].polygon)
        return self.say(f"the next room is the {room}")


def person_text(person: str) -> str:
    """Name of a person in a sentence."""
    return {SPEAKER: "the person who asked", ANYBODY: "somebody"}.get(person, person)


def person_of(builder: PlanBuilder) -> str:
    """Returns the person whom a command names: a known person, `ANYBODY` or `SPEAKER`. Raises InputError otherwise."""
    whom = builder.command.object
    name = "" if whom is None else whom.name
    person = SPEAKER if name == SPEAKER else builder.knowledge.somebody(name)
    if person is None:
        raise builder.error("the command names no known person", "name one of the people of the knowledge file")
    return person


def meet_plan(builder: PlanBuilder, person: str, place: str | None = None) -> NodeSpec:
    """Finds a person and goes to them: near the robot if it has just met them, else by a search.

    At a `place` that is given, the person is met there or not at all; else the search begins in the person's usual
    room, and then come all other rooms, nearest first.
    """
    knowledge, met = builder.knowledge, builder.met_key(person)
    usual = knowledge.room(builder.place(knowledge.people[person].at))
    said = usual if place is None else knowledge.room(place)
    others = tuple(dict.fromkeys(room for room in (usual, *knowledge.rooms) if room != said))
    here, area_W = builder.at("here"), () if place is None else knowledge.rooms[said]
    beside = _go_beside(here, person, met)
    near = here.node("only if near", f"{person} is near", beside, key=met, area_W=area_W)
    ports = {"area_W": knowledge.rooms[said], "place": said}
    there = _in_room(builder.at(said), said, meet := _meet_one_plan(builder.at(said), person, ports))
    missed = f"{person} is not"
    if place is not None:
        further = [builder.node("last seen", f"where was {person}?", part="last", person=person, key=met)]
    else:
        further = [_elsewhere_plan(builder.at("elsewhere"), person, others)] if others else []
    return builder.first_of(
        f"find {person}",
        near,
        there,
        *further,
        exhausted_cause=Cause.POSTCONDITION,
        exhausted_message=f"{missed} found" if place is None else f"{missed} in the {said}",
        looks={} if place is None else {f"in the {said}": (meet.children[0].path_id,)},
        missed=missed,
        sought=person,
    )


def _elsewhere_plan(builder: PlanBuilder, person: str, rooms: tuple[str, ...]) -> NodeSpec:
    """Searches room after room until the person is met."""
    room, pose, area, over = (builder.key(name) for name in ("room", "pose", "area", "rooms"))
    places = MappingProxyType({each: builder.knowledge.places[each] for each in rooms})
    following = builder.node(
        "next room", "the next room", part="next", places=places, room=room, pose=pose, area=area, over=over
    )
    ports: dict[str, object] = {"place": FromBoard(room), "area_W": FromBoard(area)}
    drive = _to_room(builder, FromBoard(pose), FromBoard(area), "the next room")
    visit = builder.sequence(
        "look there", drive, _meet_one_plan(builder.at("there"), person, ports, expected=False), part="visit"
    )
    title = f"look for {person} in all other rooms"
    return _each_in_turn(builder, title, following, visit, room, over, limit=len(rooms) + 1, first=True)


def _meet_one_plan(
    builder: PlanBuilder, person: str, ports: Mapping[str, object], *, expected: bool = True
) -> NodeSpec:
    """Goes to one person after another, until one of them is the requested person."""
    seen, observations, met = builder.key("seen"), builder.key("all"), builder.met_key(person)
    who = builder.node(
        "who is it",
        f"is it {person}?",
        part="who",
        text=Template(f"Are you {person}?"),
        keys=MappingProxyType({}),
        options=("yes", "no"),
        names=MappingProxyType({"yes": "yes", "no": "no"}),
        gives=str,
        limit_s=ANSWER_WITHIN_S,
        default=None,
        key=builder.key("answer"),
        person=person,
        seen=seen,
        observations=observations,
        met=met,
        beside=builder.met_key(person, "-beside"),
        always=len(builder.knowledge.people) > 1 or not expected,
    )
    visit = builder.sequence(f"meet {person}", _go_beside(builder, person, seen, ports["place"]), who, part="visit")
    own = {"whom": person, "expected": expected, "first": True, "met": met, "beside": who.options["beside"]}
    return _each_person(builder, f"is {person} here?", person, ports, visit, **own)


def _in_room(builder: PlanBuilder, room: str, then: NodeSpec) -> NodeSpec:
    """Goes to a room, and then runs another node there."""
    pose, area = builder.knowledge.place_pose(room).pose_2d(), Constant(builder.knowledge.rooms[room])
    to = _to_room(builder, pose, area, f"the {room}")
    return builder.sequence(f"in the {room}", to, then)


def _to_room(builder: PlanBuilder, pose: Pose2D | FromBoard, area: Constant | FromBoard, to: str) -> NodeSpec:
    """Goes to a pose in a room, or near it; if a person stands in the door, as near as possible."""
    once = builder.at("once").skill("navigate", {"goal": pose})
    near = builder.node("near room", f"is {to} near?", part="near", area=area)
    return builder.first_of(f"go to {to}", once, near, go_near_plan(builder, pose, to), part="to-room")


def _each_person(
    builder: PlanBuilder, title: str, person: str, ports: Mapping[str, object], visit: NodeSpec, **options: Any
) -> NodeSpec:
    """Builds rounds of a search for one more person and a visit."""
    seen, over = builder.key("seen"), builder.key("over")
    own = {"avoid": FromBoardOr(over, ()), "unpictured": True, "moves": True}
    own = builder.optional_ports("find_people", own)
    outputs = {"observation": seen, "observations": builder.key("all")}
    look = builder.skill("find_people", {**own, **ports, "person": person, "count": 1}, outputs)
    return _each_in_turn(builder.at("each"), title, look, visit, seen, over, limit=MOST_PEOPLE, **options)


def _each_in_turn(
    builder: PlanBuilder, title: str, look: NodeSpec, visit: NodeSpec, key: str, over: str, **options: Any
) -> NodeSpec:
    own = {"key": key, "done": over, "missed": over, "forgets": (over,), "misses": MOST_PEOPLE}
    return builder.node(
        "each in turn", title, look, visit, **{**own, "did": ("greeted", ""), "where": "here", **options}
    )


def _go_beside(builder: PlanBuilder, person: str, key: str, place: object = "", **options: object) -> NodeSpec:
    """Goes beside the person detected under a key, in a room called `place`; updates the person's position."""
    ports = {"person": person, "place_W": PlaceOf(key), "place": place, **options}
    return builder.skill("meet_person", ports, {"person": key})


def follow_plan(builder: PlanBuilder) -> NodeSpec:
    """Finds a person and follows them; the speaker, or anybody, is the person in front of the robot."""
    person, goal = person_of(builder), builder.command.goal
    ports: dict[str, object] = {"person": ANYBODY if person == SPEAKER else person}
    if goal is not None:
        room = builder.knowledge.room(builder.place(goal))
        ports |= {"until": room, "until_W": builder.knowledge.rooms[room]}
    to = "" if goal is None else f" to the {goal}"
    return _with_person(builder, person, f"follow {person_text(person)}{to}", "follow_person", ports)


def guide_plan(builder: PlanBuilder) -> NodeSpec:
    """Finds a person and guides them to a place."""
    person, goal = person_of(builder), builder.command.goal
    if goal is None:
        raise builder.error(f"it is not said where to guide {person_text(person)}", "name a place")
    to, area_W = goal_in_words(builder, goal), _guided_area(builder, goal)
    ports = {"person": ANYBODY if person == SPEAKER else person, "goal": goal_pose(builder, goal), "place": to}
    return _with_person(
        builder, person, f"guide {person_text(person)} to {to}", "guide_person", ports | {"area_W": area_W}
    )


def _guided_area(builder: PlanBuilder, goal: str) -> tuple[tuple[float, float], ...]:
    """Outline of the room that a person is guided to: that of the place, of the start, or of another person's place."""
    knowledge, person = builder.knowledge, builder.knowledge.person(goal)
    if goal == START:
        at = (knowledge.start.x, knowledge.start.y)
        return next((outline for outline in knowledge.rooms.values() if inside(outline, at)), ())
    place = builder.place(goal if person is None else knowledge.people[person].at)
    return knowledge.rooms[knowledge.room(place)]


def _with_person(builder: PlanBuilder, person: str, title: str, skill: str, ports: dict[str, object]) -> NodeSpec:
    if person == ANYBODY:  # whom an earlier step has found, or who is in front of the robot
        return builder.sequence(title, builder.skill(skill, {**ports, "place_W": PlaceIfMet(builder.met_key(ANYBODY))}))
    if person == SPEAKER:
        return builder.sequence(title, builder.skill(skill, ports))
    work = builder.skill(skill, {**ports, "place_W": PlaceOf(builder.met_key(person))})
    return builder.sequence(title, meet_plan(builder.at("meet"), person), work)


def greet_plan(builder: PlanBuilder) -> NodeSpec:
    """Greets a person, or once each person in a room. Raises InputError when the command names no room."""
    person, goal = person_of(builder), builder.command.goal
    place = None if goal is None else builder.place(goal)
    if person == SPEAKER:
        return builder.sequence("greet the person who asked", builder.skill("speak", {"text": "Hello!"}))
    if person != ANYBODY:
        greet = builder.skill("speak", {"text": f"Hello {person}!"})
        return builder.sequence(f"greet {person}", meet_plan(builder.at("meet"), person, place), greet)
    if place is None:
        raise builder.error("it is not said where the people are", "name the room")
    room, greet = builder.knowledge.room(place), builder.skill("speak", {"text": "Hello!"})
    within = builder.optional_ports("meet_person", {"within_m": GREETS_WITHIN_M})
    beside = _go_beside(builder, ANYBODY, builder.key("seen"), room, **within)
    visit = builder.sequence("greet somebody", beside, greet, part="visit")
    ports = {"area_W": builder.knowledge.rooms[room], "place": room}
    options = {"first": False, "where": f"in the {room}"}
    each = _each_person(builder, "greet each person here", ANYBODY, ports, visit, **options)
    return _in_room(builder, room, each)
