"""Splits a sentence into clauses, each with its addressee, its cue and its words."""

import enum
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from itertools import pairwise
from typing import Final

from executive.language.addressees import AddressedText, Addressee, addressees
from executive.language.items import Item
from executive.language.lexicon import lexicon, word_list
from executive.language.task_sentences import task_forms, task_openers
from executive.language.templates import Match, Page, Words, page, words_of
from executive.language.tokens import smooth
from executive.words.task import Part

CLAUSES: Final = page("clauses", asking=tuple(sorted(word_list("openers"), key=len, reverse=True)))
CHECKS: Final = page("checks")


class Cue(enum.Enum):
    """Relation of a clause to the clause before it."""

    FAILED = "failed"  # "if that fails"
    SO = "so"  # "if so"
    NOT = "not"  # "if not"
    OTHERWISE = "otherwise"
    UNLESS = "unless"
    EVERY = "every"  # "every ten minutes"
    SOON = "soon"  # "as soon as"
    IF = "if"
    TIMES = "times"  # "three times"
    WHILE = "while"  # "as long as"
    UNTIL = "until"


@dataclass(frozen=True)
class Clause:
    """Clause: the words that join it to the previous clause, the cue (`kind`, and `cue` in words), and its other words.

    `part` is the addressee's text that contains the clause. `lead` are implied items before the clause, such as its
    verb. `before` is the action before a trailing cue, as in "go home if ...", and `amount` the interval or the number
    of rounds in a cue.
    """

    joint: str
    text: str
    kind: Cue | None = None
    cue: str = ""
    lead: tuple[Item, ...] = ()
    part: AddressedText | None = field(default=None, compare=False, repr=False)
    before: str = ""
    amount: str = ""

    @property
    def begins(self) -> bool:
        """Returns whether the clause begins a sentence."""
        return re.search(r"[.!?;]", self.joint) is not None

    @property
    def outer(self) -> bool:
        """Returns whether the words before the clause say that it follows all earlier clauses, not only the last."""
        return CLAUSES["outer"].search(self.joint) is not None

    @property
    def anyway(self) -> bool:
        """Returns whether the clause runs at the end, whatever happens before."""
        said = self.kind is None and self.text != self.without_whatever
        return said or CLAUSES["whatever"].search(self.joint) is not None

    @property
    def without_whatever(self) -> str:
        """Text without "whatever happens" at its end."""
        found = CLAUSES["whatever_last"].fullmatch(self.text)
        return self.text if found is None else found["before"].rstrip(" ,")

    @property
    def refers(self) -> bool:
        """Returns whether the cue, or a pronoun behind "if", refers to the last look or action."""
        return self.kind in _ATTACHED or (self.kind is Cue.IF and begins_as(self.text, "pronoun"))

    @property
    def then(self) -> bool:
        """Returns whether "then" stands before the clause."""
        return re.search(r"\bthen\b", self.joint, re.IGNORECASE) is not None


def split(text: str, robots: tuple[str, ...] = ()) -> tuple[Addressee | None, tuple[Clause, ...]]:
    """Splits sentences into their addressee among `robots`, and clauses, each with the text for its own addressee.

    Raises RefusalError when it is not clear which robots a sentence names, or when it forbids an action.
    """
    listener, parts = addressees(robots).parts(text) if len(robots) > 1 else (None, (AddressedText(None, text),))
    said = ((part, _rewording()["parts"].reword(smooth(part.text))) for part in parts)
    cuts = ((part, cut(_rewording()["whole"].reword(text, whole=True))) for part, text in said)
    return listener, tuple(replace(clause, part=part) for part, clauses in cuts for clause in clauses)


def cut(text: str) -> tuple[Clause, ...]:
    """Splits the text for one addressee at joining words and cues."""
    found = list[Clause]()
    for (start, begin), (end, _) in pairwise([*_cuts(text), (len(text), 0)]):
        said = text[begin:end].strip(" ,;.!?:")
        found.append(replace(leading_cue(said) or Clause("", said), joint=text[start:begin]))
    return tuple(clause for clause in found if clause.text or clause.cue)


def _cuts(text: str) -> Iterator[tuple[int, int]]:
    """Yields begin and end of the words that join two clauses."""
    words, at = words_of(text), 0
    while not at or at < len(words.words):
        behind = _behind_joint(words, at)
        start, begin = words.spans[at - 1][1] if at else 0, words.start(behind)
        joint, before = text[start:begin], words.word(at - 1)
        if at and behind == at:  # no words join, but "otherwise" may follow
            cue = leading_cue(text[begin:]) if CLAUSES["otherwise"].match(text, at) else None
            begins = cue is not None and not before.endswith(_SOME)
        else:
            cue, ends = leading_cue(text[begin:]), re.search(r"[.!?;](?:\s|$)", joint) is not None
            one_verb = before in _ONE_VERB and joint.strip().lower() in ("and", "please")
            begins = (cue is not None or ends or begins_action(text[begin:])) and not one_verb
        if begins or not at:
            yield start, begin
        at = behind + (1 if cue is None else max(1, len(words_of(cue.cue).words)))


