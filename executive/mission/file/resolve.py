"""From mission files to missions: sentences understood, names checked, used files put in."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Final

from executive.language import DependencyParser, Status, Understanding
from executive.language.questions import Answerer, QuestionPolicy, answer_by
from executive.language.understand import understand_asking
from executive.mission.command import Command
from executive.mission.errors import InputError, Problems
from executive.mission.file.model import Mission, MissionStep, SkillCall
from executive.mission.file.names import typed_command
from executive.mission.file.overrides import overridden
from executive.mission.file.parameters import Given, with_parameters
from executive.mission.file.schema import MissionFile, StepFile, with_source
from executive.mission.knowledge import Knowledge
from executive.mission.yaml_source import read_yaml, validate

__all__ = ["load_mission", "mission_from_file"]

MAX_STEPS: Final = 5000
MAX_DEPTH: Final = 20
REASON_LETTERS: Final = 500
_NOT_UNDERSTOOD: Final = "the sentence was not understood"
_NONE_GIVEN: Final[Given] = MappingProxyType({})
_ONLY_AT_THE_TOP: Final = ("imports", "knowledge", "objects", "people", "robot", "world")


def load_mission(path: Path | str, parameters: Given = _NONE_GIVEN) -> MissionFile:
    """Read a mission file and put its parameters in.

    Raises:
        InputError: with file, line and hint, for broken YAML, unknown keys, wrong values and unknown parameters.
    """
    source = with_parameters(read_yaml(path), parameters)
    return with_source(validate(MissionFile, source), source)


def mission_from_file(
    file: MissionFile | Path | str,
    *,
    parser: DependencyParser,
    knowledge: Knowledge,
    answer: Answerer | None = None,
) -> Mission:
    """The mission of a file, its sentences understood and its names checked against `knowledge` and its overrides.

    `answer` is asked where a sentence could mean several things; unless given, the file's own policy decides.

    Raises:
        InputError: with file, line and hint, also for a sentence that is not understood, for unknown names, and for
            used files that are wrong or use each other in a circle; all that was found stands in `others`.
    """
    loaded = file if isinstance(file, MissionFile) else load_mission(file)
    own = overridden(loaded, knowledge)
    chain = () if loaded.source is None else (loaded.source.path.resolve(),)
    answers = answer or answer_by(loaded.questions or QuestionPolicy.REFUSE)
    return _Resolver(parser, own, loaded.robot or own.robot.name, loaded.world, answers).mission(loaded, chain)


@dataclass
class _Resolver:
    """Resolves a file and all that it uses, for one robot in one world."""

    parser: DependencyParser
    knowledge: Knowledge
    robot_name: str
    world: str
    answer: Answerer
    steps_so_far: int = 0
    understood: dict[str, Understanding] = field(default_factory=dict)

    def mission(self, file: MissionFile, chain: tuple[Path, ...]) -> Mission:
        """The mission of a file that the files of `chain` led to, itself the last."""
        problems, steps = Problems(), []
        for index in range(len(file.steps)):
            with problems:
                steps.append(self._step(file, index, chain))
        problems.raise_any()
        source = file.source_line(("name",))
        return Mission(file.name, self.world, self.robot_name, tuple(steps), file.over(None), source, self._notes())

    def _step(self, file: MissionFile, index: int, chain: tuple[Path, ...]) -> MissionStep:
        step, path = file.steps[index], ("steps", index)
        self.steps_so_far += 1
        if self.steps_so_far > MAX_STEPS:
            raise file.error(path, f"the mission has more than {MAX_STEPS} steps", "use fewer files, or fewer times")
        source, policy = file.source_line(path), step.over(file.each)
        if step.use is not None:
            return MissionStep(source=source, policy=policy, used=self._used(file, index, chain))
        if step.skill is not None:
            return MissionStep(source=source, policy=policy, skill=_skill_call(file, index))
        if step.say is None:
            commands: tuple[Command, ...] = (typed_command(file, index, self.knowledge),)
            return MissionStep(commands, source, policy, elsewhere=step.elsewhere is not False)
        answer = self._understand(step.say)
        if answer.status is not Status.OK:
            hint = "say it in other words, or write take, to, do and object"
            raise file.error((*path, "say"), (answer.reason or _NOT_UNDERSTOOD)[:REASON_LETTERS], hint)
        return MissionStep(answer.commands, source, policy, elsewhere=step.elsewhere is not False)

    def _understand(self, sentence: str) -> Understanding:
        """What a sentence means; one that stands there again means the same."""
        if sentence not in self.understood:
            self.understood[sentence] = understand_asking(
                sentence,
                answer=self.answer,
                parser=self.parser,
                knowledge=self.knowledge,
                require_wake=False,
                robot_name=self.robot_name,
                correct=False,
            )
        return self.understood[sentence]

    def _notes(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(note for meant in self.understood.values() for note in meant.notes))

    def _used(self, file: MissionFile, index: int, chain: tuple[Path, ...]) -> Mission:
        """The mission of the file that a step uses."""
        step, path = file.steps[index], ("steps", index, "use")
        assert step.use is not None
        used_path = _found(file, index)
        if used_path.resolve() in chain:
            names = [one.name for one in (*chain[chain.index(used_path.resolve()) :], used_path)]
            raise file.error(path, f"the files use each other in a circle: {' -> '.join(names)}", "break the circle")
        if len(chain) >= MAX_DEPTH:
            what = f"more than {MAX_DEPTH} files use each other in a row"
            raise file.error(path, what, "put what they say into fewer files")
        here = file.source_line(path)
        try:
            used = load_mission(used_path, step.with_ or {})
            _refuse_top_keys(used, file)
            return self.mission(used, (*chain, used_path.resolve()))
        except InputError as error:
            raise error if here is None else error.within(here.file, here.line) from error


def _found(file: MissionFile, index: int) -> Path:
    """The file that a step uses, as seen from the folder of the file in which the step stands."""
    step = file.steps[index]
    assert step.use is not None
    folder = Path() if file.source is None else file.source.path.parent
    path = folder / step.use
    if _is_file(path):
        return path
    beside = sorted(one.name for one in folder.glob("*.yaml"))
    near = difflib.get_close_matches(step.use, beside, n=1)
    hint = f"did you mean '{near[0]}'?" if near else "give its path from this file's folder"
    raise file.error(("steps", index, "use"), f"there is no mission file '{step.use}'", hint)


def _is_file(path: Path) -> bool:
    """Whether a path leads to a file; no when the system cannot even look there."""
    try:
        return path.is_file()
    except OSError:
        return False


def _refuse_top_keys(used: MissionFile, user: MissionFile) -> None:
    """What is for a whole run cannot be set by a file that is a part of it, unless it says the same."""
    for key in _ONLY_AT_THE_TOP:
        said = getattr(used, key)
        if key in used.model_fields_set and said is not None and said != getattr(user, key):
            hint = "remove it there, or say the same in both"
            raise used.error((key,), f"'{key}' of a file that is used cannot differ from that of its user", hint)


def _skill_call(file: MissionFile, index: int) -> SkillCall:
    step: StepFile = file.steps[index]
    prefix = ("steps", index)
    lines: Mapping[tuple[str | int, ...], int] = {} if file.source is None else file.source.lines
    below = {path[2:]: line for path, line in lines.items() if path[:2] == prefix}
    assert step.skill is not None
    return SkillCall(
        skill=step.skill,
        values=step.with_ or {},
        gives=step.gives or {},
        file=None if file.source is None else file.source.path,
        places=below,
    )
