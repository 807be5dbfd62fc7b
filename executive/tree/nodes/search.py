"""Searches for objects and people from viewpoints in order, and answers whether they are there."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import field
from types import MappingProxyType
from typing import Any, ClassVar, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import Explained, ExplainedDecorator, cause_of, message_of
from executive.tree.board import Board, FromBoard, SurfaceOfDetection
from executive.tree.context import ANSWER_TOPIC
from executive.tree.goals import surfaces_left_out, surfaces_to_search
from executive.tree.node import NodeSpec
from executive.tree.nodes.aside import floor_square
from executive.tree.nodes.pick_up import go_into_plan, go_near_plan
from executive.tree.plan import PlanBuilder
from executive.words.knowledge import ANYBODY, ANYTHING, Knowledge
from executive.words.outlines import inside
from executive.words.task import Part
from skills.api import Cause, Failed, ObjectKind, Publish, Surface
from skills.descriptions import SAME_WITHIN_M, count_of, count_sentence, describe_unknown, distinct_objects, plural
from skills.geometry import compose
from skills.inputs.errors import definite, listing, with_article
from skills.robot import Pose2D

Ports = Mapping[str, object]

NO_PORTS: Final[Ports] = MappingProxyType({})
MOST_ELSEWHERE: Final = 3
HALF_M: Final = 1.2
"""Half the side of the square of floor on which a fallen object is searched."""
BACK_M: Final = 0.5
"""Distance to back off, to bring an object before the feet to about the distance of a grasp."""
MOST_ASIDE: Final = 2
ASIDE_M: Final = 0.45
_TALLY: Final = "observations"
"""Output port of a look for all objects that it found."""
_UNEXPLAINED: Final = "unexplained"
"""Output port of a look for objects that it does not recognise and that may be what is sought."""


class Answer(ExplainedDecorator):
    """Decorator that turns the result of a search into the answer yes or no, or a number.

    | child | surfaces | status |
    |---|---|---|
    | RUNNING | any | RUNNING |
    | SUCCESS | any | SUCCESS, answer True |
    | FAILURE | all seen | SUCCESS, answer False |
    | FAILURE | some not seen | FAILURE with the cause that prevented the look |
    | with `tallies`: ended, `needed` objects counted | any | SUCCESS, answer True |
    | with `tallies`: ended, fewer counted | all seen | SUCCESS, answer False |
    | with `tallies`: ended, fewer counted | some not seen | FAILURE with the cause that prevented the look |
    | with `numeric`: like `tallies` | any | the number instead of True or False, "at least" if some is not seen |
    | halted | any | INVALID with CANCELLED |

    `looks` has the leaves for each surface, one for each viewpoint; a surface is seen when each leaf succeeded or
    failed with POSTCONDITION. The answer is published under `ANSWER_TOPIC`; with `tells` it includes the found object,
    and it names objects that no look recognised, which the leaves write under the keys `doubts`.
    The node's name is the question. `affirmed` is the text for yes, `denied` the text for no; without `yes_or_no` the
    text stands alone, because "is it empty" and "is there anything on it" are one question. A `negated` question asks
    whether nothing is found, and has yes and no the other way round. The leaves write all found objects under the
    blackboard keys `tallies`, also when they fail. Each object counts once; the number is written under `count_key`, if
    given. The answer is `numeric` where that is asked for; `related` says which objects are counted.
    """

    kind = "answer"
    answers = True
    output_types: ClassVar = {"count_key": float}
    affirmed: str
    denied: str
    looks: Mapping[str, Sequence[str]]
    key: str
    board: Board
    publish: Publish
    tells: bool = False
    tallies: Mapping[str, str] = field(default_factory=dict)
    doubts: Mapping[str, str] = field(default_factory=dict)
    needed: int = 1
    yes_or_no: bool = True
    count_key: str = ""
    numeric: bool = False
    related: str = ""
    negated: bool = False
    answer: int | None = field(default=None, init=False)

    @classmethod
    def writes(cls, options: Mapping[str, Any]) -> Mapping[str, Any]:
        """Returns the types of the answer, which may be a number, and of the count."""
        return {options["key"]: float if options.get("numeric") else bool, **super().writes(options)}

    def answered(self) -> int | None:
        """Returns the answer."""
        return self.answer

    def restore(self, status: Status, cause: Cause | None, message: str) -> None:
        """Restores the answer as well."""
        super().restore(status, cause, message)
        self.answer = self.board.get(self.key) if status == Status.SUCCESS else None

    def initialise(self) -> None:
        """Clears the answer of an earlier run, and what its looks found."""
        self.answer = None
        self.board.forget(self.tallies.values())

    def update(self) -> Status:
        """Answers once the search has ended."""
        status = self.pass_on()
        if status == Status.RUNNING:
            return status
        unseen = [surface for surface, leaves in self.looks.items() if len(looked(self, leaves)) < len(leaves)]
        if self.tallies:
            return self._counted(unseen)
        if status == Status.FAILURE and unseen:
            return self._not_looked(unseen)
        answer = status == Status.SUCCESS
        return self._answered(answer, self.message if answer and self.tells else "")

    def _counted(self, unseen: Sequence[str]) -> Status:
        done = {one.path_id for one in self.iterate() if isinstance(one, Explained) and one.status == Status.SUCCESS}
        found = distinct_objects(self.board.get(key, ()) for key in self.tallies.values())
        unknown = distinct_objects(self.board.get(key) for leaf, key in self.doubts.items() if leaf in done)
        unknown = tuple(u for u in unknown if all(math.dist(u.position_W, f.position_W) > SAME_WITHIN_M for f in found))
        enough, is_least = len(found) >= self.needed, bool(unseen or unknown)
        if self.count_key:
            self.board.put(self.count_key, float(len(found)))
        if not enough and is_least:
            unsure = (f"{one.surface}" for one in unknown if one.surface not in unseen)
            return self._not_looked((*unseen, *dict.fromkeys(unsure)))
        limits = f"; not all was seen in {listing(map(definite, unseen))}" if unseen else ""
        limits += f"; besides, {listing(map(describe_unknown, unknown))}" if unknown else ""
        told = f"{count_sentence(found, (), at_least=is_least)}{self.related}{limits}" if found else ""
        return self._answered(len(found) if self.numeric else enough, told, is_least and self.numeric)

    def _not_looked(self, unseen: Sequence[str]) -> Status:
        branches = tuple(f"{leaf.rpartition('/')[0]}/" for name in unseen for leaf in self.looks.get(name, ()))
        below = (one for one in self.iterate() if isinstance(one, Explained) and one.path_id.startswith(branches))
        first = next((one for one in below if one.cause not in (None, Cause.POSTCONDITION)), self)
        why = self.message if message_of(first) in self.message else f"{message_of(first)}, and {self.message}"
        cause = Cause.EXECUTION if first is self else cause_of(first)
        return self.fail(Failed(cause, f"no answer for {listing(map(definite, unseen))}: {why}"))

    def _answered(self, answer: int, found: str, is_least: bool = False) -> Status:
        text = self.affirmed if answer else self.denied
        answer = answer if self.numeric else bool(answer) != self.negated
        self.answer, self.cause = answer, None
        if self.yes_or_no:
            text = f"{'yes' if answer else 'no'}: {text}"
        self.message = found if found and self.numeric else "; ".join(filter(None, (text, found)))
        self.board.put(self.key, float(answer) if self.numeric else answer)
        note = {"question": self.name.removesuffix("?"), "answer": answer, "message": self.message}
        self.publish(ANSWER_TOPIC, {"node": self.path_id, **note, **({"at_least": True} if is_least else {})})
        return Status.SUCCESS


def looked(root: Behaviour, leaves: Collection[str]) -> list[str]:
    """Returns those of the leaves below a node that took a look, even if it found nothing."""
    ended = (node for node in root.iterate() if isinstance(node, Explained) and node.path_id in leaves)
    return [node.path_id for node in ended if node.status == Status.SUCCESS or node.cause == Cause.POSTCONDITION]


def surfaces_elsewhere(
    knowledge: Knowledge, item: ObjectKind, place: str | None, avoided: frozenset[str] = frozenset()
) -> tuple[str, ...]:
    """Returns the surfaces to search when the object is not in its place, at most `MOST_ELSEWHERE`, none in `avoided`.

    Its usual surfaces come first, then others in the same room, then the nearest others.
    """
    if place is None:
        return ()
    usual = (name for spot in knowledge.usual_surfaces(item.name) for name in knowledge.surfaces_in(spot))
    near = knowledge.surfaces_in(knowledge.room(place))
    inside = knowledge.surfaces_in(place)
    here = knowledge.place_pose(place)
    poses = {name: knowledge.place_pose(name) for name in knowledge.tops}
    far = sorted(poses, key=lambda name: math.hypot(here.x - poses[name].x, here.y - poses[name].y))
    left_out = {*inside, *avoided, *surfaces_left_out(knowledge, item)}
    others = dict.fromkeys(name for name in (*usual, *near, *far) if name not in left_out)
    return tuple(others)[:MOST_ELSEWHERE]


def look_plans(
    builder: PlanBuilder,
    item: ObjectKind,
    surfaces: tuple[str, ...],
    key: str,
    extra: Ports = NO_PORTS,
    *,
    tallied: bool = False,
) -> tuple[tuple[str, NodeSpec], ...]:
    """Builds a drive and a look for each surface and viewpoint; returns them with the names of the surfaces.

    The detected object goes to `key`; `extra` are further ports of `detect`. With `tallied`, all objects of a look go
    to a key of its own.
    """
    plans = []
    for name in surfaces:
        for number, view in enumerate(builder.knowledge.surfaces[name].viewpoints, start=1):
            title = f"look at the {name} ({number})".removesuffix(" (1)")
            below = builder.at(f"{name}-{number}")
            look = detect_plan(below, item, (name,), key, extra, tallied=tallied)
            plans.append((name, below.look_from(title, view.pose_2d(), f"the {name}", look)))
    return tuple(plans)


def people_looks(
    builder: PlanBuilder, person: str, place: str | None, key: str, *, tallied: bool
) -> tuple[tuple[str, NodeSpec], ...]:
    """Builds a drive and a look around for each room of the search for a person; see `look_plans`.

    Where somebody blocks the drive into a room, the robot looks from where it stands, and says what it has not seen.
    Raises InputError for a surface as the place, and for a named person among several, who all look alike to the robot.
    """
    knowledge = builder.knowledge
    if place in knowledge.surfaces:
        raise builder.error(f"people are looked for in rooms, and '{place}' is none", "name the room")
    if person in knowledge.people and len(knowledge.people) > 1:
        hint = "ask whether anybody is there"
        raise builder.error(f"the robot knows nobody by face, and {person} may be any of several people", hint)
    plans, moves = [], builder.optional_ports("find_people", {"moves": True})
    for room in knowledge.rooms_to_search(person, place):
        below = builder.at(room)
        area_W, count = knowledge.rooms[room], 0 if tallied else 1
        ports = {"area_W": area_W, "place": room, "person": person, "count": count, **moves}
        tally = {_TALLY: below.key("all")} if tallied else {}
        look = below.skill("find_people", ports, {"observation": key, **tally})
        go = go_into_plan(below, room)
        go = below.or_stay(f"go into the {room}, if possible", go, "it looks from here", part="go") if moves else go
        plans.append((room, below.sequence(f"look about the {room}", go, look)))
    return tuple(plans)


def detect_plan(
    builder: PlanBuilder,
    item: ObjectKind,
    surfaces: tuple[str | Surface, ...] | FromBoard,
    key: str,
    extra: Ports = NO_PORTS,
    *,
    tallied: bool = False,
) -> NodeSpec:
    """Looks for the object from the robot's present pose, on surfaces given by name or on the blackboard."""
    where_to_look: tuple[Surface, ...] | FromBoard
    if isinstance(surfaces, FromBoard):
        where_to_look = surfaces
    else:
        where_to_look = tuple(each if isinstance(each, Surface) else builder.surface(each) for each in surfaces)
    relations, classes = builder.relations(item.relations), builder.search_classes(item.name)
    ports = {"classes": classes, "attributes": item.attributes, "surfaces": where_to_look, **relations, **extra}
    tally = {_TALLY: builder.key("all")} if tallied else {}
    if tallied and _UNEXPLAINED in builder.registry["detect"].outputs:
        tally[_UNEXPLAINED] = builder.key("unexplained")
    return builder.skill("detect", ports, {"observation": key, **tally})


