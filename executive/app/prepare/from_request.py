"""Prepares requests: understands a sentence or a mission file, and compiles it for each robot."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import TYPE_CHECKING

from executive.app.prepare.feasibility import refuse_impossible
from executive.app.prepare.mission_files import mission_file
from executive.app.prepare.placed_robots import (
    clearance_m,
    knowledge_for,
    only_robot,
    placed_robots,
    refuse_blocked,
    reported_classes,
)
from executive.app.prepare.prepared import Prepared, combine
from executive.app.prepare.worlds import knowledge_of, open_world, refuse_blocked_poses, with_map
from executive.language.parser import load_parser
from executive.language.questions import Answerer, ClarifyingQuestion, make_answerer
from executive.mission.load import (
    import_folders,
    knowledge_of_mission,
    load_mission,
    mission_of_robot,
    routes_of_people,
)
from executive.mission.request import Request
from executive.mission.resolve import mission_from_file
from executive.tree.compiler import compile_mission
from executive.tree.registry import installed_skills
from executive.words.knowledge import Knowledge, Pose, with_own_objects
from executive.words.mission import DEFAULT_WORLD, Mission, MissionPart, QuestionPolicy
from executive.words.robot_config import RobotConfig, find_robot, robots_of_file
from executive.words.steps import steps_from_lines
from plant.robots.robot_kind import PlacedRobot
from plant.worlds.world import ObjectRule, World, WorldError
from skills.inputs.errors import InputError, Problems, listing, suggestion
from skills.inputs.outside import LONGEST_ANSWER, plain_text
from skills.inputs.yaml_source import KeyPath, read_yaml
from skills.robot import Pose2D

if TYPE_CHECKING:
    from executive.language.understand import Part, Understanding


def prepare(request: Request, *, ask: Answerer | None = None) -> Prepared:
    """Understands and compiles a request.

    For several robots it returns the mission of the first, with the missions of the others in `others`.

    Args:
        request: the request.
        ask: answers questions about an ambiguous sentence, if the request's policy allows it; None: nobody.

    Raises:
        InputError: the mission file, the world or its knowledge is broken, a sentence is not understood, the robots do
            not fit into the world, or the mission cannot be compiled. Names file and line.
    """
    if not request.only_commands and (request.file is None) == (request.sentence is None):
        raise InputError("a mission file or --say is needed, and not both", hint='try: --say "Hey Alice, ..."')
    if request.given and request.file is None:
        raise InputError("--set gives values to a mission file, and there is none", hint="name the file as well")
    request, loaded, world, knowledge = _open(request)
    configs = request.robots or _named_robots(loaded, world, knowledge)
    if not configs:
        return _for_only_robot(_at_start(request, world, knowledge, ask), loaded)
    if request.start is not None or request.stack is not None:
        what = "--start and --stack are for a run with one robot"
        raise InputError(what, hint="write alice=KIND@X,Y,YAW, or `robots` with `at` and `stack` in a mission file")
    robots = placed_robots(world, knowledge, configs)
    setting = Setting(replace(request, robots=configs), world, knowledge, robots, ask)
    if loaded is None:
        return _for_called_robots(setting)
    return _in_parts(setting, loaded, loaded.parts) if loaded.parts is not None else _for_one_robot(setting, loaded)


def prepare_checked(request: Request, *, ask: Answerer | None = None, anyway: bool = False) -> Prepared:
    """Prepares a request; unless `anyway`, raises InputError with all errors of `errand check`."""
    prepared = prepare(request, ask=ask)
    if not anyway:
        refuse_impossible(prepared)
    return prepared


def prepare_alone(request: Request) -> Prepared:
    """Understands and compiles a request for one robot, even if it names several. Raises InputError like `prepare`."""
    request, loaded, world, knowledge = _open(replace(request, robots=()))
    return _for_only_robot(_at_start(request, world, knowledge, None), loaded)


@dataclass(frozen=True)
class Setting:
    """Request with its world, knowledge and robots; `robots` is empty if only the world's own robot runs.

    `ask` answers questions about an ambiguous sentence; None: nobody answers.
    """

    request: Request
    world: World
    knowledge: Knowledge
    robots: Mapping[str, PlacedRobot]
    ask: Answerer | None = None

    def for_robot(self, name: str) -> Setting:
        """Returns the setting as one robot has it: the robot's own start, dock and knowledge."""
        robot = self.robots[name]
        world = replace(self.world, start=robot.start, dock=robot.dock)
        return replace(self, world=world, knowledge=knowledge_for(robot, self.robots, self.knowledge))

    @property
    def require_wake(self) -> bool:
        """True if a sentence must call the robot by name; the world decides if the request leaves it open."""
        asked = self.request.require_wake
        return self.knowledge.robot.require_wake if asked is None else asked

    def understand(self) -> Understanding:
        """Understands the request's sentence for one robot or several. Raises InputError if it is not understood."""
        from executive.language.several_robots import understand_for_robots  # a mission file does not need it
        from executive.language.understand import Status, ask_until_clear, understand

        meaning: Callable[..., Understanding] = understand
        if self.robots:
            meaning = partial(understand_for_robots, robots=tuple(self.robots))
        known = {"parser": load_parser(), "knowledge": self.knowledge, "require_wake": self.require_wake}
        answer = self.answerer(self.request.questions)
        meant = ask_until_clear(self.request.sentence or "", partial(meaning, **known), answer)
        if meant.status is not Status.OK:
            raise InputError(meant.reason or "the sentence was not understood")
        return meant

    def answerer(self, policy: QuestionPolicy | None) -> Answerer:
        """Returns an answerer that gives the request's own answers in order, and then follows the policy.

        Raises InputError if an answer of the request is too long or no plain text.
        """
        left = iter([plain_text(text, what="--answer", longest=LONGEST_ANSWER) for text in self.request.answers])
        further = make_answerer(policy or QuestionPolicy.ASK, self.ask)

        def answer(question: ClarifyingQuestion) -> str | None:
            return next(left, None) or further(question)

        return answer

    def part(self, name: str, meanings: Sequence[Understanding]) -> Prepared:
        """Compiles one robot's mission from all meanings that address it. Raises InputError for an impossible step."""
        steps = tuple(step for meant in meanings for step in meant.all_steps)
        notes = tuple(note for meant in meanings for note in meant.notes)
        mission = Mission.from_steps(steps, world=self.world.name, robot=name)
        return self.for_robot(name).compile(mission.with_notes(notes))

    def mission_of_commands(self) -> Mission:
        """Builds a mission from the request's commands in their text form, or from steps in YAML. Raises InputError."""
        request = self.request
        try:
            steps = steps_from_lines(request.commands)
        except ValueError as error:
            raise InputError(f"the mission '{request.name}' cannot be read: {error}", hint="give it again") from error
        mission = Mission.from_steps(steps, world=self.world.name, robot=request.robot)
        return mission.model_copy(update={"name": request.name})

    def for_file(self, loaded: Mission) -> Prepared:
        """Compiles a mission file for the setting's world and robot. Raises InputError with file and line."""
        world = _with_imports(loaded, self.world)
        knowledge = knowledge_of_mission(loaded, with_own_objects(self.knowledge, world.own_objects))
        if knowledge.poses != self.knowledge.poses or "places" in (loaded.knowledge or {}):
            clear = partial(clearance_m, world, {each.kind for each in self.robots.values()})
            refuse_blocked_poses(knowledge, lambda path, *why: loaded.error(("knowledge", *path), *why), clear)
        answer = self.answerer(self.request.questions or loaded.questions)
        mission = mission_from_file(loaded, parser=load_parser(), knowledge=knowledge, answer=answer)
        world = _with_people(loaded, _with_objects(loaded, world, knowledge), knowledge)
        file, text = self.request.file, self.request.text
        text = file.read_text(encoding="utf-8") if text is None and file is not None else text
        own = replace(self, request=replace(self.request, text=text), world=world, knowledge=knowledge)
        return own.compile(mission)

    def compile(self, mission: Mission, meant: Understanding | None = None) -> Prepared:
        """Compiles a mission for this world, with the request's scenario and variation. Raises InputError."""
        request, world = self.request, self.world
        if request.scenario or request.scenario_files:
            from executive.app.prepare.scenarios import with_events, with_scenario

            request = with_scenario(request, world, self.knowledge, {mission.robot_name, *self.robots})
            world = with_events(world, request.scenario, request.seed)
        if request.variation.people:
            from plant.worlds.seeding import add_passers_by

            try:
                world = add_passers_by(world, request.variation.people, request.seed)
            except WorldError as error:
                raise InputError(str(error), hint="take --people out") from error
        request = replace(request, world_name=world.name, robot=mission.robot_name)
        name, robots = mission.robot_name, self.robots
        if not robots:
            robots = {name: only_robot(name, world, start=request.start, stack=request.stack, seed=request.seed)}
        reported = reported_classes(robots[name])
        tree = compile_mission(mission, knowledge=self.knowledge, registry=installed_skills(), reported=reported)
        if masks := [Path(zone.mask.file) for zone in tree.zones if zone.mask is not None]:
            _read_again(masks)
        return Prepared(request, mission, world, self.knowledge, tree, robots, meant).with_tree(tree)


