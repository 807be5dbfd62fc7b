"""From what the user asks for to what can be run: the one place where a sentence or a mission file is understood."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from executive.app.answers import answerer, ask_at_terminal
from executive.app.mission_files import mission_file
from executive.app.starts import DEFAULT_KIND, PlacedRobot
from executive.app.worlds import knowledge_of, open_world, refuse_blocked, with_map
from executive.language.parser import load_parser
from executive.language.questions import Answerer
from executive.mission.file.objects import import_folders
from executive.mission.file.overrides import overridden
from executive.mission.file.people import routes_in
from executive.mission.file.resolve import load_mission, mission_from_file
from executive.mission.file.schema import MissionFile
from executive.mission.mission import lines_of, mission_from_lines, mission_from_meaning, understood
from executive.mission.request import Request
from executive.tree.compiler import CompiledTree, compile_mission
from executive.tree.registry import installed_skills
from executive.words.knowledge import Knowledge, Pose
from executive.words.robots import RobotSetup, display_name, robots_in
from executive.words.steps import DEFAULT_WORLD, Mission
from plant.worlds.world import ObjectRule, RouteRule, World, WorldError
from skills.files.errors import InputError, Problems
from skills.files.yaml_source import read_yaml
from skills.robot import Pose2D

if TYPE_CHECKING:
    from executive.language.understand import Understanding

__all__ = [
    "Prepared",
    "commanded",
    "filed",
    "fingerprint",
    "prepare",
    "prepare_alone",
    "prepared_for",
    "replacing",
    "world_of",
]


@dataclass(frozen=True)
class Prepared:
    """A request that was understood: its mission, compiled, the world that it runs in, and what is known of that.

    `meant` is what its sentence means, where it has one. `kind` is that of its robot.

    In a run with several robots, `robots` has all of them, `others` what the rest of them do meanwhile; this mission
    begins when those of the robots `after` are done, and whoever asked for it stands at `speaker_W` (None: by this
    robot).
    """

    request: Request
    mission: Mission
    world: World
    knowledge: Knowledge
    tree: CompiledTree
    meant: Understanding | None = None
    kind: str = DEFAULT_KIND
    robots: Mapping[str, PlacedRobot] = field(default_factory=dict)
    others: tuple[Prepared, ...] = ()
    after: tuple[str, ...] = ()
    speaker_W: Pose2D | None = None

    @property
    def all(self) -> tuple[Prepared, ...]:
        """This, and what the other robots do."""
        return (replace(self, others=()), *self.others)

    @property
    def stack_file(self) -> Path | None:
        """The stack file of its robot; None for that of its kind."""
        own = (setup for name, setup in self.request.robots.items() if display_name(name) == self.mission.robot_name)
        return next((setup.stack for setup in own), self.request.stack)


def prepare(
    request: Request,
    *,
    ask: Answerer | None = ask_at_terminal,
) -> Prepared:
    """Understand a request, and compile it.

    Args:
        request: what the user asks for.
        ask: who is asked where somebody sits at a terminal and the request's policy allows it; None: nobody.

    Raises:
        InputError: with file and line where it has a file: it or the world or its knowledge is broken, a sentence is
            not understood, or the mission cannot be carried out.
    """
    if not request.only_commands and (request.file is None) == (request.sentence is None):
        raise InputError("a mission file or --say is needed, and not both", hint='try: --say "Hey Alice, ..."')
    if request.given and request.file is None:
        raise InputError("--set gives values to a mission file, and there is none", hint="name the file as well")
    request, loaded, world, knowledge = _opened(request)
    robots = request.robots or _named_robots(loaded, world, knowledge)
    if not robots:
        return _alone(request, loaded, world, knowledge, ask)
    from executive.app.several import prepare_several

    return prepare_several(replace(request, robots=robots), ask=ask, loaded=loaded)


def prepare_alone(request: Request) -> Prepared:
    """A request understood for one robot, whichever robots it names; nobody is asked. Raises InputError."""
    request, loaded, world, knowledge = _opened(replace(request, robots={}))
    return _alone(request, loaded, world, knowledge, None)


def _opened(request: Request) -> tuple[Request, MissionFile | None, World, Knowledge]:
    """A request with its file read where it has one, its world, and what is known of that. Raises InputError."""
    loaded = None
    if request.file is not None:
        file = mission_file(request.file)
        request, loaded = replace(request, file=file), load_mission(file, request.given)
    world = world_of(request, loaded)
    return request, loaded, world, knowledge_of(world)


def world_of(request: Request, loaded: MissionFile | None) -> World:
    """The world of a request, which stands in for that of its mission file. Raises InputError."""
    if request.world is None and loaded is not None:
        return _own_world(loaded)
    return open_world(request.world or request.world_name or DEFAULT_WORLD)


def _named_robots(loaded: MissionFile | None, world: World, knowledge: Knowledge) -> Mapping[str, RobotSetup]:
    """The robots that a mission file names, else its world; none where it is for the world's one robot."""
    named = knowledge.robots if loaded is None or loaded.robots is None else loaded.robots
    if named is None:
        return {}
    from plant.kinds import robot_kinds

    own = read_yaml(world.knowledge_path) if loaded is None or loaded.robots is None else loaded.source
    return robots_in(named, robot_kinds(), own)


