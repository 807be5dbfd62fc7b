"""Reads rules for rooms in a sentence: keep out, drive slowly, be quiet."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from pydantic import ValidationError

from executive.language.amounts import parse_number
from executive.language.clauses import begins_action
from executive.language.lexicon import any_of
from executive.language.questions import RefusalError
from executive.language.spelling import synonyms_for
from executive.language.templates import Match, page, words_of
from executive.words.knowledge import Knowledge
from executive.words.step import Step
from executive.words.steps import Group
from executive.words.zone import ZoneFacts
from skills.api import ZoneKind

_PAGE: Final = page("zones")
_KINDS: Final = (ZoneKind.KEEP_OUT, ZoneKind.SPEED_LIMIT, ZoneKind.SILENT)
_ENDS: Final = frozenset({"", ".", ";", "!", "?"})
_ADDRESS: Final = re.compile(r"\W*(?:(?:hey|hi|hello|ok|okay)\W+)?\w+\W*", re.IGNORECASE)
Zones = Mapping[str, ZoneFacts]


@dataclass(frozen=True)
class RoomRules:
    """Rules in a sentence as zones by name, and the `rest` of the sentence; no zones if it contains no rules.

    In `knowledge`, which serves to understand the rest, no object is usually in a forbidden room.
    """

    rest: str
    knowledge: Knowledge | None
    zones: Zones = field(default_factory=dict)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes, one on each rule."""
        return tuple(f"until it is done, {facts.zone(name, {name: ()}).words}" for name, facts in self.zones.items())

    def around(self, steps: Sequence[Step]) -> Group:
        """Puts steps into a group that has the zones. Raises RefusalError for work in a forbidden room."""
        forbidden, knowledge = _forbidden(self.zones), self.knowledge
        assert knowledge is not None
        for command in (command for step in steps for each in step.walk() for command in each.commands):
            place = knowledge.place(command.goal_at or command.goal or "")
            if place is not None and (room := knowledge.room(place)) in forbidden:
                what = "and send me there" if place == room else f"and the {place} is in it"
                raise RefusalError(f"you keep me out of the {room}, {what}; say one of the two", [room])
        return Group(steps=tuple(steps), zones=dict(self.zones))


def read_rules(text: str, knowledge: Knowledge | None) -> RoomRules:
    """Reads rules for rooms in a sentence. Raises RefusalError for a rule without any work or an unclear rule."""
    if knowledge is None or not {*_PAGE.table["lists"]["mentions"]} & {*words_of(text).words}:
        return RoomRules(text, knowledge)
    rest, zones = take_rules(text, knowledge)
    if not zones:
        return RoomRules(text, knowledge)
    if not re.search(r"\w", rest):
        example = f"'{text.strip(' .!')} and bring me a drink'"
        lasting = "`errand world zone add` makes a lasting rule for a world of your own"
        what = f"a rule for a room needs work in the same sentence, as in {example}; {lasting}"
        raise RefusalError(what, [text])
    return RoomRules(rest, _without(knowledge, _forbidden(zones)), zones)


def _forbidden(zones: Zones) -> frozenset[str]:
    """Rooms that the robot must keep out of."""
    return frozenset(zone.place for zone in zones.values() if zone.place and zone.kind is ZoneKind.KEEP_OUT)


def take_rules(text: str, knowledge: Knowledge) -> tuple[str, Zones]:
    """Takes the rules out of a sentence: its rest, and the zones by name. Raises RefusalError for an unclear rule."""
    zones, own = dict[str, ZoneFacts](), _rooms_by_word(knowledge)
    forms = page("zones", room=tuple(sorted(own, key=len, reverse=True)))
    for kind in _KINDS:
        for start, first in [*_starts(text)][::-1]:
            match = forms[kind].match(text, start)
            rest = None if match is None else _rest(text, match, start, first)
            if match is None or rest is None:
                continue
            for name in (own[said.lower()] for said in re.findall(any_of(own), match["rooms"], re.IGNORECASE)):
                facts = _facts(kind, match, name)
                zones[name if name not in zones else f"{name}, {facts.kind.replace('_', ' ')}"] = facts
            text = rest
    for intent in (*_KINDS, "other"):
        left = forms[intent].search(text)
        begin = "" if left is None else text[: left.start]
        but, forbids = re.search(r"\bbut\W*$", begin, re.IGNORECASE) is not None, intent == ZoneKind.KEEP_OUT
        if left is not None and (but if _PAGE["speaks"].search(begin) else not forbids):
            raise RefusalError(f"I do not understand '{left.text}' here; say it in a sentence of its own", [left.text])
    return text, zones


