"""The dependency arcs of a sentence as a drawing: words in a row, an arc from each word's head to it."""

from __future__ import annotations

from collections.abc import Sequence

from executive.language.explain import TokenRow

__all__ = ["arcs_svg"]


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
