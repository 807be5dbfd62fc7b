"""Known names in a sentence: each becomes one plain word that parses well, and comes back afterwards."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from executive.language.parser import DependencyParser
from executive.language.tokens import Token
from executive.words.knowledge import Knowledge

__all__ = ["NameTable", "name_table", "parse_with_names"]

THING: Final = "cup"
PLACE: Final = "kitchen"
PERSON: Final = "John"


@dataclass(frozen=True)
class NameTable:
    """The pattern that finds any known name, and for each name in lower case the word that stands in for it."""

    pattern: re.Pattern[str]
    stand_ins: Mapping[str, str]


def name_table(knowledge: Knowledge) -> NameTable:
    """The names of a world, longest first."""
    things = [*(n for name, facts in knowledge.things.items() for n in (name, *facts.aliases)), *knowledge.categories()]
    places = [n for g in (knowledge.places, knowledge.surfaces) for name, f in g.items() for n in (name, *f.aliases)]
    people = [n for name, facts in knowledge.people.items() for n in (name, *facts.aliases)]
    stand_ins = {name.lower(): THING for name in things}
    stand_ins |= {name.lower(): PLACE for name in places}
    stand_ins |= {name.lower(): PERSON for name in people}
    longest_first = sorted(stand_ins, key=len, reverse=True)
    pattern = re.compile(rf"\b({'|'.join(map(re.escape, longest_first)) or '(?!)'})(e?s)?\b", re.IGNORECASE)
    return NameTable(pattern, stand_ins)


def parse_with_names(text: str, parser: DependencyParser, table: NameTable | None) -> tuple[Token, ...]:
    """Parse `text` with each known name as one token, whose text and lemma are the name as spoken and in singular."""
    if table is None:
        return parser.parse(text)
    names: dict[int, re.Match[str]] = {}
    pieces: list[str] = []
    end = 0
    for match in table.pattern.finditer(text):
        pieces.append(text[end : match.start()])
        names[sum(map(len, pieces))] = match
        plural = "s" if match.group(2) and table.stand_ins[match.group(1).lower()] != PERSON else ""
        pieces.append(table.stand_ins[match.group(1).lower()] + plural)
        end = match.end()
    tokens = parser.parse("".join([*pieces, text[end:]]))
    return tuple(_named(token, names.get(token.start), token.text) for token in tokens)


def _named(token: Token, match: re.Match[str] | None, stand_in: str) -> Token:
    if match is None:
        return token
    entity = "PERSON" if stand_in == PERSON else ""
    return replace(token, text=match.group(0), lemma=match.group(1).lower(), entity=entity, known=True)