def _alone(
    request: Request, loaded: MissionFile | None, world: World, knowledge: Knowledge, ask: Answerer | None
) -> Prepared:
    """What the one robot of a run is to do. Raises InputError."""
    if loaded is not None:
        return filed(request, loaded, *_standing(request, world, knowledge), ask)
    world, knowledge = _standing(request, world, knowledge)
    if request.sentence is None:
        return prepared_for(request, commanded(request, world), world, knowledge)
    robot = knowledge.robot
    wake = robot.require_wake if request.require_wake is None else request.require_wake
    meant = understood(
        request.sentence,
        parser=load_parser(),
        knowledge=knowledge,
        require_wake=wake,
        answer=answerer(request.answers, request.questions, ask),
    )
    mission = mission_from_meaning(meant, world=world.name, robot_name=robot.name)
    return prepared_for(replace(request, sentence=meant.text, require_wake=wake), mission, world, knowledge, meant)


def filed(request: Request, loaded: MissionFile, world: World, knowledge: Knowledge, ask: Answerer | None) -> Prepared:
    """What a mission file asks of the robot that stands in a world and knows `knowledge` of it. Raises InputError."""
    knowledge = overridden(loaded, knowledge)
    answer = answerer(request.answers, request.questions or loaded.questions, ask)
    mission = mission_from_file(loaded, parser=load_parser(), knowledge=knowledge, answer=answer)
    world = _with_people(loaded, _with_objects(loaded, world, knowledge), knowledge)
    text = None if request.file is None else request.file.read_text(encoding="utf-8")
    return prepared_for(replace(request, text=text), mission, world, knowledge)


def _with_people(loaded: MissionFile, world: World, knowledge: Knowledge) -> World:
    """The world with the people who walk in a mission's file. Raises InputError."""
    routes = {name: RouteRule.model_validate(values) for name, values in routes_in(loaded, knowledge).items()}
    try:
        return world.with_routes(routes) if routes else world
    except WorldError as error:
        raise loaded.error(("people",), str(error), "change the route or its name here") from error


def _with_objects(loaded: MissionFile, world: World, knowledge: Knowledge) -> World:
    """The world with the models and objects of a mission's file. Raises InputError."""
    problems = Problems()
    for index, folder in enumerate(import_folders(loaded)):
        try:
            world = world.with_imports([folder])
        except InputError as error:
            problems.add(loaded.error(("imports", index), str(error), ""))
    problems.raise_any()
    for name, file in (loaded.objects or {}).items():
        surfaces = tuple(knowledge.place(surface) or surface for surface in file.surfaces)
        try:
            world = world.with_objects([ObjectRule(name=name, model=file.model, surfaces=surfaces)])
        except WorldError as error:
            problems.add(loaded.error(("objects", name), str(error), ""))
    problems.raise_any()
    return world


def _standing(request: Request, world: World, knowledge: Knowledge) -> tuple[World, Knowledge]:
    """The world and what is known of it, with the robot where the request has it. Raises InputError: it is not free."""
    if request.map is not None:
        world = with_map(world, request.map)
    start = None if request.start is None else request.start.pose
    if start is None:
        return world, knowledge
    refuse_blocked(world, start)
    told = Pose(x=start.x_m, y=start.y_m, yaw=start.yaw_rad)
    return replace(world, start=start), knowledge.model_copy(update={"start": told})


def _own_world(loaded: MissionFile) -> World:
    try:
        return open_world(loaded.world)
    except InputError as error:
        raise loaded.error(("world",), error.message, error.hint) from error


def commanded(request: Request, world: World) -> Mission:
    """The mission of commands in their text form, or of steps in their written form."""
    try:
        mission = mission_from_lines(request.commands, world=world.name, robot_name=request.robot)
    except ValueError as error:
        raise InputError(f"the mission '{request.name}' cannot be read: {error}", hint="give it again") from error
    return replace(mission, name=request.name)


def prepared_for(
    request: Request, mission: Mission, world: World, knowledge: Knowledge, meant: Understanding | None = None
) -> Prepared:
    """The request with its mission compiled for a world. Raises InputError: it cannot be."""
    if request.scenario or request.scenario_files:
        from executive.app.scenarios import with_happenings, with_scenario

        request = with_scenario(request, world, knowledge)
        world = with_happenings(world, request.scenario)
    if request.variation.people:
        world = _with_passers_by(world, request)
    tree = compile_mission(mission, knowledge=knowledge, registry=installed_skills())
    compiled = _of_tree(replace(request, world_name=world.name, robot=mission.robot_name), tree)
    return Prepared(compiled, mission, world, knowledge, tree, meant)


def _with_passers_by(world: World, request: Request) -> World:
    """The world with the people of the request's variation. Raises InputError: the world has no place for them."""
    from plant.worlds.clutter import with_passers_by

    try:
        return with_passers_by(world, request.variation.people, request.seed)
    except WorldError as error:
        raise InputError(str(error), hint="take --people out") from error


def replacing(request: Request, tree: CompiledTree) -> Request:
    """The request of a mission that takes another's place by a correction, of which the commands are known."""
    return _of_tree(replace(request, sentence=None, file=None, text=None), tree)


def _of_tree(request: Request, tree: CompiledTree) -> Request:
    commands = lines_of(tree.steps)
    return replace(request, name=tree.mission_name, commands=commands, fingerprint=fingerprint(tree))


def fingerprint(tree: CompiledTree) -> str:
    """Equal for trees of the same nodes."""
    nodes = "\n".join(f"{node.kind} {node.path_id}" for node in tree.root.walk())
    return hashlib.sha256(nodes.encode()).hexdigest()[:16]
