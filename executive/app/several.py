"""From what is asked of several robots to a mission for each: who is meant, and who waits for whom."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter

from executive.app.answers import answerer
from executive.app.requests import Prepared, commanded, filed, prepared_for, world_of
from executive.app.starts import PlacedRobot, knowledge_for, placed_robots
from executive.app.worlds import knowledge_of, with_map
from executive.language.parser import load_parser
from executive.language.questions import Answerer
from executive.language.robots import Addressed, Part, Whom, understand_for_robots_asking
from executive.language.understand import Status, Understanding
from executive.mission.file.resolve import for_robot
from executive.mission.file.schema import MissionFile, PartFile
from executive.mission.mission import mission_from_steps, steps_of
from executive.mission.request import Request
from executive.words.knowledge import Knowledge
from executive.words.robots import robot_called
from executive.words.steps import KeyPath, Mission
from plant.worlds.world import World
from skills.files.errors import InputError, Problems, listing, suggestion
from skills.robot import Pose2D

__all__ = ["prepare_several", "prepared_part", "understood_for_robots"]


def prepare_several(request: Request, *, ask: Answerer | None, loaded: MissionFile | None = None) -> Prepared:
    """What each robot of a request is to do. The first of them by name stands for all; `others` are the rest.

    Args:
        request: what the user asks for, and of which robots.
        ask: who is asked where a sentence could mean several things; None: nobody.
        loaded: its mission file, where it has one.

    Raises:
        InputError: the sentence is not understood, the robots do not fit into the world, or none can do it.
    """
    if request.start is not None or request.stack is not None:
        what = "--start and --stack are for a run with one robot"
        raise InputError(what, hint="write alice=spot@X,Y,YAW, or `robots` with `at` and `stack` in a mission file")
    world = world_of(request, loaded)
    world = world if request.map is None else with_map(world, request.map)
    knowledge = knowledge_of(world)
    robots = placed_robots(world, knowledge, request.robots)
    if loaded is not None and loaded.parts is not None:
        return _together(_parts(request, loaded, loaded.parts, world, robots, ask))
    if loaded is not None:
        return _filed(request, loaded, world, robots, ask)
    if request.sentence is None:
        name = robot_called(request.robot, robots) or next(iter(robots))
        return _for_robot(name, replace(commanded(request, world), robot_name=name), request, world, knowledge, robots)
    meant = understood_for_robots(request, robots, knowledge, ask)
    request = replace(request, sentence=meant.text)
    parts = [part for each in meant.parts for part in _expanded(each, request, world, knowledge, robots)]
    waits = _waits(meant.parts, robots)
    every = [
        replace(
            prepared_part(
                name, [part.meaning for part in parts if part.robot == name], request, world, knowledge, robots
            ),
            after=waits.get(name, ()),
            speaker_W=next((_speaker_W(part, robots) for part in parts if part.robot == name), None),
        )
        for name in robots
        if any(part.robot == name for part in parts)
    ]
    return _together(every)


def _together(every: Sequence[Prepared]) -> Prepared:
    """All parts of a request, of which the first stands for all."""
    first = every[0].request
    commands = tuple(command for each in every for command in each.request.commands)
    prints = "+".join(each.request.fingerprint for each in every)
    return replace(every[0], request=replace(first, commands=commands, fingerprint=prints), others=tuple(every[1:]))


def _expanded(
    part: Part, request: Request, world: World, knowledge: Knowledge, robots: Mapping[str, PlacedRobot]
) -> Iterator[Part]:
    """The part for each robot that it is for."""
    if part.robot is Whom.ALL:
        yield from (replace(part, robot=name) for name in robots)
    elif part.robot is Whom.ANY:
        yield replace(part, robot=_soonest(part.meaning, request, world, knowledge, robots))
    else:
        yield part


def _soonest(
    meant: Understanding, request: Request, world: World, knowledge: Knowledge, robots: Mapping[str, PlacedRobot]
) -> str:
    """The robot that can do it and is done first, by the estimate. Raises InputError: none can."""
    return _first_done({name: prepared_part(name, [meant], request, world, knowledge, robots) for name in robots})


def _first_done(able: Mapping[str, Prepared]) -> str:
    """The robot that can do its mission and is done first, by the estimate. Raises InputError: none can."""
    from executive.app.feasibility import check_prepared

    bids: dict[str, float] = {}
    reasons: list[str] = []
    for name, prepared in able.items():
        checked = check_prepared(prepared)
        if checked.errors:
            reasons.append(f"{name}: {checked.errors[0].message}")
        else:
            bids[name] = checked.estimate.duration_s
    if not bids:
        raise InputError(f"no robot can do it: {'; '.join(reasons)}")
    return min(bids, key=lambda name: bids[name])


def understood_for_robots(
    request: Request, robots: Collection[str], knowledge: Knowledge, ask: Answerer | None
) -> Addressed:
    """What a request's sentence asks of each robot. Raises InputError: it is not understood."""
    asked = request.require_wake
    meant = understand_for_robots_asking(
        request.sentence or "",
        answer=answerer(request.answers, request.questions, ask),
        robots=tuple(robots),
        parser=load_parser(),
        knowledge=knowledge,
        require_wake=knowledge.robot.require_wake if asked is None else asked,
    )
    if meant.status is not Status.OK:
        raise InputError(meant.reason or "the sentence was not understood")
    return meant


