"""Sentence templates in the notation of Home Assistant, matched over the words of a text.

    (if|in case) {condition} [,] [then] {steps}

A template has words, alternatives in parentheses, optional parts in brackets, expansion rules as `<rule>`, and slots as
`{slot}` or `{list:slot}`. A slot without a list takes one or more words. A part without a blank before it continues the
word, as in `fail[s]`. Words are compared without regard to case; a punctuation mark is a word, and "don't" is two.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from typing import Any, Final, NamedTuple

from executive.language.lexicon import lexicon, read_table


class Words:
    """Words of a text in lower case, and their positions there; "n't" is "not"."""

    def __init__(self, text: str) -> None:
        self.text, self.words, self.spans = text, list[str](), list[tuple[int, int]]()
        for match in _WORD.finditer(text):
            for n, piece in enumerate(match.groups(), 1):
                if piece is not None:
                    self.words.append(_FULL.get(piece.lower(), piece.lower()))
                    self.spans.append(match.span(n))

    def word(self, at: int) -> str:
        """Word at an index; empty outside the text."""
        return self.words[at] if 0 <= at < len(self.words) else ""

    def start(self, at: int) -> int:
        """Position of a word in the text, or the text's end."""
        return self.spans[at][0] if at < len(self.spans) else len(self.text)


words_of = lru_cache(maxsize=4096)(Words)


_WORD: Final = re.compile(
    r"(\d+(?:[.:]\d+)+%?)|(can)(not|'t)\b|(\w+)(n't|'re|'ve|'ll|'m|'d)\b|(there|it|that|he|she|what|where|who|here|how|"
    r"door|battery)('s)\b|(\w+(?:['-]\w+)*%?)|([^\w\s])",
    re.IGNORECASE,
)
_FULL: Final = {
    **{"n't": "not", "'t": "not", "wo": "will", "'re": "are", "'ve": "have", "'ll": "will"},
    **{"'m": "am", "'d": "would", "'s": "is"},
}


@dataclass(frozen=True)
class Match:
    """Part of a text that a template matches: its positions, the next word, its slots, its rewording, and the rest."""

    text: str
    start: int
    end: int
    after: int
    slots: Mapping[str, str]
    instead: str
    rest: str

    def __getitem__(self, slot: str) -> str:
        """Text of a slot; empty if the template leaves it out."""
        return self.slots.get(slot, "")


class Page:
    """Templates of a page by intent; `lists` has the words of slots that the page leaves open."""

    def __init__(self, name: str, **lists: tuple[str, ...]) -> None:
        self._name, self._given = name, lists
        self._templates, self._parts = dict[str, Template](), dict[str, _Part]()

    @cached_property
    def table(self) -> Mapping[str, Any]:
        """Contents of the page."""
        found: Mapping[str, Any] = read_table(f"intents/{self._name}.yaml")
        return found

    def __getitem__(self, intent: str) -> Template:
        if intent not in self._templates:
            self._templates[intent] = Template(self, self.table["intents"][intent])
        return self._templates[intent]

    def entry(self, kind: str, name: str) -> Any:
        """Rule or list of the page, or else the common one; an unknown list takes any words."""
        tables = (self.table, read_table("intents/common.yaml"))
        return next((table[kind][name] for table in tables if name in table.get(kind, ())), {})

    def words(self, name: str) -> _Part | None:
        """Part for the words of an open slot; None for a list of the page."""
        return _choice([_phrase(words) for words in self._given[name]]) if name in self._given else None

    def part(self, values: str | Iterable[str]) -> _Part:
        """Part for a template, or for one of several; each is parsed once."""
        text = values if isinstance(values, str) else "|".join(values)
        if text not in self._parts:
            self._parts[text] = _alternatives(_PARTS.findall(text)[::-1], self)
        return self._parts[text]


page = lru_cache(maxsize=64)(Page)


