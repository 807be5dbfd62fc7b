"""Refuses what the robot cannot do: harm, unsupported routes and relations, and objects and places out of reach."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Final

from executive.language.actions import Action
from executive.language.items import Item, Outside, Predicate, Verb, chunks, spoken_words
from executive.language.lexicon import PrepositionRole, VerbKind, lexicon, read_table, word_list
from executive.language.nouns import NounKind, noun_examples
from executive.language.phrases import Phrase
from executive.language.questions import RefusalError, RefusalKind, abilities
from executive.language.roles import HERE, Location
from executive.words.knowledge import Knowledge
from skills.inputs.errors import listing

_STAYS: Final = (VerbKind.GO, VerbKind.FIND, VerbKind.WAIT, VerbKind.CHARGE)


def check_feasible(actions: Sequence[Action], knowledge: Knowledge | None) -> None:
    """Refuses invalid numbers, people as objects, all of a kind as recipients, and what is abstract or out of reach.

    Raises RefusalError when an action is out of reach; the error names all such actions.
    """
    for reason, find in _REFUSED.items():
        if said := [*filter(None, chain(*map(find, actions)))]:
            words = {"quoted": listing(map(repr, said)), "said": ", ".join(said), "able": abilities()}
            raise RefusalError(reason.format(**words), said)
    actions = actions if knowledge is None else [*_unbound(actions)]
    moved = [target for action in actions for target in action.objects[:1] if _moved(action, target)]
    outside = [(part, part) for action in actions for part in _outside(action, action.target in moved)]
    if outside:
        raise not_understood(outside, knowledge)


_REFUSED: Final[Mapping[str, Callable[[Action], Iterable[str | None]]]] = {
    "{quoted} is no number of objects; say how many in one whole number": lambda action: (
        phrase.odd_number for phrase in (action.target, action.time) if phrase is not None
    ),
    "I bring objects to one person at a time, not to {said}; name one": lambda action: (
        phrase.spoken for _, phrase in _carried(action) if phrase is not None and phrase.universal
    ),
    "I cannot carry people: {said}; {able}": lambda action: (
        f"{action.verb} {target.text}" for target, _ in _carried(action) if target.person
    ),
}
"""Reasons to refuse actions, with the words of an action to which they apply."""


def _carried(action: Action) -> list[tuple[Phrase, Phrase | None]]:
    """Object that an action carries, and where to."""
    carried = () if action.kind in _STAYS else action.objects[:1]
    return [(target, None if action.goal is None else action.goal.phrase) for target in carried]


def not_understood(parts: Sequence[tuple[str, str]], knowledge: Knowledge | None) -> RefusalError:
    """Refusal with the unknown words, each within its whole clause."""
    named = []
    for clause in dict.fromkeys(clause for _, clause in parts):
        words = dict.fromkeys(part for part, other in parts if other == clause)
        quoted = ", ".join(map(repr, words))
        named.append(quoted if not clause or clause in words else f"{quoted} in {clause!r}")
    postures = sorted({word for part, _ in parts for word in word_list("postures") & {*part.split()}})
    reason = f"I do not understand {', '.join(named)}; {abilities()}"
    if postures:
        reason = f"I see where people are, but not whether they are {listing(postures, last='or')}"
    return RefusalError(reason, [part for part, _ in parts], kind=RefusalKind.NOT_UNDERSTOOD)


def _unbound(actions: Iterable[Action]) -> Iterator[Action]:
    """Yields the actions without what a world settles: each room, and the people in it ("is anybody in the hall")."""
    for action in actions:
        who = action.target if action.kind is VerbKind.FIND else None
        if who is not None and (who.somebody or who.stands_for_somebody):
            action = replace(action, objects=())
        if action.kind is not VerbKind.GO or action.goal is None or not action.goal.every_room:
            yield action


def _moved(action: Action, target: Phrase) -> bool:
    """Returns whether a definite object is moved from or to a place ("the mail from the desk"), or a document given."""
    if target.indefinite or action.kind in _STAYS:
        return False
    by_hand = action.verb in word_list("by_hand") or (action.kind is VerbKind.PLACE and _lays(action))
    written, near = target.head.lemma in word_list("written"), target.kind is not NounKind.ELSEWHERE
    match action.goal, action.source:
        case Location(kind=NounKind.PLACE, preposition="into" | "onto"), _:
            return near
        case goal, _ if goal not in (None, HERE) and by_hand and written:
            return True
        case _, Location(kind=NounKind.PLACE, role=PrepositionRole.SOURCE):
            return near
        case _, Location(kind=NounKind.THING, role=PrepositionRole.SOURCE):
            return near and target.head.lemma in word_list("fixtures")
    return False


def _lays(action: Action) -> bool:
    return action.goal is not None and action.goal.kind is NounKind.PLACE


def _outside(action: Action, moved: bool) -> Iterator[str]:
    """Yields the words in an action that are out of reach; `moved` says that the object is in a place in the house."""
    for target in action.objects[:1]:
        odd = target.universal or target.addressed or target.counts
        if odd or not (moved or target.known or _holdable(target, action)):
            yield f"{action.verb} {target.spoken}"
    for place in chain(*(each.around for each in (action.source, action.goal) if each is not None)):
        if place.phrase is not None and not _reachable(place.phrase, place, action):
            yield f"{action.verb} {place.preposition} {place.phrase.spoken}".replace("  ", " ")


def _holdable(phrase: Phrase, action: Action) -> bool:
    """Returns whether the robot can find the object, and take it to the action's goal."""
    find, lemma = action.kind is VerbKind.FIND, phrase.head.lemma
    if find and action.source is None and _advised(phrase):
        return False
    if phrase.kind is NounKind.VEHICLE and (phrase.indefinite or not find):
        return False
    if lemma in word_list("fixtures") and not find:
        return False
    # Verb and noun may be one act, as in "take a picture": then the noun is no object.
    acts = lexicon().light_nouns.get(action.verb.split()[0], frozenset())
    loose = phrase.indefinite or action.verb in word_list("light_whole")
    light = lemma in acts and loose and action.source is None and not _lays(action)
    return not light and (phrase.kind is None or phrase.kind.within_reach)