def _behind_joint(words: Words, at: int) -> int:
    """Index of the word behind the joining words that begin at a word."""
    joints = (CLAUSES["joint"], CLAUSES["outer"], CLAUSES["whatever"])
    behind = next((found.after for form in joints if (found := form.match(words.text, at)) is not None), at)
    behind += words.word(at) in _MARKS
    return at if behind == at else _behind_joint(words, behind)


def leading_cue(text: str) -> Clause | None:
    """Clause by the cue at its beginning; None if there is none. Behind a complete cue ("if not") an action begins."""
    words = words_of(text)
    for kind in Cue:
        for found in CLAUSES[kind.value].matches(text, 0):
            behind, last = words.word(found.after), words.word(found.after - 1)
            begins = {"", "then", "please", "just", *_MARKS, *(_ARTICLES if last in CLAUSES.table["objects"] else ())}
            rest = text[found.end :].strip(" ,;:")
            if kind not in _WHOLE or behind in begins or begins_action(rest):
                return _clause(kind, found, re.sub(r"^then\s+", "", rest, flags=re.IGNORECASE))
    return None


@lru_cache(maxsize=1024)
def trailing_cue(text: str) -> Clause | None:
    """First cue after an action in a clause, which makes the action conditional or repeated; None if there is none."""
    for at in range(1, len(words_of(text).words)):
        for kind in _BEHIND:
            found = CLAUSES[kind.value].match(text, at)
            if found is not None and not (kind is Cue.IF and CLAUSES["asks_before"].fullmatch(text[: found.start])):
                before = text[: found.start].strip(" ,")
                return replace(_clause(kind, found, text[found.end :].strip(" ,")), before=before)
    return None


def _clause(kind: Cue, cue: Match, text: str) -> Clause:
    return Clause("", text, kind, cue.text, amount=cue["span"] or cue["times"])


def begins_as(text: str, *intents: str) -> bool:
    """Returns whether a text begins with words of one of the intents of `CHECKS`."""
    return any(CHECKS[intent].match(text) is not None for intent in intents)


def begins_action(text: str) -> bool:
    """Returns whether the first word is a verb that can begin a clause."""
    return words_of(text).word(0) in _verbs()


def verb_positions(text: str) -> Iterator[int]:
    """Yields the positions of verbs after the first word, where a clause may begin without a comma before it."""
    words = words_of(text)
    yield from (words.start(at) for at in range(1, len(words.words)) if words.word(at) in _verbs())


def join_clauses(clauses: Iterable[Clause]) -> str:
    """Joins clauses to one text."""
    return " ".join(f"{clause.joint}{clause.cue} {clause.text}".strip() for clause in clauses).strip(" ,;.")


def end_of_scope(clauses: Sequence[Clause], at: int, *, branch: bool = False, rounds: bool = False) -> int:
    """Index after the clauses, from `at` on, that a condition or rounds apply to.

    `branch` marks a second branch, in which "then" goes on after both branches. A clause that follows the whole block
    ends it; in "first ..., finally ..." it still belongs to the block.
    """
    first = any(re.search(r"\bfirst\b", one.joint, re.IGNORECASE) for one in clauses[at : at + 1])
    for n, one in enumerate(clauses[at:], at):
        after_all = one.anyway or (one.outer and not first)
        if rounds:
            ends = n > at and (after_all or (one.begins and not one.refers))
        else:
            ends = one.begins or one.kind in _DECIDES or (n > at and (after_all or (branch and one.then)))
        if ends:
            return n
    return len(clauses)


@cache
def _rewording() -> Page:
    """Templates of other words for the same, with the words of the installed tasks."""
    forms, opener = dict(task_forms()), tuple(task_openers(Part.PERSON))
    own = {form: verb for form, verb in forms.items() if verb in task_openers(templates=True)}
    return Page("rewording", opener=opener, opener_form=forms or (), own_form=own or ())


@cache
def _verbs() -> frozenset[str]:
    return frozenset({first for first, *_ in lexicon().verbs} | set(CLAUSES.table["openers"]) | task_openers())


_ATTACHED: Final = (Cue.SO, Cue.NOT, Cue.OTHERWISE, Cue.FAILED)
_DECIDES: Final = (*_ATTACHED, Cue.IF, Cue.UNLESS, Cue.SOON)
_BEHIND: Final = (Cue.EVERY, Cue.TIMES, Cue.WHILE, Cue.UNTIL, Cue.UNLESS, Cue.IF)
_WHOLE: Final = frozenset({Cue.FAILED, Cue.SO, Cue.NOT})
_MARKS: Final = frozenset(",;.!?:")
_ARTICLES: Final = ("a", "an", "the", "some", "another")
_ONE_VERB: Final = frozenset({"go", "come", "run", "say"})
"""Verbs after which "and" and "please" join no other clause: "go and charge"."""
_SOME: Final = ("some", "any", "every", "no", "body", "thing", "one", "where", "what", "who")
"""Ends of words before "else" in "somebody else"."""