def find_again_plan(builder: PlanBuilder, item: ObjectKind, surfaces: tuple[str, ...], key: str) -> NodeSpec:
    """Looks from the present pose at the place where the object was detected before, and at the floor beside it."""
    seen_on = SurfaceOfDetection(key, tuple(map(builder.surface, surfaces)))
    floor = builder.optional_ports("detect", {"floor": True})
    look = detect_plan(builder, item, seen_on, key, floor)
    return builder.node("only if known", "look from here, if seen before", look, key=key)


def search_plan(
    builder: PlanBuilder, item: ObjectKind, place: str | None, key: str, *, anywhere: bool = True
) -> NodeSpec:
    """Looks for the object where it was detected before, then at each surface; the first detection ends the search.

    If the object is not in its place, the robot looks at up to `MOST_ASIDE` surfaces from the side, then, with
    `anywhere`, at surfaces elsewhere. Where another robot last detected the object, the floor nearby is searched too,
    because the object may have fallen out of that robot's gripper. Raises InputError when the place has no surfaces.
    """
    surfaces = surfaces_first_known(builder, item, place)
    elsewhere = (
        surfaces_elsewhere(builder.knowledge, item, place, builder.avoided) if anywhere and builder.anywhere else ()
    )
    known = builder.last_known_of(item)
    first = tuple(each for each in surfaces if known is not None and each == known.surface)
    likely = builder.optional_ports("detect", {"likely": True})
    floor = builder.optional_ports("detect", {"floor": True}) | likely
    rest = surfaces[len(first) :]
    looks = (*look_plans(builder, item, first, key, floor), *look_plans(builder, item, rest, key, likely))
    further = look_plans(builder.at("elsewhere"), item, elsewhere, key, likely)
    aside = tuple(_looks_from_aside(builder, item, surfaces, key))
    meant = bool(builder.relations(item.relations))
    missed, where = f"{'did not find the one' if meant else 'found no'} {item}", place_phrase(builder.knowledge, place)
    where += f", nor on the {listing(elsewhere)}" if elsewhere and not meant else ""
    needed = (
        find_again_plan(builder.at("again"), item, (*surfaces, *elsewhere), key),
        *_looks_at_last_known(builder.at("last-known"), item, key),
        *(look for _, look in looks),
    )
    return builder.first_of(
        f"find the {item}",
        *needed,
        *(look for _, look in aside),
        *(look for _, look in further),
        exhausted_cause=Cause.PRECONDITION,
        exhausted_message=f"{missed} {where}",
        looks={f"on the {name}": leaves for name, leaves in _leaves((*looks, *aside, *further)).items()},
        missed=missed,
        sought=f"the {item}",
        one_goal=meant,
        needed=len(needed),
    )


