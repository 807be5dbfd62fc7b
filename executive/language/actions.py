"""Reads actions: the work that each clause asks of the robot."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, takewhile
from typing import Final

from executive.language.items import (
    Adverb,
    Being,
    Chunk,
    Outside,
    Predicate,
    Separator,
    Unknown,
    Verb,
    requested_predicates,
    spoken_words,
)
from executive.language.lexicon import PrepositionRole, VerbKind, word_list
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.questions import RefusalError
from executive.language.roles import HERE, THERE, Location, Roles, read_roles
from executive.language.spelling import synonyms_for
from executive.language.tokens import Token
from executive.words.command import TIME_UNITS_S


@dataclass(frozen=True)
class Action:
    """Action of one verb: on `objects` at `source`, towards `goal`.

    `kind` is None for a statement on the place of an object. `said` is the clause's text, `unknown` are the unknown
    words in it, `choices` are phrases joined by "or", `teller` is the person who put the object there. `departs` marks
    a place that the robot only leaves, `passes` are places on the route, `time` is the length of a wait. `follows`
    marks an action after "then" or "after that"; `again`, set once pronouns are resolved, a repeated object.
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
    passes: tuple[Location, ...] = ()
    time: Phrase | None = None
    follows: bool = False
    again: bool = False

    @property
    def target(self) -> Phrase | None:
        """Only object of the action, once pronouns are resolved; None if it has no object."""
        return self.objects[0] if self.objects else None

    @property
    def for_somebody(self) -> bool:
        """Returns whether the speaker, another person or an animal gets the object."""
        return self.goal is not None and (self.goal == HERE or self.goal.living)

    @property
    def phrases(self) -> tuple[Phrase, ...]:
        """Noun phrases of the action in any role."""
        places = (place for each in (self.source, self.goal, *self.passes) if each is not None for place in each.around)
        others = (self.teller, self.time, *(place.phrase for place in places))
        return (*self.objects, *chain(*self.choices), *(phrase for phrase in others if phrase is not None))


_IT: Final = Phrase((Token(0, 0, "it", "it", "PRON", "PRP", 0, "obj"),))
_BIN: Final = Location(Phrase((Token(0, 0, "bin", "bin", "NOUN", "NN", 0, "obl", kind=NounKind.PLACE),)), "to")
_AIMS: Final = (PrepositionRole.GOAL, PrepositionRole.FOR)
_ELIDING: Final = frozenset({VerbKind.ROUND_TRIP, VerbKind.SINGLE_TRIP, VerbKind.PLACE, VerbKind.FIND})
_QUESTION_TAGS: Final = frozenset({"WDT", "WP", "WP$", "WRB"})


def read_actions(
    clauses: Sequence[Predicate], *, elliptic: bool = False, recipient: Location | None = None
) -> tuple[Action, ...]:
    """Reads the actions of all clauses, in order.

    With `elliptic`, a clause may omit an earlier object; `recipient` receives objects if a clause names nobody.
    """
    found: list[Action] = []
    follows = False
    for clause in requested_predicates(clauses):
        before = [each for each in (clause.subject, clause.verb) if each is not None]
        chunks = [item for item in clause.items if isinstance(item, Chunk)]
        named = any(one.role in _AIMS or (one.role is None and one.phrase.receiver) for one in chunks)
        named = named or any(isinstance(item, Adverb) for item in clause.items)
        for action in _actions(clause):
            gives = recipient is not None and not named and action.verb.partition(" ")[0] in word_list("to_recipient")
            goal = recipient if gives else action.goal
            action = replace(action, said=spoken_words([*before, *clause.items]), follows=follows, goal=goal)
            lacks = action.unknown == (action.verb,) and not action.objects and action.kind in _ELIDING
            if elliptic and lacks and (goal is not None or action.kind is VerbKind.FIND):
                action = replace(action, unknown=(), objects=(_IT,))  # take the phone and carry to me
            elliptic = elliptic or any(not phrase.speaker for phrase in action.objects)
            found.append(action)
        end = takewhile(lambda item: isinstance(item, Separator), reversed(clause.items))
        follows = any(isinstance(item, Separator) and item.word in word_list("follows") for item in end)
    found = _without_idle_waits(found)
    last = [replace(action, unknown=(action.said,)) if action.departs else action for action in found[-1:]]
    # The "go" of "go and find" is left out.
    bare = [one for one in found[:-1] if one.kind is VerbKind.GO and one.goal is None and one.unknown == (one.verb,)]
    return (*(action for action in found[:-1] if action not in bare), *last)


