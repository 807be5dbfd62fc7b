"""Resolves missions: understands their sentences, and checks their names against the world."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pydantic import BaseModel

from executive.language.questions import Answerer, make_answerer
from executive.mission.certainty import refuse_certain, refuse_certain_comparisons
from executive.mission.load import load_mission, locate
from executive.mission.parameters import round_source
from executive.mission.world_names import in_world_names, unknown_names
from executive.words.command import START, Command
from executive.words.condition import CONDITIONS, RANGES, Condition, DoorOpen, Look, LookFor, Question, ValueIs
from executive.words.expression import Expression, ExpressionError, Value, literal
from executive.words.knowledge import ANYBODY, Knowledge
from executive.words.leaf_steps import CallSkill, Do, Say, Set, UseMission
from executive.words.mission import Mission, Parameter, QuestionPolicy
from executive.words.step import Policy, Step
from executive.words.steps import ForEach, Group, Steps
from executive.words.zone import ZoneFacts
from skills.inputs.errors import InputError, Problems, listing, suggestion
from skills.inputs.outside import is_file
from skills.inputs.schema import Strict, validate
from skills.inputs.yaml_source import KeyPath

if TYPE_CHECKING:
    from executive.language.parser import DependencyParser
    from executive.language.understand import Understanding

MAX_STEPS: Final = 5000
MAX_DEPTH: Final = 20
MAX_NESTING: Final = 25
MOST_ROUNDS: Final = 1000
REASON_LETTERS: Final = 500
_NOT_UNDERSTOOD: Final = "the sentence was not understood"
_ONLY_AT_THE_TOP: Final = ("imports", "knowledge", "objects", "people", "robot", "robots", "world")


def mission_from_file(
    file: Mission | Path | str,
    *,
    parser: DependencyParser,
    knowledge: Knowledge,
    answer: Answerer | None = None,
) -> Mission:
    """Resolves the mission in a file: understands its sentences and checks its names against `knowledge`.

    `knowledge` includes the knowledge in the file (`knowledge_of_mission`). `answer` answers questions about ambiguous
    sentences; by default the file's policy decides.

    Raises:
        InputError: with file, line and hint, also for a sentence that is not understood, for unknown names, and for
            used files that are wrong or use each other in a circle; `others` has all further errors.
    """
    loaded = file if isinstance(file, Mission) else load_mission(file)
    chain = () if loaded.document is None else (loaded.document.path.resolve(),)
    answers = answer or make_answerer(loaded.questions or QuestionPolicy.REFUSE)
    robot = loaded.robot or knowledge.robot.name
    return _Resolver(parser, knowledge, robot, loaded.world, answers).mission(loaded, chain)


@dataclass(frozen=True)
class _Scope:
    """File whose steps are resolved, and the chain of files that use one another, up to and including this file."""

    file: Mission
    chain: tuple[Path, ...] = ()

    @property
    def folder(self) -> Path:
        """Folder of the file."""
        return Path() if self.file.document is None else self.file.document.path.parent


class _Round(Strict):
    """Steps of one round of a `for_each`."""

    steps: Steps


_Error = Callable[[KeyPath, str, str], InputError]


@dataclass
class _Resolver:
    """Resolves a file and all files that it uses, for one robot in one world."""

    parser: DependencyParser
    knowledge: Knowledge
    robot_name: str
    world: str
    answer: Answerer
    steps_so_far: int = 0
    depth: int = 0
    understood: dict[str, Understanding] = field(default_factory=dict)

    def mission(self, file: Mission, chain: tuple[Path, ...]) -> Mission:
        """Resolves the mission in a file; `chain` are the files that led to it, the file itself last."""
        if file.parts is not None:
            what = "its parts are for several robots, and this is for one"
            hint = "run the file by `errand run`, and name them: 'robots: {alice: spot, bob: fetch}', or --robots"
            raise file.error(("parts",), what, hint)
        scope, problems = _Scope(file, chain), Problems()
        for name, value in (file.variables or {}).items():
            with problems:
                try:
                    literal(value)
                except ExpressionError as fault:
                    raise file.error(("variables", name), fault.message, fault.hint) from fault
        for name, parameter in (file.parameters or {}).items():
            with problems:
                self._refuse_unknown(file, name, parameter)
        resolved: dict[str, Any] = {"world": self.world, "robot": self.robot_name}
        for name in ("steps", "always", "while_", "when", "zones"):
            with problems:
                alias = name.removesuffix("_")
                resolved[name] = self._part(scope, file.error, getattr(file, name), (alias,))
        problems.raise_any()
        notes = dict.fromkeys(note for meant in self.understood.values() for note in meant.notes)
        return file.model_copy(update=resolved).with_notes(tuple(notes))

    def _steps(self, scope: _Scope, steps: Steps) -> Steps:
        """Resolves steps in order. Raises InputError with the errors of all steps."""
        if self.depth == MAX_NESTING:
            what = f"steps are nested more than {MAX_NESTING} deep"
            raise steps[0].error((), what, "write some of them one after the other")
        problems, made = Problems(), []
        self.depth += 1
        for step in steps:
            with problems:
                made.append(self._step(scope, step.with_policy(scope.file.each)))
        self.depth -= 1
        problems.raise_any()
        return tuple(made)

    def _step(self, scope: _Scope, step: Step) -> Step:
        self.steps_so_far += 1
        if self.steps_so_far > MAX_STEPS:
            raise step.error((), f"the mission has more than {MAX_STEPS} steps", "use fewer files, or fewer times")
        for path, what, hint in step.faults:
            raise step.error(path, what, hint)
        match step:
            case UseMission():
                return step.with_mission(self._used(scope, step))
            case CallSkill():
                return step
            case Say():
                meant = self._meaning(step.error, ("say",), step.say)
                return _group(step, meant.steps, step.say) if meant.steps else step.with_commands(meant.commands)
            case Do():
                return step.with_command(self._command(step.error, step))
            case ForEach():
                return _group(step, self._rounds(scope, step), f"for each {step.loop.name}")
            case Set():
                for name, expression in step.values.items():
                    _refuse_decided(step.error, expression, ("set", name))
        return step.model_copy(update=self._parts(scope, step.error, step, ()))

    def _parts(self, scope: _Scope, error: _Error, model: BaseModel, path: KeyPath) -> dict[str, Any]:
        """Resolves the steps and conditions in a model's fields."""
        found = {}
        for name, facts in type(model).model_fields.items():
            if name not in Policy.model_fields:
                value = getattr(model, name)
                found[name] = self._part(scope, error, value, (*path, facts.alias or name))
        return found

    def _part(self, scope: _Scope, error: _Error, value: Any, path: KeyPath) -> Any:
        """Resolves the steps and conditions in a value at a path below a step or the file."""
        if isinstance(value, CONDITIONS):
            return self._condition(scope, error, value, path)
        match value:
            case (Step(), *_):
                return self._steps(scope, value)
            case tuple():
                return tuple(self._part(scope, error, each, (*path, n)) for n, each in enumerate(value))
            case dict():
                return {key: self._part(scope, error, each, (*path, key)) for key, each in value.items()}
            case ZoneFacts():
                return self._zone(error, value, path)
            case Strict():
                return value.model_copy(update=self._parts(scope, error, value, path))
        return value

    def _zone(self, error: _Error, zone: ZoneFacts, path: KeyPath) -> ZoneFacts:
        """Replaces the room that a zone names by the world's own name for it."""
        if zone.mask is not None:
            what = "a zone of a mission has a room or a polygon, and no mask"
            raise error((*path, "mask"), what, "write a zone with a mask below 'knowledge: zones:'")
        if zone.place is None:
            return zone
        room = self.knowledge.place(zone.place)
        if room not in self.knowledge.rooms:
            rooms = self.knowledge.rooms
            hint = suggestion(zone.place, self.knowledge.spellings(rooms), shown=tuple(rooms))
            raise error((*path, "place"), f"unknown room '{zone.place[:60]}'", hint)
        return zone.model_copy(update={"place": room})

    def _condition(self, scope: _Scope, error: _Error, condition: Condition, path: KeyPath) -> Condition:
        """Replaces the names in a condition by the world's own names.

        Raises:
            InputError: for an unknown name, a sentence that is no question, or a condition that always or never holds.
        """
        resolved = self._named(scope, error, condition, path)
        try:
            refuse_certain(resolved, RANGES)
        except ExpressionError as fault:
            raise error(path, fault.message, fault.hint) from fault
        return resolved

    def _named(self, scope: _Scope, error: _Error, condition: Condition, path: KeyPath) -> Condition:
        match condition:
            case ValueIs():
                _refuse_decided(error, condition.text, path)
            case Question(look=question):
                commands = self._meaning(error, (*path, "look"), question).commands
                if len(commands) != 1 or not commands[0].looks:
                    hint = "ask one thing, as in 'is there a hammer in the workshop'"
                    raise error((*path, "look"), f"'{question}' is no single question that a look can answer", hint)
                return Look.from_command(commands[0], condition.max_age_s)
            case Look():
                return Look.from_command(self._command(error, condition, path), condition.max_age_s)
            case LookFor(person=person):
                look = Look(object=self._person(error, person, (*path, "person")), at=condition.at)
                return Look.from_command(self._command(error, look, path), condition.max_age_s)
            case DoorOpen():
                return condition.model_copy(update={"door": self._door(error, condition.door, (*path, "door"))})
        return condition.model_copy(update=self._parts(scope, error, condition, path))

    def _command(self, error: _Error, of: Do | Look, path: KeyPath = ()) -> Command:
        """Replaces the names in the command of a step or a look by the world's own names.

        Raises InputError when a part cannot be parsed, or the world does not have a name.
        """
        try:
            command = of.command
        except ValueError as fault:
            raise error(path, str(fault), "write names in plain words") from fault
        problems = Problems()
        for key, what, hint in unknown_names(command, self.knowledge):
            problems.add(error((*path, key), what, hint))
        problems.raise_any()
        return in_world_names(command, self.knowledge)

    def _person(self, error: _Error, name: str, path: KeyPath) -> str:
        """World's own name for a person, or `ANYBODY`."""
        known = self.knowledge.somebody(ANYBODY if name.strip().lower() == "anybody" else name)
        if known is None:
            hint = suggestion(name, ("anybody", *self.knowledge.people))
            raise error(path, f"unknown person '{name[:60]}'", hint)
        return known

    def _door(self, error: _Error, rooms: tuple[str, ...], path: KeyPath) -> tuple[str, str]:
        """Rooms that a door joins, in the order of the knowledge file."""
        facts, named = self.knowledge, list[str]()
        for n, room in enumerate(rooms):
            known = facts.place(room)
            if known not in facts.rooms:
                raise error((*path, n), f"unknown room '{room}'", suggestion(room, facts.rooms))
            named.append(known)
        doors = [door.between for door in facts.doors if set(named) <= set(door.between)]
        if len(doors) == 1:
            return doors[0]
        rooms_text = " and ".join(named)
        if doors:
            raise error(path, f"there are {len(doors)} doors of {rooms_text}", "name the two rooms that it joins")
        all_doors = listing(" and ".join(door.between) for door in facts.doors)
        hint = f"known are the doors of {all_doors}" if facts.doors else "add it under 'doors' in the knowledge file"
        raise error(path, f"no door of {rooms_text} is known", hint)

    def _meaning(self, error: _Error, path: KeyPath, sentence: str) -> Understanding:
        """Understands a sentence once, even if it occurs several times. Raises InputError when it is not understood."""
        from executive.language.understand import Status, ask_until_clear, understand

        if sentence not in self.understood:
            meaning = partial(
                understand,
                parser=self.parser,
                knowledge=self.knowledge,
                require_wake=False,
                robot_name=self.robot_name,
                correct=False,
            )
            self.understood[sentence] = ask_until_clear(sentence, meaning, self.answer)
        meant = self.understood[sentence]
        if meant.status is not Status.OK:
            open_question = meant.status is Status.QUESTION
            hint = "say which" if open_question else "say it in other words, or write take, to, do and object"
            raise error(path, (meant.reason or _NOT_UNDERSTOOD)[:REASON_LETTERS], hint)
        return meant

    def _rounds(self, scope: _Scope, step: ForEach) -> Steps:
        """Builds one group of steps for each value of a `for_each`. Raises InputError with the errors of all rounds."""
        place, name = step.place, step.loop.name
        assert place is not None and name is not None
        made = []
        for value in self._round_values(step):
            document = round_source(place.document, (*place.path, "steps"), step.steps, name, value)
            steps = validate(_Round, document).steps
            locate(steps, document, ("steps",))
            made.append(_group(Group.model_construct().with_place(place), self._steps(scope, steps), str(value)))
        return tuple(made)

    def _round_values(self, step: ForEach) -> Sequence[Value]:
        """Values for the rounds. Raises InputError when there are none or too many, or one is not a plain value."""
        at, listed = ("repeat", "for_each"), step.loop.for_each
        if isinstance(listed, str):
            values = list[Value](self._known_values(step.error, listed, at))
        else:
            values = list(listed or ())
            wrong = next((n for n, value in enumerate(values) if not isinstance(value, str | bool | int | float)), None)
            if wrong is not None:
                raise step.error((*at, wrong), "no plain value", "list texts, numbers, or true and false")
        if not 0 < len(values) <= MOST_ROUNDS:
            said = "there is nothing to go through" if not values else f"{len(values)} values are too many"
            raise step.error(at, said, f"list up to {MOST_ROUNDS} values")
        return values

    def _known_values(self, error: _Error, of: str, path: KeyPath) -> tuple[str, ...]:
        """Rooms, named poses, people or surfaces in a world, or only the people, poses or surfaces in one room."""
        facts, (kind, _, room) = self.knowledge, of.partition(" in ")
        if kind not in ("rooms", "poses", "people", "surfaces") or (kind == "rooms" and room):
            hint = "write a list, or one of rooms, poses, people and surfaces, or 'poses in ROOM' and the like"
            raise error(path, f"'{of[:60]}' is no list", hint)
        place = facts.place(room.removeprefix("the ")) if room else None
        if room and place is None:
            raise error(path, f"unknown place '{room[:60]}'", suggestion(room, facts.place_names()))
        if kind == "rooms":
            return tuple(facts.rooms)
        if kind == "poses":
            return tuple(name for name in facts.poses if place is None or facts.room(name) == facts.room(place))
        if kind == "surfaces":
            return tuple(facts.surfaces) if place is None else facts.surfaces_in(place)
        inside = {place, facts.room(place)} if place is not None else set()
        people = facts.people.items()
        return tuple(name for name, who in people if place is None or inside & {who.at, facts.room(who.at)})

    def _refuse_unknown(self, file: Mission, name: str, parameter: Parameter) -> None:
        """Refuses a parameter with a default that is no place, object or person in the world."""
        known = {
            "place": (self.knowledge.place, self.knowledge.place_names()),
            "object": (self.knowledge.object_name, self.knowledge.object_names()),
            "person": (self.knowledge.person, tuple(self.knowledge.people)),
        }
        if parameter.type in known:
            find, names = known[parameter.type]
            said = str(parameter.default)
            if said != START and find(said) is None:
                what = f"parameter '{name}': unknown {parameter.type} '{said[:60]}'"
                hint = suggestion(said, self.knowledge.spellings(names), shown=names)
                raise file.error(("parameters", name), what, hint)

    def _used(self, scope: _Scope, step: UseMission) -> Mission:
        """Resolves the mission in the file that a step uses."""
        used_path, chain = _found(scope, step), scope.chain
        if used_path.resolve() in chain:
            names = [one.name for one in (*chain[chain.index(used_path.resolve()) :], used_path)]
            what = f"the files use each other in a circle: {' -> '.join(names)}"
            raise step.error(("use",), what, "break the circle")
        if len(chain) >= MAX_DEPTH:
            what = f"more than {MAX_DEPTH} files use each other in a row"
            raise step.error(("use",), what, "merge some of the files")
        try:
            used = load_mission(used_path, step.values or {})
            _refuse_top_keys(used, scope.file)
            return self.mission(used, (*chain, used_path.resolve()))
        except InputError as error:
            raise step.within(("use",), error) from error


