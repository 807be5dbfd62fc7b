"""Explains how a sentence became its commands: as JSON values, lines of text, or a drawing of the dependencies."""

import enum
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

from executive.language.actions import Action
from executive.language.command_frames import spoken_command
from executive.language.items import Predicate, spoken_words
from executive.language.lexicon import any_of, lexicon, unquoted, word_list
from executive.language.pipeline import Trace
from executive.language.tokens import Token
from executive.words.steps import steps_to_yaml

_WORD: Final = re.compile(r"[\w'-]*\w")


class Use(enum.Enum):
    """Part of an answer that has a word of the sentence."""

    MEANING = "meaning"  # into the commands or the mission
    NOTE = "note"  # nowhere else, and a note names it
    FILLER = "filler"  # it changes nothing
    REFUSED = "refused"  # the refusal names it


def word_uses(trace: Trace) -> tuple[tuple[str, Use], ...]:
    """Words of a sentence in order, each with where it went."""
    refused = () if trace.refusal is None else trace.refusal.unknown
    noted = re.findall(r"'((?:[^']|(?<=\w)'(?=\w))+)'", " ".join(trace.notes))
    small = (*map(" ".join, lexicon().fillers), *word_list("asides"), *word_list("openers"), *word_list("hesitations"))
    forms = {Use.REFUSED: refused, Use.NOTE: noted, Use.FILLER: filter(_WORD.search, small)}
    groups = (rf"(?P<{use.name}>\b(?:{any_of(texts) or '(?!)'})(?!\w))" for use, texts in forms.items())
    found = re.compile("|".join(groups), re.IGNORECASE)
    uses = {n: Use[match.lastgroup or ""] for match in found.finditer(trace.text) for n in range(*match.span())}
    return tuple((word[0], uses.get(word.start(), Use.MEANING)) for word in _WORD.finditer(trace.text))


def explain(trace: Trace) -> dict[str, Any]:
    """Explains each step of understanding a sentence, as JSON values; the steps after a refusal are empty.

    `uses` has each word with where it went, `parts` are the clauses, `stands_for` the pronouns with their meanings,
    `frames` the commands with the spoken names, and `refused_at` is the refusing step.
    """
    subject = None
    if trace.actions:  # the addressed robot acts in every request
        said = (t.text for t in trace.tokens if t.relation == "nsubj" and t.pos in ("PRON", "PROPN"))
        subject = "you (the robot)" if any(action.kind for action in trace.actions) else next(said, None)
    values = {
        "text": trace.text,
        "plain": trace.opened,
        "subject": subject,
        "tokens": list(map(_token_values, trace.tokens)),
        "parts": [*trace.parts] or list(map(_part, trace.clauses)),
        "actions": list(map(_action_values, trace.actions)),
        "stands_for": list(map(list, trace.meanings)),
        "frames": [str(spoken_command(frame)) for frame in trace.frames],
        "commands": list(map(str, trace.commands)),
        "mission": [*steps_to_yaml(trace.steps)],
        "notes": [*trace.notes],
        "uses": [[word, use.value] for word, use in word_uses(trace)],
        "refused_at": trace.refused_at,
        "reason": None if trace.refusal is None else trace.refusal.reason,
    }
    return dict(json.loads(unquoted(json.dumps(values, ensure_ascii=False))))


def _token_values(token: Token) -> dict[str, Any]:
    names = ("index", "text", "lemma", "pos", "tag", "relation")
    return {
        **{name: getattr(token, name) for name in names},
        "head": None if token.head == token.index else token.head,
        "kind": token.kind.value if token.kind is not None and token.pos in ("NOUN", "PROPN") else None,
    }


def _action_values(action: Action) -> dict[str, Any]:
    places = {"source": action.source, "goal": action.goal}
    said = {name: place and f"{place.preposition} {place.text}".strip() for name, place in places.items()}
    to_somebody = action.goal is not None and (action.goal.person or action.goal.phrase is None)
    return {
        "verb": action.verb,
        "asks_for": None if action.kind is None else action.kind.value,
        "objects": [{"name": phrase.text, "count": phrase.count} for phrase in action.objects],
        "source": said["source"],
        "goal": None if to_somebody else said["goal"],
        "recipient": said["goal"] if to_somebody else None,
        "not_understood": [*action.unknown],
    }


