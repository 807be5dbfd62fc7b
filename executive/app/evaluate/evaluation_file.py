"""Builds the runs of an evaluation: the product of missions, worlds and variations of a file, or many seeds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import Field, model_validator

from executive.app.evaluate.results import Evaluation, RunSpec
from executive.app.prepare.mission_files import mission_file
from executive.mission.request import Request
from executive.mission.scenario import NO_SCENARIO, RandomFaults, Scenario
from executive.words.robot_config import NamedRobot, RobotConfig, robots_of_file
from executive.words.slug import slug
from executive.words.variation import NORMAL_LIGHT, Brightness, Clutter, Friction, MorePeople, Variation, parse_light
from plant.robots.robot_kind import robot_kinds
from skills.inputs.errors import InputError
from skills.inputs.outside import is_file, read_text
from skills.inputs.schema import Name, Strict, Text, validate
from skills.inputs.yaml_source import KeyPath, YamlSource, read_yaml
from skills.quantities import LongDuration, Seed
from skills.stack import stack_file

MOST_RUNS: Final = 200_000
CONDITION: Final = "condition"
"""Dimension of runs that have one fault or scenario each."""
_NOTHING: Final = ("none", "default")
FileFinder = Callable[[Path], Path]
"""Returns the file of a path, or the shipped file of that name. Raises InputError."""


def is_evaluation(path: Path) -> bool:
    """Returns whether a file is an evaluation file, not a mission file. Raises InputError if it cannot be read."""
    if path.suffix not in (".yaml", ".yml") or not is_file(path):
        return False
    data = read_yaml(path).data
    return isinstance(data, dict) and "missions" in data and "steps" not in data


def load_evaluation(path: Path) -> Evaluation:
    """Reads the runs of an evaluation file, in the order of missions, worlds, robots, variations, seeds.

    Raises:
        InputError: a key, mission, file or value is wrong, or there are too many runs; with file and line.
    """
    source = read_yaml(path)
    runs = tuple(_Reader(validate(EvaluationFile, source), source).runs())
    if len(runs) > MOST_RUNS:
        raise source.error((), f"the file gives {len(runs)} runs, more than {MOST_RUNS}", "split it into several files")
    twice = len(runs) - len({run.id for run in runs})
    if twice:
        raise source.error((), f"{twice} of the runs stand in it twice", "list each mission, value and seed once")
    return Evaluation(str(path), runs)


def evaluation_at_seeds(asked: Request, seeds: Sequence[int], *, each_fault: bool) -> Evaluation:
    """Builds the runs of a request at many seeds; with `each_fault` once without faults, then with each fault alone.

    Raises InputError if `each_fault` is set and the request has no fault.
    """
    asked = asked.from_anywhere()
    name = asked.sentence or (asked.file.stem if asked.file is not None else "")
    runs: dict[str, RunSpec] = {}
    for number, (condition, request) in enumerate(_conditions(asked, each_fault=each_fault)):
        folder, files = f"{number}-{slug(condition)}/" if each_fault else "", _files_of(request)
        for seed in seeds:
            each = replace(request, seed=seed, out=Request.out)
            run = RunSpec(each, name, {CONDITION: condition} if condition else {}, files, f"{folder}seed-{seed:03d}")
            runs.setdefault(run.id, run)
    return Evaluation(name, tuple(runs.values()))


def _conditions(asked: Request, *, each_fault: bool) -> Sequence[tuple[str, Request]]:
    """Returns the request for each condition by name: as it is, or first without faults and then with each fault alone.

    Raises InputError if `each_fault` is set and the request has no fault.
    """
    if not each_fault:
        return [("", asked)]
    scenario, plain = asked.scenario, replace(asked, scenario=NO_SCENARIO, scenario_files=())
    alone = [(words, replace(plain, scenario=Scenario((words,)))) for words in scenario.faults]
    alone += [(str(path), replace(plain, scenario_files=(path,))) for path in asked.scenario_files]
    if scenario.random:
        alone.append((f"{scenario.random} random faults", replace(plain, scenario=Scenario(random=scenario.random))))
    if not alone:
        raise InputError("there is no fault to try alone", hint="give some by --fault, --random-faults or --scenario")
    return [("no fault", plain), *alone]


def seed_range(text: str, count: int | None = None) -> tuple[int, ...]:
    """Parses seeds such as "1-20", "3" or "1,4,7-9".

    With a `count` it returns the first `count` seeds, and the last range may be open, as in "8001-".

    Raises:
        InputError: the text is no range of seeds, or holds fewer than `count`.
    """
    seeds, parts = list[int](), text.split(",")
    try:
        for part in parts:
            first, dash, last = part.partition("-")
            if count is not None and dash and not last.strip() and part is parts[-1]:
                last = f"{int(first) + count - 1}"
            seeds += range(int(first), int(last if dash else first) + 1)
    except ValueError as error:
        raise InputError(f"'{text}' is no range of seeds", hint="write it like 1-20 or 1,4,7") from error
    if not seeds:
        raise InputError(f"'{text}' holds no seed", hint="write it like 1-20")
    if count is not None and len(seeds) < count:
        what = f"'{text}' holds {len(seeds)} seeds, fewer than {count}"
        raise InputError(what, hint="leave its end open, as in 8001-")
    return tuple(seeds[:count])


@dataclass(frozen=True)
class _Reader:
    """Reader of one evaluation file."""

    file: EvaluationFile
    source: YamlSource

    def runs(self) -> Iterator[RunSpec]:
        """Yields all runs. Raises InputError."""
        missions = [self._mission(entry, ("missions", index)) for index, entry in enumerate(self.file.missions)]
        worlds = [None] if self.file.worlds is None else [self._world(name) for name in self.file.worlds]
        seeds, variations = self._seeds(), [*self._variations(self.file.variations)]
        for (name, asked), world, robots, (changes, varied) in product(missions, worlds, self._robots(), variations):
            first = replace(asked, world=world, robots=robots, time_limit_s=self.file.time_limit, **changes)
            files = _files_of(first)
            yield from (RunSpec(replace(first, seed=seed), name, varied, files) for seed in seeds)

    def _robots(self) -> Sequence[tuple[RobotConfig, ...]]:
        """Returns the groups of robots to try. Raises InputError with the line if a name or kind is wrong."""
        named = self.file.robots or ({},)
        fleets = [named] if isinstance(named, dict) else named
        kinds = [{name: NamedRobot.model_validate({"kind": kind}) for name, kind in each.items()} for each in fleets]
        try:
            return [robots_of_file(each, robot_kinds(), None) for each in kinds]
        except InputError as error:
            raise self.source.error(("robots",), error.message, error.hint) from error

    def _seeds(self) -> tuple[int, ...]:
        if not isinstance(self.file.seeds, str):
            return self.file.seeds
        try:
            return seed_range(self.file.seeds)
        except InputError as error:
            raise self.source.error(("seeds",), error.message, error.hint) from error

    def _mission(self, entry: str | MissionEntry, path: KeyPath) -> tuple[str, Request]:
        """Returns the name and the request of an entry; a text with spaces that names no file is a sentence."""
        if isinstance(entry, str):
            is_file = entry.endswith((".yaml", ".yml")) or " " not in entry.strip()
            entry = MissionEntry.model_validate({"file" if is_file else "say": entry})
        if entry.say is not None:
            return entry.name or entry.say, Request(entry.say, answers=entry.answers)
        assert entry.file is not None
        found = self._find(entry.file, path, mission_file)
        request = Request(file=found, given=entry.set, answers=entry.answers)
        values = ", ".join(f"{name}={value}" for name, value in entry.set.items())
        return entry.name or Path(entry.file).stem + (f" ({values})" if values else ""), request

    def _world(self, name: str) -> str:
        """Returns a world's name, or its folder as seen from the file."""
        folder = self.source.path.parent / name
        return str(folder.resolve()) if is_file(folder / "world.dmd.yaml") else name

    def _find(self, name: str, path: KeyPath, finder: FileFinder | None = None) -> Path:
        """Returns a file as seen from the evaluation file, or a shipped file. Raises InputError with the line."""
        beside = self.source.path.parent / name
        try:
            found = beside if is_file(beside) or finder is None else finder(Path(name))
        except InputError as error:
            raise self.source.error(path, f"{name}: {error.message}", error.hint) from error
        if not is_file(found):
            raise self.source.error(path, f"there is no file '{name}'", "give its path from this file's folder")
        return found.resolve()

    def _light(self, light: str | float, path: KeyPath) -> str:
        """Returns the light level as text. Raises InputError with the line if it is no name and no brightness."""
        words = light if isinstance(light, str) else f"{light:g}"
        try:
            parse_light(words)
        except InputError as error:
            raise self.source.error(path, error.message, error.hint) from error
        return words

    def _variations(self, lists: VariationsFile) -> Iterator[tuple[Mapping[str, Any], Mapping[str, str]]]:
        """Yields, for each combination of values, the request fields to change and the varied values as text."""
        several = [name for name in type(lists).model_fields if len(getattr(lists, name)) > 1]
        lights = [self._light(light, ("variations", "light", index)) for index, light in enumerate(lists.light)]
        scenarios, stacks = self._files("scenario", lists.scenario), self._files("stack", lists.stack, stack_file)
        for light, clutter, people, friction, faults, scenario, stack in product(
            lights, lists.clutter, lists.people, lists.friction, lists.faults, scenarios, stacks
        ):
            named, injected = _faults(faults)
            words = {"light": light, "clutter": clutter, "people": people, "friction": f"{friction:g}"}
            words |= {"faults": named, "scenario": scenario[0], "stack": stack[0]}
            changes = {
                "variation": Variation(light, clutter, people, friction),
                "scenario": injected,
                "scenario_files": () if scenario[1] is None else (scenario[1],),
                "stack": stack[1],
            }
            yield changes, {name: str(words[name]) for name in several}

    def _files(
        self, key: str, names: Sequence[str], finder: FileFinder | None = None
    ) -> Sequence[tuple[str, Path | None]]:
        """Returns each name in a list with its file; `none` and `default` have no file. Raises InputError with line."""
        return [
            (name, None if name in _NOTHING else self._find(name, ("variations", key, index), finder))
            for index, name in enumerate(names)
        ]