def _leaves(looks: Sequence[tuple[str, NodeSpec]]) -> dict[str, tuple[str, ...]]:
    return {place: tuple(look.children[-1].path_id for name, look in looks if name == place) for place, _ in looks}


def last_known_floor(builder: PlanBuilder, item: ObjectKind) -> Surface | None:
    """Returns the floor around where another robot last knew the object to be; None for an object on a surface."""
    known = builder.last_known_of(item)
    if known is None or known.surface in builder.knowledge.surfaces:
        return None
    x, y, _ = known.position_W
    return floor_square(Pose2D(x, y, 0.0), 0.0, HALF_M)


def _looks_at_last_known(builder: PlanBuilder, item: ObjectKind, key: str) -> Iterator[NodeSpec]:
    """Yields looks at the floor where another robot last knew the object to be."""
    known, floor = builder.last_known_of(item), last_known_floor(builder, item)
    if known is None or floor is None or known.robot_W is None:
        return
    here = f"where {known}"
    drive = go_near_plan(builder, compose(known.robot_W, Pose2D(-BACK_M, 0.0, 0.0)), f"the place {here}")
    yield builder.sequence(f"look {here}", drive, detect_plan(builder, item, (floor,), key))


def _looks_from_aside(
    builder: PlanBuilder, item: ObjectKind, surfaces: tuple[str, ...], key: str
) -> Iterator[tuple[str, NodeSpec]]:
    """Yields additional looks from the side, at surfaces that have only one viewpoint."""
    facts = builder.knowledge.surfaces
    single = [name for name in surfaces if len(facts[name].viewpoints) == 1]
    for name in single[:MOST_ASIDE]:
        room = builder.knowledge.rooms[facts[name].place]
        view = facts[name].viewpoints[0].pose_2d()
        poses = (compose(view, Pose2D(0.0, left_m, 0.0)) for left_m in (ASIDE_M, -ASIDE_M))
        aside = next((pose for pose in poses if inside(room, (pose.x_m, pose.y_m))), None)
        if aside is not None:
            below = builder.at(f"{name}-aside")
            look = detect_plan(below, item, (name,), key)
            yield name, below.look_from(f"look at the {name} from aside", aside, f"the side of the {name}", look)


