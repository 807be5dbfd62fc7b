"""Sentence templates in the notation of Home Assistant, matched over the words of a text.

    (if|in case) {condition} [,] [then] {steps}

A template has words, alternatives in parentheses, optional parts in brackets, expansion rules as `<rule>`, and slots as
`{slot}` or `{list:slot}`. A slot without a list takes one or more words. A part without a blank before it continues the
word, as in `fail[s]`. Words are compared without regard to case; a punctuation mark is a word, and "don't" is two.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from itertools import accumulate, pairwise
from typing import Any, Final

from executive.language.lexicon import any_of, lexicon, read_table


class Words:
    """Words of a text in lower case, and their positions there; "n't" is "not"; `spaced` has a blank before each."""

    def __init__(self, text: str) -> None:
        self.text, self.words, self.spans = text, list[str](), list[tuple[int, int]]()
        for match in _WORD.finditer(text):
            for n, piece in enumerate(match.groups(), 1):
                if piece is not None:
                    self.words.append(_FULL.get(piece.lower(), piece.lower()))
                    self.spans.append(match.span(n))
        self.spaced = "".join(f" {word}" for word in self.words)
        self.known = frozenset(self.words)
        self.starts = [*(n for n, letter in enumerate(self.spaced) if letter == " "), len(self.spaced)]

    def word(self, at: int) -> str:
        """Word at an index; empty outside the text."""
        return self.words[at] if 0 <= at < len(self.words) else ""

    def start(self, at: int) -> int:
        """Position of a word in the text, or the text's end."""
        return self.spans[at][0] if at < len(self.spans) else len(self.text)

    def span(self, begin: int, end: int) -> tuple[int, int]:
        """Positions in the text of the words between two positions in `spaced`."""
        first, last = self.starts.index(begin), self.starts.index(end)
        return (self.spans[first][0], self.spans[last - 1][1]) if last > first else (0, 0)


@lru_cache(maxsize=4096)
def words_of(text: str) -> Words:
    """Words of a text."""
    return Words(text)


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
    """Part of a text that a template matches: its positions, the next word, its slots and its rewording."""

    text: str
    start: int
    end: int
    after: int
    slots: Mapping[str, str]
    instead: str

    def __getitem__(self, slot: str) -> str:
        """Text of a slot; empty if the template leaves it out."""
        return self.slots.get(slot, "")


class Page:
    """Templates of a page by intent; `lists` has the values of slots that the page leaves open."""

    def __init__(self, name: str, **lists: tuple[str, ...]) -> None:
        self._name, self._given = name, lists
        self._templates, self._forms = dict[str, Template](), dict[str, _Form]()

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
        tables = ({"lists": self._given}, self.table, read_table("intents/common.yaml"))
        return next((table[kind][name] for table in tables if name in table.get(kind, ())), {})

    def form(self, template: str) -> _Form:
        """Form of a template, which is translated once."""
        if template not in self._forms:
            self._forms[template] = _Form(self, template)
        return self._forms[template]


page = lru_cache(maxsize=64)(Page)