def _faults(entry: str | FaultsFile) -> tuple[str, Scenario]:
    """Returns the name and the faults of an entry in the list of faults."""
    if isinstance(entry, str):
        return entry, Scenario(() if entry in _NOTHING else (entry,))
    drawn = (f"{entry.random} random",) if entry.random else ()
    name = entry.name or " and ".join((*entry.faults, *drawn)) or "none"
    return name, Scenario(entry.faults, entry.random)


def _files_of(request: Request) -> Mapping[str, str]:
    """Returns the text by path of the files that a request names, and of the files that these include."""
    others = (path for path in (request.stack, *request.scenario_files) if path is not None)
    used = {} if request.file is None else dict(_with_used(request.file))
    return {**used, **{str(path): read_text(path) for path in others}}


def _with_used(file: Path) -> Iterator[tuple[str, str]]:
    """Yields path and text of a mission file and of the files that it includes, directly or not."""
    todo, known = [file], set[Path]()
    while todo:
        path = todo.pop()
        if path in known or not is_file(path):
            continue
        known.add(path)
        yield str(path), read_text(path)
        todo += [(path.parent / used).resolve() for used in _uses(read_yaml(path).data)]


def _uses(data: Any) -> Iterator[str]:
    """Yields the files under a key `use` or `stack` anywhere in a document."""
    if isinstance(data, dict):
        yield from (value for key, value in data.items() if key in ("use", "stack") and isinstance(value, str))
    for value in data.values() if isinstance(data, dict) else data if isinstance(data, list) else ():
        yield from _uses(value)


