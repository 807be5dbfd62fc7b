"""The sentence's clauses: a verb with what stands behind it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from executive.language.items import Being, Chunk, Item, Outside, Separator, Verb, Whether

__all__ = ["Clause", "split_clauses", "without_name"]


@dataclass(frozen=True)
class Clause:
    """A verb, or a form of "to be", with the items behind it; a verb may be one that the robot does not know.

    `verb` is None for what stands before the first verb; `subject` stood before a form of "to be"; `whether` says that
    "if" or "whether" did.
    """

    verb: Verb | Being | Outside | None
    items: tuple[Item, ...] = ()
    subject: Chunk | None = None
    whether: bool = False


def split_clauses(items: Iterable[Item]) -> tuple[Clause, ...]:
    """Cut the row of items at its verbs."""
    found: list[Clause] = [Clause(None)]
    for item in items:
        if isinstance(item, Being):
            found = [*found[:-1], *_begin_being(found[-1], item)]
        elif isinstance(item, Verb | Outside):
            found.append(Clause(item))
        else:
            found[-1] = replace(found[-1], items=(*found[-1].items, item))
    whole = (clause for clause in found if clause.verb is not None or _content(clause.items))
    return tuple(part for clause in whole for part in _ungapped(clause))


def _ungapped(clause: Clause) -> Iterator[Clause]:
    """Say the verb again where it was left out: "a beer to Robin and a coke to Charlie"."""
    given = next((n for n in range(1, len(clause.items) - 1) if _gives_another(clause.items, n)), None)
    if given is not None and isinstance(clause.verb, Verb):
        yield replace(clause, items=clause.items[:given])
        yield from _ungapped(Clause(clause.verb, clause.items[given + 1 :]))
        return
    cut = next((n for n in range(1, len(clause.items) - 1) if _gap(clause.items, n)), None)
    if cut is None or not isinstance(clause.verb, Verb):
        yield clause
        return
    yield replace(clause, items=clause.items[:cut])
    first = clause.items[0]
    recipient = (first,) if isinstance(first, Chunk) and first.role is None and first.phrase.speaker else ()
    yield from _ungapped(Clause(clause.verb, (*recipient, *clause.items[cut + 1 :])))


def _gives_another(items: Sequence[Item], at: int) -> bool:
    """Whether somebody else and what they are given stand behind a separator: "me the book and Anna the pen"."""
    joint, who, what = items[at], items[at + 1], items[at + 2] if at + 2 < len(items) else None
    if not (isinstance(joint, Separator) and isinstance(who, Chunk) and isinstance(what, Chunk)):
        return False
    bare = who.role is None and what.role is None and isinstance(items[at - 1], Chunk)
    return bare and (who.phrase.person or who.phrase.speaker) and not (what.phrase.person or what.phrase.speaker)


def _gap(items: Sequence[Item], at: int) -> bool:
    """Whether a separator stands between two things that each have a place of the same role."""
    joint, thing, place = items[at], items[at + 1], items[at + 2] if at + 2 < len(items) else None
    if not (isinstance(joint, Separator) and isinstance(thing, Chunk) and isinstance(place, Chunk)):
        return False
    bare = [item for item in items[:at] if isinstance(item, Chunk) and item.role is None and not item.phrase.speaker]
    roles = [item.role for item in items[:at] if isinstance(item, Chunk) and item.role is not None]
    return thing.role is None and place.role is not None and bool(bare) and place.role in roles


def _content(items: Sequence[Item]) -> bool:
    return any(not isinstance(item, Separator) for item in items)


def _begin_being(last: Clause, being: Being) -> list[Clause]:
    """Begin a clause of "to be", which takes its subject, and the "if" before it, from the clause before."""
    rest = last.items
    subject = rest[-1] if rest and isinstance(rest[-1], Chunk) and not being.existential else None
    if subject is None or subject.role is not None:
        subject = None
    else:
        rest = rest[:-1]
    whether = bool(rest) and isinstance(rest[-1], Whether)
    asked = being.asked and subject is None
    before = replace(last, items=rest[: len(rest) - whether])
    return [before, Clause(replace(being, asked=asked), (), subject, whether)]


def without_name(clauses: Sequence[Clause]) -> tuple[Clause, ...]:
    """Leave out a bare name before the first verb: it calls somebody ("Michael go to the kitchen")."""
    first, *rest = clauses or [Clause(None)]
    content = [item for item in first.items if not isinstance(item, Separator)]
    name = content[0] if len(content) == 1 and isinstance(content[0], Chunk) and content[0].role is None else None
    joined = any(isinstance(item, Separator) and item.word in ("and", "or") for item in first.items)
    comma = isinstance(first.items[-1], Separator) and first.items[-1].word == "," if first.items else False
    called = name is not None and not joined and (name.phrase.named_person or (comma and name.phrase.proper))
    return tuple(rest if first.verb is None and called and rest else clauses)
