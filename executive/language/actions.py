"""Actions: what each clause asks for, in the robot's own few kinds of work."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Final

from executive.language.items import (
    Adverb,
    Being,
    Chunk,
    Item,
    Outside,
    Predicate,
    Separator,
    Unknown,
    Verb,
    requested,
    spoken_words,
)
from executive.language.lexicon import PrepositionRole, VerbKind, lexicon
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.roles import HERE, THERE, Location, Roles, read_roles
from executive.language.tokens import Token
from executive.words.command import TIME_UNITS_S


@dataclass(frozen=True)
class Action:
    """One verb's work: `objects` are what it is done to, `source` where those are, `goal` where they or the robot go.

    `kind` is None for a statement, which only tells where something is. `said` is all that was said of it, `unknown`
    the words that do not fit, `choices` phrases of which only one can be meant, `teller` who told by what they did.
    `departs` says that a place is only left, `ways` are where the way was said to lead past, `time` is how long it is
    to be waited. `anew` says that "then" or "after that" stood before it, and `again`, once pronouns are resolved, that
    the thing was spoken of before.
    """

    kind: VerbKind | None
    verb: str
    objects: tuple[Phrase, ...] = ()
    source: Location | None = None
    goal: Location | None = None
    unknown: tuple[str, ...] = ()
    said: str = ""
    choices: tuple[tuple[Phrase, ...], ...] = ()
    teller: Phrase | None = None
    departs: bool = False
    ways: tuple[Location, ...] = ()
    time: Phrase | None = None
    anew: bool = False
    again: bool = False

    @property
    def target(self) -> Phrase | None:
        """The one thing that it is done to, once pronouns are resolved."""
        return self.objects[0] if self.objects else None


_ELIDING: Final = frozenset({VerbKind.ROUND_TRIP, VerbKind.SINGLE_TRIP, VerbKind.PLACE, VerbKind.FIND})
_GIVING: Final = [[verb] for verb in ("bring", "get", "fetch", "give", "take", "hand", "serve")]
_IT: Final = Phrase((Token(0, 0, "it", "it", "PRON", "PRP", 0, "obj"),))
_FRONTED: Final = frozenset({PrepositionRole.SOURCE, PrepositionRole.GOAL, PrepositionRole.AT, PrepositionRole.BESIDE})
_AROUND: Final = frozenset({"around", "by"})
_THEN: Final = frozenset({"then", "after that", "afterwards", "next", "second", "subsequently"})
_TAKE: Final = "take"
_IF: Final = "if"
_OUT_OF: Final = "out of"
_QUESTION_TAGS: Final = frozenset({"WDT", "WP", "WP$", "WRB"})


def read_actions(
    clauses: Sequence[Predicate], *, told: bool = False, recipient: Location | None = None
) -> tuple[Action, ...]:
    """The actions of all clauses, in order.

    `told` says that things were spoken of before, which may be left out; `recipient` is given things where a clause
    does not say to whom.
    """
    merged = requested(clauses)
    found = [
        replace(action, said=_said(clause), anew=before is not None and _ends_with_then(before))
        for before, clause in zip([None, *merged], merged, strict=False)
        for action in _given(_actions(clause), clause, recipient)
    ]
    found = list(_with_elided(found, told))
    last = [replace(action, unknown=(action.said,)) if action.departs else action for action in found[-1:]]
    return tuple(action for action in found[:-1] if not _goes_nowhere(action)) + tuple(last)


def _given(actions: Iterator[Action], clause: Predicate, recipient: Location | None) -> Iterator[Action]:
    """The actions, things being given to the recipient where the clause does not say to whom."""
    whom = (PrepositionRole.GOAL, PrepositionRole.FOR)
    chunks = [item for item in clause.items if isinstance(item, Chunk)]
    said = any(one.role in whom or (one.role is None and (one.phrase.speaker or one.phrase.person)) for one in chunks)
    said = said or any(isinstance(item, Adverb) for item in clause.items)
    for action in actions:
        gives = recipient is not None and not said and action.verb.split()[:1] in _GIVING
        yield replace(action, goal=recipient) if gives else action


def _with_elided(actions: Sequence[Action], things: bool) -> Iterator[Action]:
    """Say "it" where that was left out: "take the phone and carry to me", "I left my watch there, can you check"."""
    for action in actions:
        lacks = action.unknown == (action.verb,) and not action.objects and action.kind in _ELIDING
        goes_on = action.goal is not None or action.kind is VerbKind.FIND
        if things and lacks and goes_on:
            action = replace(action, unknown=(), objects=(_IT,))
        things = things or any(not phrase.speaker for phrase in action.objects)
        yield action


def _ends_with_then(clause: Predicate) -> bool:
    """Whether "then" or "after that" stands at its end, before the next verb."""
    end = takewhile(lambda item: isinstance(item, Separator), reversed(clause.items))
    return any(isinstance(item, Separator) and item.word in _THEN for item in end)


def _said(clause: Predicate) -> str:
    before = [clause.subject] if clause.subject is not None else []
    verb = [clause.verb] if clause.verb is not None else []
    return spoken_words([*before, *verb, *clause.items])


def _goes_nowhere(action: Action) -> bool:
    """Whether it is the "go" of "go and find", which says nothing of its own."""
    return action.kind is VerbKind.GO and action.goal is None and action.unknown == (action.verb,)


def _actions(clause: Predicate) -> Iterator[Action]:
    if clause.verb is None:
        yield Action(None, "", unknown=(spoken_words(clause.items),))
    elif isinstance(clause.verb, Outside):
        yield Action(None, "", unknown=(spoken_words([clause.verb, *clause.items]),))
    elif isinstance(clause.verb, Being):
        yield _being(clause, clause.verb)
    else:
        yield from _acting(clause, clause.verb)


def _being(clause: Predicate, being: Being) -> Action:
    """A status check ("is there a hammer in the workshop"), or a statement ("there is a hammer in the workshop")."""
    if being.narrated:
        return _narrated(clause, being)
    if _is_state(clause, being):
        named = clause.subject is not None and not (clause.subject.phrase.speaker or clause.subject.phrase.pronoun)
        return Action(None, being.text, (clause.subject.phrase,) if named and clause.subject else ())
    if clause.subject is not None and clause.subject.phrase.speaker and not being.asked:
        return _lacking(clause, being)
    roles = read_roles(clause.items, describes=False)
    objects = [*([clause.subject.phrase] if clause.subject else []), *roles.objects]
    if clause.subject and not being.asked and roles.recipient is not None and len(objects) == 1 and not roles.unknown:
        return Action(None, being.text, tuple(objects), teller=roles.recipient.phrase)
    there = [place for place in roles.goals if place == THERE]
    places = [*roles.ats, *roles.sources, *there]
    place = next(iter(places), None)
    known = len(roles.goals) == len(there) and not (roles.unknown or roles.joined_goals)
    simple = len(objects) == 1 and len(places) <= 1 and known
    fits = simple and (place or being.existential)
    asked_for = any(map(_asks, objects))
    before = [clause.subject] if clause.subject else []
    unknown = () if fits and not asked_for else (spoken_words([*before, being, *clause.items]),)
    asked = being.asked or clause.whether
    kind = VerbKind.FIND if asked else None
    choices = tuple(map(tuple, roles.choices))
    return Action(kind, "be", tuple(objects[:1]), place, unknown=unknown, choices=choices, teller=being.teller)


def _narrated(clause: Predicate, being: Being) -> Action:
    """What happened or goes on, with the thing that it happens to; nothing to do by itself."""
    roles = read_roles(clause.items, describes=False)
    lacked = [place.phrase for place in roles.sources if place.preposition == _OUT_OF and place.phrase is not None]
    things = [*roles.objects, *([] if roles.searched is None else [roles.searched]), *lacked]
    things = things or [phrase for phrase in (being.topic,) if phrase is not None]
    named = tuple(phrase for phrase in things if not (phrase.pronoun or phrase.speaker or phrase.person))
    place = next(iter([*roles.ats, *roles.goals]), None)
    return Action(None, being.text, named[:1], place, teller=being.teller)


def _departs(verb: Verb, roles: Roles) -> bool:
    """Whether a place is only left ("leave the kitchen and go to the hall"), which is part of going elsewhere."""
    sources = [place.phrase for place in roles.sources if place.phrase is not None]
    left = (
        roles.objects
        if verb.text in lexicon().leaves
        else sources
        if VerbKind.GO in verb.kinds and not roles.objects
        else []
    )
    places = bool(left) and all(phrase.kind is NounKind.PLACE for phrase in left)
    return places and not (roles.goals or roles.ats or roles.recipient or roles.unknown or roles.searched)


def _lacking(clause: Predicate, being: Being) -> Action:
    """What the speaker lacks ("we are out of napkins"), or where they are ("I am in the hall")."""
    roles = read_roles(clause.items, describes=False)
    lacked = [place.phrase for place in roles.sources if place.phrase is not None]
    place = next(iter(roles.ats), None)
    return Action(None, being.text, tuple(lacked), place, unknown=(*roles.unknown, *(p.spoken for p in roles.objects)))


def _is_state(clause: Predicate, being: Being) -> bool:
    """Whether it only tells how things are ("I'm thirsty", "the baby is crying"): a reason, and nothing to do."""
    if clause.subject is None or clause.whether or (being.asked and _asks(clause.subject.phrase)):
        return False
    told = any(isinstance(item, Unknown | Adverb) for item in clause.items) or clause.subject.phrase.speaker
    return told and all(isinstance(item, Unknown | Separator) or _is_here(item) for item in clause.items)


def _is_here(item: Item) -> bool:
    return isinstance(item, Adverb) and item.here


def _asks(phrase: Phrase) -> bool:
    return any(token.tag in _QUESTION_TAGS for token in phrase.tokens)


def _acting(clause: Predicate, verb: Verb) -> Iterator[Action]:
    going = verb.kinds == {VerbKind.GO}
    roles = read_roles(clause.items, describes=not going, puts=VerbKind.PLACE in verb.kinds)
    if verb.text in lexicon().gives and len(roles.objects) > 1 and not roles.recipient and not roles.listed:
        roles.unknown.append(roles.objects[0].spoken)
    if _departs(verb, roles):
        yield Action(None, verb.text, departs=True)
        return
    kind = _kind(verb, roles)
    blank = Action(kind, verb.text, unknown=tuple(roles.unknown), choices=tuple(map(tuple, roles.choices)))
    if kind is VerbKind.GO:
        yield from _going(blank, roles)
    elif kind is VerbKind.FIND or (kind is VerbKind.CHECK and roles.searched is not None):
        yield from _finding(replace(blank, kind=VerbKind.FIND), roles)
    elif kind is VerbKind.WAIT:
        yield _waiting(blank, roles)
    elif kind is VerbKind.CHARGE:
        yield _charging(blank, roles)
    elif kind is VerbKind.CHECK:
        bare = all(isinstance(item, Separator) for item in clause.items)
        looks = VerbKind.FIND if bare else blank.kind
        yield replace(blank, kind=looks, unknown=(spoken_words([verb, *clause.items]),))
    else:
        yield from _carrying(blank, roles)


def _kind(verb: Verb, roles: Roles) -> VerbKind:
    """Which of a verb's meanings fits what stands behind it."""
    if VerbKind.GO in verb.kinds and (len(verb.kinds) == 1 or not (roles.objects or roles.recipient)):
        return VerbKind.GO
    return next(kind for kind in VerbKind if kind in verb.kinds and kind is not VerbKind.GO)