class MissionEntry(Strict):
    """Mission of an evaluation: exactly one of `say` and `file`."""

    say: Text | None = Field(None, description="A sentence.")
    file: Name | None = Field(
        None, description="A mission file, as seen from this file, or a name of `errand missions`."
    )
    name: Name | None = Field(None, description="Name in the report.")
    set: dict[str, Any] = Field(default_factory=dict, description="Values for the parameters of the file.")
    answers: tuple[Text, ...] = Field((), description="Answers to the questions that it leaves open.")

    @model_validator(mode="after")
    def _one_of_both(self) -> MissionEntry:
        if (self.say is None) == (self.file is None):
            raise ValueError("give exactly one of 'say' and 'file'")
        if self.set and self.file is None:
            raise ValueError("'set' gives values to a mission file, and there is none")
        return self


class FaultsFile(Strict):
    """Faults of one condition: in words, and drawn by the seed."""

    name: Name | None = Field(None, description="Name in the report.")
    faults: tuple[Text, ...] = Field((), description="Faults in words.")
    random: RandomFaults = Field(0, description="Number of further faults that the run's seed draws.")


Light = Name | Brightness
_SOME = Field(min_length=1)


class VariationsFile(Strict):
    """Lists of values, of which all combinations are tried."""

    light: Annotated[tuple[Light, ...], _SOME] = Field(
        (NORMAL_LIGHT,), description="Lights by name (normal, dim, bright, evening, low sun), or brightnesses."
    )
    clutter: Annotated[tuple[Clutter, ...], _SOME] = Field((0,), description="Number of added objects.")
    people: Annotated[tuple[MorePeople, ...], _SOME] = Field((0,), description="Number of added people who walk.")
    friction: Annotated[tuple[Friction, ...], _SOME] = Field(
        (1.0,), description="Factors on the friction of loose objects and robots."
    )
    faults: Annotated[tuple[Text | FaultsFile, ...], _SOME] = Field(
        ("none",), description="Faults: `none`, one in words, or several together."
    )
    scenario: Annotated[tuple[Name, ...], _SOME] = Field(
        ("none",), description="`none`, or files of faults and events, as `errand run --scenario` takes them."
    )
    stack: Annotated[tuple[Name, ...], _SOME] = Field(
        ("default",), description="Stacks: `default`, `no_map`, or stack files."
    )


Robots = Annotated[dict[Name, Name], _SOME]


class EvaluationFile(Strict):
    """Evaluation file: missions, worlds, robots, seeds and variations, of which all combinations are run."""

    missions: Annotated[tuple[Text | MissionEntry, ...], _SOME] = Field(
        description="Sentences, names of `errand missions`, and mission files, as seen from this file."
    )
    worlds: Annotated[tuple[Name, ...], _SOME] | None = Field(
        None, description="Worlds by name or folder; by default the world of each mission."
    )
    robots: Robots | Annotated[tuple[Robots, ...], _SOME] | None = Field(
        None, description="Robots by name, each with its kind, or a list of such mappings, of which each is tried."
    )
    seeds: Text | Annotated[tuple[Seed, ...], _SOME] = Field(
        "1-20", description="Seeds such as `1-20`, or a list of them."
    )
    time_limit: LongDuration | None = Field(None, description="Time limit of each run on the robot's clock.")
    variations: VariationsFile = Field(VariationsFile.model_validate({}), description="Values to vary.")