def _without_idle_waits(actions: list[Action]) -> list[Action]:
    """Removes a wait without a time after the last drive: the robot stays there. Raises RefusalError for others."""
    waits = [action for action in actions if action.verb in word_list("wait") and action.time is None]
    idle = [action for action in waits if action.kind is VerbKind.WAIT and action.unknown == (action.verb,)]
    if idle and idle[-1] is actions[-1] and len(actions) > 1 and actions[-2].kind is VerbKind.GO:
        return _without_idle_waits(actions[:-1])
    if idle or any(action.kind is VerbKind.GO for action in waits if action is not actions[-1]):
        said = (idle or waits)[0].said
        raise RefusalError(f"say for how long I am to wait in '{said}', or until what", [said])
    return actions


def _actions(clause: Predicate) -> Iterator[Action]:
    verb = clause.verb
    if verb is None or isinstance(verb, Outside):
        yield Action(None, "", unknown=(spoken_words([*([] if verb is None else [verb]), *clause.items]),))
    elif isinstance(verb, Being):
        yield _being(clause, verb)
    else:
        yield from _acting(clause, verb)


def _being(clause: Predicate, being: Being) -> Action:
    """Reads a status check ("is there a hammer on the desk") or a statement ("there is a hammer on the desk")."""
    subject = None if clause.subject is None else clause.subject.phrase
    if being.narrated:
        return _narrated(clause, being)
    if _is_state(clause, being):
        named = subject is not None and not (subject.speaker or subject.pronoun)
        return Action(None, being.text, (subject,) if named and subject is not None else ())
    roles = read_roles(clause.items, describes=False)
    if subject is not None and subject.speaker and not being.asked:  # we are out of napkins, I am in the hall
        lacked = tuple(place.phrase for place in roles.sources if place.phrase is not None)
        unknown = (*roles.unknown, *(phrase.spoken for phrase in roles.objects))
        return Action(None, being.text, lacked, next(iter(roles.ats), None), unknown=unknown)
    objects = [*([subject] if subject is not None else []), *roles.objects]
    if subject and not being.asked and roles.recipient is not None and len(objects) == 1 and not roles.unknown:
        return Action(None, being.text, tuple(objects), teller=roles.recipient.phrase)
    there = [place for place in roles.goals if place == THERE]
    places = [*roles.ats, *roles.sources, *there]
    place = next(iter(places), None)
    known = len(roles.goals) == len(there) and not (roles.unknown or roles.joined_goals)
    kind = VerbKind.FIND if being.asked or clause.whether else None
    located = place or being.existential or (kind is not None and objects and objects[0].relations)
    fits = len(objects) == 1 and len(places) <= 1 and known and located
    before = [clause.subject] if clause.subject else []
    unknown = () if fits and not any(map(_is_question, objects)) else (spoken_words([*before, being, *clause.items]),)
    choices = tuple(map(tuple, roles.choices))
    return Action(kind, "be", tuple(objects[:1]), place, unknown=unknown, choices=choices, teller=being.teller)


def _narrated(clause: Predicate, being: Being) -> Action:
    """Reads a narrated event with its object; an event is no request."""
    roles = read_roles(clause.items, describes=False)
    lacked = [place.phrase for place in roles.sources if place.preposition == "out of"]
    topics = [phrase for phrase in (*roles.objects, roles.searched, *lacked) if phrase is not None]
    topics = topics or [phrase for phrase in (being.topic,) if phrase is not None]
    named = tuple(phrase for phrase in topics if not (phrase.pronoun or phrase.receiver))
    place = next(iter([*roles.ats, *roles.goals]), None)
    return Action(None, being.text, named[:1], place, teller=being.teller)


def _is_state(clause: Predicate, being: Being) -> bool:
    """Returns whether a clause only describes a state as a reason, as in "I'm thirsty" or "the baby is crying"."""
    if clause.subject is None or clause.whether or (being.asked and _is_question(clause.subject.phrase)):
        return False
    states = any(isinstance(item, Unknown | Adverb) for item in clause.items) or clause.subject.phrase.speaker
    rest = (item for item in clause.content if not (isinstance(item, Adverb) and item.here))
    return states and all(isinstance(item, Unknown) for item in rest)


def _is_question(phrase: Phrase) -> bool:
    return any(token.tag in _QUESTION_TAGS for token in phrase.tokens)