def _filed(
    request: Request, loaded: MissionFile, world: World, robots: Mapping[str, PlacedRobot], ask: Answerer | None
) -> Prepared:
    """A mission file, done by the robot that it names, or that can do it and is done first. Raises InputError."""
    names = tuple(robots) if loaded.robot is None else (_robot_in(loaded, ("robot",), loaded.robot, robots),)
    able = {name: _filed_for(name, request, for_robot(loaded, name), world, robots, ask) for name in names}
    return able[names[0] if len(able) == 1 else _first_done(able)]


def _parts(
    request: Request,
    loaded: MissionFile,
    parts: Mapping[str, PartFile],
    world: World,
    robots: Mapping[str, PlacedRobot],
    ask: Answerer | None,
) -> Sequence[Prepared]:
    """The parts of a mission file, in the order of the robots. Raises InputError: one is for no robot of the run."""
    written: dict[str, str] = {}
    for part in parts:
        name = _robot_in(loaded, ("parts", part), part, robots)
        if name in written:
            raise loaded.error(("parts", part), f"there are two parts for {name}", "put their steps into one")
        written[name] = part
    waits: dict[str, tuple[str, ...]] = {}
    for name, part in written.items():
        at = ("parts", part, "after")
        waits[name] = tuple(_robot_in(loaded, at, first, written) for first in parts[part].first)
        try:
            _refuse_rings(waits)
        except InputError as error:
            raise loaded.error(at, error.message, "let one of them begin") from error
    problems, made = Problems(), list[Prepared]()
    for name in (name for name in robots if name in written):
        with problems:
            own = for_robot(loaded, name, written[name])
            made.append(replace(_filed_for(name, request, own, world, robots, ask), after=waits[name]))
    problems.raise_any()
    return made


def _robot_in(loaded: MissionFile, at: KeyPath, said: str, robots: Collection[str]) -> str:
    """The robot that a file names. Raises InputError: it is none of those that it could be."""
    name = robot_called(said, robots)
    if name is None:
        what = "has no part to wait for" if at[-1] == "after" else "is no robot of this run"
        raise loaded.error(at, f"'{said[:60]}' {what}", suggestion(said, robots))
    return name


def _filed_for(
    name: str,
    request: Request,
    loaded: MissionFile,
    world: World,
    robots: Mapping[str, PlacedRobot],
    ask: Answerer | None,
) -> Prepared:
    """What a mission file asks of one of the robots, from where it stands. Raises InputError."""
    robot = robots[name]
    own = replace(world, start=robot.start, dock=robot.dock)
    known = knowledge_for(name, robot, robots, knowledge_of(own))
    return replace(filed(request, loaded, own, known, ask), kind=robot.kind, robots=robots)


def prepared_part(
    name: str,
    meanings: Sequence[Understanding],
    request: Request,
    world: World,
    knowledge: Knowledge,
    robots: Mapping[str, PlacedRobot],
) -> Prepared:
    """What one robot is to do: all that was meant for it, from where it stands. Raises InputError: it cannot be."""
    steps = tuple(step for meant in meanings for step in steps_of(meant))
    notes = tuple(note for meant in meanings for note in meant.notes)
    mission: Mission = replace(mission_from_steps(steps, world=world.name, robot_name=name), notes=notes)
    return _for_robot(name, mission, request, world, knowledge, robots)


def _for_robot(
    name: str,
    mission: Mission,
    request: Request,
    world: World,
    knowledge: Knowledge,
    robots: Mapping[str, PlacedRobot],
) -> Prepared:
    """A mission compiled for one of the robots, from where it stands. Raises InputError: it cannot be."""
    robot = robots[name]
    own_world = replace(world, start=robot.start, dock=robot.dock)
    known = knowledge_for(name, robot, robots, knowledge)
    return replace(prepared_for(request, mission, own_world, known), kind=robot.kind, robots=robots)


def _waits(parts: Sequence[Part], robots: Mapping[str, PlacedRobot]) -> Mapping[str, tuple[str, ...]]:
    """For each robot those that must be done first. Raises InputError: two wait for each other."""
    waits: dict[str, set[str]] = {}
    for part in parts:
        first = {str(parts[number].robot) for number in part.after if parts[number].robot in robots}
        if isinstance(part.robot, str):
            waits.setdefault(part.robot, set()).update(first - {part.robot})
    _refuse_rings(waits)
    return {name: tuple(sorted(first)) for name, first in waits.items() if first}


def _refuse_rings(waits: Mapping[str, Collection[str]]) -> None:
    """Raise InputError where robots would wait for each other."""
    try:
        TopologicalSorter(waits).prepare()
    except CycleError as error:
        ring = sorted(set(error.args[1]))
        what = f"{ring[0]} would wait for itself" if len(ring) == 1 else f"{listing(ring)} would wait for each other"
        raise InputError(what, hint="give the last part when the first is done") from error


def _speaker_W(part: Part, robots: Mapping[str, PlacedRobot]) -> Pose2D | None:
    """Where the robot stands by which the speaker stands, when it is another than the one that acts."""
    by = part.speaker_by
    return robots[by].start if by is not None and by in robots and by != part.robot else None
