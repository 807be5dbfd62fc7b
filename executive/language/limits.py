"""What the robot does not do: harm, ways that it cannot keep to, and what lies out of its reach."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Final

from executive.language.actions import Action
from executive.language.items import Chunk, Outside, Predicate, Verb, spoken_words
from executive.language.lexicon import PrepositionRole, VerbKind, lexicon, read_table
from executive.language.nouns import NounKind, noun_examples
from executive.language.phrases import Phrase
from executive.language.questions import ABLE, RefusalError, RefusalKind
from executive.language.roles import HERE, Location
from executive.words.knowledge import Knowledge
from skills.files.errors import listing


def check_feasible(actions: Sequence[Action], knowledge: Knowledge | None) -> None:
    """Refuse odd numbers, to carry people, to serve all of a kind, what no hand can hold, and places out of reach.

    Raises:
        RefusalError: any action is out of reach; it names all that is.
    """
    counted = (phrase for d in actions for phrase in (d.target, d.time) if phrase is not None)
    odd = [number for phrase in counted if (number := phrase.odd_number)]
    if odd:
        raise RefusalError(f"{listing(map(repr, odd))} is no number of things; say how many in one whole number", odd)
    shared = [
        d.goal.phrase.spoken for d in actions if d.goal is not None and d.goal.phrase is not None and _serves_all(d)
    ]
    if shared:
        raise RefusalError(f"I bring things to one person at a time, not to {', '.join(shared)}; name one", shared)
    people = [f"{d.verb} {d.target.text}" for d in actions if _carries(d) and d.target is not None and d.target.person]
    if people:
        raise RefusalError(f"I cannot carry or lead people: {', '.join(people)}; {ABLE}", people)
    if knowledge is not None:
        actions = [replace(action, objects=()) if _asks_for_people(action) else action for action in actions]
        actions = [action for action in actions if not _visits_all(action)]
    moved = [action.target for action in actions if _moved(action)]
    outside = [(part, part) for action in actions for part in _outside(action, action.target in moved)]
    if outside:
        raise not_understood(outside, knowledge)


def not_understood(parts: Sequence[tuple[str, str]], knowledge: Knowledge | None) -> RefusalError:
    """The refusal that names the parts which lie outside the mission, each with the whole clause that it stands in."""
    within = {clause: [part for part, other in parts if other == clause] for _, clause in parts}
    named = (_named(tuple(dict.fromkeys(words)), clause) for clause, words in within.items())
    reason = f"I do not understand {', '.join(named)}; {ABLE}"
    return RefusalError(reason, [part for part, _ in parts], kind=RefusalKind.NOT_UNDERSTOOD)


def _named(words: Sequence[str], clause: str) -> str:
    """The words in quotes, and the clause, unless that is all the same."""
    quoted = ", ".join(map(repr, words))
    return quoted if not clause or clause in words else f"{quoted} in {clause!r}"


def _serves_all(action: Action) -> bool:
    """Whether a thing is brought to all of some people."""
    goal = None if action.goal is None else action.goal.phrase
    return _carries(action) and goal is not None and goal.universal and action.target is not None


def _carries(action: Action) -> bool:
    return action.kind not in (VerbKind.GO, VerbKind.FIND, VerbKind.WAIT, VerbKind.CHARGE)


_BY_HAND: Final = frozenset({"bring", "carry", "take", "deliver", "take over", "bring over", "carry over", "hand"})
_INTO: Final = frozenset({"into", "onto"})


def _moved(action: Action) -> bool:
    """Whether a definite thing is taken from or put into a place in the house, so that it is no idea.

    So is "the mail from the desk", and what is written ("take the report to the boss").
    """
    if action.target is None or action.target.indefinite or not _carries(action):
        return False
    goal = action.goal
    if (
        goal is not None
        and goal.preposition in _INTO
        and goal.phrase is not None
        and goal.phrase.kind is NounKind.PLACE
    ):
        return action.target.kind is not NounKind.ELSEWHERE
    laid = action.kind is VerbKind.PLACE and goal is not None and goal.phrase is not None
    laid = laid and goal is not None and goal.phrase is not None and goal.phrase.kind is NounKind.PLACE
    if goal not in (None, HERE) and (action.verb in _BY_HAND or laid) and action.target.head.lemma in lexicon().written:
        return True
    role = lexicon().prepositions.get(tuple(action.source.preposition.split())) if action.source is not None else None
    place = None if action.source is None else action.source.phrase
    if place is None or role is not PrepositionRole.SOURCE or action.target.kind is NounKind.ELSEWHERE:
        return False
    return place.kind is NounKind.PLACE or (place.kind is NounKind.THING and _fixture(action.target))


def _outside(action: Action, moved: bool) -> Iterator[str]:
    """The parts of an action that are out of reach; `moved` says that its thing lies in a place of the house."""
    if action.target is not None and (
        action.target.universal
        or action.target.addressed
        or action.target.counts
        or not (moved or _holdable(action.target, action))
    ):
        yield f"{action.verb} {action.target.spoken}"
    for place in (action.source, action.goal):
        yield from _outside_place(place, action)


def _holdable(phrase: Phrase, action: Action) -> bool:
    """Whether it is something to be found, and taken where the action takes it."""
    if phrase.known:
        return True
    if action.kind is VerbKind.FIND and action.source is None and (_anybody(phrase) or _cuisine(phrase)):
        return False
    called = phrase.kind is NounKind.VEHICLE and (phrase.indefinite or action.kind is not VerbKind.FIND)
    if called or (action.kind is not VerbKind.FIND and _fixture(phrase)):
        return False
    return not _light(phrase, action) and (phrase.kind is None or phrase.kind.within_reach)


def _visits_all(action: Action) -> bool:
    return action.kind is VerbKind.GO and action.goal is not None and action.goal.every_room


def _asks_for_people(action: Action) -> bool:
    """Whether it asks where somebody is, or whether there is any person at all ("is anybody in the hall")."""
    phrase = action.target if action.kind is VerbKind.FIND else None
    anyone = phrase is not None and phrase.head.word in lexicon().anyone
    return phrase is not None and (anyone or phrase.person or phrase.stands_for_somebody)


def _anybody(phrase: Phrase) -> bool:
    """Whether it is any one of some trade ("a good dentist"), who is not looked for in a house."""
    return phrase.kind is NounKind.PERSON and phrase.indefinite and not phrase.named_person


def _cuisine(phrase: Phrase) -> bool:
    """Whether it is any food of some style, as recipes and menus have it ("pasta dishes")."""
    styled = any(t.relation in ("compound", "amod") and not t.adjective for t in phrase.tokens[:-1])
    return styled and phrase.plural and phrase.indefinite and phrase.head.lemma in lexicon().prepared


def _fixture(phrase: Phrase) -> bool:
    return phrase.head.lemma in lexicon().fixtures


def _light(phrase: Phrase, action: Action) -> bool:
    """Whether verb and noun are one act, as in "take a picture": the noun is no thing then."""
    acts = lexicon().light_nouns.get(action.verb.split()[0], frozenset())
    elsewhere = action.goal is not None and action.goal.phrase is not None and action.goal.phrase.kind is NounKind.PLACE
    loose = phrase.indefinite or action.verb in lexicon().light_whole
    return phrase.head.lemma in acts and loose and action.source is None and not elsewhere


def _outside_place(place: Location | None, action: Action) -> Iterator[str]:
    while place is not None:
        phrase = place.phrase
        idle = phrase is not None and action.kind is VerbKind.GO and _idle(phrase, place, action.verb)
        if phrase is not None and (idle or phrase.universal or not _reachable(phrase, place)):
            yield f"{action.verb} {place.preposition} {phrase.spoken}".replace("  ", " ")
        place = place.within


def _idle(phrase: Phrase, place: Location, verb: str) -> bool:
    """Whether going there is something else than a way: "go to bed", "reach my wife"."""
    bare = len(phrase.tokens) == 1 and not phrase.known
    out = place.preposition.startswith("out")
    called = phrase.person and (out or not phrase.named_person) and place.within is None and verb in lexicon().calls
    return called or (bare and phrase.head.lemma in lexicon().light_nouns.get(verb.split()[0], frozenset()))


def _reachable(phrase: Phrase, place: Location) -> bool:
    """Whether one can go there, or to somebody; a name in front of a place is somebody's ("Paris at the desk")."""
    named = place.within is not None and phrase.head.pos == "PROPN"
    if phrase.known or named or phrase.person:
        return True
    nominal = phrase.head.pos not in ("ADJ", "ADV") or len(phrase.tokens) > 1 or phrase.known
    called = place.preposition == "to" and phrase.proper and phrase.kind is NounKind.ABSTRACT
    called = called and phrase.head.lemma not in noun_examples()
    return called or (nominal and (phrase.kind is None or phrase.kind.within_reach))