def _going(blank: Action, roles: Roles) -> Iterator[Action]:
    """One action for each place to go to."""
    bare = [HERE if phrase.speaker else Location(phrase) for phrase in roles.objects]
    passed = [place for place in roles.ats if roles.goals and place.preposition in _AROUND]
    roles = replace(roles, ats=[place for place in roles.ats if place not in passed])
    if len(bare) == 1 and bare[0] is not HERE and len(roles.ats) == 1 and not roles.goals:
        bare = [replace(bare[0], within=roles.ats.pop())]
    if bare and blank.verb.endswith((" down", " up", " along")):
        passed += [replace(place, preposition=blank.verb.split()[-1]) for place in bare if roles.goals]
        bare = [] if roles.goals else bare
    elif bare and (blank.verb not in lexicon().bare_goal or (blank.verb in lexicon().enters and _thing(roles.objects))):
        blank = replace(blank, unknown=(*blank.unknown, *(phrase.spoken for phrase in roles.objects)))
    if _goes_for(roles):
        fetched = tuple(phrase for phrase in (roles.searched,) if phrase is not None)
        yield replace(blank, kind=VerbKind.ROUND_TRIP, objects=fetched, source=roles.goals[0], goal=HERE)
        return
    headed = roles.searched if roles.searched is not None and roles.searched.kind is NounKind.PLACE else None
    places = [*roles.goals, *roles.ats, *bare, *([] if headed is None else [Location(headed)]), *roles.joined_goals]
    passed += roles.paths if places else []
    places = places or roles.paths
    if not places and blank.verb in lexicon().goes_back:
        places = [HERE]
    recipient = None if roles.recipient is HERE and roles.favour else roles.recipient
    unfit = (recipient, None if headed is not None else roles.searched)
    extra = [part.text for part in unfit if part is not None]
    extra += [place.text for place in roles.sources] + ([] if places else [blank.verb])
    blank = replace(blank, unknown=(*blank.unknown, *extra), ways=tuple(passed))
    yield from (replace(blank, goal=place) for place in places) if places else (blank,)


