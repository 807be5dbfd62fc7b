"""Assigns roles in a clause: the object of its verb, source, goal and recipient; relations first get their nouns."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Final

from executive.language.items import Adverb, Being, Chunk, Item, Outside, Separator, Unknown, Verb, Whether, chunks
from executive.language.lexicon import PrepositionRole, VerbKind, lexicon, read_table, word_list
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase, SpokenRelation
from executive.language.tokens import Token
from skills.relations import ROWS, RelationKind


@dataclass(frozen=True)
class Location:
    """Place or person as spoken; `phrase` is None for HERE and THERE.

    `within` is a larger place around it ("the table in the kitchen"), or the place where a person is.
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
        around = () if self.within is None else (self.within.preposition, self.within.text)
        return " ".join(filter(None, (self.name, *around)))


_JOINTS: Final = frozenset({",", ";", "and", "or", "then", "also", "plus", "second", "but"})
_CLOSER: Final = (PrepositionRole.AT, PrepositionRole.BESIDE)
_LISTING: Final = frozenset({",", ""})
HERE: Final = Location(None)
THERE: Final = Location(None, preposition="there")


@dataclass
class Roles:
    """Items after a verb, sorted into noun phrases, places by their prepositions, and unknown words.

    `first_at` is where the person is if the first phrase without a preposition is one. `listed` marks phrases joined by
    "and", `choices` are those joined by "or", and `favour` marks a recipient after "for".
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
        role, phrase = one.chunk.role, one.chunk.phrase
        match role:
            case None:
                self._add_bare(one)
            case PrepositionRole.FOR if phrase.receiver:
                self.recipient, self.favour = one.location, True
            case PrepositionRole.FOR:
                self.searched = phrase
            case PrepositionRole.SOURCE | PrepositionRole.PATH:
                (self.paths if role is PrepositionRole.PATH else self.sources).append(one.location)
            case _:
                places = self.goals if role is PrepositionRole.GOAL else self.ats
                (self.joined_goals if one.joint and (self.goals or places) else places).append(one.location)

    def _add_bare(self, one: _Placed) -> None:
        phrase, last = one.chunk.phrase, self.objects[-1:]
        self.listed = self.listed or bool(one.joint and last)
        again = phrase.stands_for_one and one.joint in _LISTING and one.within is None
        if again and last and not last[0].receiver:
            self.objects[-1] = phrase.replace_one(last[0])
            return
        if one.joint and self._are_goals(phrase):
            self.joined_goals.append(one.location)
            return
        if one.within is not None and phrase.somebody and not last:
            self.first_at = one.within
        elif one.within is not None:
            self.ats.append(one.within)
        self.objects.append(phrase)

    def _are_goals(self, phrase: Phrase) -> bool:
        """Returns whether a phrase after "and" is a goal: not "the pepper" in "the salt to the hall and the pepper"."""
        match self.goals or self.ats:
            case [*_, Location(kind=NounKind.PLACE)] if phrase.kind is NounKind.THING and self.objects:
                return False
            case places:
                return bool(places) and not self.sources

    def hand_over(self) -> None:
        """Takes the recipient from the objects: "give Robin a coke", "bring me a coke"."""
        match self.objects:
            case [first, *others] if first.speaker or (others and (first.person or self._are_them(first))):
                self.objects, self.recipient = others, HERE if first.speaker else Location(first, within=self.first_at)
            case _ if self.first_at is not None:
                self.ats.append(self.first_at)

    def _are_them(self, first: Phrase) -> bool:
        return not self.listed and (first.stands_for_somebody or first.somebody or first.living)


@dataclass(frozen=True)
class _Placed:
    """Noun phrase with the "and" or "or" directly before it, and the place around it."""

    chunk: Chunk
    joint: str
    within: Location | None = None

    @property
    def location(self) -> Location:
        """Noun phrase as a location."""
        chunk = self.chunk
        return HERE if chunk.phrase.speaker else Location(chunk.phrase, chunk.preposition, self.within)


def read_roles(items: Sequence[Item], *, describes: bool, puts: bool = False) -> Roles:
    """Sorts the items after a verb into roles; with `describes`, "near" before further places identifies the object.

    With `puts`, "on" after "from" is the destination, as in "put the cup from the desk on the bed".
    """
    roles = Roles()
    spoken = list(_spoken(items, roles))
    row: list[_Placed] = []
    for one in _nested(_described(spoken) if describes else spoken, puts):
        if one.joint == "or" and row and one.chunk.role in (None, row[-1].chunk.role):
            listed = _listed_before(row)
            roles.choices.append([*listed, one.chunk.phrase])
            roles.objects = [phrase for phrase in roles.objects if phrase not in listed[1:]]
        else:
            roles.add(one)
            row.append(one)
    roles.goals += [HERE if item.here else THERE for item in items if isinstance(item, Adverb)]
    roles.hand_over()
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
            roles.unknown.append(getattr(item, "word", "if"))
        word = item.word if isinstance(item, Separator) else None
        relative = word in word_list("relative") or (relative and word == "")
        joint = "" if word is None else word if word in _JOINTS else joint


def _described(spoken: list[_Placed]) -> list[_Placed]:
    """Splits "the object on top of the cup from the desk" into an object and a source."""
    places = [n for n, one in enumerate(spoken) if one.chunk.role not in _TO]
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
        first, within = rest.pop(0), None
        chain, apart = [first.chunk], puts and first.chunk.role is PrepositionRole.SOURCE
        while rest and not apart:
            before, chunk = chain[-1], rest[0].chunk
            place = before.placed or (before.role in _TO and before.phrase.somebody)
            if not place or chunk.role not in _CLOSER or rest[0].joint or chunk.preposition == before.preposition:
                break
            chain.append(rest.pop(0).chunk)
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
_TO: Final = (None, PrepositionRole.FOR)
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
        match item:
            case Verb() | Outside():
                self.verb, self.named, self.place = item, None, None
            case Being():
                self.verb = item
            case Chunk() if self._attach(item):
                return
            case Chunk(role=None | PrepositionRole.FOR, phrase=Phrase(receiver=False) as phrase):
                self.named, item = len(self.found), replace(item, phrase=self._ordered(phrase))
            case Chunk() if _is_placed(item):
                self.place = len(self.found)
            case Chunk(role=PrepositionRole.AT | PrepositionRole.GOAL):
                self.named = None
        self.found.append(item)

    def _ordered(self, phrase: Phrase) -> Phrase:
        """Phrase with its order in place of "second", "biggest" or "left"; takes "on the left" behind it."""
        ordinals, kinds = read_table("relations.yaml")["ordinals"], {**_kinds("orders"), **_kinds("sides")}
        words = ((phrase.tokens, ordinals), (phrase.tokens[:-1], _kinds("orders")))
        numbers, orders = ([t for t in tokens if t.word in known] for tokens, known in words)
        chosen = numbers or (isinstance(self.verb, Verb) and VerbKind.PLACE not in self.verb.kinds)
        sides = [one.spoken for one in chunks(self.rest[:1]) if chosen and one.spoken in _kinds("sides")]
        said = [*(t.word for t in orders), *sides]
        if len(numbers) > 1 or len(said) != 1:
            return phrase
        self.rest = self.rest[len(sides) :]
        kind, before = kinds[said[0]], tuple(sorted((*numbers, *orders), key=phrase.tokens.index))
        nth = int(ordinals[numbers[0].word]) if numbers else 1
        relation = SpokenRelation(kind, "".join(sides), () if kind in ROWS else (_YOU,), nth, before)
        if phrase.head in numbers:
            phrase = replace(phrase, tokens=(*phrase.tokens[:-1], replace(_ONE, index=phrase.head.index)))
        return phrase.with_relation(relation)

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

    def _attach(self, item: Chunk) -> bool:
        """Attaches a relation to the object, or to the surface; returns whether there is one for them."""
        relation = self._relation(item)
        if relation is None:
            return False
        spot, own = self._is_spot(), not relation.landmarks and item.spoken.lower() not in _kinds("parts")
        surface, at = replace(item, preposition="on", role=PrepositionRole.AT), self.place if spot else self.named
        if spot and (own or at is None):
            self._put(relation, surface, own)
            return True
        chunk = None if at is None or spot is None else self.found[at]
        if at is None or not isinstance(chunk, Chunk) or not (spot or own or relation.landmarks):
            return False
        self.found[at] = replace(chunk, phrase=chunk.phrase.with_relation(relation))
        self.found = self.found[: len(self.found) - _is_relative(self.found[-1])]
        self.rest[:0] = [surface] if own else []
        return True

    def _put(self, relation: SpokenRelation, surface: Chunk, own: bool) -> None:
        """Attaches a relation to its own surface, or else to the one that follows; otherwise to one to be found."""
        placed = [one for one in chunks(self.rest[:1]) if _is_placed(one) and not own]
        named = surface if own or relation.landmarks else replace(surface, phrase=_THERE)
        place = next(iter(placed), named)
        self.rest[: len(placed)] = [replace(place, phrase=place.phrase.with_relation(relation))]

    def _is_spot(self) -> bool | None:
        """Returns whether a relation says where to put the object, and not which one it is; None if it says neither."""
        verb = self.verb
        kinds = verb.kinds if isinstance(verb, Verb) else {VerbKind.FIND} if isinstance(verb, Being) else _GOES
        if kinds <= _GOES:
            return None
        apart, aimed = _is_relative(self.found[-1]), self.place is not None and _is_aim(self.found[self.place])
        aims = apart or any(map(_is_aim, (*self.found, *self.rest)))
        lacks = isinstance(verb, Verb) and verb.text in word_list("at_is_goal") and not aims
        if lacks and VerbKind.ROUND_TRIP in kinds:
            return None  # it could say which one, or where to
        return self.named is not None and (lacks or aimed or (VerbKind.PLACE in kinds and not apart))


def _is_relative(item: Item) -> bool:
    return isinstance(item, Separator) and item.word in word_list("relative")


def _is_aim(item: Item) -> bool:
    """Returns whether a noun phrase says whereto, or to whom."""
    to = isinstance(item, Chunk) and item.phrase.receiver and item.role in _TO
    return to or (isinstance(item, Chunk) and item.role is PrepositionRole.GOAL)


def _is_placed(item: Chunk) -> bool:
    """Returns whether a noun phrase is a place of objects, or one to put them."""
    return item.role in _PLACED and not item.phrase.receiver
