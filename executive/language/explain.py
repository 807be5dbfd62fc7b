"""How a sentence became its commands, step by step: for people to read, as JSON values, and as a drawing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from executive.language.actions import Action
from executive.language.command_frames import spoken_command
from executive.language.items import Predicate, spoken_words
from executive.language.roles import Location
from executive.language.steps import Trace
from executive.language.tokens import Token
from executive.words.yaml_steps import steps_to_yaml


@dataclass(frozen=True)
class TokenRow:
    """A word of the sentence: its dictionary form, tags, and the word that it depends on (None for a root), and how."""

    index: int
    text: str
    lemma: str
    pos: str
    tag: str
    relation: str
    head: int | None
    kind: str | None


@dataclass(frozen=True)
class ThingRow:
    """Something that an action is done to; a count of 0 is a plural without a number."""

    name: str
    count: int


@dataclass(frozen=True)
class ActionRow:
    """An action: what the verb asks for (None for a statement), what with, from where, to where and for whom."""

    verb: str
    asks_for: str | None
    objects: tuple[ThingRow, ...]
    source: str | None
    goal: str | None
    recipient: str | None
    not_understood: tuple[str, ...]


@dataclass(frozen=True)
class Explanation:
    """All steps of one sentence in order; those behind a refusal are empty.

    `parts` are the clauses as they were read, `stands_for` the pronouns with what each stood for, `frames` the commands
    with names as they were spoken, and `refused_at` names the step that refused.
    """

    text: str
    plain: str
    subject: str | None
    tokens: tuple[TokenRow, ...]
    parts: tuple[str, ...]
    actions: tuple[ActionRow, ...]
    stands_for: tuple[tuple[str, str], ...]
    frames: tuple[str, ...]
    commands: tuple[str, ...]
    mission: tuple[str, ...]
    notes: tuple[str, ...]
    refused_at: str | None
    reason: str | None

    def to_json(self) -> dict[str, Any]:
        """The steps as JSON values."""
        return asdict(self)


def explain(trace: Trace) -> Explanation:
    """What the steps of a sentence made of it."""
    return Explanation(
        text=trace.text,
        plain=trace.opened,
        subject=_subject(trace),
        tokens=tuple(map(_token_row, trace.tokens)),
        parts=trace.parts or tuple(map(_part, trace.clauses)),
        actions=tuple(map(_action_row, trace.actions)),
        stands_for=trace.meanings,
        frames=tuple(str(spoken_command(frame)) for frame in trace.frames),
        commands=tuple(map(str, trace.commands)),
        mission=steps_to_yaml(trace.steps),
        notes=trace.notes,
        refused_at=trace.refused_at,
        reason=None if trace.refusal is None else trace.refusal.reason,
    )


def _subject(trace: Trace) -> str | None:
    """Who acts: the robot that is spoken to, in all that asks it for something; None before that is known."""
    if not trace.actions:
        return None
    said = (t.text for t in trace.tokens if t.relation == "nsubj" and t.pos in ("PRON", "PROPN"))
    return "you (the robot)" if any(action.kind for action in trace.actions) else next(said, None)


def _token_row(token: Token) -> TokenRow:
    root = token.head == token.index
    kind = token.kind.value if token.kind is not None and token.pos in ("NOUN", "PROPN") else None
    return TokenRow(
        token.index, token.text, token.lemma, token.pos, token.tag, token.relation, None if root else token.head, kind
    )


def _part(clause: Predicate) -> str:
    """The words of a clause, its verb in front."""
    verb = [] if clause.verb is None else [spoken_words([clause.verb])]
    subject = [clause.subject.phrase.spoken] if clause.subject is not None else []
    return " | ".join([*verb, *subject, *_pieces(clause)])


def _pieces(clause: Predicate) -> Iterator[str]:
    yield from filter(None, (spoken_words([item]) for item in clause.items))


def _action_row(action: Action) -> ActionRow:
    goal = action.goal
    to_somebody = goal is not None and (goal.person or goal.phrase is None)
    return ActionRow(
        verb=action.verb,
        asks_for=None if action.kind is None else action.kind.value,
        objects=tuple(ThingRow(phrase.text, phrase.count) for phrase in action.objects),
        source=_place(action.source),
        goal=None if to_somebody else _place(goal),
        recipient=_place(goal) if to_somebody else None,
        not_understood=action.unknown,
    )


def _place(place: Location | None) -> str | None:
    return None if place is None else f"{place.preposition} {place.text}".strip()


def tree_lines(tokens: Sequence[TokenRow]) -> Iterator[str]:
    """The dependency tree as lines of text: each word below the one that it depends on."""
    for root in (token for token in tokens if token.head is None):
        yield f"{root.text} ({root.pos} {root.relation})"
        yield from _branches(root, tokens, "")


def _branches(head: TokenRow, tokens: Sequence[TokenRow], indent: str) -> Iterator[str]:
    below = [token for token in tokens if token.head == head.index]
    for token in below:
        last = token is below[-1]
        yield f"{indent}{'└─' if last else '├─'} {token.relation}: {token.text} ({token.pos})"
        yield from _branches(token, tokens, indent + ("   " if last else "│  "))


def explanation_lines(explained: Explanation) -> Iterator[str]:
    """All steps as lines, a heading before each; steps that were not reached are left out."""
    yield from _section("heard", [explained.text])
    yield from _section("in plain words", [explained.plain] if explained.plain else [])
    yield from _section("words", _table(explained.tokens))
    yield from _section("dependencies", list(tree_lines(explained.tokens)))
    yield from _section("subject", [explained.subject] if explained.subject else [])
    yield from _section("parts", explained.parts)
    yield from _section("actions", [line for action in explained.actions for line in _action_lines(action)])
    yield from _section("stands for", [f"{word} = {meant}" for word, meant in explained.stands_for])
    yield from _section("command frames", explained.frames)
    yield from _section("notes", explained.notes)
    yield from _section("commands", explained.commands)
    yield from _section("mission", explained.mission)
    if explained.refused_at is not None:
        yield from _section(f"refused at {explained.refused_at!r}", [explained.reason or ""])


def _section(title: str, lines: Sequence[str]) -> Iterator[str]:
    if lines:
        yield f"{title}:"
        yield from (f"  {line}" for line in lines)


def _table(tokens: Sequence[TokenRow]) -> list[str]:
    """The words in columns."""
    rows = [_cells(token, tokens) for token in tokens]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def _cells(token: TokenRow, tokens: Sequence[TokenRow]) -> tuple[str, ...]:
    head = next((other.text for other in tokens if other.index == token.head), "")
    arc = f"{token.relation} <- {head}" if head else token.relation
    return (str(token.index), token.text, token.lemma, token.pos, token.tag, arc, token.kind or "")


def _action_lines(action: ActionRow) -> Iterator[str]:
    yield f"{action.verb or '(no verb)'}: {action.asks_for or 'tells only'}"
    things = ", ".join(f"{thing.name} x {thing.count or 'some'}" for thing in action.objects)
    found = {
        "objects": things,
        "source": action.source,
        "goal": action.goal,
        "recipient": action.recipient,
        "not understood": ", ".join(action.not_understood),
    }
    yield from (f"  {name}: {value}" for name, value in found.items() if value)


def arcs_svg(tokens: Sequence[TokenRow]) -> str:
    """An SVG document with the words, their parts of speech, and the arcs, as displaCy of spaCy draws them."""
    from spacy.displacy.render import DependencyRenderer

    places = {token.index: place for place, token in enumerate(tokens)}
    arcs = []
    for token in tokens:
        if token.head in places:
            start, end = sorted((places[token.index], places[token.head]))
            side = "left" if places[token.index] == start else "right"
            arcs.append({"start": start, "end": end, "label": token.relation, "dir": side})
    words = [{"text": token.text, "tag": token.pos, "lemma": None} for token in tokens]
    return DependencyRenderer({"distance": 110}).render_svg("arcs", words, arcs).strip() + "\n"