def _group(step: Step, steps: Steps, name: str) -> Group:
    """Builds a group that replaces a step and keeps its policy; any text may be the group's name."""
    policy = {key: getattr(step, key) for key in Policy.model_fields}
    return Group.model_construct(steps=steps, name=name, **policy).with_place(step.place)


def _refuse_decided(error: _Error, expression: str | Expression, path: KeyPath) -> None:
    """Refuses an expression that cannot be parsed, or a comparison that a reading's range decides."""
    try:
        read = Expression(expression) if isinstance(expression, str) else expression
        refuse_certain_comparisons(read, RANGES)
    except ExpressionError as fault:
        raise error(path, fault.message, fault.hint) from fault


def _found(scope: _Scope, step: UseMission) -> Path:
    """Finds the file that a step uses, relative to the file that contains the step.

    Raises InputError when there is no such file, or it lies outside the folder of the first file.
    """
    use, found = step.use, scope.folder / step.use
    home = scope.chain[0].parent if scope.chain else scope.folder.resolve()
    if not found.resolve().is_relative_to(home):
        hint = f"put it into {home.name or home} or a folder in it"
        raise step.error(("use",), f"'{use[:60]}' leaves the folder of the mission", hint)
    if is_file(found):
        return found
    beside = sorted(one.name for one in scope.folder.glob("*.yaml"))
    near = difflib.get_close_matches(use, beside, n=1)
    hint = f"did you mean '{near[0]}'?" if near else "give its path from this file's folder"
    raise step.error(("use",), f"there is no mission file '{use[:60]}'", hint)


def _refuse_top_keys(used: Mission, user: Mission) -> None:
    """Refuses keys that apply to a whole run in a used file, unless the using file has the same value."""
    for key in _ONLY_AT_THE_TOP:
        said = getattr(used, key)
        if key in used.model_fields_set and said is not None and said != getattr(user, key):
            hint = "remove it there, or say the same in both"
            raise used.error((key,), f"'{key}' of a file that is used cannot differ from that of its user", hint)
