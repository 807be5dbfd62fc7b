"""Reads rules for rooms in a sentence: keep out, drive slowly, be quiet."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from pydantic import ValidationError

from executive.language.amounts import parse_number
from executive.language.clauses import begins_action
from executive.language.lexicon import Patterns, any_of, expression, read_table
from executive.language.questions import RefusalError
from executive.language.spelling import synonyms_for
from executive.language.templates import page
from executive.words.knowledge import Knowledge
from executive.words.step import Step
from executive.words.steps import Group
from executive.words.zone import ZoneFacts
from skills.api import ZoneKind

SLOWLY_M_S: Final = 0.3
"""Speed limit of "slowly"."""
_FORMS: Final = Patterns("zones.yaml")
_PAGE: Final = page("zones")
_PARTS: Final = {"half": 0.5, "quarter": 0.25, "three quarters": 0.75}
_UNITS_M_S: Final = {"m": 1.0, "c": 0.01, "k": 1.0 / 3.6}
_SPEEDS: Final = ("slowly", "at_most")
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
    if knowledge is None or _FORMS.mentions.search(text) is None:
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
    """Removes the rules for rooms from a sentence; returns the rest of the sentence, and the zones by name.

    Raises RefusalError for a speed limit that is not a separate clause, or that no robot can obey.
    """
    zones: dict[str, ZoneFacts] = {}
    own = {
        word.lower(): name
        for name in knowledge.rooms
        for spelling in knowledge.spellings([name])
        for word in (*synonyms_for(spelling), spelling)
        if knowledge.place(word) in (None, name)
    }
    names = rf"(?:{any_of(own)})(?![\w'-])"
    room = rf"(?:(?:the|my|our|your) )?{names}"
    rooms = rf"(?P<rooms>{room}(?:(?:,? (?:and|or|nor)|,)(?: {_FORMS.text('into')})? {room})*)"
    patterns, rules = _FORMS.with_words(rooms=rooms), read_table("zones.yaml")["rules"] if own else {}
    forms = {kind: [*map(patterns.compiled, map(expression, rows))] for kind, rows in rules.items()}
    for kind, form in ((kind, form) for kind, rows in forms.items() for form in rows if kind != "other"):
        for match in [*form.finditer(text)][::-1]:
            if (end := _end(text, match)) is not None:
                for said in re.findall(names, match["rooms"], re.IGNORECASE):
                    name = own[said.lower()]
                    facts = _facts(kind, match, name)
                    zones[name if name not in zones else f"{name}, {facts.kind.replace('_', ' ')}"] = facts
                text = _joined(text[: match.start()], text[end:])
    for left in filter(None, (form.search(text) for rows in forms.values() for form in rows)):
        begin = text[: left.start()]
        is_said, other = _PAGE["speaks"].search(begin) is not None, left.re not in forms["keep_out"]
        if re.search(r"\bbut\W*$", begin, re.IGNORECASE) if is_said else other:
            raise RefusalError(f"I do not understand '{left[0]}' here; say it in a sentence of its own", [left[0]])
    return text, zones


def _end(text: str, match: re.Match[str]) -> int | None:
    """End of a rule's clause; None if the rule is no separate clause, is conditional, or is quoted speech."""
    begin, tail = text[: match.start()], _FORMS.tail.match(text, match.end())
    end = match.end() if tail is None else tail.end()
    sentence = re.split(r"[.;!?]", begin)[-1]
    if _FORMS.depends.search(sentence) or _PAGE["speaks"].search(sentence):
        return None
    if not match[0].lower().startswith("without") and _FORMS.before.search(begin) is None:
        return None
    behind = text[end:]
    after = _FORMS.joined.match(behind)
    goes_on = after is not None and begins_action(behind[after.end() :])
    return end if goes_on or _FORMS.ends.match(behind) else None


def _joined(begin: str, behind: str) -> str:
    """Joins the words before and after a rule."""
    joint = _FORMS.text("joined")
    begin = re.sub(rf"{joint}$", "", begin, flags=re.IGNORECASE)
    rest = re.sub(rf"^(?:{joint}|[.;!?])*", "", behind, flags=re.IGNORECASE)
    if not re.search(r"\w", behind):
        return begin
    if not begin or _ADDRESS.fullmatch(begin):
        return f"{begin}, {rest}" if begin else rest
    ends = re.match(r"[\s,]*[.;!?]", behind) or re.search(r"[.;!?]$", begin)
    return f"{begin.rstrip('.;!?')}. {rest}" if ends else f"{begin}, and {rest}"


def _facts(kind: str, match: re.Match[str], room: str) -> ZoneFacts:
    """Zone for a room's rule. Raises RefusalError for a speed that no robot can obey."""
    if kind not in _SPEEDS:
        return ZoneFacts(kind=ZoneKind(kind), place=room)
    said = match.groupdict()
    number, unit = said.get("amount") or "one", said.get("unit") or "m"
    speed = _PARTS.get(number.lower()) or parse_number(number) or 0.0
    try:
        limit = SLOWLY_M_S if kind == "slowly" else round(speed * _UNITS_M_S[unit[0].lower()], 3)
        return ZoneFacts(kind=ZoneKind.SPEED_LIMIT, place=room, speed=limit)
    except ValidationError as error:
        raise RefusalError(f"I cannot keep a limit of {number} {unit}; say 0.1 to 3 m/s", [number]) from error


def _without(knowledge: Knowledge, rooms: Collection[str]) -> Knowledge:
    """Knowledge in which no objects are usually in these rooms."""
    if not rooms:
        return knowledge

    def is_open(place: str) -> bool:
        return knowledge.room(place) not in rooms

    things = {
        name: facts.model_copy(update={"usual": tuple(filter(is_open, facts.usual))})
        for name, facts in knowledge.things.items()
    }
    defaults = {
        task: {word: place for word, place in table.items() if is_open(place)}
        for task, table in knowledge.defaults.items()
    }
    return knowledge.model_copy(update={"things": things, "defaults": defaults})
