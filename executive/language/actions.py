"""Reads actions: the work that each clause asks of the robot."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, takewhile, zip_longest
from typing import Final

from executive.language.items import Adverb, Being, Chunk, Predicate, Unknown, Verb, requested_predicates, spoken_words
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
    def bare(self) -> bool:
        """Returns whether only the verb is not understood: it lacks its object or place."""
        return self.unknown == (self.verb,)

    @property
    def for_somebody(self) -> bool:
        """Returns whether the speaker, another person or an animal gets the object."""
        return self.goal is not None and (self.goal == HERE or self.goal.living)

    @property
    def phrases(self) -> tuple[Phrase, ...]:
        """Noun phrases of the action in any role."""
        places = (place for each in (self.source, self.goal, *self.passes) if each is not None for place in each.around)
        others = (self.teller, self.time, *_phrases(places))
        return (*self.objects, *chain(*self.choices), *(phrase for phrase in others if phrase is not None))


def _phrases(places: Iterable[Location | None]) -> tuple[Phrase, ...]:
    return tuple(place.phrase for place in places if place is not None and place.phrase is not None)


_IT: Final = Phrase((Token(0, 0, "it", "it", "PRON", "PRP", 0, "obj"),))
_BIN: Final = Location(Phrase((Token(0, 0, "bin", "bin", "NOUN", "NN", 0, "obl", kind=NounKind.PLACE),)), "to")
_AIMS: Final = (PrepositionRole.GOAL, PrepositionRole.FOR)
_ALONG: Final = (" down", " up", " along")
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
        receiver = None if any(map(_names_aim, clause.items)) else recipient
        for action in _actions(clause):
            gives = action.verb.partition(" ")[0] in word_list("to_recipient")
            goal = (receiver if gives else None) or action.goal
            action = replace(action, said=_said(clause), follows=follows, goal=goal)
            lacks = action.bare and not action.objects and action.kind in _ELIDING
            if elliptic and lacks and (goal is not None or action.kind is VerbKind.FIND):
                action = replace(action, unknown=(), objects=(_IT,))  # take the phone and carry to me
            elliptic = elliptic or any(not phrase.speaker for phrase in action.objects)
            found.append(action)
        follows = _leads_on(clause)
    return tuple(_without_idle_drives(_without_idle_waits(found)))


def _leads_on(clause: Predicate) -> bool:
    end = takewhile(lambda item: item not in clause.content, reversed(clause.items))
    return any(getattr(item, "word", "") in word_list("follows") for item in end)


def _names_aim(item: object) -> bool:
    aims = isinstance(item, Chunk) and (item.role in _AIMS or (item.role is None and item.phrase.receiver))
    return aims or isinstance(item, Adverb)


def _said(clause: Predicate) -> str:
    return spoken_words(item for item in (clause.subject, clause.verb, *clause.items) if item is not None)


def _without_idle_waits(actions: Sequence[Action]) -> Sequence[Action]:
    """Removes a wait without a time after the last drive: the robot stays there. Raises RefusalError for others."""
    waits = [action for action in actions if action.verb in word_list("wait") and action.time is None]
    idle = [action for action in waits if action.kind is VerbKind.WAIT and action.bare]
    match actions:
        case [*before, Action(kind=VerbKind.GO) as drive, last] if last in idle:
            return _without_idle_waits([*before, drive])
    if idle or any(action.kind is VerbKind.GO for action in waits if action is not actions[-1]):
        said = (idle or waits)[0].said
        raise RefusalError(f"say for how long I am to wait in '{said}', or until what", [said])
    return actions


def _without_idle_drives(actions: Sequence[Action]) -> Iterator[Action]:
    """Leaves out the "go" of "go and find"; the last action is not understood if it only leaves a place."""
    for action, after in zip_longest(actions, actions[1:]):
        if after is None and action.departs:
            yield replace(action, unknown=(action.said,))
        elif after is None or action.kind is not VerbKind.GO or action.goal is not None or not action.bare:
            yield action


def _actions(clause: Predicate) -> Iterator[Action]:
    match clause.verb:
        case Being() as being:
            yield _being(clause, being)
        case Verb() as verb:
            yield from _acting(clause, verb)
        case _:
            yield Action(None, "", unknown=(_said(replace(clause, subject=None)),))


def _being(clause: Predicate, being: Being) -> Action:
    """Reads a status check ("is there a hammer on the desk") or a statement ("there is a hammer on the desk")."""
    roles, told = read_roles(clause.items, describes=False), Action(None, being.text)
    match clause.subject, roles:
        case _ if being.narrated:
            return _narrated(being, roles)
        case Chunk(phrase=subject), _ if _is_state(clause, being):
            return replace(told, objects=() if subject.speaker or subject.pronoun else (subject,))
        case Chunk(phrase=Phrase(speaker=True)), _ if not being.asked:  # we are out of napkins, I am in the hall
            unknown = (*roles.unknown, *(phrase.spoken for phrase in roles.objects))
            return replace(told, objects=_phrases(roles.sources), source=next(iter(roles.ats), None), unknown=unknown)
        case Chunk(phrase=subject), Roles(recipient=Location(phrase=teller), objects=[], unknown=[]) if not being.asked:
            return replace(told, objects=(subject,), teller=teller)
        case Chunk(phrase=subject), _:
            return _located(clause, being, roles, [subject, *roles.objects])
    return _located(clause, being, roles, roles.objects)


def _located(clause: Predicate, being: Being, roles: Roles, objects: Sequence[Phrase]) -> Action:
    there = [THERE] * roles.goals.count(THERE)
    places = [*roles.ats, *roles.sources, *there]
    kind = VerbKind.FIND if being.asked or clause.whether else None
    located = places or being.existential or (kind is not None and any(phrase.relations for phrase in objects))
    surplus = places[1:] or objects[1:] or roles.goals != there or roles.unknown or roles.joined_goals
    fits = objects and located and not (surplus or any(map(_is_question, objects)))
    found = Action(kind, "be", tuple(objects[:1]), next(iter(places), None), teller=being.teller)
    return replace(found, unknown=() if fits else (_said(clause),), choices=tuple(map(tuple, roles.choices)))


def _narrated(being: Being, roles: Roles) -> Action:
    """Reads a narrated event with its object; an event is no request."""
    lacked = [place.phrase for place in roles.sources if place.preposition == "out of"]
    topics = [*filter(None, (*roles.objects, roles.searched, *lacked))] or [*filter(None, (being.topic,))]
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
    match roles:
        case Roles(objects=[first, _, *_], recipient=None, listed=False) if verb.text in word_list("gives"):
            roles.unknown.append(first.spoken)
    if _departs(verb, roles):
        yield Action(None, verb.text, departs=True)
        return
    moved = bool(roles.objects or roles.recipient)  # "get the cup" takes, "get to the hall" goes
    kinds = [kind for kind in VerbKind if kind in verb.kinds]
    kind = min(kinds, key=lambda kind: moved is (kind is VerbKind.GO))
    blank = Action(kind, verb.text, unknown=tuple(roles.unknown), choices=tuple(map(tuple, roles.choices)))
    match kind, roles:
        case VerbKind.GO, _:
            yield from _going(blank, roles)
        case (VerbKind.FIND, _) | (VerbKind.CHECK, Roles(searched=Phrase())):
            yield from _finding(replace(blank, kind=VerbKind.FIND), roles)
        case VerbKind.WAIT, _:
            yield _waiting(blank, roles)
        case VerbKind.CHARGE, _:  # the robot charges only itself, at its dock
            docks = (place for place in (*roles.ats, *roles.goals) if place.name in word_list("docks"))
            yield replace(blank, passes=tuple(docks))
        case VerbKind.CHECK, _:
            yield replace(blank, kind=kind if clause.content else VerbKind.FIND, unknown=(_said(clause),))
        case _:
            yield from _carrying(blank, roles)


def _departs(verb: Verb, roles: Roles) -> bool:
    """Returns whether a place is only left on the way elsewhere, as in "leave the kitchen and go to the hall"."""
    left = roles.objects if verb.text in word_list("leaves") else []
    if verb.text not in word_list("leaves") and VerbKind.GO in verb.kinds and not roles.objects:
        left = [*_phrases(roles.sources)]
    places = bool(left) and all(phrase.kind is NounKind.PLACE for phrase in left)
    return places and not (roles.goals or roles.ats or roles.recipient or roles.unknown or roles.searched)


def _going(blank: Action, roles: Roles) -> Iterator[Action]:
    """Yields one action for each place to go to."""
    bare = not (roles.sources or roles.objects)
    match roles.searched, roles.goals:
        case Phrase(kind=NounKind.THING, pronoun=False) as sought, [Location(phrase=Phrase()) as place] if bare:
            # run to the cellar for some wine
            yield replace(blank, kind=VerbKind.ROUND_TRIP, objects=(sought,), source=place, goal=HERE)
            return
    places, passed = _route(blank.verb, roles)
    passes = (*passed, *roles.paths) if places else ()
    places = places or roles.paths or ([HERE] if blank.verb in word_list("goes_back") else [])
    unfit = (
        (not _names_places(blank.verb, roles.objects), [phrase.spoken for phrase in roles.objects]),
        (roles.recipient == HERE and not roles.favour, ["me"]),
        (not places, [blank.verb]),
    )
    unknown = (*blank.unknown, *chain(*(words for when, words in unfit if when)))
    blank = replace(blank, unknown=unknown, passes=passes)
    yield from (replace(blank, goal=place) for place in places) if places else (blank,)


def _route(verb: str, roles: Roles) -> tuple[list[Location], list[Location]]:
    """Places to go to, and places on the way to them."""
    named = [HERE if phrase.speaker else Location(phrase) for phrase in roles.objects]
    passed = [place for place in roles.ats if roles.goals and place.preposition in ("around", "by")]
    ats = [place for place in roles.ats if place not in passed]
    if roles.goals and verb.endswith(_ALONG):
        passed, named = [*passed, *(replace(place, preposition=verb.split()[-1]) for place in named)], []
    elif not roles.goals and len(named) == len(ats) == 1 and named != [HERE]:
        named, ats = [replace(named[0], within=ats[0])], []
    match roles.searched:
        case Phrase(kind=NounKind.PLACE) as headed:
            named.append(Location(headed))
    return [*roles.goals, *ats, *named, *roles.joined_goals], passed


def _names_places(verb: str, objects: Sequence[Phrase]) -> bool:
    """Returns whether phrases without a preposition are places to go to, or to go along."""
    things = any(phrase.kind is NounKind.THING and not phrase.known for phrase in objects)
    enters = verb in word_list("bare_goal") and not (things and verb in word_list("enters"))
    return enters or verb.endswith(_ALONG)


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
    goal, ats = _aim(blank, roles)
    sources, shared = [*roles.sources, *ats], list[Location]()
    if goal is None and blank.verb in word_list("discards"):
        goal = _BIN
    elif goal is None and blank.verb in word_list("hands") and not sources:
        goal = HERE
    match roles.objects:
        case [Phrase(indefinite=True, pronoun=False)] if goal is not None:
            shared = roles.joined_goals
    choice = _phrases([] if shared else [goal, *roles.joined_goals])
    lost = [word for word, place in (("here", HERE), ("there", THERE)) if place in roles.goals and goal != place]
    if goal is None and blank.verb in word_list("hurls"):
        lost = [blank.verb, *lost]
    found = replace(blank, objects=tuple(roles.objects), source=next(iter(sources), None), passes=tuple(roles.paths))
    found = replace(_with_object(found, lost), choices=(*blank.choices, choice) if choice[1:] else blank.choices)
    yield from (replace(found, goal=place) for place in (goal, *shared))


def _aim(blank: Action, roles: Roles) -> tuple[Location | None, Sequence[Location]]:
    """Goal or recipient of an object, and the places after "in" and "on" where it lies."""
    goal, ats, puts = next(iter(roles.goals), None), roles.ats, blank.kind is VerbKind.PLACE
    if (goal is None or goal.person) and not (roles.favour and ats and puts):
        goal = roles.recipient or goal
    if goal is not None or not ats:
        return goal, ats
    bins = [n for n, at in enumerate(ats) if at.phrase and at.phrase.singular in ("bin", *synonyms_for("bin"))]
    if bins and puts:
        thrown, *around = ats[bins[-1] :]
        return replace(thrown, within=next(iter(around), thrown.within)), ats[: bins[-1]]
    return (ats[-1], ats[:-1]) if _goes_there(blank, roles) else (None, ats)


def _goes_there(blank: Action, roles: Roles) -> bool:
    """Returns whether the last place after "in" or "on" says where an object goes, and not where it lies."""
    hurled = blank.verb in word_list("hurls") and roles.ats[-1].preposition not in ("in", "inside")
    puts = blank.kind is VerbKind.PLACE and not (hurled or blank.verb in word_list("discards"))
    described = any(place.role is not PrepositionRole.SOURCE for place in roles.sources)  # the cup that is on the desk
    return puts or described or len(roles.ats) > 1 or blank.verb in word_list("at_is_goal")


def _with_object(action: Action, unknown: Sequence[str] = ()) -> Action:
    """Adds unknown words to the action, and the verb itself when its object is missing."""
    return replace(action, unknown=(*action.unknown, *unknown, *(() if action.objects else (action.verb,))))