def _advised(phrase: Phrase) -> bool:
    """Returns whether advice is sought: "a good dentist", or "pasta dishes", as recipes and menus have them."""
    trade = phrase.kind is NounKind.PERSON and phrase.indefinite and not phrase.named_person
    styled = any(t.relation in ("compound", "amod") and not t.adjective for t in phrase.tokens[:-1])
    cuisine = styled and phrase.plural and phrase.indefinite and phrase.head.lemma in word_list("prepared")
    return trade or cuisine


def _idle(phrase: Phrase, place: Location, verb: str) -> bool:
    """Returns whether going there is an idiom or an activity instead of a route: "go to bed", "reach my wife"."""
    out = place.preposition.startswith("out")
    if phrase.person and (out or not phrase.named_person) and place.within is None and verb in word_list("calls"):
        return True
    bare = len(phrase.tokens) == 1 and not phrase.known
    return bare and phrase.head.lemma in lexicon().light_nouns.get(verb.split()[0], frozenset())


def _reachable(phrase: Phrase, place: Location, action: Action) -> bool:
    """Returns whether the robot can go there; a name before a place belongs to a person ("Paris at the desk")."""
    if phrase.universal or (action.kind is VerbKind.GO and _idle(phrase, place, action.verb)):
        return False
    if phrase.known or phrase.person or (place.within is not None and phrase.head.pos == "PROPN"):
        return True
    nominal = phrase.head.pos not in ("ADJ", "ADV") or len(phrase.tokens) > 1
    called = place.preposition == "to" and phrase.proper and phrase.kind is NounKind.ABSTRACT
    return (called and phrase.head.lemma not in noun_examples()) or (
        nominal and (phrase.kind is None or phrase.kind.within_reach)
    )


def refuse_harm(clauses: Sequence[Predicate]) -> None:
    """Refuses harmful clauses. Raises RefusalError, which names them."""
    acts = [(one.verb, one.items) for one in clauses if isinstance(one.verb, Verb | Outside)]
    harmful = [spoken_words((verb, *items)) for verb, items in acts if _does_harm(verb, items)]
    if harmful:
        raise RefusalError(f"{', '.join(map(repr, harmful))} could hurt somebody or break something", harmful)


def _does_harm(verb: Verb | Outside, items: Sequence[Item]) -> bool:
    words, said = read_table("harm.yaml"), spoken_words([verb]).lower()
    kinds = verb.kinds if isinstance(verb, Verb) else frozenset[VerbKind]()
    over = "over" if said.endswith(" over") and VerbKind.GO in kinds else ""
    ways = {chunk.preposition for chunk in chunks(items)}
    met = {one.preposition or over for one in chunks(items) if _somebody(one.phrase) and one.preposition != "for"}
    return (
        said in words["harms"]
        or (bool(met) and said in (*words["harms_somebody"], *words["throws"]))
        or (said in words["throws"] and not ways.isdisjoint(words["flies"]))
        or (not kinds <= {VerbKind.FIND, VerbKind.CHECK} and not met.isdisjoint(words["upon"]))
    )


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
        for chunk in chunks(clause.items):
            if chunk.phrase.speaker and not _keeps(act, "person", chunk.preposition):
                raise relation_refusal(act, chunk.preposition, chunk.phrase.spoken)


def check_relation(act: str, kinds: Sequence[str], location: Location) -> None:
    """Refuses a relation that an act ("go", "bring", "look") does not support to a "room", "surface" or "person"."""
    name, around = location.phrase, location.within
    if name is None:
        return
    open_top = "surface" in kinds and name.head.lemma.split()[-1] in read_table("relations.yaml")["open_tops"]
    if not any(_keeps(act, kind, location.preposition) for kind in kinds) and not (
        open_top and _keeps("lie", "open_top", location.preposition)
    ):
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
