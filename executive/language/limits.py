"""Refuses what the robot cannot do: harm, unsupported routes and relations, and objects and places out of reach."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

from executive.language.actions import Action
from executive.language.items import Chunk, Outside, Predicate, Verb, spoken_words
from executive.language.lexicon import PrepositionRole, VerbKind, lexicon, read_table, word_list
from executive.language.nouns import NounKind, noun_examples
from executive.language.phrases import Phrase
from executive.language.questions import ABLE, RefusalError, RefusalKind
from executive.language.roles import HERE, Location
from executive.words.knowledge import Knowledge
from skills.inputs.errors import listing

_STAYS: Final = (VerbKind.GO, VerbKind.FIND, VerbKind.WAIT, VerbKind.CHARGE)


def check_feasible(actions: Sequence[Action], knowledge: Knowledge | None) -> None:
    """Refuses invalid numbers, people as objects, all of a kind as recipients, abstract objects, and places out of
    reach.

    Raises RefusalError when an action is out of reach; the error names all such actions.
    """
    counted = (phrase for one in actions for phrase in (one.target, one.time) if phrase is not None)
    odd = [number for phrase in counted if (number := phrase.odd_number)]
    if odd:
        raise RefusalError(f"{listing(map(repr, odd))} is no number of objects; say how many in one whole number", odd)
    carrying = [(one, one.target) for one in actions if one.kind not in _STAYS and one.target is not None]
    goals = [one.goal.phrase for one, _ in carrying if one.goal is not None]
    shared = [goal.spoken for goal in goals if goal is not None and goal.universal]
    if shared:
        raise RefusalError(f"I bring objects to one person at a time, not to {', '.join(shared)}; name one", shared)
    people = [f"{one.verb} {target.text}" for one, target in carrying if target.person]
    if people:
        raise RefusalError(f"I cannot carry people: {', '.join(people)}; {ABLE}", people)
    if knowledge is not None:
        rooms = [one for one in actions if one.kind is VerbKind.GO and one.goal is not None and one.goal.every_room]
        actions = [replace(one, objects=()) if _seeks_people(one) else one for one in actions if one not in rooms]
    moved = [one.target for one in actions if one.target is not None and _moved(one, one.target)]
    outside = [(part, part) for one in actions for part in _outside(one, one.target in moved)]
    if outside:
        raise not_understood(outside, knowledge)


def not_understood(parts: Sequence[tuple[str, str]], knowledge: Knowledge | None) -> RefusalError:
    """Refusal with the unknown words, each within its whole clause."""
    named = []
    for clause in dict.fromkeys(clause for _, clause in parts):
        words = dict.fromkeys(part for part, other in parts if other == clause)
        quoted = ", ".join(map(repr, words))
        named.append(quoted if not clause or clause in words else f"{quoted} in {clause!r}")
    postures = sorted({word for part, _ in parts for word in word_list("postures") & {*part.split()}})
    reason = f"I do not understand {', '.join(named)}; {ABLE}"
    if postures:
        reason = f"I see where people are, but not whether they are {listing(postures, last='or')}"
    return RefusalError(reason, [part for part, _ in parts], kind=RefusalKind.NOT_UNDERSTOOD)


def _seeks_people(action: Action) -> bool:
    """Returns whether an action looks for a person, or for anybody ("is anybody in the hall")."""
    phrase = action.target if action.kind is VerbKind.FIND else None
    return phrase is not None and (phrase.somebody or phrase.stands_for_somebody)


def _moved(action: Action, target: Phrase) -> bool:
    """Returns whether an action moves a concrete, definite object from or to a place in the house.

    Examples are "the mail from the desk", and documents ("take the report to the boss").
    """
    if target.indefinite or action.kind in _STAYS:
        return False
    goal, source = action.goal, action.source
    laid = goal is not None and goal.kind is NounKind.PLACE
    if goal is not None and goal.preposition in ("into", "onto") and laid:
        return target.kind is not NounKind.ELSEWHERE
    by_hand = action.verb in word_list("by_hand") or (action.kind is VerbKind.PLACE and laid)
    if goal not in (None, HERE) and by_hand and target.head.lemma in word_list("written"):
        return True
    if source is None or source.role is not PrepositionRole.SOURCE or target.kind is NounKind.ELSEWHERE:
        return False
    fixture = target.head.lemma in word_list("fixtures")
    return source.kind is NounKind.PLACE or (source.kind is NounKind.THING and fixture)


def _outside(action: Action, moved: bool) -> Iterator[str]:
    """Yields the words in an action that are out of reach; `moved` says that the object is in a place in the house."""
    target = action.target
    if target is not None:
        odd = target.universal or target.addressed or target.counts
        if odd or not (moved or target.known or _holdable(target, action)):
            yield f"{action.verb} {target.spoken}"
    for place in (place for each in (action.source, action.goal) if each is not None for place in each.around):
        phrase = place.phrase
        if phrase is not None and (
            phrase.universal
            or not _reachable(phrase, place)
            or (action.kind is VerbKind.GO and _idle(phrase, place, action.verb))
        ):
            yield f"{action.verb} {place.preposition} {phrase.spoken}".replace("  ", " ")


def _holdable(phrase: Phrase, action: Action) -> bool:
    """Returns whether the robot can find the object, and take it to the action's goal."""
    find = action.kind is VerbKind.FIND
    if find and action.source is None:
        trade = phrase.kind is NounKind.PERSON and phrase.indefinite and not phrase.named_person  # a good dentist
        styled = any(t.relation in ("compound", "amod") and not t.adjective for t in phrase.tokens[:-1])
        cuisine = styled and phrase.plural and phrase.indefinite and phrase.head.lemma in word_list("prepared")
        if trade or cuisine:  # pasta dishes, as recipes and menus have them
            return False
    if phrase.kind is NounKind.VEHICLE and (phrase.indefinite or not find):
        return False
    if not find and phrase.head.lemma in word_list("fixtures"):
        return False
    # Verb and noun may be one act, as in "take a picture": then the noun is no object.
    acts = lexicon().light_nouns.get(action.verb.split()[0], frozenset())
    loose = phrase.indefinite or action.verb in word_list("light_whole")
    placed = action.source is not None or (action.goal is not None and action.goal.kind is NounKind.PLACE)
    light = phrase.head.lemma in acts and loose and not placed
    return not light and (phrase.kind is None or phrase.kind.within_reach)