_MOVES: Final = frozenset(VerbKind) - {VerbKind.FIND, VerbKind.CHECK}
_OVER: Final = "over"


def refuse_harm(clauses: Sequence[Predicate]) -> None:
    """Refuse what does harm. Raises RefusalError, which names the clauses that do."""
    harmful = [spoken_words((clause.verb, *clause.items)) for clause in clauses if clause.verb and _does_harm(clause)]
    if harmful:
        raise RefusalError(f"{', '.join(map(repr, harmful))} could hurt somebody or break something", harmful)


def _does_harm(clause: Predicate) -> bool:
    words = _harmful()
    if not isinstance(verb := clause.verb, Verb | Outside):
        return False
    said = (verb.text if isinstance(verb, Verb) else verb.word).lower()
    chunks = [item for item in clause.items if isinstance(item, Chunk) and item.role is not PrepositionRole.FOR]
    met = [chunk for chunk in chunks if _somebody(chunk.phrase)]
    if said in words["harms"] or (met and said in words["harms_somebody"]):
        return True
    if said in words["throws"]:
        return any(chunk.preposition in words["flies"] for chunk in chunks) or bool(met)
    moves = isinstance(verb, Verb) and bool(verb.kinds & _MOVES)
    over = _OVER if said.endswith(f" {_OVER}") else ""
    return moves and any((chunk.preposition or over) in words["upon"] for chunk in met)


