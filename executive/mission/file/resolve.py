"""From mission files to missions: sentences understood, names checked, used files put in."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from executive.language.questions import Answerer, QuestionPolicy, answer_by
from executive.mission.file.block_steps import condition_of, plain_value, read_block, round_values
from executive.mission.file.condition_schema import ConditionFile
from executive.mission.file.names import typed_command
from executive.mission.file.overrides import overridden
from executive.mission.file.parameters import Given, part_source, round_source, with_parameters
from executive.mission.file.schema import HandlerFile, MissionFile, ParameterFile, RoundFile, StepFile, with_source
from executive.mission.file.scope import Scope
from executive.words.blocks import Block, Group, Handler
from executive.words.command import START, Command
from executive.words.condition import Condition
from executive.words.knowledge import Knowledge
from executive.words.steps import KeyPath, Mission, MissionStep, SkillCall
from skills.files.errors import InputError, Problems, suggestion
from skills.files.outside import is_file
from skills.files.schema import validate
from skills.files.yaml_source import read_yaml

if TYPE_CHECKING:
    from executive.language.parser import DependencyParser
    from executive.language.understand import Understanding

__all__ = ["for_robot", "load_mission", "mission_from_file"]

MAX_STEPS: Final = 5000
MAX_DEPTH: Final = 20
MAX_NESTING: Final = 25
REASON_LETTERS: Final = 500
_NOT_UNDERSTOOD: Final = "the sentence was not understood"
_NONE_GIVEN: Final[Given] = MappingProxyType({})
_ONLY_AT_THE_TOP: Final = ("imports", "knowledge", "objects", "people", "robot", "robots", "world")


def load_mission(path: Path | str, parameters: Given = _NONE_GIVEN) -> MissionFile:
    """Read a mission file and put its parameters in.

    Raises:
        InputError: with file, line and hint, for broken YAML, unknown keys, wrong values and unknown parameters.
    """
    source = with_parameters(read_yaml(path), parameters)
    return with_source(validate(MissionFile, source), source)


def for_robot(file: MissionFile, robot: str, part: str | None = None) -> MissionFile:
    """What a mission file has for one robot of several: the part that stands under the name `part`, or all its steps.

    Raises:
        InputError: with file and line, for a policy that a whole mission cannot have.
    """
    if file.source is None:
        own = None if part is None or file.parts is None else file.parts[part]
        laid_over = {} if own is None else {key: getattr(own, key) for key in own.model_fields_set - {"after"}}
        return file.model_copy(update={**laid_over, "robot": robot, "robots": None, "parts": None})
    source = part_source(file.source, robot, part)
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
    depth: int = 0
    understood: dict[str, Understanding] = field(default_factory=dict)

    def mission(self, file: MissionFile, chain: tuple[Path, ...]) -> Mission:
        """The mission of a file that the files of `chain` led to, itself the last."""
        if file.parts is not None:
            what = "its parts are for several robots, and this is for one"
            hint = "run the file by `errand run`, and name them: 'robots: {alice: spot, bob: fetch}', or --robots"
            raise file.error(("parts",), what, hint)
        scope, problems = Scope(file, file.source, chain), Problems()
        steps: tuple[MissionStep, ...] = ()
        whole: Group | None = None
        variables = file.variables or {}
        for name, value in variables.items():
            with problems:
                plain_value(scope, value, ("variables", name))
        for name, parameter in (file.parameters or {}).items():
            with problems:
                self._refuse_unknown(scope, name, parameter)
        with problems:
            steps = self.steps(scope, file.steps or (), ("steps",))
        with problems:
            whole = self._whole(scope, file)
        problems.raise_any()
        return Mission(
            file.name,
            self.world,
            self.robot_name,
            steps,
            file.over(None),
            file.source_line(("name",)),
            self._notes(),
            variables,
            whole,
        )

    def steps(self, scope: Scope, steps: Sequence[StepFile], path: KeyPath) -> tuple[MissionStep, ...]:
        """The steps of a list that stands at `path`. Raises InputError: all that is wrong with them."""
        if self.depth == MAX_NESTING:
            what = f"steps hold steps more than {MAX_NESTING} deep"
            raise scope.error(path, what, "write some of them one after the other")
        problems, made = Problems(), []
        self.depth += 1
        for index, step in enumerate(steps):
            with problems:
                made.append(self._step(scope, step, (*path, index)))
        self.depth -= 1
        problems.raise_any()
        return tuple(made)

    def condition(self, scope: Scope, condition: ConditionFile, path: KeyPath) -> Condition:
        """The condition that stands at `path`. Raises InputError."""
        return condition_of(self, scope, condition, path)

    def handlers(self, scope: Scope, handlers: Sequence[HandlerFile], path: KeyPath) -> tuple[Handler, ...]:
        """What interrupts a group or a mission, from a list at `path`. Raises InputError."""
        return tuple(
            Handler(
                self.condition(scope, each.if_, (*path, index, "if")),
                self.steps(scope, each.do, (*path, index, "do")),
                each.times,
            )
            for index, each in enumerate(handlers)
        )

    def rounds(self, scope: Scope, step: StepFile, path: KeyPath) -> tuple[MissionStep, ...]:
        """One group for each value of a `for_each`. Raises InputError."""
        assert step.repeat is not None and step.repeat.as_ is not None and scope.source is not None
        made, below = [], (*path, "steps")
        for value in round_values(scope, step.repeat, path, self.knowledge):
            source = round_source(scope.source, below, step.repeat.as_, value)
            steps = validate(RoundFile, source).steps
            group = Group(self.steps(replace(scope, source=source), steps, ("steps",)), name=str(value))
            made.append(MissionStep(source=scope.line(path), block=group))
        return tuple(made)

    def find_command(self, scope: Scope, path: KeyPath, found: str, at: str | None) -> Command:
        """The status check for something or somebody. Raises InputError: an unknown name."""
        step = StepFile.model_validate({"do": "find", "object": found, "to": at})
        return typed_command(scope, step, path, self.knowledge)

    def meaning(self, scope: Scope, path: KeyPath, sentence: str) -> Understanding:
        """What a sentence at `path` means. Raises InputError: it is not understood."""
        from executive.language.understand import Status

        answer = self._understand(sentence)
        if answer.status is not Status.OK:
            hint = "say it in other words, or write take, to, do and object"
            raise scope.error(path, (answer.reason or _NOT_UNDERSTOOD)[:REASON_LETTERS], hint)
        return answer

    def _step(self, scope: Scope, step: StepFile, path: KeyPath) -> MissionStep:
        self.steps_so_far += 1
        if self.steps_so_far > MAX_STEPS:
            raise scope.error(path, f"the mission has more than {MAX_STEPS} steps", "use fewer files, or fewer times")
        made = MissionStep(
            source=scope.line(path),
            policy=step.over(scope.file.each),
            elsewhere=step.elsewhere is not False,
            gives=step.gives or {},
        )
        if step.use is not None:
            return replace(made, used=self._used(scope, step, path))
        if step.skill is not None:
            return replace(made, skill=_skill_call(scope, step, path), gives={})
        block: Block | None = read_block(self, scope, step, path)
        if block is not None:
            return replace(made, block=block, gives={})
        if step.say is None:
            return replace(made, commands=(typed_command(scope, step, path, self.knowledge),))
        meant = self.meaning(scope, (*path, "say"), step.say)
        if meant.steps:
            return replace(made, block=Group(meant.steps, name=step.say), gives={})
        return replace(made, commands=meant.commands)

    def _refuse_unknown(self, scope: Scope, name: str, parameter: ParameterFile) -> None:
        """Refuse a parameter that names no place, object or person of the world."""
        known = {
            "place": (self.knowledge.place, self.knowledge.place_names()),
            "object": (self.knowledge.thing, self.knowledge.thing_names()),
            "person": (self.knowledge.person, tuple(self.knowledge.people)),
        }
        if parameter.type in known:
            find, names = known[parameter.type]
            said = str(parameter.default)
            if said != START and find(said) is None:
                what = f"parameter '{name}': unknown {parameter.type} '{said[:60]}'"
                hint = suggestion(said, self.knowledge.spellings(names), shown=names)
                raise scope.error(("parameters", name), what, hint)

    def _whole(self, scope: Scope, file: MissionFile) -> Group | None:
        """What is watched while a file's steps run, and done in the end."""
        if file.always is None and file.while_ is None and file.when is None:
            return None
        return Group(
            (),
            always=self.steps(scope, file.always or (), ("always",)),
            holds=None if file.while_ is None else self.condition(scope, file.while_.holds, ("while", "holds")),
            when=self.handlers(scope, file.when or (), ("when",)),
        )

    def _understand(self, sentence: str) -> Understanding:
        """What a sentence means; one that stands there again means the same."""
        from executive.language.understand import understand_asking

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

    def _used(self, scope: Scope, step: StepFile, path: KeyPath) -> Mission:
        """The mission of the file that a step uses."""
        assert step.use is not None
        used_path, chain, at = _found(scope, step.use, (*path, "use")), scope.chain, (*path, "use")
        if used_path.resolve() in chain:
            names = [one.name for one in (*chain[chain.index(used_path.resolve()) :], used_path)]
            raise scope.error(at, f"the files use each other in a circle: {' -> '.join(names)}", "break the circle")
        if len(chain) >= MAX_DEPTH:
            what = f"more than {MAX_DEPTH} files use each other in a row"
            raise scope.error(at, what, "put what they say into fewer files")
        here = scope.line(at)
        try:
            used = load_mission(used_path, step.with_ or {})
            _refuse_top_keys(used, scope.file)
            return self.mission(used, (*chain, used_path.resolve()))
        except InputError as error:
            raise error if here is None else error.within(here.file, here.line) from error