def _open(request: Request) -> tuple[Request, Mission | None, World, Knowledge]:
    """Reads the world of a request, the world's knowledge, and the mission file, if any. Raises InputError."""
    loaded = None
    if request.file is not None:
        file = mission_file(request.file)
        request, loaded = replace(request, file=file), load_mission(file, request.given, request.text)
    if request.world is not None or loaded is None:
        world = open_world(request.world or request.world_name or DEFAULT_WORLD)
    else:
        try:
            world = open_world(loaded.world)
        except InputError as error:
            raise loaded.within(("world",), error) from error
    knowledge = knowledge_of(world)
    return request, loaded, world if request.map is None else with_map(world, request.map), knowledge


def _read_again(masks: Sequence[Path]) -> None:
    """Reads filter masks from their files again. Raises InputError if a mask cannot be read."""
    from skills.grid_map import load_filter_mask  # most worlds have no masks, and need no pictures
    from skills.zone_map import zone_map

    load_filter_mask.cache_clear()
    zone_map.cache_clear()
    for file in masks:
        load_filter_mask(file)


def _named_robots(loaded: Mission | None, world: World, knowledge: Knowledge) -> tuple[RobotConfig, ...]:
    """Returns the robots that the mission file names, else the world's robots; empty for the world's only robot."""
    named = knowledge.robots if loaded is None or loaded.robots is None else loaded.robots
    if named is None:
        return ()
    from plant.robots.robot_kind import robot_kinds

    own = read_yaml(world.knowledge_path) if loaded is None or loaded.robots is None else loaded.document
    return robots_of_file(named, robot_kinds(), own)


