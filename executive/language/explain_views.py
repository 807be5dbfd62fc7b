"""The steps of a sentence as text, and its dependency arcs as a drawing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from executive.language.explain import ActionRow, Explanation, TokenRow, tree_lines

__all__ = ["arcs_svg", "explanation_lines"]


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