def _thing(phrases: Sequence[Phrase]) -> bool:
    """Whether any of them is a thing and no place."""
    return any(phrase.kind is NounKind.THING and not phrase.known for phrase in phrases)


def _goes_for(roles: Roles) -> bool:
    """Whether somebody is to go somewhere for a thing ("run to the cellar for some wine")."""
    thing, place = roles.searched, roles.goals[0] if len(roles.goals) == 1 else None
    fetched = thing is not None and thing.kind is NounKind.THING and not thing.pronoun
    return fetched and place is not None and place.phrase is not None and not (roles.sources or roles.objects)


def _finding(blank: Action, roles: Roles) -> Iterator[Action]:
    """One action for each place to look at: "in the kitchen and the hall"."""
    objects, places = list(roles.objects), [*roles.ats, *roles.sources]
    if roles.searched is not None:
        within, places = (places[0], places[1:]) if objects and places else (None, places)
        places = [*(Location(phrase, within=within) for phrase in objects), *places]
        objects = [roles.searched]
    there = [place for place in roles.goals if place == THERE]
    places = places or there
    elsewhere = [] if roles.searched is None else places[1 : len(roles.objects)]
    unfit = [place for place in roles.goals if place != THERE]
    extra = [place.text for place in (*places[1 + len(elsewhere) :], *_others([HERE, *unfit]), *roles.paths)]
    extra += ["here"] if HERE in unfit else []
    found = _with_object(replace(blank, objects=tuple(objects), source=next(iter(places), None)), extra)
    yield found
    yield from (replace(found, source=place) for place in (*elsewhere, *roles.joined_goals))


