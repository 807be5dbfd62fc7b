"""The dependency arcs of a sentence as a drawing: words in a row, an arc from each word's head to it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Final

from executive.language.explain import TokenRow

__all__ = ["arcs_svg"]

_CHARACTER_PX: Final = 9.0
_GAP_PX: Final = 26.0
_LABEL_CHARACTER_PX: Final = 6.5
_LEVEL_PX: Final = 30.0
_MARGIN_PX: Final = 20.0
_TEXT_PX: Final = 58.0
_STYLE: Final = (
    "text{font-family:sans-serif;text-anchor:middle}.word{font-size:16px;fill:#1b1b1b}.tag{font-size:11px;fill:#68727d}"
    ".arc{fill:none;stroke:#7a8794;stroke-width:1.3}.head{fill:#7a8794}.label{font-size:11px;fill:#0b5d8f}"
    ".under{fill:#fff}"
)


def arcs_svg(tokens: Sequence[TokenRow]) -> str:
    """An SVG document with the words, their parts of speech, and the dependency arcs with their relations."""
    centres, width = _centres(tokens)
    levels = _levels(tokens)
    base = _MARGIN_PX + _LEVEL_PX * (max(levels.values(), default=0) + 1)
    height = base + _TEXT_PX
    body = [*_arcs(tokens, centres, levels, base), *_words(tokens, centres, base)]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}"><style>{_STYLE}</style>'
        f'<rect width="100%" height="100%" fill="#fff"/>{"".join(body)}</svg>\n'
    )


def _centres(tokens: Sequence[TokenRow]) -> tuple[Mapping[int, float], float]:
    """Where the middle of each word stands (px), and how wide all is."""
    centres: dict[int, float] = {}
    left = _MARGIN_PX
    for token in tokens:
        longest = max(len(token.text) * _CHARACTER_PX, max(len(token.tag), len(token.relation)) * _LABEL_CHARACTER_PX)
        centres[token.index] = left + longest / 2
        left += longest + _GAP_PX
    return centres, left - _GAP_PX + _MARGIN_PX if tokens else 2 * _MARGIN_PX


def _levels(tokens: Sequence[TokenRow]) -> Mapping[int, int]:
    """How high the arc to each word goes: above all arcs that lie within its span, from 1."""
    spans = {t.index: tuple(sorted((t.index, t.head))) for t in tokens if t.head is not None}
    levels: dict[int, int] = {}
    for index, (first, last) in sorted(spans.items(), key=lambda item: (item[1][1] - item[1][0], item[0])):
        within = [levels[other] for other, (a, b) in spans.items() if other in levels and first <= a and b <= last]
        levels[index] = 1 + max(within, default=0)
    return levels


def _arcs(
    tokens: Sequence[TokenRow], centres: Mapping[int, float], levels: Mapping[int, int], base: float
) -> Iterator[str]:
    for token in tokens:
        if token.head is None or token.head not in centres:
            continue
        start, end = centres[token.head], centres[token.index]
        start += _shift(start, end)
        top = base - _LEVEL_PX * levels[token.index]
        bend = min(14.0, abs(end - start) / 2)
        side = bend if end > start else -bend
        rise = f"M{start:.1f},{base:.1f} L{start:.1f},{top + bend:.1f} Q{start:.1f},{top:.1f}"
        along = f"{start + side:.1f},{top:.1f} L{end - side:.1f},{top:.1f}"
        path = f"{rise} {along} Q{end:.1f},{top:.1f} {end:.1f},{top + bend:.1f} L{end:.1f},{base - 5:.1f}"
        yield f'<path class="arc" d="{path}"/>'
        yield f'<path class="head" d="M{end - 3.5:.1f},{base - 7:.1f} h7 L{end:.1f},{base:.1f} z"/>'
        yield _label((start + end) / 2, top, token.relation)


def _shift(start: float, end: float) -> float:
    """Arcs leave a word a little beside its middle, where the arc to it ends."""
    return 6.0 if end > start else -6.0


def _label(x: float, y: float, relation: str) -> str:
    width = len(relation) * _LABEL_CHARACTER_PX + 4
    return (
        f'<rect class="under" x="{x - width / 2:.1f}" y="{y - 7:.1f}" width="{width:.1f}" height="13"/>'
        f'<text class="label" x="{x:.1f}" y="{y + 4:.1f}">{escape(relation)}</text>'
    )


def _words(tokens: Sequence[TokenRow], centres: Mapping[int, float], base: float) -> Iterator[str]:
    for token in tokens:
        x = centres[token.index]
        yield f'<text class="word" x="{x:.1f}" y="{base + 22:.1f}">{escape(token.text)}</text>'
        below = token.pos if token.head is not None else f"{token.pos} {token.relation}"
        yield f'<text class="tag" x="{x:.1f}" y="{base + 40:.1f}">{escape(below)}</text>'
