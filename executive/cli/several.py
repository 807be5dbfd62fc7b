"""From what is asked of several robots to a mission for each: who is meant, and who waits for whom."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from executive.cli.answers import answerer
from executive.cli.missions_command import mission_file
from executive.cli.requests import Prepared, Standing, filed, prepared_for, world_of_file
from executive.cli.starts import PlacedRobot, knowledge_for, placed_robots
from executive.cli.worlds import knowledge_of, open_world
from executive.language import Status, Understanding, load_parser
from executive.language.questions import Answerer
from executive.language.robots import Addressed, Part, Whom, understand_for_robots_asking
from executive.mission.errors import InputError
from executive.mission.file.model import DEFAULT_WORLD, Mission
from executive.mission.knowledge import Knowledge
from executive.mission.mission import mission_from_steps, steps_of
from executive.mission.request import Request
from plant.worlds.world import World
from skills.robot import Pose2D

__all__ = ["prepare_several", "prepared_part", "understood_for_robots"]


def prepare_several(request: Request, *, ask: Answerer | None) -> Prepared:
    """What each robot of a request is to do. The first of them by name stands for all; `others` are the rest.

    Raises:
        InputError: the sentence is not understood, the robots do not fit into the world, or none can do it.
    """
    if request.file is not None:
        return _filed(request, mission_file(request.file), ask)
    if request.sentence is None:
        raise InputError("robots are given a mission file or --say", hint='try: --say "Hey Bob, ..."')
    world = open_world(request.world or request.world_name or DEFAULT_WORLD)
    knowledge = knowledge_of(world)
    robots = placed_robots(world, knowledge, request.robots)
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
    return replace(every[0], others=tuple(every[1:]), robots=robots)


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
    from executive.cli.feasibility import check_prepared

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
    meant = understand_for_robots_asking(
        request.sentence or "",
        answer=answerer(request.answers, request.questions, ask),
        robots=tuple(robots),
        parser=load_parser(),
        knowledge=knowledge,
        require_wake=bool(request.require_wake),
    )
    if meant.status is not Status.OK:
        raise InputError(meant.reason or "the sentence was not understood")
    return meant


def _filed(request: Request, file: Path, ask: Answerer | None) -> Prepared:
    """A mission file, done by the robot that can do it and is done first. Raises InputError: none can."""
    asked = replace(request, file=file)
    world = world_of_file(asked, file)
    robots = placed_robots(world, knowledge_of(world), request.robots)

    def standing_of(name: str) -> Standing:
        robot = robots[name]
        return lambda _, own: (
            replace(own, start=robot.start, dock=robot.dock),
            knowledge_for(name, robot, robots, knowledge_of(own)),
        )

    able = {
        name: replace(filed(asked, file, ask, standing_of(name)), kind=robot.kind, robots=robots)
        for name, robot in robots.items()
    }
    return able[next(iter(able)) if len(able) == 1 else _first_done(able)]


def prepared_part(
    name: str,
    meanings: Sequence[Understanding],
    request: Request,
    world: World,
    knowledge: Knowledge,
    robots: Mapping[str, PlacedRobot],
) -> Prepared:
    """What one robot is to do: all that was meant for it, from where it stands. Raises InputError: it cannot be."""
    robot = robots[name]
    own_world = replace(world, start=robot.start, dock=robot.dock)
    steps = tuple(step for meant in meanings for step in steps_of(meant))
    notes = tuple(note for meant in meanings for note in meant.notes)
    mission: Mission = replace(mission_from_steps(steps, world=world.name, robot_name=name), notes=notes)
    known = knowledge_for(name, robot, robots, knowledge)
    return replace(prepared_for(request, mission, own_world, known), kind=robot.kind, robots=robots)


def _waits(parts: Sequence[Part], robots: Mapping[str, PlacedRobot]) -> Mapping[str, tuple[str, ...]]:
    """For each robot those that must be done first. Raises InputError: two wait for each other."""
    waits: dict[str, set[str]] = {}
    for part in parts:
        first = {str(parts[number].robot) for number in part.after if parts[number].robot in robots}
        if isinstance(part.robot, str):
            waits.setdefault(part.robot, set()).update(first - {part.robot})
    try:
        TopologicalSorter(waits).prepare()
    except CycleError as error:
        ring = " and ".join(sorted(set(error.args[1])))
        hint = "give the last part when the first is done"
        raise InputError(f"{ring} would wait for each other", hint=hint) from error
    return {name: tuple(sorted(first)) for name, first in waits.items() if first}


def _speaker_W(part: Part, robots: Mapping[str, PlacedRobot]) -> Pose2D | None:
    """Where the robot stands by which the speaker stands, when it is another than the one that acts."""
    by = part.speaker_by
    return robots[by].start if by is not None and by in robots and by != part.robot else None