def _idle(phrase: Phrase, place: Location, verb: str) -> bool:
    """Returns whether going there is an idiom or an activity instead of a route: "go to bed", "reach my wife"."""
    out = place.preposition.startswith("out")
    if phrase.person and (out or not phrase.named_person) and place.within is None and verb in word_list("calls"):
        return True
    bare = len(phrase.tokens) == 1 and not phrase.known
    return bare and phrase.head.lemma in lexicon().light_nouns.get(verb.split()[0], frozenset())


def _reachable(phrase: Phrase, place: Location) -> bool:
    """Returns whether the robot can go there; a name before a place belongs to a person ("Paris at the desk")."""
    if phrase.known or phrase.person or (place.within is not None and phrase.head.pos == "PROPN"):
        return True
    nominal = phrase.head.pos not in ("ADJ", "ADV") or len(phrase.tokens) > 1
    called = place.preposition == "to" and phrase.proper and phrase.kind is NounKind.ABSTRACT
    called = called and phrase.head.lemma not in noun_examples()
    return called or (nominal and (phrase.kind is None or phrase.kind.within_reach))


def refuse_harm(clauses: Sequence[Predicate]) -> None:
    """Refuses harmful clauses. Raises RefusalError, which names them."""
    harmful = [spoken_words((clause.verb, *clause.items)) for clause in clauses if clause.verb and _does_harm(clause)]
    if harmful:
        raise RefusalError(f"{', '.join(map(repr, harmful))} could hurt somebody or break something", harmful)