def surfaces_first_known(builder: PlanBuilder, item: ObjectKind, place: str | None) -> tuple[str, ...]:
    """Returns the required surfaces, and before them the surface where another robot last detected the object."""
    known, surfaces = builder.last_known_of(item), required_surfaces(builder, item, place)
    allowed = {*builder.knowledge.surfaces} - surfaces_left_out(builder.knowledge, item)
    first = [known.surface] if known is not None and known.surface in allowed else []
    return tuple(dict.fromkeys((*filter(None, first), *surfaces)))


def required_surfaces(builder: PlanBuilder, item: ObjectKind, place: str | None) -> tuple[str, ...]:
    """Returns the surfaces to search. Raises InputError when the place has no surfaces."""
    surfaces = surfaces_to_search(builder.knowledge, item, place)
    if place in builder.knowledge.bins:
        raise builder.error(f"the robot neither looks into the {place} nor takes things out", "name a surface or room")
    if not surfaces and surfaces_left_out(builder.knowledge, item):
        raise builder.error(f"no place is left to look for {item}", "name a place where it may be")
    if not surfaces:
        raise builder.error(f"'{place}' has no surface to look at", "add one under 'surfaces' in the knowledge file")
    return surfaces


def place_phrase(knowledge: Knowledge, place: str | None) -> str:
    """Text of a place at the end of a sentence: "in the kitchen", "on the desk"."""
    return "anywhere" if place is None else f"{'on' if place in knowledge.tops else 'in'} the {place}"


