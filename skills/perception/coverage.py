"""How much of each surface was seen, over several pictures: seen, hidden behind something, or out of view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.api import Surface
from skills.geometry import grid_inside
from skills.perception.detection_3d import depth_ahead_m
from skills.robot import FloatArray, Image

_CELL_M = 0.05
_OUT, _HIDDEN, _SEEN = 0, 1, 2
_NEAR_M, _NEAR_SHARE = 0.04, 0.02
_MUCH = 0.04


@dataclass(frozen=True)
class SurfaceShares:
    """Shares of one surface that were seen, were hidden behind something, or were never in view; they add up to 1."""

    seen: float
    hidden: float

    @property
    def out_of_view(self) -> float:
        """The share that no picture held, or of which there was no depth."""
        return max(0.0, 1.0 - self.seen - self.hidden)

    def __str__(self) -> str:
        parts = [f"{100 * self.seen:.0f} % seen"]
        parts += [f"{100 * share:.0f} % {how}" for share, how in self._unseen() if share >= 0.005]
        return ", ".join(parts)

    def _unseen(self) -> tuple[tuple[float, str], ...]:
        return (self.hidden, "hidden"), (self.out_of_view, "out of view")


class Coverage:
    """Gathers what pictures show of some surfaces."""

    def __init__(self, surfaces: Sequence[Surface]) -> None:
        self._points = {surface.name: _cells(surface) for surface in surfaces}
        self._states = {name: np.zeros(len(points), dtype=np.int8) for name, points in self._points.items()}

    def add(self, image: Image, X_WO: RigidTransform) -> None:
        """Takes in a picture that was looked through."""
        for name, points in self._points.items():
            depth, seen = depth_ahead_m(image, X_WO, points)
            with np.errstate(invalid="ignore"):
                state = np.where(seen < depth - _NEAR_M - _NEAR_SHARE * depth, _HIDDEN, _SEEN)
            state = np.where(np.isfinite(depth) & np.isfinite(seen), state, _OUT)
            self._states[name] = np.maximum(self._states[name], state.astype(np.int8))

    def hidden_middle_W(self) -> Mapping[str, FloatArray]:
        """For each surface of which a good part was hidden, the middle of that part."""
        hidden = {name: self._points[name][states == _HIDDEN] for name, states in self._states.items()}
        return {n: points.mean(axis=0) for n, points in hidden.items() if len(points) > _MUCH * len(self._points[n])}

    def shares(self) -> Mapping[str, SurfaceShares]:
        """The shares of each surface by its name."""
        return {name: _shares(states) for name, states in self._states.items()}


def _shares(states: NDArray[np.int8]) -> SurfaceShares:
    return SurfaceShares(float(np.mean(states == _SEEN)), float(np.mean(states == _HIDDEN)))


def _cells(surface: Surface) -> FloatArray:
    """Points (N, 3) all over a surface; its middle when it is small."""
    inside = grid_inside(surface.polygon_W, _CELL_M, first_m=0.5 * _CELL_M)
    xy = inside if len(inside) else np.mean(surface.polygon_W, axis=0)[None]
    return np.column_stack([xy, np.full(len(xy), surface.height_m)])