class Template:
    """Templates of an intent, in the order of trying.

    A row has `slots` besides those of its template, templates `before` one of which it must end ("" is the end of the
    text), or `not_before`, intents of the page that precede it (`unless`), and the text `instead` of a rewording.
    """

    def __init__(self, page: Page, rows: Iterable[Mapping[str, Any]]) -> None:
        self._page, self._rows = page, tuple(rows)

    def fullmatch(self, text: str) -> Match | None:
        """Matches the whole text."""
        return next(self.matches(text, 0, whole=True), None)

    def match(self, text: str, at: int = 0) -> Match | None:
        """Matches words at the beginning of the text, or from the word `at` on."""
        return next(self.matches(text, at), None)

    def matches(self, text: str, at: int, *, whole: bool = False) -> Iterator[Match]:
        """Matches of the rows from the word `at` on."""
        words = words_of(text)
        return filter(None, (self._match(row, words, at, whole) for row in self._rows))

    def search(self, text: str) -> Match | None:
        """Finds the first match."""
        return next(self.finditer(text), None)

    def finditer(self, text: str) -> Iterator[Match]:
        """Finds the matches that do not overlap."""
        at = 0
        while at < len(words_of(text).words):
            if (found := self.match(text, at)) is not None:
                yield found
            at = at + 1 if found is None else found.after

    def reword(self, text: str, *, whole: bool = False) -> str:
        """Replaces the first match of each row, or the whole text when a row matches it."""
        for row in self._rows:
            one = Template(self._page, [row])
            if (found := one.fullmatch(text) if whole else one.search(text)) is not None:
                text = text[: found.start] + found.instead + text[found.end :]
        return text

    def _match(self, row: Mapping[str, Any], words: Words, at: int, whole: bool) -> Match | None:
        ends, size = self._page.part(row["template"]).ends_at(words, at), len(words.words)
        end, slots = next(((end, slots) for end, slots in ends if (end == size if whole else end > at)), (-1, ()))
        if end < 0 or not self._begins(row.get("before"), words, end, missing=True):
            return None
        if self._begins(row.get("not_before"), words, end, missing=False):
            return None
        if whole and any(self._page[one].fullmatch(words.text) for one in row.get("unless", ())):
            return None
        start, stop = (words.spans[at][0], words.spans[end - 1][1]) if end > at else (0, 0)
        filled = {**row.get("slots", {}), **dict(slots)}
        instead = " ".join(row.get("instead", "").format_map(defaultdict(str, filled)).split())
        return Match(words.text[start:stop], start, stop, end, filled, instead, words.text[words.start(end) :])

    def _begins(self, templates: Sequence[str] | None, words: Words, at: int, *, missing: bool) -> bool:
        """Returns whether one of the templates, or the end of the text, is at a word; `missing` without templates."""
        if templates is None or at == len(words.words):
            return missing if templates is None else "" in templates
        named = [template for template in templates if template]
        return bool(named) and next(self._page.part(named).ends_at(words, at), None) is not None


_Ends = Iterator[tuple[int, tuple[tuple[str, str], ...]]]


class _Part(NamedTuple):
    """Part of a template: the words with which it can begin (None: any), and whether it may be without words.

    `ends` yields the indices behind the part when it begins at a word, the preferred ones first, with its slots.
    """

    ends: Callable[[Words, int], _Ends]
    first: frozenset[str] | None = None
    empty: bool = False

    def ends_at(self, words: Words, at: int) -> _Ends:
        begins = self.empty or self.first is None or words.word(at) in self.first
        return self.ends(words, at) if begins else iter(())


def _next_word(words: Words, at: int) -> _Ends:
    yield at + 1, ()


def _word(spellings: Iterable[str]) -> _Part:
    """One of some words."""
    return _Part(_next_word, frozenset(spellings))


def _phrase(text: str) -> _Part:
    """Words of a text."""
    words = [_word([word]) for word in words_of(text).words]
    return words[0] if len(words) == 1 else _sequence(words)


def _sequence(parts: Sequence[_Part]) -> _Part:
    def ends(words: Words, at: int, n: int = 0) -> _Ends:
        if n == len(parts):
            yield at, ()
            return
        for middle, slots in parts[n].ends_at(words, at):
            for end, more in ends(words, middle, n + 1):
                yield end, (*slots, *more)

    begin = next((n for n, part in enumerate(parts) if not part.empty), len(parts))
    return _Part(ends, _firsts(parts[: begin + 1]), begin == len(parts))