def _does_harm(clause: Predicate) -> bool:
    words, verb = read_table("harm.yaml"), clause.verb
    if not isinstance(verb, Verb | Outside):
        return False
    said = (verb.text if isinstance(verb, Verb) else verb.word).lower()
    chunks = [item for item in clause.items if isinstance(item, Chunk) and item.role is not PrepositionRole.FOR]
    met = [chunk for chunk in chunks if _somebody(chunk.phrase)]
    if said in words["harms"] or (met and said in words["harms_somebody"]):
        return True
    if said in words["throws"]:
        return any(chunk.preposition in words["flies"] for chunk in chunks) or bool(met)
    moves = isinstance(verb, Verb) and not verb.kinds <= {VerbKind.FIND, VerbKind.CHECK}
    over = "over" if said.endswith(" over") and isinstance(verb, Verb) and VerbKind.GO in verb.kinds else ""
    return moves and any((chunk.preposition or over) in words["upon"] for chunk in met)


def _somebody(phrase: Phrase) -> bool:
    """Returns whether the phrase means a person, or a part of a person."""
    bare = len(phrase.content) == 1
    living = phrase.receiver or phrase.stands_for_somebody or (bare and phrase.living)
    owned = not bare or any(token.tag in ("PRP$", "POS") for token in phrase.tokens)
    return living or (owned and phrase.head.lemma in read_table("harm.yaml")["body"])


def is_door(place: Location) -> bool:
    """Returns whether a place on a route is a door, through which the robot goes in any case."""
    return place.phrase is not None and place.phrase.head.lemma in read_table("relations.yaml")["doors"]


def check_routes_and_speaker(clauses: Sequence[Predicate], actions: Sequence[Action]) -> None:
    """Refuses a prescribed route, and relations to the speaker except "to me". Raises RefusalError."""
    for place in (place for action in actions for place in action.passes if not is_door(place)):
        said = f"{place.preposition} {place.name if place.phrase is None else place.phrase.spoken}"
        raise RefusalError(f"I find my own way, and do not go {said!r}", [said])
    for clause in clauses:
        act = "go" if isinstance(clause.verb, Verb) and clause.verb.kinds == {VerbKind.GO} else "bring"
        for chunk in clause.items:
            if isinstance(chunk, Chunk) and chunk.phrase.speaker and not _keeps(act, "person", chunk.preposition):
                raise relation_refusal(act, chunk.preposition, chunk.phrase.spoken)


def check_relation(act: str, kinds: Sequence[str], location: Location) -> None:
    """Refuses a relation to a place that a command ("go", "bring", "look") does not support.

    `kinds` are the possible kinds of the place: "room", "surface" or "person". Raises RefusalError.
    """
    name, around = location.phrase, location.within
    if name is None:
        return
    open_top = "surface" in kinds and name.head.lemma.split()[-1] in read_table("relations.yaml")["open_tops"]
    supported = any(_keeps(act, kind, location.preposition) for kind in kinds)
    if not supported and not (open_top and _keeps("lie", "open_top", location.preposition)):
        raise relation_refusal(act, location.preposition, name.spoken)
    if around is not None and not _keeps("around", "place", around.preposition):
        raise relation_refusal("around", around.preposition, around.name)


def relation_refusal(act: str, preposition: str, name: str) -> RefusalError:
    """Refusal of a relation to a place or to somebody, with what the robot does instead."""
    said = f"{preposition} {name}".strip()
    return RefusalError(f"{read_table('relations.yaml')['instead'][act]}, not {said!r}", [said])


def _keeps(act: str, kind: str, preposition: str) -> bool:
    table = read_table("relations.yaml")
    return any(preposition in table["groups"][group] for group in table["supported"][act][kind])