def find_plan(builder: PlanBuilder, answer_key: str | None = None, *, negated: bool = False) -> NodeSpec:
    """Looks at the place's surfaces and answers yes or no, with the place or the number if the question asks for it.

    The answer is written under `answer_key` (None: a key of this subtree); with `negated`, yes stands for none. The
    first found object ends the search, unless objects are counted: then all surfaces are searched. People are searched
    in rooms.
    """
    command, knowledge = builder.command, builder.knowledge
    place = None if command.goal is None else builder.place(command.goal)
    counting, key, related = command.object_count != 1, builder.key("detection"), ""
    person = None if command.object is None else knowledge.somebody(command.object.name)
    if person is not None:
        what = "somebody" if person == ANYBODY else person
        asked = absent = what if command.object_count == 1 else _asked_for(person, command.object_count)
        looks = people_looks(builder.at("search"), person, place, key, tallied=counting)
    else:
        item = builder.required_object(command.object)
        related = "".join(f" {relation}" for relation in item.relations)
        what, asked = str(item), _asked_for(str(item.plain), command.object_count) + related
        absent = str(item) if command.object_count == 1 else asked
        floor, count = place is None or place in knowledge.rooms, 0 if counting or item.relations else 1
        extra = {"floor": floor, "count": count}
        surfaces = required_surfaces(builder, item, place)
        looks = look_plans(builder.at("search"), item, surfaces, key, extra, tallied=counting)
    below = builder.at("search")
    title = f"look for {what if what == ANYTHING else asked}"
    search = below.node("round" if counting else "selector", title, *(look for _, look in looks))
    outputs = {leaf.path_id: leaf.options["outputs"] for _, look in looks for leaf in look.children[1:] if counting}
    tallies, doubts = ({p: o[port] for p, o in outputs.items() if port in o} for port in (_TALLY, _UNEXPLAINED))
    spot, counts = place_phrase(knowledge, place), answer_key is None and command.object_count == 0
    denial = "{} is not" if person in knowledge.people else "not {}" if command.object_count > 1 else "no {}"
    denied = f"{denial.format(absent)} {spot}"
    if what == ANYTHING:
        asked, denied = "something", f"nothing {spot}"
    elif person == ANYBODY and not counting:
        denied = f"nobody {spot}"
    named = "is" if person in knowledge.people else "are there" if counting and what != ANYTHING else "is there"
    sought = denied.replace(" is not ", " not ") if negated else f"{asked} {spot}"
    answer = builder.node(
        "answer",
        f"how many {asked} are {spot}?" if counts and what != ANYTHING else f"{named} {sought}?",
        search,
        affirmed=asked if place is None else f"{asked} {spot}",
        denied=denied,
        looks=MappingProxyType(_leaves(looks)),
        key=answer_key or builder.key("answer"),
        tells=place is None,
        tallies=MappingProxyType(tallies),
        doubts=MappingProxyType(doubts),
        needed=max(1, command.object_count),
        yes_or_no=what != ANYTHING and not counts,
        numeric=counts,
        related=related,
        negated=negated,
    )
    return builder.at("tidy").stow_after(answer)


def _asked_for(item: str, count: int) -> str:
    """Text for the object that a question is about: "a beer", "two beers", or "beers" for any number."""
    return with_article(item) if count == 1 else count_of(count, item) if count else plural(item)


def refuse_several(builder: PlanBuilder) -> None:
    """Raises InputError for several or an open number of objects, unless the command asks, waits or takes several."""
    command, task = builder.command, builder.command.task
    asked = 1 if task is not None and (task.several or task.object_is is Part.TIME) else command.object_count
    for item, count in ((command.item, command.item_count), (command.object, asked)):
        if count != 1:
            said = f"{count} of '{item}'" if count else f"an open number of '{item}'"
            hint = "say from where to where, and how many, or ask for one at a time"
            raise builder.error(f"{said} cannot be carried in one go", hint)