def _somebody(phrase: Phrase) -> bool:
    """Whether it is somebody, or a part of them."""
    bare = len(phrase.content) == 1
    living = phrase.person or phrase.speaker or phrase.stands_for_somebody or (bare and phrase.kind is NounKind.PERSON)
    owned = not bare or any(token.tag in ("PRP$", "POS") for token in phrase.tokens)
    return living or (owned and phrase.head.lemma in _harmful()["body"])


@cache
def _harmful() -> Mapping[str, frozenset[str]]:
    return {name: frozenset(words) for name, words in read_table("harm.yaml").items()}


_GO: Final = frozenset({VerbKind.GO})
_ON_TOP: Final = ("in", "out")


def check_ways_and_speaker(clauses: Sequence[Predicate], actions: Sequence[Action]) -> None:
    """Refuse a way that is to be taken, and relations to the speaker but "to me". Raises RefusalError."""
    for action in actions:
        for place in action.ways:
            if place.phrase is None or place.phrase.head.lemma not in read_table("relations.yaml")["doors"]:
                raise _refused("go", place.preposition, place.name)
    for clause in clauses:
        act = "go" if isinstance(clause.verb, Verb) and clause.verb.kinds == _GO else "bring"
        for chunk in clause.items:
            if isinstance(chunk, Chunk) and chunk.phrase.speaker and not _keeps(act, "person", chunk.preposition):
                raise _refused(act, chunk.preposition, chunk.phrase.spoken)


def check_relation(act: str, kinds: Sequence[str], location: Location) -> None:
    """Refuse a relation that a command which goes, brings or looks ("go", "bring", "look") does not keep.

    `kinds` is what the place may turn out to be: "room", "surface" or "person". Raises RefusalError.
    """
    name = location.phrase
    if name is None:
        return
    groups = (
        _ON_TOP
        if "surface" in kinds and name.head.lemma.split()[-1] in read_table("relations.yaml")["open_tops"]
        else ()
    )
    on_top = any(_in(group, location.preposition) for group in groups)
    if not (on_top or any(_keeps(act, kind, location.preposition) for kind in kinds)):
        raise _refused(act, location.preposition, name.spoken)
    around = location.within
    if around is not None and not _keeps("around", "place", around.preposition):
        raise _refused("around", around.preposition, around.name)


def _refused(act: str, preposition: str, name: str) -> RefusalError:
    said = f"{preposition} {name}".strip()
    return RefusalError(f"{read_table('relations.yaml')['instead'][act]}, not {said!r}", [said])


def _keeps(act: str, kind: str, preposition: str) -> bool:
    return any(_in(group, preposition) for group in read_table("relations.yaml")["kept"][act][kind])


def _in(group: str, preposition: str) -> bool:
    return preposition in read_table("relations.yaml")["groups"][group]
