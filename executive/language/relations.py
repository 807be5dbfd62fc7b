"""Relations to a place or to somebody ("behind Robin", "through the kitchen"): one that no command keeps is refused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Final

from executive.language.actions import Action
from executive.language.clauses import Clause
from executive.language.items import Chunk, Verb
from executive.language.lexicon import VerbKind, read_table
from executive.language.questions import RefusalError
from executive.language.roles import Location

__all__ = ["check_relation", "check_ways_and_speaker"]

_GO: Final = frozenset({VerbKind.GO})
_ON_TOP: Final = ("in", "out")


def check_ways_and_speaker(clauses: Sequence[Clause], actions: Sequence[Action]) -> None:
    """Refuse a way that is to be taken, and relations to the speaker but "to me". Raises RefusalError."""
    for action in actions:
        for place in action.ways:
            if place.phrase is None or place.phrase.head.lemma not in _table()["doors"]:
                raise _refused("go", place.preposition, place.name)
    for clause in clauses:
        act = "go" if isinstance(clause.verb, Verb) and clause.verb.kinds == _GO else "bring"
        for chunk in clause.items:
            if isinstance(chunk, Chunk) and chunk.phrase.speaker and not _keeps(act, "person", chunk.preposition):
                raise _refused(act, chunk.preposition, chunk.phrase.spoken)


def check_relation(act: str, kinds: Sequence[str], location: Location) -> None:
    """Refuse a relation that a command which goes, brings or looks ("go", "bring", "look") does not keep.

    `kinds` is what the place may turn out to be: "room", "surface" or "person". Raises RefusalError.
    """
    name = location.phrase
    if name is None:
        return
    groups = _ON_TOP if "surface" in kinds and name.head.lemma.split()[-1] in _table()["open_tops"] else ()
    on_top = any(_in(group, location.preposition) for group in groups)
    if not (on_top or any(_keeps(act, kind, location.preposition) for kind in kinds)):
        raise _refused(act, location.preposition, name.spoken)
    around = location.within
    if around is not None and not _keeps("around", "place", around.preposition):
        raise _refused("around", around.preposition, around.name)


def _refused(act: str, preposition: str, name: str) -> RefusalError:
    said = f"{preposition} {name}".strip()
    return RefusalError(f"{_table()['instead'][act]}, not {said!r}", [said])


def _keeps(act: str, kind: str, preposition: str) -> bool:
    return any(_in(group, preposition) for group in _table()["kept"][act][kind])


def _in(group: str, preposition: str) -> bool:
    return preposition in _table()["groups"][group]


@cache
def _table() -> Mapping[str, Any]:
    return read_table("relations.yaml")
