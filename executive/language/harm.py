"""What could hurt somebody or break something: it is refused as such, whatever else the sentence says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Final

from executive.language.clauses import Clause
from executive.language.items import Chunk, Outside, Verb, spoken_words
from executive.language.lexicon import PrepositionRole, VerbKind, read_table
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.questions import RefusalError

__all__ = ["refuse_harm"]

_MOVES: Final = frozenset(VerbKind) - {VerbKind.FIND, VerbKind.CHECK}
_OVER: Final = "over"


def refuse_harm(clauses: Sequence[Clause]) -> None:
    """Refuse what does harm. Raises RefusalError, which names the clauses that do."""
    harmful = [spoken_words((clause.verb, *clause.items)) for clause in clauses if clause.verb and _does_harm(clause)]
    if harmful:
        raise RefusalError(f"{', '.join(map(repr, harmful))} could hurt somebody or break something", harmful)


def _does_harm(clause: Clause) -> bool:
    words = _table()
    if not isinstance(verb := clause.verb, Verb | Outside):
        return False
    said = (verb.text if isinstance(verb, Verb) else verb.word).lower()
    chunks = [item for item in clause.items if isinstance(item, Chunk) and item.role is not PrepositionRole.FOR]
    met = [chunk for chunk in chunks if _somebody(chunk.phrase)]
    if said in words["harms"] or (met and said in words["harms_somebody"]):
        return True
    if said in words["throws"]:
        return any(chunk.preposition in words["flies"] for chunk in chunks) or bool(met)
    moves = isinstance(verb, Verb) and bool(verb.kinds & _MOVES)
    over = _OVER if said.endswith(f" {_OVER}") else ""
    return moves and any((chunk.preposition or over) in words["upon"] for chunk in met)


def _somebody(phrase: Phrase) -> bool:
    """Whether it is somebody, or a part of them."""
    bare = len(phrase.content) == 1
    living = phrase.person or phrase.speaker or phrase.stands_for_somebody or (bare and phrase.kind is NounKind.PERSON)
    owned = not bare or any(token.tag in ("PRP$", "POS") for token in phrase.tokens)
    return living or (owned and phrase.head.lemma in _table()["body"])


@cache
def _table() -> Mapping[str, frozenset[str]]:
    return {name: frozenset(words) for name, words in read_table("harm.yaml").items()}