def _acting(clause: Predicate, verb: Verb) -> Iterator[Action]:
    roles = read_roles(clause.items, describes=verb.kinds != {VerbKind.GO}, puts=VerbKind.PLACE in verb.kinds)
    if verb.text in word_list("gives") and len(roles.objects) > 1 and not roles.recipient and not roles.listed:
        roles.unknown.append(roles.objects[0].spoken)
    if _departs(verb, roles):
        yield Action(None, verb.text, departs=True)
        return
    going = VerbKind.GO in verb.kinds and (len(verb.kinds) == 1 or not (roles.objects or roles.recipient))
    others = (kind for kind in VerbKind if kind in verb.kinds and kind is not VerbKind.GO)
    kind = VerbKind.GO if going else next(others)
    blank = Action(kind, verb.text, unknown=tuple(roles.unknown), choices=tuple(map(tuple, roles.choices)))
    if kind is VerbKind.GO:
        yield from _going(blank, roles)
    elif kind is VerbKind.FIND or (kind is VerbKind.CHECK and roles.searched is not None):
        yield from _finding(replace(blank, kind=VerbKind.FIND), roles)
    elif kind is VerbKind.WAIT:
        yield _waiting(blank, roles)
    elif kind is VerbKind.CHARGE:  # the robot charges only itself, at its dock
        places = (place for place in (*roles.ats, *roles.goals) if place.phrase is not None)
        yield replace(blank, passes=tuple(place for place in places if place.name in word_list("docks")))
    elif kind is VerbKind.CHECK:
        unknown = (spoken_words([verb, *clause.items]),)
        yield replace(blank, kind=kind if clause.content else VerbKind.FIND, unknown=unknown)
    else:
        yield from _carrying(blank, roles)


def _departs(verb: Verb, roles: Roles) -> bool:
    """Returns whether a place is only left on the way elsewhere, as in "leave the kitchen and go to the hall"."""
    left = roles.objects if verb.text in word_list("leaves") else []
    if verb.text not in word_list("leaves") and VerbKind.GO in verb.kinds and not roles.objects:
        left = [place.phrase for place in roles.sources if place.phrase is not None]
    places = bool(left) and all(phrase.kind is NounKind.PLACE for phrase in left)
    return places and not (roles.goals or roles.ats or roles.recipient or roles.unknown or roles.searched)


def _going(blank: Action, roles: Roles) -> Iterator[Action]:
    """Yields one action for each place to go to."""
    bare = [HERE if phrase.speaker else Location(phrase) for phrase in roles.objects]
    passed = [place for place in roles.ats if roles.goals and place.preposition in ("around", "by")]
    ats = [place for place in roles.ats if place not in passed]
    if len(bare) == 1 and bare[0] is not HERE and len(ats) == 1 and not roles.goals:
        bare = [replace(bare[0], within=ats.pop())]
    objects = any(phrase.kind is NounKind.THING and not phrase.known for phrase in roles.objects)
    if bare and blank.verb.endswith((" down", " up", " along")):
        passed += [replace(place, preposition=blank.verb.split()[-1]) for place in bare if roles.goals]
        bare = [] if roles.goals else bare
    elif bare and (blank.verb not in word_list("bare_goal") or (blank.verb in word_list("enters") and objects)):
        blank = replace(blank, unknown=(*blank.unknown, *(phrase.spoken for phrase in roles.objects)))
    sought = roles.searched
    fetched = sought is not None and sought.kind is NounKind.THING and not sought.pronoun
    elsewhere = len(roles.goals) == 1 and roles.goals[0].phrase is not None and not (roles.sources or roles.objects)
    if sought is not None and fetched and elsewhere:  # run to the cellar for some wine
        yield replace(blank, kind=VerbKind.ROUND_TRIP, objects=(sought,), source=roles.goals[0], goal=HERE)
        return
    headed = sought if sought is not None and sought.kind is NounKind.PLACE else None
    places = [*roles.goals, *ats, *bare, *([] if headed is None else [Location(headed)]), *roles.joined_goals]
    passed += roles.paths if places else []
    places = places or roles.paths
    if not places and blank.verb in word_list("goes_back"):
        places = [HERE]
    me = ["me"] if roles.recipient is HERE and not roles.favour else []
    unknown = (*blank.unknown, *me, *([] if places else [blank.verb]))
    blank = replace(blank, unknown=unknown, passes=tuple(passed))
    yield from (replace(blank, goal=place) for place in places) if places else (blank,)