def _choice(parts: Sequence[_Part]) -> _Part:
    def ends(words: Words, at: int) -> _Ends:
        for part in parts:
            yield from part.ends_at(words, at)

    if all(part.ends is _next_word for part in parts):
        return _word(_firsts(parts) or ())
    return _Part(ends, _firsts(parts), any(part.empty for part in parts))


def _firsts(parts: Sequence[_Part]) -> frozenset[str] | None:
    firsts = [part.first for part in parts]
    return None if None in firsts else frozenset(word for first in firsts for word in first or ())


def _slot(name: str, part: _Part, instead: Mapping[str, str]) -> _Part:
    """Part whose text is kept, or another text for it."""

    def ends(words: Words, at: int) -> _Ends:
        for end, slots in part.ends_at(words, at):
            text = words.text[words.start(at) : words.spans[end - 1][1]]
            yield end, ((name, instead.get(text.lower(), text)), *slots)

    return part._replace(ends=ends)


def _any(facts: Mapping[str, Any]) -> _Part:
    """One or more words, as few as possible, or `most` of them; `without` some words."""

    def ends(words: Words, at: int) -> _Ends:
        for end in range(at + 1, min(len(words.words), at + int(facts.get("most", len(words.words)))) + 1):
            if words.words[end - 1] in facts.get("without", ()):
                break
            yield end, ()

    return _Part(ends)


def _number(words: Words, at: int) -> _Ends:
    """Number in digits, or in one or two words."""
    first, known = words.word(at), lexicon().numbers.keys() - {"couple", "dozen"}
    if first in known and words.word(at + 1) in known:
        yield at + 2, ()
    if first.replace(".", "", 1).isdigit() or known >= {*first.split("-")}:
        yield at + 1, ()


def _alternatives(parts: list[str], page: Page) -> _Part:
    """Alternatives up to the closing bracket, which it removes from the reversed parts."""
    choices, pieces, joined = list[_Part](), list[_Part](), False
    while True:
        part = parts.pop() if parts else ""
        if part in ("|", ")", "]", ""):
            choices.append(pieces[0] if len(pieces) == 1 else _sequence(pieces))
            pieces, joined = [], False
            if part != "|":
                break
            continue
        mark = part.isspace() or part in _MARKS or (part == "[" and parts[-1] in _MARKS)
        glued = joined and not mark
        if not part.isspace():
            found = _part(part, parts, page)
            pieces[len(pieces) - glued :] = [_glued(pieces[-1], found) if glued else found]
        joined = not mark
    return choices[0] if len(choices) == 1 else _choice(choices)


def _glued(one: _Part, other: _Part) -> _Part:
    """Words that two parts spell, of which the other may be left out."""
    return _word(map("".join, product(one.first or (), {*(other.first or ()), *([""] if other.empty else [])})))


def _part(part: str, parts: list[str], page: Page) -> _Part:
    if part in "([":
        found = _alternatives(parts, page)
        return found if part == "(" else _choice([found, _sequence(())])
    if part[0] == "<":
        return page.part(page.entry("rules", part[1:-1]) or page.table["rules"][part[1:-1]])
    if part[0] != "{":
        return _phrase(part)
    name, _, slot = part[1:-1].partition(":")
    if (words := page.words(name)) is not None:
        return _slot(slot or name, words, {})
    values: Any = {} if name == "number" else page.entry("lists", name)
    if isinstance(values, Mapping) and values.keys() <= {"most", "without"}:
        return _slot(slot or name, _Part(_number) if name == "number" else _any(values), {})
    inner = page.part(values) if values else _word(())
    return _slot(slot or name, inner, values if isinstance(values, Mapping) else {})


_PARTS: Final = re.compile(r"\s+|[()\[\]|]|<[^>]*>|\{[^}]*\}|[,;:.!?]|[^\s()\[\]|<>{},;:.!?]+")
_MARKS: Final = tuple(",;:.!?")