def _waiting(blank: Action, roles: Roles) -> Action:
    """Waiting for a time, here or in a place."""
    times = [phrase for phrase in (roles.searched, *roles.objects) if phrase is not None]
    places = [place for place in (*roles.ats, *roles.goals) if place not in (HERE, THERE)]
    fits = len(times) == 1 and times[0].head.word in TIME_UNITS_S and times[0].count > 0
    extra = [phrase.spoken for phrase in (times[1:] if fits else times)] + ([] if fits else [blank.verb])
    extra += [place.text for place in (*places[1:], *_beyond(roles))]
    goal, time = next(iter(places), None), times[0] if fits else None
    return replace(blank, goal=goal, time=time, unknown=(*blank.unknown, *extra))


def _charging(blank: Action, roles: Roles) -> Action:
    """Charging the robot's own battery at its dock; it charges nothing else and nowhere else."""
    things = [phrase.spoken for phrase in roles.objects if not phrase.addressed]
    places = [place for place in (*roles.ats, *roles.goals) if place not in (HERE, THERE)]
    docks = [place.text for place in places if place.phrase is None or place.phrase.head.lemma not in lexicon().docks]
    searched = [] if roles.searched is None else [roles.searched.spoken]
    return replace(blank, unknown=(*blank.unknown, *things, *docks, *searched, *(p.text for p in _beyond(roles))))