def _rooms_by_word(knowledge: Knowledge) -> dict[str, str]:
    """Rooms by the words that mean them, in lower case."""
    spelt = ((room, spelling) for room in knowledge.rooms for spelling in knowledge.spellings([room]))
    words = ((word, room) for room, spelling in spelt for word in (*synonyms_for(spelling), spelling))
    return {word.lower(): room for word, room in words if knowledge.place(word) in (None, room)}


def _starts(text: str) -> Iterator[tuple[int, int]]:
    """Yields the words at which the clause of a rule may begin, each with the first of the words that join it."""
    words, at, first = words_of(text).words, 0, 0
    yield 0, 0
    while at < len(words):
        if (joint := _PAGE["joint"].match(text, at)) is not None:
            at = joint.after
            yield at, first
        else:
            if first == at and _PAGE["begins"].match(text, at) is not None:
                yield at, at
            at = first = at + 1


def _rest(text: str, rule: Match, start: int, first: int) -> str | None:
    """Text without a rule; None if the rule is no separate clause, is conditional, or is quoted speech."""
    words = words_of(text)
    begin = text[: words.spans[first - 1][1]] if first else ""
    sentence = re.split(r"[.;!?]", text[: rule.start])[-1]
    tail = _PAGE["tail"].match(text, rule.after)
    behind = end = rule.after if tail is None else tail.after
    while (joint := _PAGE["joint"].match(text, behind)) is not None:
        behind = joint.after
    rest = text[words.start(behind) :]
    asks = words.words[behind - 1 : behind + 1] in (["and", "if"], ["but", "if"])
    apart = words.word(end) in _ENDS or asks or begins_action(rest)
    if not apart or _PAGE["depends"].search(sentence) or _PAGE["speaks"].search(sentence):
        return None
    if not rest or not begin:
        return begin or rest
    if _ADDRESS.fullmatch(begin):
        return f"{begin}, {rest}"
    ends = _ENDS & {*words.words[first:start], *words.words[end:behind]}
    return f"{begin}. {rest}" if ends else f"{begin}, and {rest}"


def _facts(kind: ZoneKind, match: Match, room: str) -> ZoneFacts:
    """Zone for a room's rule. Raises RefusalError for a speed that no robot can obey."""
    speed = None
    if kind is ZoneKind.SPEED_LIMIT:
        speed = round((parse_number(match["amount"] or "one") or 0.0) * float(match["unit"]), 3)
    try:
        return ZoneFacts(kind=kind, place=room, speed=speed)
    except ValidationError as error:
        what = f"I cannot keep a limit of {match['speed']}; say 0.1 to 3 m/s"
        raise RefusalError(what, [match["amount"]]) from error


def _without(knowledge: Knowledge, rooms: Collection[str]) -> Knowledge:
    """Knowledge in which no objects are usually in these rooms."""

    def is_open(place: str) -> bool:
        return knowledge.room(place) not in rooms

    usual = {name: {"usual": (*filter(is_open, facts.usual),)} for name, facts in knowledge.things.items()}
    things = {name: facts.model_copy(update=usual[name]) for name, facts in knowledge.things.items()}
    tables = knowledge.defaults.items()
    defaults = {task: {word: place for word, place in table.items() if is_open(place)} for task, table in tables}
    return knowledge.model_copy(update={"things": things, "defaults": defaults})