def _at_start(request: Request, world: World, knowledge: Knowledge, ask: Answerer | None) -> Setting:
    """Builds the setting for the only robot at the request's start. Raises InputError if the start is blocked."""
    start = request.start
    if isinstance(start, Pose2D):
        refuse_blocked(world, start)
        world = replace(world, start=start)
        known = Pose(x=start.x_m, y=start.y_m, yaw=start.yaw_rad)
        knowledge = knowledge.model_copy(update={"start": known})
    return Setting(request, world, knowledge, {}, ask)


def _for_only_robot(setting: Setting, loaded: Mission | None) -> Prepared:
    """Prepares the mission of the world's only robot. Raises InputError if it is not understood or not compiled."""
    request, robot = setting.request, setting.knowledge.robot
    if loaded is not None:
        return setting.for_file(loaded)
    if request.sentence is None:
        return setting.compile(setting.mission_of_commands())
    meant = setting.understand()
    mission = Mission.from_steps(meant.all_steps, world=setting.world.name, robot=robot.name).with_notes(meant.notes)
    asked = replace(request, sentence=meant.text, require_wake=setting.require_wake)
    return replace(setting, request=asked).compile(mission, meant)


def _for_called_robots(setting: Setting) -> Prepared:
    """Prepares the missions of the robots that the sentence or its commands address. Raises InputError."""
    request, robots = setting.request, setting.robots
    if request.sentence is None:
        name = find_robot(request.robot, robots) or next(iter(robots))
        return setting.for_robot(name).compile(setting.mission_of_commands().model_copy(update={"robot": name}))
    meant = setting.understand()
    setting = replace(setting, request=replace(request, sentence=meant.text))
    parts = [part for each in meant.parts for part in _part_for_each(each, setting)]
    waits = _waits(meant.parts, robots)
    every = list[Prepared]()
    for name in robots:
        own = [part for part in parts if part.robot == name]
        if own:
            by = own[0].speaker_by
            speaker_W = robots[by].start if by is not None and by in robots and by != name else None
            prepared = setting.part(name, [part.meaning for part in own])
            every.append(replace(prepared, after=waits.get(name, ()), speaker_W=speaker_W))
    return combine(every)


def _part_for_each(part: Part, setting: Setting) -> Iterator[Part]:
    """Yields each part for the robots that it addresses. Raises InputError if none can do a part for any robot."""
    from executive.language.addressees import RobotChoice

    if part.robot is RobotChoice.ALL:
        yield from (replace(part, robot=name) for name in setting.robots)
    elif part.robot is RobotChoice.ANY:
        yield replace(part, robot=_fastest(setting.robots, lambda name: setting.part(name, [part.meaning]))[0])
    else:
        yield part