def _finding(blank: Action, roles: Roles) -> Iterator[Action]:
    """Yields one action for each place to search: "in the kitchen and the hall"."""
    objects, places = list(roles.objects), [*roles.ats, *roles.sources]
    if roles.searched is not None:
        within, places = (places[0], places[1:]) if objects and places else (None, places)
        places = [*(Location(phrase, within=within) for phrase in objects), *places]
        objects = [roles.searched]
    places = places or [place for place in roles.goals if place == THERE]
    elsewhere = [] if roles.searched is None else places[1 : len(roles.objects)]
    unfit = ["here"] if HERE in roles.goals else []
    found = _with_object(replace(blank, objects=tuple(objects), source=next(iter(places), None)), unfit)
    yield found
    yield from (replace(found, source=place) for place in (*elsewhere, *roles.joined_goals))


def _waiting(blank: Action, roles: Roles) -> Action:
    """Waits for a time, here or in a place; a wait without a time only goes to the place."""
    times = [phrase for phrase in (roles.searched, *roles.objects) if phrase is not None]
    places = [place for place in (*roles.ats, *roles.goals) if place not in (HERE, THERE)]
    fits = len(times) == 1 and times[0].text.lower() in TIME_UNITS_S and times[0].count > 0
    goal, time = next(iter(places), None), times[0] if fits else None
    if not times and goal is not None:
        return replace(blank, kind=VerbKind.GO, goal=goal)
    return replace(blank, goal=goal, time=time, unknown=(*blank.unknown, *([] if fits else [blank.verb])))


def _carrying(blank: Action, roles: Roles) -> Iterator[Action]:
    """Reads taking, bringing and putting: assigns source, goal and recipient.

    "A beer to Robin and Charlie" gives one action for each recipient or place.
    """
    goals, sources, ats = list(roles.goals), list(roles.sources), list(roles.ats)
    if roles.recipient is not None and not (roles.favour and ats and blank.kind is VerbKind.PLACE):
        to_place = bool(goals) and not goals[0].person
        rest = [] if to_place and roles.favour else [roles.recipient]
        goals = [*goals, *rest] if to_place else [roles.recipient, *goals]
    bins = [n for n, each in enumerate(ats) if each.phrase and each.phrase.singular in ("bin", *synonyms_for("bin"))]
    if bins and not goals and blank.kind is VerbKind.PLACE:
        bin_at, around = ats.pop(bins[-1]), ats[bins[-1] :]
        ats, goals = ats[: bins[-1]], [replace(bin_at, within=next(iter(around), bin_at.within))]
    discards, hurls = blank.verb in word_list("discards"), blank.verb in word_list("hurls")
    lies_there = discards or (hurls and bool(ats) and ats[-1].preposition not in ("in", "inside"))
    puts = blank.kind is VerbKind.PLACE and not lies_there
    at_is_goal = puts or blank.verb in word_list("at_is_goal") or len(ats) > 1
    lies = any(place.role is not PrepositionRole.SOURCE for place in sources)  # the cup that is on the desk
    if ats and not goals and (at_is_goal or lies):
        goals.append(ats.pop())
    sources += ats
    bare = _BIN if discards else HERE if blank.verb in word_list("hands") and not sources else None
    goal = next(iter(goals), bare)
    if goal is None and hurls:
        blank = replace(blank, unknown=(*blank.unknown, blank.verb))
    each = len(roles.objects) == 1 and roles.objects[0].indefinite and not roles.objects[0].pronoun
    shared = roles.joined_goals if goal is not None and each else []
    candidates = [place.phrase for place in ([] if shared else [goal, *roles.joined_goals]) if place and place.phrase]
    if len(candidates) > 1:
        blank = replace(blank, choices=(*blank.choices, tuple(candidates)))
    source = next(iter(sources), None)
    found = replace(blank, objects=tuple(roles.objects), source=source, goal=goal, passes=tuple(roles.paths))
    beside = [word for word, place in (("here", HERE), ("there", THERE)) if place in roles.goals and goal != place]
    carried = _with_object(found, beside)
    yield carried
    yield from (replace(carried, goal=place) for place in shared)


def _with_object(action: Action, unknown: Sequence[str] = ()) -> Action:
    """Adds unknown words to the action, and the verb itself when its object is missing."""
    return replace(action, unknown=(*action.unknown, *unknown, *(() if action.objects else (action.verb,))))
