"""How a sentence became its commands, step by step: for people to read, as JSON values, and as a drawing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from executive.language.actions import Action
from executive.language.command_frames import spoken_command
from executive.language.items import Predicate, spoken_words
from executive.language.pipeline import Trace
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

    @classmethod
    def of(cls, token: Token) -> TokenRow:
        """The row of a word."""
        kind = token.kind.value if token.kind is not None and token.pos in ("NOUN", "PROPN") else None
        head = None if token.head == token.index else token.head
        return cls(token.index, token.text, token.lemma, token.pos, token.tag, token.relation, head, kind)


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

    @classmethod
    def of(cls, action: Action) -> ActionRow:
        """The row of an action."""
        source, goal = (
            None if place is None else f"{place.preposition} {place.text}".strip()
            for place in (action.source, action.goal)
        )
        to_somebody = action.goal is not None and (action.goal.person or action.goal.phrase is None)
        return cls(
            verb=action.verb,
            asks_for=None if action.kind is None else action.kind.value,
            objects=tuple(ThingRow(phrase.text, phrase.count) for phrase in action.objects),
            source=source,
            goal=None if to_somebody else goal,
            recipient=goal if to_somebody else None,
            not_understood=action.unknown,
        )

    @property
    def lines(self) -> Iterator[str]:
        """The action to read."""
        yield f"{self.verb or '(no verb)'}: {self.asks_for or 'tells only'}"
        found = {
            "objects": ", ".join(f"{thing.name} x {thing.count or 'some'}" for thing in self.objects),
            "source": self.source,
            "goal": self.goal,
            "recipient": self.recipient,
            "not understood": ", ".join(self.not_understood),
        }
        yield from (f"  {name}: {value}" for name, value in found.items() if value)


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
    subject = None
    if trace.actions:  # the robot that is spoken to acts, in all that asks it for something
        said = (t.text for t in trace.tokens if t.relation == "nsubj" and t.pos in ("PRON", "PROPN"))
        subject = "you (the robot)" if any(action.kind for action in trace.actions) else next(said, None)
    return Explanation(
        text=trace.text,
        plain=trace.opened,
        subject=subject,
        tokens=tuple(map(TokenRow.of, trace.tokens)),
        parts=trace.parts or tuple(map(_part, trace.clauses)),
        actions=tuple(map(ActionRow.of, trace.actions)),
        stands_for=trace.meanings,
        frames=tuple(str(spoken_command(frame)) for frame in trace.frames),
        commands=tuple(map(str, trace.commands)),
        mission=steps_to_yaml(trace.steps),
        notes=trace.notes,
        refused_at=trace.refused_at,
        reason=None if trace.refusal is None else trace.refusal.reason,
    )


def _part(clause: Predicate) -> str:
    """The words of a clause, its verb in front."""
    verb = [] if clause.verb is None else [spoken_words([clause.verb])]
    subject = [clause.subject.phrase.spoken] if clause.subject is not None else []
    return " | ".join([*verb, *subject, *filter(None, (spoken_words([item]) for item in clause.items))])


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
    sections: dict[str, Sequence[str]] = {
        "heard": [explained.text],
        "in plain words": [explained.plain] if explained.plain else [],
        "words": _table(explained.tokens),
        "dependencies": list(tree_lines(explained.tokens)),
        "subject": [explained.subject] if explained.subject else [],
        "parts": explained.parts,
        "actions": [line for action in explained.actions for line in action.lines],
        "stands for": [f"{word} = {meant}" for word, meant in explained.stands_for],
        "command frames": explained.frames,
        "notes": explained.notes,
        "commands": explained.commands,
        "mission": explained.mission,
        f"refused at {explained.refused_at!r}": [] if explained.refused_at is None else [explained.reason or ""],
    }
    for title, lines in sections.items():
        yield from (f"{title}:", *(f"  {line}" for line in lines)) if lines else ()


def _table(tokens: Sequence[TokenRow]) -> list[str]:
    """The words in columns."""
    rows = []
    for token in tokens:
        head = next((other.text for other in tokens if other.index == token.head), "")
        arc = f"{token.relation} <- {head}" if head else token.relation
        rows.append((str(token.index), token.text, token.lemma, token.pos, token.tag, arc, token.kind or ""))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


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
