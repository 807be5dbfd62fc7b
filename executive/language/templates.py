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
from functools import cached_property, lru_cache, partial
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from executive.language.lexicon import lexicon, plain_yaml, read_table


class Words:
    """Words of a text in lower case, and their positions there; "n't" is "not"."""

    def __init__(self, text: str) -> None:
        spans = (match.span(n) for match in _WORD.finditer(text) for n in range(1, _WORD.groups + 1))
        self.text, self.spans = text, [span for span in spans if span[0] >= 0]
        said = (text[start:end].lower() for start, end in self.spans)
        self.words = [_FULL.get(word, word) for word in said]

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
    """Templates of a page by intent; `lists` has the words of slots that the page leaves open.

    The page is in a `file`, or this package's own. `more` are intents, and `rules`, that code brings beside its own.
    """

    def __init__(
        self,
        name: str,
        *,
        file: Path | None = None,
        more: Mapping[str, Any] = MappingProxyType({}),
        rules: Mapping[str, Any] = MappingProxyType({}),
        **lists: tuple[str, ...] | dict[str, str],
    ) -> None:
        self._name, self._file, self._given, self._more, self._rules = name, file, lists, more, rules
        self._templates, self._parts = dict[str, Template](), dict[str, _Part]()

    @cached_property
    def table(self) -> Mapping[str, Any]:
        """Contents of the page, with the common rules and lists, and the words that are given."""
        file, name = self._file, f"intents/{self._name}.yaml"
        own = read_table(name) if file is None else plain_yaml(file.read_text("utf-8"))
        common = read_table("intents/common.yaml")
        lists = {**common["lists"], **own.get("lists", {}), **self._given}
        rules = {**common["rules"], **own.get("rules", {}), **self._rules}
        return {**own, "rules": rules, "lists": lists, "intents": {**own["intents"], **self._more}}

    def __getitem__(self, intent: str) -> Template:
        if intent not in self._templates:
            self._templates[intent] = Template(self, self.table["intents"][intent])
        return self._templates[intent]

    def first_words(self, intent: str) -> frozenset[str]:
        """Words with which the templates of an intent begin; none of one that any word may begin."""
        parts = (self.part(row["template"]) for row in self.table["intents"][intent])
        return frozenset(word for part in parts for word in part.first or ())

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
        if end < 0 or ("before" in row and not self._begins(row["before"], words, end)):
            return None
        if self._begins(row.get("not_before", ()), words, end):
            return None
        if whole and any(self._page[one].fullmatch(words.text) for one in row.get("unless", ())):
            return None
        start, stop = (words.spans[at][0], words.spans[end - 1][1]) if end > at else (0, 0)
        filled = {**row.get("slots", {}), **dict(slots)}
        instead = " ".join(row.get("instead", "").format_map(defaultdict(str, filled)).split())
        return Match(words.text[start:stop], start, stop, end, filled, instead, words.text[words.start(end) :])

    def _begins(self, templates: Sequence[str], words: Words, at: int) -> bool:
        """Returns whether one of the templates, or the end of the text (""), is at a word."""
        if at == len(words.words):
            return "" in templates
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
    return _sequence([_word([word]) for word in words_of(text).words])


def _sequence(parts: Sequence[_Part]) -> _Part:
    def ends(words: Words, at: int, n: int = 0) -> _Ends:
        if n == len(parts):
            yield at, ()
            return
        for middle, slots in parts[n].ends_at(words, at):
            for end, more in ends(words, middle, n + 1):
                yield end, (*slots, *more)

    if len(parts) == 1:
        return parts[0]
    begin = next((n for n, part in enumerate(parts) if not part.empty), len(parts))
    return _Part(ends, _firsts(parts[: begin + 1]), begin == len(parts))


def _choice(parts: Sequence[_Part]) -> _Part:
    def ends(words: Words, at: int) -> _Ends:
        for part in parts:
            yield from part.ends_at(words, at)

    if len(parts) == 1:
        return parts[0]
    if all(part.ends is _next_word for part in parts):
        return _word(_firsts(parts) or ())
    return _Part(ends, _firsts(parts), any(part.empty for part in parts))


def _firsts(parts: Sequence[_Part]) -> frozenset[str] | None:
    firsts = [part.first for part in parts]
    return None if None in firsts else frozenset(word for first in firsts for word in first or ())


def _kept(said: str, part: _Part, instead: Mapping[str, str] | None = None) -> _Part:
    """Part whose text, or another text for it, is kept in a slot, by the slot's name, and by its list with the name."""
    name = said.rpartition(":")[2]

    def ends(words: Words, at: int) -> _Ends:
        for end, slots in part.ends_at(words, at):
            text = words.text[words.start(at) : words.spans[end - 1][1]]
            text = (instead or {}).get(text.lower(), text)
            yield end, ((name, text), (said, text), *slots)

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
    choices, joined = [list[_Part]()], False
    while (part := parts.pop() if parts else ")") not in (")", "]"):
        mark = part.isspace() or part in _MARKS or (part == "[" and parts[-1] in _MARKS)
        if part == "|":
            choices.append([])
        elif not part.isspace():
            found = _part(part, parts, page)
            choices[-1].append(_glued(choices[-1].pop(), found) if joined and not mark else found)
        joined = not mark
    return _choice([*map(_sequence, choices)])


def _glued(one: _Part, other: _Part) -> _Part:
    """Words that two parts spell, of which the other may be left out."""
    return _word(map("".join, product(one.first or (), {*(other.first or ()), *([""] if other.empty else [])})))


def _part(part: str, parts: list[str], page: Page) -> _Part:
    match part[0]:
        case "(":
            return _alternatives(parts, page)
        case "[":
            return _choice([_alternatives(parts, page), _sequence(())])
        case "<":
            return page.part(page.table["rules"][part[1:-1]])
        case "{":
            return _slot(part[1:-1], page)
    return _phrase(part)


def _slot(said: str, page: Page) -> _Part:
    """Slot `said`, or `list:slot`; a list without values takes any words."""
    name, kept = said.partition(":")[0], partial(_kept, said)
    match page.table["lists"].get(name, {}):
        case _ if name == "number":
            return kept(_Part(_number))
        case tuple() as given:
            return kept(_choice([*map(_phrase, given)]))
        case dict() as facts if facts.keys() <= {"most", "without"}:
            return kept(_any(facts))
        case dict() as instead:
            return kept(page.part(instead), instead)
        case values:
            return kept(page.part(values) if values else _word(()))


_PARTS: Final = re.compile(r"\s+|[()\[\]|]|<[^>]*>|\{[^}]*\}|[,;:.!?]|[^\s()\[\]|<>{},;:.!?]+")
_MARKS: Final = tuple("|,;:.!?")