def _fastest(names: Collection[str], prepare_for: Callable[[str], Prepared]) -> tuple[str, Prepared]:
    """Returns the robot with the shortest estimate for a mission, and its mission. Raises InputError if none can."""
    from executive.app.prepare.feasibility import check_prepared  # loads the check, which a single robot does not need

    able, reasons = dict[str, float](), list[str]()
    every = {name: prepare_for(name) for name in names}
    for name, prepared in every.items():
        checked = check_prepared(prepared)
        if checked.errors:
            reasons.append(f"{name}: {checked.errors[0].message}")
        else:
            able[name] = checked.estimate.duration_s
    if not able:
        raise InputError(f"no robot can do it: {'; '.join(reasons)}")
    first = min(able, key=lambda name: able[name])
    return first, every[first]


def _for_one_robot(setting: Setting, loaded: Mission) -> Prepared:
    """Prepares a mission file for the robot that it names, else for the fastest robot. Raises InputError."""
    robots = setting.robots
    names = tuple(robots) if loaded.robot is None else (_robot_in(loaded, ("robot",), loaded.robot, robots),)

    def for_file(name: str) -> Prepared:
        return setting.for_robot(name).for_file(mission_of_robot(loaded, name))

    return for_file(names[0]) if len(names) == 1 else _fastest(names, for_file)[1]


def _in_parts(setting: Setting, loaded: Mission, parts: Mapping[str, MissionPart]) -> Prepared:
    """Prepares the parts of a mission file, in the order of the robots. Raises InputError."""
    robots, written = setting.robots, dict[str, str]()
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
            _refuse_cycles(waits)
        except InputError as error:
            raise loaded.error(at, error.message, "let one of them begin") from error
    problems, made = Problems(), list[Prepared]()
    for name in (name for name in robots if name in written):
        with problems:
            own = mission_of_robot(loaded, name, written[name])
            made.append(replace(setting.for_robot(name).for_file(own), after=waits[name]))
    problems.raise_any()
    return combine(made)


def _robot_in(loaded: Mission, at: KeyPath, said: str, robots: Collection[str]) -> str:
    """Returns the robot that a file names. Raises InputError if `robots` lacks it."""
    name = find_robot(said, robots)
    if name is None:
        what = "has no part to wait for" if at[-1] == "after" else "is no robot of this run"
        raise loaded.error(at, f"'{said[:60]}' {what}", suggestion(said, robots))
    return name


def _waits(parts: Sequence[Part], robots: Mapping[str, PlacedRobot]) -> Mapping[str, tuple[str, ...]]:
    """Maps each robot to the robots that must end first. Raises InputError if robots wait for each other."""
    waits: dict[str, set[str]] = {}
    for part in parts:
        first = {str(parts[number].robot) for number in part.after if parts[number].robot in robots}
        if isinstance(part.robot, str):
            waits.setdefault(part.robot, set()).update(first - {part.robot})
    _refuse_cycles(waits)
    return {name: tuple(sorted(first)) for name, first in waits.items() if first}


def _refuse_cycles(waits: Mapping[str, Collection[str]]) -> None:
    """Raises InputError if robots would wait for each other."""
    try:
        TopologicalSorter(waits).prepare()
    except CycleError as error:
        names = sorted(set(error.args[1]))
        what = f"{names[0]} would wait for itself" if len(names) == 1 else f"{listing(names)} would wait for each other"
        raise InputError(what, hint="give the last part when the first is done") from error


def _with_people(loaded: Mission, world: World, knowledge: Knowledge) -> World:
    """Adds the walking people of a mission file to the world. Raises InputError if they do not fit the world."""
    routes = routes_of_people(loaded, knowledge)
    try:
        return world.with_routes(routes) if routes else world
    except WorldError as error:
        raise loaded.error(("people",), str(error), "change the route or its name here") from error


def _with_imports(loaded: Mission, world: World) -> World:
    """Adds the models that a mission file imports to the world. Raises InputError if a model cannot be used."""
    problems = Problems()
    for index, folder in enumerate(import_folders(loaded)):
        try:
            world = world.with_imports([folder])
        except InputError as error:
            problems.add(loaded.within(("imports", index), error))
    problems.raise_any()
    return world


def _with_objects(loaded: Mission, world: World, knowledge: Knowledge) -> World:
    """Adds the objects that a mission file places to the world. Raises InputError if they do not fit the world."""
    problems = Problems()
    for name, file in (loaded.objects or {}).items():
        surfaces = tuple(knowledge.place(surface) or surface for surface in file.surfaces)
        try:
            world = world.with_objects([ObjectRule(name=name, model=file.model, surfaces=surfaces)])
        except WorldError as error:
            problems.add(loaded.error(("objects", name), str(error), ""))
    problems.raise_any()
    return world