def _found(scope: Scope, use: str, path: KeyPath) -> Path:
    """The file that a step uses, as seen from the folder of the file in which the step stands.

    Raises InputError: there is none, or it lies outside of the folder of the first file.
    """
    found = scope.folder / use
    home = scope.chain[0].parent if scope.chain else scope.folder.resolve()
    if not found.resolve().is_relative_to(home):
        hint = f"put it into {home.name or home} or a folder in it"
        raise scope.error(path, f"'{use[:60]}' leaves the folder of the mission", hint)
    if is_file(found):
        return found
    beside = sorted(one.name for one in scope.folder.glob("*.yaml"))
    near = difflib.get_close_matches(use, beside, n=1)
    hint = f"did you mean '{near[0]}'?" if near else "give its path from this file's folder"
    raise scope.error(path, f"there is no mission file '{use[:60]}'", hint)


def _refuse_top_keys(used: MissionFile, user: MissionFile) -> None:
    """What is for a whole run cannot be set by a file that is a part of it, unless it says the same."""
    for key in _ONLY_AT_THE_TOP:
        said = getattr(used, key)
        if key in used.model_fields_set and said is not None and said != getattr(user, key):
            hint = "remove it there, or say the same in both"
            raise used.error((key,), f"'{key}' of a file that is used cannot differ from that of its user", hint)


def _skill_call(scope: Scope, step: StepFile, path: KeyPath) -> SkillCall:
    lines: Mapping[KeyPath, int] = {} if scope.source is None else scope.source.lines
    below = {each[len(path) :]: line for each, line in lines.items() if each[: len(path)] == path}
    assert step.skill is not None
    return SkillCall(
        skill=step.skill,
        values=step.with_ or {},
        gives=step.gives or {},
        file=None if scope.source is None else scope.source.path,
        places=below,
    )
