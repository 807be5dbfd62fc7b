"""Splits a sentence into clauses, each with its addressee, its cue and its words."""

import enum
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Final

from executive.language.addressees import AddressedText, Addressee, addressees
from executive.language.amounts import AMOUNTS
from executive.language.items import Item
from executive.language.lexicon import Patterns, any_of, lexicon, read_table
from executive.language.tokens import smooth

CLAUSES: Final = Patterns("structures.yaml", words=AMOUNTS)
ACTS: Final = Patterns("structures.yaml", "acts", AMOUNTS)


class Cue(enum.Enum):
    """Relation of a clause to the clause before it."""

    FAILED = "failed"  # "if that fails"
    SO = "so"  # "if so"
    NOT = "not"  # "if not"
    OTHERWISE = "otherwise"
    UNLESS = "unless"
    SOON = "soon"  # "as soon as"
    IF = "if"
    EVERY = "every"  # "every ten minutes"
    TIMES = "times"  # "three times"
    WHILE = "while"  # "as long as"
    UNTIL = "until"


@dataclass(frozen=True)
class Clause:
    """Clause: the words that join it to the previous clause, the cue (`kind`, and `cue` in words), and its other words.

    `part` is the addressee's text that contains the clause. `lead` are implied items before the clause, such as its
    verb. `before` is the action before a trailing cue, as in "go home if ...".
    """

    joint: str
    text: str
    kind: Cue | None = None
    cue: str = ""
    lead: tuple[Item, ...] = ()
    part: AddressedText | None = field(default=None, compare=False, repr=False)
    before: str = ""

    @property
    def begins(self) -> bool:
        """Returns whether the clause begins a sentence."""
        return re.search(r"[.!?;]", self.joint) is not None

    @property
    def outer(self) -> bool:
        """Returns whether the words before the clause say that it follows all earlier clauses, not only the last."""
        return CLAUSES.outer.search(self.joint) is not None

    @property
    def anyway(self) -> bool:
        """Returns whether the clause runs at the end, whatever happens before."""
        return CLAUSES.whatever.search(self.joint) is not None

    @property
    def ends_anyway(self) -> bool:
        """Returns whether the last words say that the clause runs whatever happens before."""
        return self.kind is None and CLAUSES.ends_anyway.search(self.text) is not None

    @property
    def then(self) -> bool:
        """Returns whether "then" stands before the clause."""
        return re.search(r"\bthen\b", self.joint, re.IGNORECASE) is not None


@dataclass(frozen=True)
class Split:
    """Clauses of a sentence, and the sentence's addressee."""

    clauses: tuple[Clause, ...]
    listener: Addressee | None = None


def split(text: str, robots: tuple[str, ...] = ()) -> Split:
    """Splits sentences into clauses, each with the part of the text for its addressee among `robots`.

    Raises RefusalError when it is not clear which robots a sentence names, or when it forbids an action.
    """
    listener, parts = addressees(robots).parts(text) if len(robots) > 1 else (None, (AddressedText(None, text),))
    found: list[Clause] = []
    for part in parts:
        said = smooth(part.text)
        for form, meant in read_table("structures.yaml")["reworded"]:
            said = CLAUSES.compiled(form).sub(meant, said)
        found += (replace(clause, part=part) for clause in cut(said))
    return Split(tuple(found), listener)


def cut(text: str) -> tuple[Clause, ...]:
    """Splits the text for one addressee at joining words and cues."""
    cuts, found = list(_cuts(text)), []
    for (start, begin), end in zip(cuts, (*(start for start, _ in cuts[1:]), len(text)), strict=True):
        clause = Clause(text[start:begin], text[begin:end].strip(" ,;.!?:"))
        if (kind := _kind(clause.text)) is not None:
            rest = clause.text[len(kind[1]) :].strip(" ,;:")
            rest = re.sub(r"^then\s+", "", rest, flags=re.IGNORECASE)
            clause = replace(clause, kind=kind[0], cue=kind[1], text=rest)
        found += [clause] if clause.text or clause.cue else []
    return tuple(found)