def _beyond(roles: Roles) -> Iterator[Location]:
    """Where a verb that moves nothing cannot go: sources, paths, somebody, more places."""
    recipient = () if roles.recipient in (None, HERE) else (roles.recipient,)
    yield from (place for place in (*roles.sources, *roles.paths, *recipient, *roles.joined_goals) if place)


def _carrying(blank: Action, roles: Roles) -> Iterator[Action]:
    """Taking, bringing and putting: sort out from where, to where and for whom.

    One thing of a kind for each of several places: "a beer to Robin and Charlie".
    """
    goals, sources, ats = list(roles.goals), list(roles.sources), list(roles.ats)
    if roles.recipient is not None and not (roles.favour and ats and blank.kind is VerbKind.PLACE):
        to_place = bool(goals) and not goals[0].person
        rest = [] if to_place and roles.favour else [roles.recipient]
        goals = [*goals, *rest] if to_place else [roles.recipient, *goals]
    at_is_goal = blank.kind is VerbKind.PLACE or blank.verb in lexicon().at_is_goal or len(ats) > 1
    at_is_goal = at_is_goal or any(_lies_in(place) for place in sources)
    if ats and not goals and at_is_goal:
        goals.append(ats.pop())
    sources += ats
    goal = next(iter(goals), HERE if blank.verb in lexicon().hands and not sources else None)
    shared = roles.joined_goals if goal is not None and _for_each(roles) else []
    rivals = [place.phrase for place in ([] if shared else [goal, *roles.joined_goals]) if place and place.phrase]
    if len(rivals) > 1:
        blank = replace(blank, choices=(*blank.choices, tuple(rivals)))
    extra = [place.text for place in (*sources[1:], *_others(goals))]
    extra += [roles.searched.text] if roles.searched is not None else []
    source = next(iter(sources), None)
    carried = _with_object(replace(blank, objects=tuple(roles.objects), source=source, goal=goal), extra)
    yield carried
    yield from (replace(carried, goal=place) for place in shared)


def _lies_in(place: Location) -> bool:
    """Whether it was said that a thing is in a place ("the cup that is on the desk"), not only from where."""
    return lexicon().prepositions.get(tuple(place.preposition.split())) is not PrepositionRole.SOURCE


def _for_each(roles: Roles) -> bool:
    """Whether there can be one for each place: a single "a beer", not "the hammer"."""
    return len(roles.objects) == 1 and roles.objects[0].indefinite and not roles.objects[0].pronoun


def _others(goals: Sequence[Location]) -> Sequence[Location]:
    """Goals that are too many; HERE beside another one only says for whom."""
    return [goal for goal in goals[1:] if goal is not HERE]


def _with_object(action: Action, extra: Sequence[str]) -> Action:
    """The action with the words that are too many, its verb among them when it says not what."""
    missing = () if action.objects else (action.verb,)
    return replace(action, unknown=(*action.unknown, *extra, *missing))