def _part(clause: Predicate) -> str:
    """Words of a clause, with its verb first."""
    parts = (spoken_words([one]) for one in (clause.verb, clause.subject, *clause.items) if one is not None)
    return " | ".join(filter(None, parts))


def explanation_lines(trace: Trace) -> Iterator[str]:
    """Explains each step of understanding a sentence in lines with headings; omits empty steps."""
    values, uses = explain(trace), word_uses(trace)
    its = {use.value: ", ".join(word for word, where in uses if where is use) for use in Use}
    sections: dict[str, Iterable[str]] = {
        "heard": [trace.text],
        "in plain words": filter(None, [trace.opened]),
        "words": _table(values["tokens"]),
        "dependencies": tree_lines(trace.tokens),
        "subject": filter(None, [values["subject"]]),
        "parts": values["parts"],
        "actions": (line for action in values["actions"] for line in _action_lines(action)),
        "stands for": (f"{word} = {meant}" for word, meant in trace.meanings),
        "command frames": values["frames"],
        "notes": trace.notes,
        "where each word went": (f"{use}: {words}" for use, words in its.items() if words),
        "commands": values["commands"],
        "mission": values["mission"],
        f"refused at {trace.refused_at!r}": [] if trace.refusal is None else [trace.refusal.reason],
    }
    for title, lines in sections.items():
        shown = [f"  {unquoted(line)}" for line in lines]
        yield from (f"{title}:", *shown) if shown else ()


def _action_lines(action: Mapping[str, Any]) -> Iterator[str]:
    yield f"{action['verb'] or '(no verb)'}: {action['asks_for'] or 'tells only'}"
    objects = (f"{each['name']} x {each['count'] or 'some'}" for each in action["objects"])
    found = {**action, "objects": ", ".join(objects), "not understood": ", ".join(action["not_understood"])}
    shown = ("objects", "source", "goal", "recipient", "not understood")
    yield from (f"  {name}: {found[name]}" for name in shown if found[name])


def _table(words: Sequence[Mapping[str, Any]]) -> list[str]:
    """Formats words in columns."""
    texts = {word["index"]: word["text"] for word in words}
    arcs = (f"{word['relation']} <- {texts.get(word['head'], '')}".removesuffix(" <- ") for word in words)
    names = ("index", "text", "lemma", "pos", "tag")
    rows = [
        [*(str(word[name]) for name in names), arc, word["kind"] or ""] for word, arc in zip(words, arcs, strict=True)
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def tree_lines(tokens: Sequence[Token], head: Token | None = None, indent: str = "") -> Iterator[str]:
    """Formats the dependency tree as lines of text: each word below the word that it depends on."""
    if head is None:
        for root in (token for token in tokens if token.head == token.index):
            yield f"{root.text} ({root.pos} {root.relation})"
            yield from tree_lines(tokens, root)
        return
    below = [token for token in tokens if token.head == head.index != token.index]
    for token in below:
        mark, more = ("└─", "   ") if token is below[-1] else ("├─", "│  ")
        yield f"{indent}{mark} {token.relation}: {token.text} ({token.pos})"
        yield from tree_lines(tokens, token, indent + more)


def arcs_svg(tokens: Sequence[Token]) -> str:
    """Draws the words, their parts of speech and the arcs as an SVG document, as displaCy of spaCy does."""
    from spacy.displacy.render import DependencyRenderer

    places = {token.index: place for place, token in enumerate(tokens)}
    arcs = []
    for token in tokens:
        if token.head in places and token.head != token.index:
            start, end = sorted((places[token.index], places[token.head]))
            side = "left" if places[token.index] == start else "right"
            arcs.append({"start": start, "end": end, "label": token.relation, "dir": side})
    words = [{"text": token.text, "tag": token.pos, "lemma": None} for token in tokens]
    return DependencyRenderer({"distance": 110}).render_svg("arcs", words, arcs).strip() + "\n"
