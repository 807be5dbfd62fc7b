"""The states' colours stay apart without colour vision, and their words are readable."""

from itertools import combinations

import numpy as np
import pytest

from executive.view.styles import Styles

# Linear RGB as seen with one kind of cone missing (Machado and others, 2009, severity 1).
CONES = {
    "all": np.eye(3),
    "no M cones": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "no L cones": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "no S cones": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def linear(colour: str) -> np.ndarray:
    values = np.array([int(colour[n : n + 2], 16) for n in (1, 3, 5)]) / 255
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    ratios = XYZ @ np.clip(rgb, 0, 1) / np.array([0.9505, 1.0, 1.089])
    x, y, z = np.where(ratios > 0.008856, np.cbrt(ratios), 7.787 * ratios + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("cones", CONES)
def test_line_colours_stay_apart_for_every_kind_of_colour_vision(cones):
    seen = {style.name: lab(np.array(CONES[cones]) @ linear(style.value.line)) for style in Styles}
    distances = {(a, b): np.linalg.norm(seen[a] - seen[b]) for a, b in combinations(seen, 2)}
    assert min(distances.values()) > 15, distances


@pytest.mark.parametrize("style", Styles)
def test_words_are_readable_on_their_fill(style):
    ink, fill = (XYZ[1] @ linear(colour) for colour in (style.value.ink, style.value.fill))
    assert (fill + 0.05) / (ink + 0.05) > 4.5


def test_every_state_has_its_own_symbol_and_kind_of_line():
    for attribute in ("word", "symbol", "ascii", "line", "dashes"):
        values = [getattr(style.value, attribute) for style in Styles]
        if attribute == "dashes":
            values = [(style.value.dashes, style is Styles.FAILURE) for style in Styles]  # a failure's line is thicker
        assert len(set(values)) == len(values)
