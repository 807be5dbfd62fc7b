"""Assigns roles in a clause: the object of its verb, source, goal and recipient; relations first get their nouns."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Final

from executive.language.items import Adverb, Being, Chunk, Item, Outside, Separator, Unknown, Verb, Whether
from executive.language.lexicon import PrepositionRole, VerbKind, lexicon, read_table, word_list
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase, SpokenRelation
from executive.language.tokens import Token
from skills.relations import ROWS, RelationKind


@dataclass(frozen=True)
class Location:
    """Place or person as spoken.

    `preposition` precedes the location; `within` is a larger place around it ("the table in the kitchen"), or the place
    where a person is. `phrase` is None for HERE and THERE.
    """

    phrase: Phrase | None
    preposition: str = ""
    within: Location | None = None

    @property
    def person(self) -> bool:
        """Returns whether the location is a person."""
        return self.phrase is not None and self.phrase.person

    @property
    def living(self) -> bool:
        """Returns whether the location is a person, by profession too, or an animal: "him" and "her" can mean them."""
        return self.phrase is not None and self.phrase.living

    @property
    def kind(self) -> NounKind | None:
        """Kind of the place, or PERSON."""
        return None if self.phrase is None else self.phrase.kind

    @property
    def role(self) -> PrepositionRole | None:
        """Role that the preposition gives to the place."""
        return lexicon().prepositions.get(tuple(self.preposition.split()))

    @property
    def every_room(self) -> bool:
        """Returns whether the location means all rooms."""
        return self.phrase is not None and self.phrase.universal and self.phrase.singular == "room"

    @property
    def around(self) -> tuple[Location, ...]:
        """This place and the larger places around it."""
        return (self,) if self.within is None else (self, *self.within.around)

    @property
    def name(self) -> str:
        """Words for the place itself, without articles; "start" for HERE."""
        return "start" if self.phrase is None else self.phrase.text

    @property
    def text(self) -> str:
        """Words for the place, with the larger place around it."""
        if self.within is None:
            return self.name
        return " ".join(filter(None, (self.name, self.within.preposition, self.within.text)))


_JOINTS: Final = frozenset({",", ";", "and", "or", "then", "also", "plus", "second", "but"})
_CLOSER: Final = (PrepositionRole.AT, PrepositionRole.BESIDE)
_LISTING: Final = frozenset({",", ""})
HERE: Final = Location(None)
THERE: Final = Location(None, preposition="there")


@dataclass
class Roles:
    """Items after a verb, sorted into noun phrases, places by their prepositions, and unknown words.

    `first_at` is where the person is if the first phrase without a preposition is a person; `listed` marks phrases
    joined by "and". `choices` are phrases joined by "or". `favour` marks a recipient after "for".
    """

    objects: list[Phrase] = field(default_factory=list)
    recipient: Location | None = None
    searched: Phrase | None = None
    first_at: Location | None = None
    listed: bool = False
    sources: list[Location] = field(default_factory=list)
    goals: list[Location] = field(default_factory=list)
    ats: list[Location] = field(default_factory=list)
    joined_goals: list[Location] = field(default_factory=list)
    paths: list[Location] = field(default_factory=list)
    choices: list[list[Phrase]] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)
    favour: bool = False

    def add(self, one: _Placed) -> None:
        """Adds a phrase to the role that its preposition gives, with the larger place around it."""
        phrase, role, location = one.chunk.phrase, one.chunk.role, one.location
        joined = bool(one.joint and self.goals)
        if role is None:
            self._add_bare(one)
        elif role is PrepositionRole.SOURCE:
            self.sources.append(location)
        elif role is PrepositionRole.GOAL:
            (self.joined_goals if joined else self.goals).append(location)
        elif role in _CLOSER:
            (self.joined_goals if joined or (one.joint and self.ats) else self.ats).append(location)
        elif role is PrepositionRole.PATH:
            self.paths.append(location)
        elif phrase.receiver:
            self.recipient, self.favour = location, True
        else:
            self.searched = phrase

    def _add_bare(self, one: _Placed) -> None:
        phrase = one.chunk.phrase
        self.listed = self.listed or (bool(one.joint) and bool(self.objects))
        last = self.objects[-1] if self.objects else None
        again = phrase.stands_for_one and one.joint in _LISTING and one.within is None
        if again and last is not None and not last.receiver:
            self.objects[-1] = phrase.replace_one(last)
            return
        places = self.goals or self.ats
        another = phrase.kind is NounKind.THING and bool(places and self.objects)  # the salt to the hall and the pepper
        another = another and places[-1].kind is NounKind.PLACE
        if one.joint and places and not self.sources and not another:
            self.joined_goals.append(one.location)
            return
        if one.within is not None and phrase.somebody and not self.objects:
            self.first_at = one.within
        elif one.within is not None:
            self.ats.append(one.within)
        self.objects.append(phrase)


@dataclass(frozen=True)
class _Placed:
    """Noun phrase with the "and" or "or" directly before it, and the place around it."""

    chunk: Chunk
    joint: str
    within: Location | None = None

    @property
    def location(self) -> Location:
        """Noun phrase as a location."""
        if self.chunk.phrase.speaker:
            return HERE
        return Location(self.chunk.phrase, self.chunk.preposition, self.within)


def read_roles(items: Sequence[Item], *, describes: bool, puts: bool = False) -> Roles:
    """Sorts the items after a verb into roles.

    With `describes`, "near" or "on top of" before further places identifies the object. With `puts`, "on" after "from"
    is the destination, as in "put the cup from the desk on the bed".
    """
    roles = Roles()
    spoken = list(_spoken(items, roles))
    row: list[_Placed] = []
    for one in _nested(_described(spoken) if describes else spoken, puts):
        if one.joint == "or" and row and one.chunk.role in (None, row[-1].chunk.role):
            listed = _listed_before(row)
            roles.choices.append([*listed, one.chunk.phrase])
            roles.objects = [phrase for phrase in roles.objects if phrase not in listed[1:]]
            continue
        roles.add(one)
        row.append(one)
    roles.goals += [HERE if item.here else THERE for item in items if isinstance(item, Adverb)]
    first = roles.objects[0] if roles.objects else None
    them = first is not None and (first.stands_for_somebody or first.somebody or first.living)
    receives = first is not None and len(roles.objects) > 1 and (first.person or (them and not roles.listed))
    if first is not None and (first.speaker or receives):
        roles.objects.pop(0)  # give Robin a coke, bring me a coke
        roles.recipient = HERE if first.speaker else Location(first, within=roles.first_at)
    elif roles.first_at is not None:
        roles.ats.append(roles.first_at)
    return roles


def _spoken(items: Sequence[Item], roles: Roles) -> Iterator[_Placed]:
    """Yields the noun phrases, and collects unknown words."""
    joint, relative = "", False
    before: Chunk | None = None
    for item in items:
        if isinstance(item, Chunk):
            lies = relative and before is not None and before.role is None and not before.phrase.person
            before = replace(item, role=PrepositionRole.SOURCE) if lies and item.role in _CLOSER else item
            yield _Placed(before, joint)
        elif isinstance(item, Unknown | Whether):
            roles.unknown.append(item.word if isinstance(item, Unknown) else "if")
        relates = isinstance(item, Separator) and item.word in word_list("relative")
        relative = relates or (relative and isinstance(item, Separator) and item.word == "")
        joint = "" if not isinstance(item, Separator) else item.word if item.word in _JOINTS else joint


def _described(spoken: list[_Placed]) -> list[_Placed]:
    """Splits "the object on top of the cup from the desk" into an object and a source."""
    places = [n for n, one in enumerate(spoken) if one.chunk.role not in (None, PrepositionRole.FOR)]
    if len(places) < 2 or places[0] == 0:
        return spoken
    first, second = places[:2]
    beside, named = spoken[first].chunk, spoken[first - 1].chunk
    lies = spoken[second].chunk.role is PrepositionRole.AT and beside.phrase.kind is NounKind.THING
    if beside.role is not PrepositionRole.BESIDE or named.role is not None or lies:
        return spoken
    phrase = named.phrase.with_extra(*beside.preposition.split(), beside.phrase.text)
    described = replace(spoken[first - 1], chunk=replace(named, phrase=phrase))
    return [*spoken[: first - 1], described, *spoken[first + 1 :]]


def _nested(spoken: Sequence[_Placed], puts: bool) -> Iterator[_Placed]:
    """Joins a place to the previous place if it contains that place: no "and" between, and another preposition."""
    rest = list(spoken)
    while rest:
        first = rest.pop(0)
        chain = [first.chunk]
        apart = puts and first.chunk.role is PrepositionRole.SOURCE
        while rest and not apart:
            before, chunk = chain[-1], rest[0].chunk
            place = before.placed
            place = place or (before.role in (None, PrepositionRole.FOR) and before.phrase.somebody)
            closer = chunk.role in _CLOSER and not rest[0].joint and chunk.preposition != before.preposition
            if not (place and closer):
                break
            chain.append(rest.pop(0).chunk)
        within: Location | None = None
        for chunk in reversed(chain[1:]):
            within = Location(chunk.phrase, chunk.preposition, within)
        yield replace(first, within=within)


def _listed_before(row: Sequence[_Placed]) -> list[Phrase]:
    """Phrases that an "or" after the row joins: the last phrase, and those that commas join to it."""
    first = len(row) - 1
    while first > 0 and row[first].joint in _LISTING:
        before, chunk = row[first - 1].chunk, row[first].chunk
        receives = before.phrase.speaker or before.phrase.living
        if before.role != chunk.role or (receives and not chunk.phrase.person):
            break
        first -= 1
    return [one.chunk.phrase for one in row[first:]]


_YOU: Final = Phrase((Token(0, 0, "you", "you", "PRON", "PRP", 0, "obl"),))
_ONE: Final = Token(0, 0, "one", "one", "NOUN", "NN", 0, "obj")
_THERE: Final = Phrase((Token(0, 0, "that", "that", "PRON", "DT", 0, "obl"),))
_COMPARED: Final = (RelationKind.NEAREST_TO, RelationKind.SEEN_FROM)
_GOES: Final = {VerbKind.GO, VerbKind.CHECK}
_PLACED: Final = (PrepositionRole.AT, PrepositionRole.GOAL)


@cache
def _kinds(name: str) -> Mapping[str, RelationKind]:
    """Kinds of relations by their words, from a part of the table."""
    return {words: RelationKind[kind] for kind, each in read_table("relations.yaml")[name].items() for words in each}


@cache
def prepositions(*, related: bool) -> Mapping[tuple[str, ...], PrepositionRole]:
    """All prepositions; those of relations only if they are wanted."""
    own = (*_kinds("beside"), *(f"{words} of" for words in _kinds("parts"))) if related else ()
    down = (f"down {words}" for words in own if words.startswith(("in ", "at ", "to ")))
    return {**{tuple(words.split()): PrepositionRole.BESIDE for words in (*own, *down)}, **lexicon().prepositions}


def relate(items: Iterable[Item]) -> tuple[Item, ...]:
    """Attaches relations to noun phrases; leaves those alone that describe no object and no spot."""
    row = _Row(list(items))
    while row.rest:
        row.take(row.rest.pop(0))
    return tuple(row.found)


@dataclass
class _Row:
    """Items that are left and found, and the indices of the present verb's last object and last surface."""

    rest: list[Item]
    found: list[Item] = field(default_factory=list)
    verb: Verb | Being | Outside | None = None
    named: int | None = None
    place: int | None = None

    def take(self, item: Item) -> None:
        """Takes the next item."""
        if isinstance(item, Verb | Outside):
            self.verb, self.named, self.place = item, None, None
        elif isinstance(item, Being):
            self.verb = item
        elif isinstance(item, Chunk):
            relation = self._relation(item)
            if relation is not None and self._attach(item, relation):
                return
            if item.role in (None, PrepositionRole.FOR) and not item.phrase.receiver:
                self.named, item = len(self.found), replace(item, phrase=self._ordered(item.phrase))
            elif _is_placed(item):
                self.place = len(self.found)
            elif item.role in _PLACED:
                self.named = None
        self.found.append(item)

    def _ordered(self, phrase: Phrase) -> Phrase:
        """Phrase with its order in place of "second", "biggest" or "left"; takes "on the left" behind it."""
        ordinals, behind = read_table("relations.yaml")["ordinals"], next(iter(self.rest), None)
        chosen = isinstance(self.verb, Verb) and VerbKind.PLACE not in self.verb.kinds
        numbers = [t for t in phrase.tokens if t.word in ordinals]
        orders = [t for t in phrase.tokens[:-1] if t.word in _kinds("orders")]
        side = behind.spoken if isinstance(behind, Chunk) and behind.spoken in _kinds("sides") else ""
        side = side if numbers or chosen else ""
        if len(numbers) > 1 or len(orders) + bool(side) != 1:
            return phrase
        self.rest = self.rest[bool(side) :]
        kind = _kinds("sides")[side] if side else _kinds("orders")[orders[0].word]
        nth = int(ordinals[numbers[0].word]) if numbers else 1
        before = tuple(t for t in phrase.tokens if t in (*numbers, *orders))
        one = (replace(_ONE, index=phrase.head.index),) if phrase.head in numbers else ()
        relation = SpokenRelation(kind, side, () if kind in ROWS else (_YOU,), nth, before)
        return replace(phrase, tokens=(*phrase.tokens[: -1 if one else None], *one)).with_relation(relation)

    def _relation(self, item: Chunk) -> SpokenRelation | None:
        """Relation in a noun phrase with its preposition; takes the second landmark of "between"."""
        words, parts, bare = item.preposition.removeprefix("down "), _kinds("parts"), item.spoken.lower()
        beside, part = _kinds("beside").get(words), words.removesuffix(" of")
        if bare in parts or (part in parts and (beside is None or item.phrase.kind is NounKind.PLACE)):
            said = bare if bare in parts else part
            return SpokenRelation(parts[said], said)
        if beside is None or (item.phrase.receiver and beside not in _COMPARED):
            return None
        joint, other = (*self.rest, None, None)[:2]
        if beside is not RelationKind.BETWEEN:
            return SpokenRelation(beside, item.spoken, (item.phrase,))
        if not isinstance(other, Chunk) or getattr(joint, "word", "") != "and":
            both = item.phrase.count in (0, 2)  # between the two beers
            return SpokenRelation(beside, item.spoken, (item.phrase, item.phrase)) if both else None
        self.rest = self.rest[2:]
        return SpokenRelation(beside, f"{item.spoken} and {other.spoken}", (item.phrase, other.phrase))

    def _attach(self, item: Chunk, relation: SpokenRelation) -> bool:
        """Attaches a relation to the object, or to the surface; returns whether it belongs to one of them."""
        verb, own = self.verb, not relation.landmarks and item.spoken.lower() not in _kinds("parts")
        kinds = verb.kinds if isinstance(verb, Verb) else {VerbKind.FIND} if isinstance(verb, Being) else _GOES
        if kinds <= _GOES:
            return False
        surface, last, behind = replace(item, preposition="on", role=PrepositionRole.AT), self.found[-1], self.rest[:1]
        apart = isinstance(last, Separator) and last.word in word_list("relative")
        aims = [id(one) for one in (*self.found, *self.rest) if _is_aim(one)]
        lacks = isinstance(verb, Verb) and verb.text in word_list("at_is_goal") and not (aims or apart)
        if lacks and VerbKind.ROUND_TRIP in kinds:
            return False  # it could say which one, or where to
        aimed = self.place is not None and id(self.found[self.place]) in aims
        is_spot = self.named is not None and (lacks or aimed or (VerbKind.PLACE in kinds and not apart))
        if is_spot and (own or self.place is None):
            placed = [one for one in behind if isinstance(one, Chunk) and _is_placed(one)]
            named = surface if own or relation.landmarks else replace(surface, phrase=_THERE)
            place = named if own or not placed else placed[0]
            self.rest[: place is not named] = [replace(place, phrase=place.phrase.with_relation(relation))]
            return True
        at = self.place if is_spot else self.named
        chunk = None if at is None else self.found[at]
        if at is None or not isinstance(chunk, Chunk) or not (is_spot or own or relation.landmarks):
            return False
        self.found[at] = replace(chunk, phrase=chunk.phrase.with_relation(relation))
        self.found = self.found[: len(self.found) - apart]
        self.rest[:0] = [surface] if own else []
        return True


def _is_aim(item: Item) -> bool:
    """Returns whether a noun phrase says whereto, or to whom."""
    if not isinstance(item, Chunk):
        return False
    return item.role is PrepositionRole.GOAL or (item.phrase.receiver and item.role in (None, PrepositionRole.FOR))


def _is_placed(item: Chunk) -> bool:
    """Returns whether a noun phrase is a place of objects, or one to put them."""
    return item.role in _PLACED and not item.phrase.receiver
