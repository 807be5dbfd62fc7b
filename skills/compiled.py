"""Compilation of inner loops to machine code, cached on disk between runs, and loops shared by several modules."""

import functools
import math
import sys
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])
Triple = tuple[float, float, float]
"""A pose (x, y, yaw), or the frame of a grid (cell size, and x and y of its corner)."""


def compiled(function: FunctionT) -> FunctionT:
    """Compiles a function when it is first called, single-threaded and without reordering floating-point operations."""
    return cast(FunctionT, CompiledFunction(function))


class CompiledFunction:
    """A function that numba compiles at the first call, because importing numba takes half a second."""

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self._function = function

    def __call__(self, *arguments: Any) -> Any:
        """Compiles the function at the first call, and returns its result."""
        return self.machine_code(*arguments)

    @functools.cached_property
    def machine_code(self) -> Callable[..., Any]:
        """The compiled function; the functions that it calls are compiled, too."""
        njit, names = _compiler(), self._function.__globals__
        for name in self._function.__code__.co_names:
            if isinstance(names.get(name), CompiledFunction):
                names[name] = names[name].machine_code
        code: Any = njit(cache=True, nogil=True)(self._function)
        try:
            code._cache._cache_file._load_index()
        except (ImportError, AttributeError):  # its arguments' types stood in another module when it was compiled
            code._cache.flush()
        return cast(Callable[..., Any], code)


@functools.cache
def _compiler() -> Any:
    """Imports numba and returns njit."""
    from numba import njit

    # numba imports scipy.linalg, which takes 70 ms, to see whether it offers BLAS, which few loops call
    if sys.modules.setdefault("scipy.linalg", None) is None:  # type: ignore[arg-type]
        import numba.np.arraymath  # noqa: F401

        del sys.modules["scipy.linalg"]
    return njit


@compiled
def bilinear(field: NDArray[np.float32], u: float, v: float) -> float:
    """Value of field[row, column] at column u, row v (cell centres at whole numbers); clamped to the edge outside."""
    rows, columns = field.shape
    u = min(max(u, 0.0), columns - 1.0)
    v = min(max(v, 0.0), rows - 1.0)
    i, j = min(int(v), rows - 2), min(int(u), columns - 2)
    a, b = u - j, v - i
    low = (1.0 - a) * field[i, j] + a * field[i, j + 1]
    high = (1.0 - a) * field[i + 1, j] + a * field[i + 1, j + 1]
    return float((1.0 - b) * low + b * high)


@compiled
def distance_at(
    field: NDArray[np.float32], resolution_m: float, x0_m: float, y0_m: float, x_m: float, y_m: float
) -> float:
    """Distance (m) at a point, from a distance field; outside the field, minus the distance to its edge."""
    rows, columns = field.shape
    u, v = (x_m - x0_m) / resolution_m, (y_m - y0_m) / resolution_m
    du, dv = max(-u, u - columns, 0.0), max(-v, v - rows, 0.0)
    if du > 0.0 or dv > 0.0:
        return -math.hypot(du, dv) * resolution_m
    return bilinear(field, u - 0.5, v - 0.5)


@compiled
def distances(
    field: NDArray[np.float32], resolution_m: float, x0_m: float, y0_m: float, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distances (m) at points (N, 2), as `distance_at`."""
    values = np.empty(points.shape[0])
    for n in range(points.shape[0]):
        values[n] = distance_at(field, resolution_m, x0_m, y0_m, points[n, 0], points[n, 1])
    return values