def _cuts(text: str) -> Iterator[tuple[int, int]]:
    """Yields begin and end of the words that join two clauses."""
    first = _joint().match(text)
    begin = 0 if first is None else first.end()
    yield 0, begin
    for match in _joint().finditer(text, begin):
        joined = match[0].strip() != "" or (_ELSE.match(text, match.end()) and not _SOME.search(text[: match.start()]))
        sentence = re.search(r"[.!?;](?:\s|$)", match[0]) is not None
        if match[0].strip().lower() in ("and", "please") and _ONE_VERB.search(text[: match.start()]):
            continue
        word = re.match(r"[\w']+", rest := text[match.end() :])
        if joined and (sentence or (word and (word[0].lower() in _verbs() or _kind(rest) is not None))):
            yield match.span()


def _kind(text: str) -> tuple[Cue, str] | None:
    """Cue at the beginning of a clause; None if there is none. After a complete cue ("if not") a clause can begin."""
    for kind, form in _kinds():
        match = form.match(text)
        behind_it = None if match is None or kind not in _WHOLE else _NEXT.match(text, match.end())
        object_follows = match is not None and _WHOLE_WORDS.search(match[0]) is not None
        begins = _verbs() | _SMALL | (_ARTICLES if object_follows else frozenset())
        if match is not None and (behind_it is None or behind_it[1].lower() in begins):
            return kind, match[0]
    return None


def trailing_cue(text: str) -> Clause | None:
    """First cue after an action in a clause, which makes the action conditional or repeated; None if there is none."""
    forms = CLAUSES.mapping("behind")
    found = [(match.start(), Cue(kind), match) for kind, form in forms for match in form.finditer(text, 1)]
    found = [one for one in found if one[1] is not Cue.IF or not CLAUSES.asks_before.search(text[: one[0]])]
    if not found:
        return None
    start, kind, match = min(found, key=lambda one: one[0])
    return Clause("", text[match.end() :].strip(" ,"), kind, match[0], before=text[:start].strip(" ,"))


def begins_action(text: str) -> bool:
    """Returns whether the first word is a verb that can begin a clause."""
    word = re.match(r"[\w']+", text)
    return word is not None and word[0].lower() in _verbs()


def verb_positions(text: str) -> Iterator[int]:
    """Yields the positions of verbs after the first word, where a clause may begin without a comma before it."""
    for match in re.finditer(r"[\w']+", text):
        if match.start() and match[0].lower() in _verbs():
            yield match.start()


def join_clauses(clauses: Iterable[Clause]) -> str:
    """Joins clauses to one text."""
    return " ".join(f"{clause.joint}{clause.cue} {clause.text}".strip() for clause in clauses).strip(" ,;.")


@cache
def _joint() -> re.Pattern[str]:
    words = "|".join((*map(CLAUSES.text, ("outer", "whatever", "joints")), any_of(lexicon().openers)))
    return re.compile(rf"(?:[\s,;.!?:]+|(?<![\w'])(?:{words})(?![\w']))+", re.IGNORECASE)


@cache
def _verbs() -> frozenset[str]:
    return frozenset({first for first, *_ in lexicon().verbs} | set(read_table("structures.yaml")["openers"]))


@cache
def _kinds() -> tuple[tuple[Cue, re.Pattern[str]], ...]:
    table = read_table("structures.yaml")["kinds"]
    return tuple((kind, CLAUSES.compiled(rf"{text}(?![\w'])")) for kind in Cue for text in table[kind.value])


_WHOLE: Final = frozenset({Cue.FAILED, Cue.SO, Cue.NOT})
_NEXT: Final = re.compile(r"\s*([^\s,;:]\w*)")
_SMALL: Final = frozenset({"then", "please", "just"})
_ARTICLES: Final = frozenset({"a", "an", "the", "some", "another"})
_WHOLE_WORDS: Final = re.compile(
    r"(?:\b(?:none|one|any|it|them|that|this|failed|fails?|works?|out|(?:im)?possible|wrong|left|available)|^if not)$",
    re.IGNORECASE,
)
"""Last words of cues before an object without a comma: "if there is none a beer"."""
_ONE_VERB: Final = re.compile(r"(?:^|[\s,])(?:go|come|run|say)$", re.IGNORECASE)
"""Verbs after which "and" and "please" join no other clause: "go and charge"."""
_ELSE: Final = re.compile(r"(?:or )?(?:else|otherwise)\b", re.IGNORECASE)
_SOME: Final = re.compile(r"(?:some|any|every|no|body|thing|one|where|what|who)$", re.IGNORECASE)