class Template:
    """Templates of an intent, in the order of trying.

    A row has `slots` besides those of its template, the words `before` which it must end ("" is the end of the text),
    intents of the page that precede it (`unless`), and the text `instead` of a rewording.
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
        return next(filter(None, (self.match(text, at) for at in range(len(words_of(text).words)))), None)

    def reword(self, text: str, *, whole: bool = False) -> str:
        """Replaces the first match of each row, or the whole text when a row matches it."""
        for row in self._rows:
            one = Template(self._page, [row])
            if (found := one.fullmatch(text) if whole else one.search(text)) is not None:
                text = text[: found.start] + found.instead + text[found.end :]
        return text

    def _match(self, row: Mapping[str, Any], words: Words, at: int, whole: bool) -> Match | None:
        form = self._page.form(row["template"])
        if at > len(words.words) or (found := form.match(words, at, whole)) is None:
            return None
        after = words.starts.index(found.end())
        if words.word(after) not in row.get("before", [words.word(after)]):
            return None
        if whole and any(self._page[one].fullmatch(words.text) for one in row.get("unless", ())):
            return None
        slots = {**row.get("slots", {}), **form.slots_of(found, words)}
        instead = " ".join(row.get("instead", "").format_map(defaultdict(str, slots)).split())
        start, end = words.span(found.start(), found.end())
        return Match(words.text[start:end], start, end, after, slots, instead)


class _Form:
    """Template as a regular expression over spaced words; its groups are the slots, each with other texts for some.

    The expression is only made for a text that begins with a word of `first` (empty: any) and has the words `needs`.
    """

    def __init__(self, page: Page, template: str) -> None:
        self._page, self._template, self._slots = page, template, list[tuple[str, Mapping[str, str]]]()
        listed = page.entry("lists", template[1:-1]) if _SLOT.fullmatch(template) else ()
        opened = _RULE.sub(lambda rule: _text(self._rule(rule[1])), template)
        heads = list(map(_HEAD.match, listed if isinstance(listed, tuple) and listed else _split(opened)))
        words = {one.split()[0].lower() for head in heads if head for one in (head[1] or head[2]).split("|")}
        self._first = words if all(heads) else set()
        bare, before = template, ""
        while bare != before:
            bare, before = re.sub(r"[(\[][^()\[\]]*[)\]]|<[^>]*>|\{[^}]*\}", "§", bare), bare
        self._needs = set() if "|" in bare else set(words_of(re.sub(r"\S*§\S*", " ", bare)).words)

    def match(self, words: Words, at: int, whole: bool) -> re.Match[str] | None:
        """Matches words from an index on, up to the end if `whole`."""
        if (self._first and words.word(at) not in self._first) or not self._needs <= words.known:
            return None
        start = words.starts[at]
        found = (self._form.fullmatch if whole else self._form.match)(words.spaced, start)
        return None if found is None or (found.end() == start and not whole) else found

    def slots_of(self, found: re.Match[str], words: Words) -> dict[str, str]:
        """Texts of the slots; of two slots with one name, the last counts."""
        slots = {}
        for n, (name, instead) in enumerate(self._slots, 1):
            if found.start(n) >= 0:
                start, end = words.span(*found.span(n))
                slots[name] = instead.get(words.text[start:end].lower(), words.text[start:end])
        return slots

    @cached_property
    def _form(self) -> re.Pattern[str]:
        return re.compile(rf"(?:{self._expression(self._template)})(?![^ ])")

    def _expression(self, template: str) -> str:
        """Expression for a template, a rule or a list; a word has a blank before it unless it continues another."""
        pieces, found, opened, joined = _PARTS.findall(template), "", list[tuple[str, bool]](), False
        for piece, behind in zip(pieces, [*pieces[1:], ""], strict=True):
            joined = joined and not (piece.isspace() or piece in _MARKS or (piece == "[" and behind in _MARKS))
            if piece in "([":
                opened.append((piece, joined))
                found += "(?:"
            elif piece in ")]":
                found += ")" if opened.pop()[0] == "(" else "|)"
                joined = True
            elif piece == "|":
                found, joined = f"{found}|", bool(opened) and opened[-1][1]
            elif not piece.isspace():
                found, joined = found + self._piece(piece, joined), piece not in _MARKS
        return found

    def _rule(self, name: str) -> str | Iterable[str]:
        found: str | Iterable[str] = self._page.entry("rules", name) or self._page.table["rules"][name]
        return found

    def _piece(self, piece: str, joined: bool) -> str:
        """Expression for a word, a rule or a slot."""
        if piece[0] == "<":
            return f"(?:{self._expression(_text(self._rule(piece[1:-1])))})"
        if piece[0] != "{":
            return "".join(f" {re.escape(word)}" for word in words_of(piece).words)[joined:]
        name, _, slot = piece[1:-1].partition(":")
        values: Any = {} if name == "number" else self._page.entry("lists", name)
        self._slots.append((slot or name, {}))
        if isinstance(values, Mapping) and values.keys() <= {"most", "without"}:
            most = f"{{1,{values['most']}}}" if "most" in values else "+"
            without = f"(?! (?:{any_of(values['without'])})(?![^ ]))" if "without" in values else ""
            return f"({_number() if name == 'number' else f'(?:{without} [^ ]++){most}?'})"
        if isinstance(values, Mapping):
            self._slots[-1] = (slot or name, values)
        return f"({self._expression(_text(values)) if values else '(?!)'})"


def _split(template: str) -> list[str]:
    """Splits a template at the bars outside of its brackets."""
    depths = list(accumulate((letter in "([") - (letter in ")]") for letter in template))
    bars = [n for n, letter in enumerate(template) if letter == "|" and depths[n] == 0]
    return [template[begin + 1 : end] for begin, end in pairwise([-1, *bars, len(template)])]


def _text(values: str | Iterable[str]) -> str:
    return values if isinstance(values, str) else "|".join(values)


@cache
def _number() -> str:
    """Expression for a number in digits, or in one or two words."""
    word = f"(?:{any_of(lexicon().numbers.keys() - {'couple', 'dozen'})})"
    return rf" (?:\d+(?:\.\d+)?|{word}(?: {word}|(?:-{word})*))(?![^ ])"


_SLOT: Final = re.compile(r"\{\w+\}")
_RULE: Final = re.compile(r"^<(\w+)>")
_HEAD: Final = re.compile(r"(?:\((\w[\w| ]*)\)|(\w+))(?: |$)")
_PARTS: Final = re.compile(r"\s+|[()\[\]|]|<[^>]*>|\{[^}]*\}|[,;:.!?]|[^\s()\[\]|<>{},;:.!?]+")
_MARKS: Final = tuple(",;:.!?")
