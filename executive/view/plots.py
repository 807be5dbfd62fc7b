"""Plots of a run over time, from its log: speed, battery, force of the gripper, error of the position, and pace."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from executive.record.history import Event
from executive.view.html import render
from executive.view.text import ROBOT_COLOURS
from executive.words.schemas import STATE, TRUTH, WALL

_CURVES: Final[Mapping[str, tuple[str, str, float]]] = {
    "speed_m_s": ("Speed", "m/s", 1.0),
    "charge": ("Battery", "%", 100.0),
    "grip_n": ("Force of the gripper", "N", 1.0),
    "position_sigma_m": ("Own estimate of the position (1σ)", "cm", 100.0),
    "error_m": ("Position error (dashed: own estimate, 1σ)", "cm", 100.0),
    "pace": ("Real-time factor", "", 1.0),
}
"""Title and unit of the plot of each logged value, and the factor into this unit."""
_W, _H, _LEFT, _RIGHT, _TOP, _BOTTOM = 360.0, 190.0, 46.0, 346.0, 32.0, 160.0
_MOST_POINTS: Final = 400
"""Most points of a line, to bound the size of the report of a long run."""

Line = NDArray[np.float64]
"""Points (N, 2): time (s) and value."""


@dataclass(frozen=True)
class Curve:
    """Values over time: the title and unit of the plot, and each robot's line and dashed line by its name."""

    title: str
    unit: str
    lines: Mapping[str, Line]
    dashed: Mapping[str, Line] = field(default_factory=dict)


def curves_of(events: Iterable[Event]) -> tuple[Curve, ...]:
    """Returns the curves of a run's events; omits those without values, or of a value that is always 0.

    The error of the position is known in a simulated run alone.
    """
    found = {name: defaultdict[str, list[tuple[float, float]]](list) for name in _CURVES}
    before: tuple[float, float] | None = None
    for event in events:
        if event.topic in (STATE, TRUTH):
            for name in _CURVES.keys() & event.data.keys():
                own = found[name][str(event.data.get("robot", ""))]
                own.append((event.stamp_s, _CURVES[name][2] * float(event.data[name])))
        elif event.topic == WALL and "lasted_s" in event.data:
            now = event.stamp_s, float(event.data["lasted_s"])
            if before is not None and now[1] > before[1]:
                found["pace"][""].append((now[0], (now[0] - before[0]) / (now[1] - before[1])))
            before = now
    every = {name: {one: np.array(line) for one, line in lines.items()} for name, lines in found.items()}
    dashed = {"error_m": every.pop("position_sigma_m")} if every["error_m"] else {}
    curves = (Curve(*_CURVES[name][:2], lines, dashed.get(name, {})) for name, lines in every.items())
    return tuple(each for each in curves if any(np.any(line[:, 1]) for line in each.lines.values()))


def to_plot(curve: Curve) -> str:
    """Draws a curve as SVG, with the colours of the robots."""
    every = np.vstack([*curve.lines.values(), *curve.dashed.values()])
    end_s, most = max(float(every[:, 0].max()), 1e-9), _round_up(float(every[:, 1].max()))
    scale = np.array([(_RIGHT - _LEFT) / end_s, (_TOP - _BOTTOM) / most])
    values: dict[str, Any] = {
        "lines": [
            (ROBOT_COLOURS[number % len(ROBOT_COLOURS)], _thinned(line) * scale + (_LEFT, _BOTTOM), dashes)
            for lines, dashes in ((curve.dashed, "3 3"), (curve.lines, "none"))
            for number, (_, line) in enumerate(sorted(lines.items()))
        ],
        "rows": [(_BOTTOM + share * (_TOP - _BOTTOM), f"{share * most:g}") for share in (0.0, 0.5, 1.0)],
        "columns": [
            (_LEFT + share * (_RIGHT - _LEFT), f"{share * end_s:.0f} s", anchor)
            for share, anchor in ((0.0, "start"), (0.5, "middle"), (1.0, "end"))
        ],
    }
    return render("plot.svg", curve=curve, w=_W, h=_H, left=_LEFT, right=_RIGHT, **values)


def _thinned(line: Line) -> Line:
    """Returns at most `_MOST_POINTS` points, with the largest value of each stretch."""
    stretches: Sequence[Line] = np.array_split(line, min(len(line), _MOST_POINTS))
    return np.array([each[int(np.argmax(each[:, 1]))] for each in stretches])


def _round_up(value: float) -> float:
    """Smallest of 1, 2 and 5 times a power of ten that is not less than a positive value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= value * (1.0 - 1e-9)))
