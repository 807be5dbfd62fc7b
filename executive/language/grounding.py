"""Grounds spoken names in the names of the world, and open places in their defaults.

A name is looked up as spoken, then by its synonyms, then by its noun alone; ambiguous and similar ones make a question.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, pairwise
from typing import Final

from executive.language.command_frames import CommandFrame
from executive.language.indirect import CONTENTS
from executive.language.lexicon import read_table, word_list
from executive.language.limits import check_relation, relation_refusal
from executive.language.nouns import NounKind
from executive.language.parser import DependencyParser
from executive.language.phrases import Phrase, SpokenRelation
from executive.language.questions import (
    ClarifyingQuestion,
    RefusalError,
    Slot,
    abilities,
    perhaps_question,
    which_question,
)
from executive.language.roles import HERE, Location
from executive.language.spelling import look_alikes, synonyms_for, synonyms_of
from executive.words.command import Command
from executive.words.knowledge import ANYBODY, ANYTHING, EVERYTHING, Knowledge, except_for, split_exceptions
from executive.words.task import Task, basic
from skills.api import ObjectKind
from skills.class_forms import NON, known_attributes
from skills.inputs.errors import known_names, listing
from skills.relations import DOOR, ORDERS, ROBOT, Landmark, Relation, RelationKind


def known_line(knowledge: Knowledge | None) -> str:
    """Abilities of the robot and known names, in one line."""
    if knowledge is None:
        return abilities()
    objects, places = listing(knowledge.object_names()), listing(knowledge.place_names())
    return f"{abilities()}; known objects: {objects}; known places: {places}"


def ground(
    frames: Sequence[CommandFrame], knowledge: Knowledge, parser: DependencyParser
) -> tuple[tuple[Command, ...], tuple[str, ...]]:
    """Converts frames to commands in the world's own names, with default places, and notes on names taken for others.

    Raises RefusalError when an object, place or person is unknown or ambiguous; with a question if that helps.
    """
    grounder = _Grounder(knowledge, parser)
    commands = [command for frame in grounder.needed_there(frames) for command in grounder.commands(frame)]
    return tuple(_one_by_one(commands, knowledge)), tuple(dict.fromkeys(grounder.notes))


def _one_by_one(commands: Sequence[Command], knowledge: Knowledge) -> Iterator[Command]:
    """Yields the commands; several objects for a person are fetched and handed over one by one."""
    match commands:
        case [Command(takes=True, object_count=count) as gets, Command(goal=str(to)) as brings, *rest] if (
            count > 1 and brings.item == gets.object and (to == HERE.name or knowledge.person(to) is not None)
        ):
            yield from (replace(gets, object_count=1), replace(brings, item_count=1)) * count
            yield from _one_by_one(rest, knowledge)
        case [command, *rest]:
            yield command
            yield from _one_by_one(rest, knowledge)


def leave_out(unwanted: Sequence[Phrase], commands: Sequence[Command], knowledge: Knowledge) -> tuple[Command, ...]:
    """Leaves unwanted classes out of the categories that commands take, and unwanted rooms out of visits to each room.

    Raises RefusalError for an object that is told by more than its class, and for an unknown place.
    """
    for phrase in unwanted:
        names = [*filter(None, (knowledge.object_name(form) for _, form in _readings(phrase)))]
        rest = partial(_without, knowledge, phrase, names)
        commands = [replace(one, item=rest(one.item), object=rest(one.object)) for one in commands]
        visits = [one for one in commands if one.item is None and one.task is None and one.goal in knowledge.rooms]
        if phrase.kind is NounKind.PLACE and len(visits) > 1 and not names:
            if (room := knowledge.place(phrase.text)) not in knowledge.rooms:
                raise RefusalError(f"I know no room {phrase.text!r} to leave out", [phrase.text])
            commands = [one for one in commands if one not in visits or one.goal != room]
    return tuple(commands)


def _without(world: Knowledge, unwanted: Phrase, names: Sequence[str], kind: ObjectKind | None) -> ObjectKind | None:
    """Leaves the classes with the names of an unwanted phrase out of a kind of object."""
    kinds = {one for name in names for one in world.classes(name)}
    if kind is None or kind.attributes or kinds.isdisjoint(world.classes(kind.name)):
        return kind
    kept, *others = split_exceptions(kind.name)
    rest = except_for(kept, *dict.fromkeys((*others, names[0])))
    told = max((attributes for attributes, _ in _readings(unwanted)), key=len, default=())
    non = tuple(f"{NON}{colour}" for colour in told)
    named = kept not in (ANYTHING, EVERYTHING) and not unwanted.relations
    if named and len(told) == 1 and {*non} <= known_attributes():
        return replace(kind, attributes=non)
    if told or not named or not world.classes(rest):
        raise RefusalError(f"I cannot follow the exclusion of '{unwanted.spoken}'; name a kind", [unwanted.spoken])
    return replace(kind, name=rest)


@dataclass
class _Grounder:
    """Grounds names in one world; collects notes on names that were interpreted as others."""

    knowledge: Knowledge
    parser: DependencyParser
    notes: list[str] = field(default_factory=list)

    def needed_there(self, frames: Sequence[CommandFrame]) -> tuple[CommandFrame, ...]:
        """If an object is fetched from a room without surfaces, brings it to that room instead."""
        found = list(frames)
        for k, (takes, brings) in enumerate(pairwise(frames)):
            place, fetched = takes.goal, takes.takes and brings.item == takes.object
            if fetched and place is not None and place.preposition in ("in", "at", "inside") and brings.goal == HERE:
                name = self.knowledge.place(place.name)
                if name is not None and not self.knowledge.surfaces_in(name):
                    self.notes.append(f"I bring it to the {name}: nothing can be taken from there")
                    there = replace(place, preposition="to")
                    found[k : k + 2] = [replace(takes, goal=None), replace(brings, goal=there)]
        return tuple(found)

    def commands(self, frame: CommandFrame) -> Iterator[Command]:
        """Converts one frame to a command, or to one for each room."""
        match frame:
            case CommandFrame(item=None, task=None, goal=Location(every_room=True, within=None)):
                yield from (Command(goal=room, verb=frame.verb) for room in self.knowledge.rooms)
            case CommandFrame(verb=verb) if verb in word_list("stacks"):
                raise RefusalError("I put objects side by side, and stack none", [verb])
            case CommandFrame(item=None, task=None, goal=Location(name=name)) if (
                name.lower() == _HOME and self.knowledge.place(_HOME) is None
            ):
                dock = self.knowledge.dock
                self.notes.append(f"I take 'home' to be {'the dock' if dock else 'here'}")
                home = Command(task=basic().charge) if dock else Command(goal=HERE.name)
                yield replace(home, verb=frame.verb)
            case _:
                yield self._command(frame)

    def _command(self, frame: CommandFrame) -> Command:
        item = None if frame.item is None else self.taken(frame.item)
        target = None if frame.object is None else self.target(frame.object, frame.task)
        for kind in filter(None, (item, target)):
            self._check_seen(kind)
        place, spot = self._spot(frame.goal)
        goal, goal_at = (None, None) if place is None else self._supported_goal(frame, place, target)
        if target is not None:
            target, goal = self._target_there(frame, target, goal)
        counts = _count(frame.item, item), _count(frame.object, target)
        try:
            return Command(item, goal, goal_at, frame.task, target, *counts, frame.verb, spot)
        except ValueError as error:  # two relations of one kind
            raise RefusalError(str(error)) from error

    def _target_there(self, frame: CommandFrame, target: ObjectKind, goal: str | None) -> tuple[ObjectKind, str | None]:
        """Object of a task with its relations, and its default place if none is given."""
        if goal is None and target.name == EVERYTHING:
            raise RefusalError("everything from where? Name the surface or the room", [target.name])
        counts = frame.object is not None and not (frame.object.count or frame.object.relations)
        if goal is None and (frame.takes or (frame.looks and not counts)):  # a count is of the whole building
            goal = self.knowledge.default_place(frame.task, target.name)
        target = self._described(frame, target, goal)
        if target.name == ANYTHING and (not frame.looks or frame.goal is None):
            raise RefusalError(f"which object? Known are {listing(self.knowledge.object_names())}", [target.name])
        surfaces = self.knowledge.surfaces_in
        apart = (each.landmarks[0].name for each in target.relations if each.kind is RelationKind.NOT_AT)
        usual = frame.goal is None and goal is not None and any({*surfaces(goal)} <= {*surfaces(one)} for one in apart)
        return target, None if usual else goal

    def _check_seen(self, kind: ObjectKind | Landmark) -> None:
        """Raises RefusalError for attributes that the robot cannot see."""
        if unseen := [word for word in kind.attributes if word not in known_attributes()]:
            what = f"I cannot see which {kind.name} is {listing(map(repr, unseen))}"
            raise RefusalError(f"{what}; I tell objects apart by colour, and big from small", unseen)

    def _described(self, frame: CommandFrame, target: ObjectKind, place: str | None) -> ObjectKind:
        """Object with the relations that say which one at a place is meant. Raises RefusalError for impossible ones."""
        phrase = frame.object
        if phrase is None or not (frame.takes or frame.looks) or not phrase.relations:
            return target
        said, relations = phrase.relations[0].said, self._relations(phrase, "look")
        if self.knowledge.somebody(target.name) or target.name in (ANYTHING, EVERYTHING):
            raise RefusalError(f"I cannot tell who or what is '{said}'; name one kind of object", [said])
        orders = [each for each in relations if each.kind in ORDERS]
        several = phrase.count == 0 or (phrase.count != 1 and any(each.nth > 1 for each in orders))
        if orders and (several or frame.verb == "be"):
            raise RefusalError(f"I take or find the one '{said}'; I cannot tell how many, or whether one is", [said])
        self._check_door(relations, None if place is None else self.knowledge.room(place))
        return replace(target, relations=relations)

    def _check_door(self, relations: Iterable[Relation], room: str | None) -> None:
        """Raises RefusalError for the door of a room that has several doors, or none."""
        doors = sum(room in door.between for door in self.knowledge.doors)
        if doors != 1 and any(one.name == DOOR for each in relations for one in each.landmarks):
            raise RefusalError(f"I cannot tell which door is meant: the {room or 'place'} has {doors}", [DOOR])

    def _relations(self, phrase: Phrase, act: str) -> tuple[Relation, ...]:
        """Relations of an object or a spot. Raises RefusalError for a landmark that a relation cannot have."""
        said = phrase.relations
        if all(each.kind is RelationKind.SEEN_FROM for each in said):
            raise relation_refusal(act, "", said[0].said)
        return tuple(Relation(e.kind, tuple(self._landmark(p, e, act) for p in e.landmarks), e.nth) for e in said)

    def _landmark(self, phrase: Phrase, said: SpokenRelation, act: str) -> Landmark:
        place, looks = self.knowledge.place(phrase.text), act == "look"
        known = place or self.knowledge.person(phrase.text)
        named = known or {**dict.fromkeys(read_table("relations.yaml")["doors"], DOOR), "you": ROBOT}.get(phrase.text)
        apart = (looks and place is not None) or None  # or not at an object
        special = {RelationKind.SEEN_FROM: known in self.knowledge.people, RelationKind.NOT_AT: apart}
        fits = looks if said.kind in ORDERS else special.get(said.kind)
        if fits and named:
            return Landmark(named)
        other = known or phrase.speaker or phrase.somebody or phrase.addressed or phrase.pronoun
        if other or fits is False or (phrase.count != 1 and said.kind is not RelationKind.BETWEEN):
            raise relation_refusal(act, "", said.said)
        kind = self.object_kind(phrase)
        self._check_seen(kind)
        return Landmark(kind.name, kind.attributes)

    def _spot(self, goal: Location | None) -> tuple[Location | None, tuple[Relation, ...]]:
        """Surface of a spot, by what stands there if it is not named, and relations on it. Raises RefusalError."""
        if goal is None or goal.phrase is None or not goal.phrase.relations:
            return goal, ()
        said, bare = goal.phrase.relations[0], replace(goal.phrase, relations=())
        relations, there = self._relations(goal.phrase, "bring"), replace(goal, phrase=bare, preposition="on")
        beside = bare in said.landmarks
        around = self.place(there) if not beside else goal.within and self.place(goal.within)
        if not beside and around in self.knowledge.surfaces:
            return there, relations
        if not said.landmarks:
            raise relation_refusal("bring", f"{said.said} of", bare.spoken)
        usual = self.knowledge.usual_surfaces(relations[0].landmarks[0].name)
        names = [name for name in usual if around in (None, name, self.knowledge.room(name))]
        if len(names) != 1:
            where = tuple(f"on the {name}" for name in names)
            what = f"On which surface is '{said.said}': {listing(where or ('name it',), last='or')}?"
            raise _asking(ClarifyingQuestion(what, Slot.GOAL, where, next(iter(where), None)))
        self.notes.append(f"I take '{said.said}' to be on the {names[0]}")
        return Location(Phrase((replace(bare.head, text=names[0], lemma=names[0], known=True),)), "on"), relations

    def target(self, phrase: Phrase, task: Task | None) -> ObjectKind:
        """Object of a task: a known object or person, or a duration."""
        if task == basic().wait:
            return ObjectKind(phrase.head.lemma)
        if task is None or not task.looks:
            return self.taken(phrase)
        person = self._sought(phrase)
        return ObjectKind(person) if person else self.object_kind(phrase)

    def taken(self, phrase: Phrase) -> ObjectKind:
        """Known class or category that a phrase names; "all the objects" means everything."""
        kind = self.object_kind(phrase)
        return replace(kind, name=EVERYTHING) if kind.name == ANYTHING and phrase.count == 0 else kind

    def _sought(self, phrase: Phrase) -> str | None:
        """Person to look for, or anybody; None for an object. Raises RefusalError for one whom it cannot tell."""
        person = self.knowledge.person(phrase.text)
        if person is not None and len(self.knowledge.people) > 1:
            others = listing((name for name in self.knowledge.people if name != person), last="or")
            raise RefusalError(f"I know nobody by face, and cannot tell {person} from {others}", [phrase.text])
        if person is not None:
            return person
        if len(phrase.content) == 1 and not phrase.extra and phrase.head.word in word_list("any_person"):
            return ANYBODY
        if phrase.named_person:
            raise self._unknown(Slot.PERSON, (phrase.text,), self._known(self.knowledge.people))
        if (phrase.somebody or phrase.stands_for_somebody) and self.knowledge.object_name(phrase.text) is None:
            what = f"I see whether anybody is there, but not whether it is {phrase.spoken!r}"
            raise RefusalError(what, [phrase.text])
        return None

    def _supported_goal(
        self, frame: CommandFrame, place: Location, target: ObjectKind | None
    ) -> tuple[str, str | None]:
        """Goal of a frame, if the command supports the preposition; for a person also the place."""
        looks = frame.takes or frame.looks
        if looks and place == HERE:
            raise RefusalError("I take and find objects on surfaces, and people in rooms: name a place", [HERE.name])
        act = "look" if looks else "go" if frame.item is None else "bring"
        check_relation(act, ("room", "surface", "person"), place)
        goal, goal_at = self._goal(place)
        room, surface = goal in self.knowledge.rooms, goal in self.knowledge.surfaces
        if frame.object == CONTENTS and room:
            what = f"I cannot tell whether all of the {goal} is empty; ask whether anybody is in it, or what is in it"
            raise RefusalError(what, [place.text])
        if target is not None and frame.looks and surface and self.knowledge.somebody(target.name):
            raise RefusalError(f"I look for people in rooms, and the {goal} is none", [goal])
        kind = "room" if room else "surface" if surface or goal in self.knowledge.poses else "person"
        check_relation(act, [kind], place)
        return goal, goal_at

    def _goal(self, location: Location) -> tuple[str, str | None]:
        """Place that a location means, or a known person with the place where the person is."""
        phrase, within = location.phrase, location.within
        person = None if phrase is None else self.knowledge.person(phrase.text)
        if location == HERE or person is not None:
            return person or HERE.name, None if within is None else self.place(within)
        if phrase is None or not phrase.person or self.knowledge.place(phrase.text) is not None:
            return self.place(location), None
        if self.knowledge.people and not phrase.named_person:
            raise _asking(which_question(Slot.PERSON, phrase.text, tuple(self.knowledge.people)))
        raise self._unknown(Slot.PERSON, (phrase.text,), self._known(self.knowledge.people))

    def object_kind(self, phrase: Phrase) -> ObjectKind:
        """Known class or category that a phrase names, with the adjectives before it."""
        known = self._known(self.knowledge.object_names())
        for attributes, form in _readings(phrase):
            if (name := self.knowledge.object_name(form)) is not None:
                return ObjectKind(name, attributes)
            if candidates := synonyms_of(form, known):
                return ObjectKind(self._only(candidates, Slot.THING, form), attributes)
        for attributes, form in _readings(phrase):  # "bottle" for "water bottle"
            ending = (name for spelling, name in known.items() if spelling.endswith(f" {form.lower()}"))
            if candidates := tuple(dict.fromkeys(ending)):
                return ObjectKind(self._only(candidates, Slot.THING, form), attributes)
        raise self._unknown(Slot.THING, (phrase.text, phrase.singular), known)

    def place(self, location: Location) -> str:
        """Known place that a location names. Among surfaces with the same noun ("table"), the room around decides."""
        phrase = location.phrase
        if phrase is None:
            raise RefusalError(f"which place is {location.preposition!r}?", [location.preposition], question=True)
        if phrase.said_count not in (None, 1) or location.every_room:
            raise RefusalError(f"I go to one place at a time, not to {phrase.spoken!r}", [phrase.spoken])
        known = self._known(self.knowledge.place_names())
        room = self._room(phrase, location.within, known)
        candidates = (name for name in self._places(phrase, room, known) if not self._left_over(phrase, name))
        inside = [name for name in candidates if room in (None, name, self.knowledge.room(name))]
        return self._only(inside or self._bins(phrase, room, known), Slot.PLACE, Phrase(phrase.tokens).text)

    def _bins(self, phrase: Phrase, room: str | None, known: Mapping[str, str]) -> Sequence[str]:
        """Bins in a room that "bin" can mean. Raises RefusalError for other words."""
        exact = self.knowledge.place(phrase.text)
        if exact is not None and room is not None:
            own = self.knowledge.room(exact)
            where = f"the {exact} is not {'in' if room in self.knowledge.places else 'on'} the {room}"
            raise RefusalError(where if own == exact else f"{where}, but in the {own}", [phrase.text])
        if phrase.singular not in (_BIN, *synonyms_for(_BIN)):
            raise self._unknown(Slot.PLACE, (phrase.text, phrase.singular), known)
        if bins := [name for name in self.knowledge.bins if room in (None, self.knowledge.room(name))]:
            return bins
        raise RefusalError("there is no bin here that I know of", [phrase.text])

    def _room(self, phrase: Phrase, within: Location | None, known: Mapping[str, str]) -> str | None:
        """Room that is named besides the place ("in the kitchen", "of the kitchen", "bedroom table")."""
        of = " ".join(phrase.extra[1:]) if phrase.extra[:1] == ("of",) else None
        around = of if within is None else within.text
        if around is None:
            return next(filter(None, (self.knowledge.place(token.text) for token in phrase.tokens[:-1])), None)
        found = self.knowledge.place(around) or next(iter(synonyms_of(around, known)), None)
        if found is None:
            raise self._unknown(Slot.PLACE, (around,), known)
        return found

    def _places(self, phrase: Phrase, room: str | None, known: Mapping[str, str]) -> Sequence[str]:
        """Places with exactly this name, or else with this noun; if a room is given, also places with a synonym."""
        groups = {"room": tuple(self.knowledge.rooms), "surface": tuple(self.knowledge.surfaces)}
        any_place = groups.get(phrase.head.lemma)  # "the room", "a surface"
        if any_place and len(phrase.content) == 1 and self.knowledge.place(phrase.text) is None:
            return any_place
        bare = Phrase(phrase.tokens)
        forms = (phrase.text, bare.text, bare.singular)
        if exact := [*filter(None, map(self.knowledge.place, forms))]:
            return exact[:1]
        if synonyms := dict.fromkeys(chain(*(synonyms_of(form, known) for form in forms))):
            self._note(bare.text, *synonyms)
            return [*synonyms]
        nouns = {phrase.head.word, phrase.head.lemma}
        own = [name for name in self.knowledge.place_names() if _last(name) in nouns]
        other = [name for spelling, name in known.items() if _last(spelling) in nouns]
        called = (name for spelling, name in known.items() if nouns & {*map(_last, synonyms_for(spelling))})
        return [*dict.fromkeys((own or other) if room is None else [*own, *other, *called])]

    def _left_over(self, phrase: Phrase, name: str) -> bool:
        """Returns whether words remain that belong neither to the place's name nor to its room's ("kitchen 3")."""
        extra = () if phrase.extra[:1] == ("of",) else phrase.extra
        said = {word for part in (*(t.word for t in phrase.content[:-1]), *extra) for word in part.lower().split()}
        spellings = self.knowledge.spellings([name, self.knowledge.room(name)])
        known = (other for spelling in spellings for other in (spelling, *synonyms_for(spelling)))
        return not said <= {word.lower() for other in known for word in other.split()}

    def _only(self, candidates: Sequence[str], slot: Slot, heard: str) -> str:
        """Single candidate. Raises RefusalError with a question if there are several."""
        if len(candidates) > 1:
            raise _asking(which_question(slot, heard, tuple(candidates)))
        if slot is not Slot.PLACE:
            self._note(heard, candidates[0])
        return candidates[0]

    def _note(self, heard: str, *names: str) -> None:
        self.notes += [f"I take '{heard}' to be {name}" for name in names if heard.lower() != name.lower()]

    def _known(self, names: Iterable[str]) -> Mapping[str, str]:
        """Names by each of their spellings, in lower case."""
        return {word.lower(): name for name in names for word in self.knowledge.spellings([name])}

    def _unknown(self, slot: Slot, forms: Sequence[str], known: Mapping[str, str]) -> RefusalError:
        """Error with a question about names of similar spelling, sound or meaning; without such names, a refusal."""
        heard = forms[0]
        ends = (name for form in forms for spelling, name in known.items() if spelling == _last(form))
        near = (name for form in forms for name in look_alikes(form, known, self.parser))
        candidates = tuple(name for name in dict.fromkeys([*ends, *near]) if name.lower() not in map(str.lower, forms))
        if candidates:
            return _asking(perhaps_question(slot, heard, candidates))
        return RefusalError(f"I know no {slot.noun} {heard!r}; {known_names(heard, known.values())}", [heard])


def _count(phrase: Phrase | None, kind: ObjectKind | None) -> int:
    """Number of objects; "everything" counts as one."""
    return 1 if phrase is None or kind is None or kind.name == EVERYTHING else phrase.count


def _asking(question: ClarifyingQuestion) -> RefusalError:
    return RefusalError(question.text, (question.heard,) if question.heard else (), question=question)


def _readings(phrase: Phrase) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yields splits of a phrase into adjectives and a name: the longest name first, as spoken and in the singular."""
    *left, head = phrase.tokens
    words = [t for t in left if t.text in phrase.text.split()]
    for first in range(len(words) + 1):
        attributes, name = words[:first], [t.text for t in words[first:]]
        if all(t.adjective for t in attributes):
            for form in dict.fromkeys((head.word, head.lemma)):
                yield tuple(t.word for t in attributes), " ".join([*name, form, *phrase.extra])


def _last(name: str) -> str:
    return name.split()[-1].lower()


_BIN: Final = "bin"
_HOME: Final = "home"
