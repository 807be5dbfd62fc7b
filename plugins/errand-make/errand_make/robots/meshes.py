"""Copies the meshes of a URDF into a package: appearances with their colours, and convex hulls for collisions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Final, Literal
from xml.etree.ElementTree import Element

import numpy as np

from errand_make.errors import ObjectImportError
from errand_make.mesh import unique_rows
from errand_make.objects.import_object import hull_text, write_appearance
from errand_make.objects.mesh_files import GREY, MOST_TRIANGLES, MeshContent, Patch, read_mesh
from errand_make.objects.solid import bodies_apart
from errand_make.robots.source import package_folder
from plant.robots.urdf_robot.urdf_file import PACKAGE, UrdfFile
from skills.inputs.errors import listing
from skills.robot import FloatArray

MESHES: Final = "meshes"
Role = Literal["visual", "collision"]
_MOST_READ: Final = 3_000_000
_LARGEST_M: Final = 10.0
_APART_M: Final = 0.1
_THIN_M: Final = 1e-3
_ROLES: Final[tuple[Role, ...]] = ("visual", "collision")


@dataclass
class MeshCopies:
    """Copies of the meshes of a URDF into the folder `meshes` beside its `robot.urdf`; `notes` are for a person."""

    urdf: UrdfFile
    packages: Mapping[str, Path]
    folder: Path
    notes: list[str] = field(default_factory=list)
    _names: dict[tuple[Path, str, str], str] = field(default_factory=dict)
    _coarser: list[str] = field(default_factory=list)

    def meshes(self) -> list[tuple[Role, Element, Element]]:
        """Role, shape and mesh of each shape that is a mesh."""
        shapes = ((role, each) for link in self.urdf.links for role in _ROLES for each in self.urdf.shapes(link, role))
        return [(role, shape, mesh) for role, shape in shapes for mesh in shape.iter("mesh")]

    def copy(self, role: Role, shape: Element, mesh: Element) -> None:
        """Copies one mesh, unless it is copied yet, and names its copy. Raises InputError with the mesh's line."""
        path, colour = self._path(mesh), self._colour(shape)
        key = (path, role, "" if colour is None else colour.get("rgba", ""))
        if key not in self._names:
            name = f"{path.stem}_{role}_{len(self._names)}"
            self._names[key] = f"{name}/{name}.obj"
            try:
                self._convert(role, mesh, path, self.folder / MESHES / self._names[key], key[2])
            except ObjectImportError as error:
                raise self.urdf.error(mesh, f"{path}: {error.message}", error.hint) from error
        mesh.set("filename", f"package://{PACKAGE}/{MESHES}/{self._names[key]}")

    def _colour(self, shape: Element) -> Element | None:
        """Colour of a shape, which may be defined at the top of the file."""
        material, own = shape.find("material"), shape.find("material/color")
        name = "" if material is None else material.get("name", "")
        named = (each.find("color") for each in self.urdf.robot.findall("material") if each.get("name") == name)
        return own if own is not None or material is None else next(named, None)

    def all_notes(self) -> list[str]:
        """Notes on the meshes that a person should check."""
        few = f"{listing(self._coarser)}: drawn with fewer triangles than the file has"
        return [*self.notes, *([few] if self._coarser else [])]

    def _path(self, mesh: Element) -> Path:
        """File of a mesh. Raises InputError with the line when there is none."""
        name, urdf = mesh.get("filename", ""), self.urdf
        package, _, rest = name.removeprefix("package://").lstrip("/").partition("/")
        if not name.startswith("package://"):
            path = urdf.path.parent / name.removeprefix("file://")
        elif package in self.packages:
            path = self.packages[package] / rest
        else:
            path = self._around(package, rest)
            if path == Path():
                hint = f"give its folder: --package {package}=DIR"
                raise urdf.error(mesh, f"there is no folder of package '{package}' with {rest}", hint)
        if not path.is_file():
            beside = [each.name for each in sorted(path.parent.glob(f"{path.stem}.*"))]
            other = next(iter(get_close_matches(path.name, beside, n=1, cutoff=0.0)), "")
            other = f"write the name of {other}, which is there" if other else "correct the name"
            hint = f"{other}, or give the folder by --package NAME=DIR"
            raise urdf.error(mesh, f"there is no mesh {path}", hint)
        return path

    def _around(self, package: str, rest: str) -> Path:
        """File of a package around the URDF; an empty path when there is none."""
        folders = self.urdf.path.resolve().parents
        near = [folder for folder in folders if (folder / "package.xml").is_file()]
        named = package_folder(package, self.urdf.path)
        return next((each / rest for each in ([named] if named else []) + near if (each / rest).is_file()), Path())

    def _convert(self, role: Role, mesh: Element, path: Path, target: Path, rgba: str) -> None:
        """Writes a mesh as OBJ: its appearance, or its convex hull for collisions. Raises ObjectImportError."""
        target.parent.mkdir(parents=True)
        content = read_mesh(path, most=_MOST_READ)
        points = np.concatenate([patch.triangles.reshape(-1, 3) for patch in content.patches])
        self._check_size(mesh, path, points)
        if role == "collision":
            scale = np.abs(self.urdf.numbers(mesh, "scale", "1 1 1"))
            gap_m = bodies_apart(np.concatenate([patch.triangles for patch in content.patches]) * scale)
            if gap_m > _APART_M:
                what = f"{path.name}: two bodies of this collision mesh are {gap_m:.2f} m apart, and its convex hull"
                self.notes.append(f"{what} fills the gap; give each body a mesh of its own")
            target.write_text(hull_text(_thickened(points)), encoding="utf-8")
            return
        patches = content.patches
        if content.triangles > MOST_TRIANGLES:
            patches = coarser(content, MOST_TRIANGLES // 2)
            self._coarser.append(path.name)
        if rgba and all(patch.colour == GREY and patch.picture is None for patch in patches):
            red, green, blue, *_ = map(float, rgba.split())
            patches = tuple(replace(patch, colour=(red, green, blue)) for patch in patches)
        write_appearance(target.parent, target.stem, patches)

    def _check_size(self, mesh: Element, path: Path, points: FloatArray) -> None:
        """Refuses a mesh whose size is no robot's. Raises InputError with its line."""
        size_m = np.ptp(points * self.urdf.numbers(mesh, "scale", "1 1 1"), axis=0)
        if float(size_m.max()) > _LARGEST_M:
            what = f"{path.name} is {size_m.max():.4g} m long as the file reads it: its unit is probably the millimetre"
            raise self.urdf.error(mesh, what, 'write scale="0.001 0.001 0.001" into <mesh>')


def _thickened(points: FloatArray) -> FloatArray:
    """Points of a body, or of a sheet or line that is given a thickness, so that they have a hull."""
    middle = points.mean(axis=0)
    _, spread, axes = np.linalg.svd((points - middle)[:: max(1, len(points) // 5000)], full_matrices=False)
    thin = axes[spread < 1e-6 * max(float(spread.max()), 1e-9) + 1e-9]
    if len(axes) < 3:
        thin = np.eye(3)
    for axis in thin:
        points = np.concatenate([points + _THIN_M * axis / 2.0, points - _THIN_M * axis / 2.0])
    return points


def coarser(content: MeshContent, most: int) -> tuple[Patch, ...]:
    """Patches of a mesh with at most so many triangles: corners in one cell of a grid become one."""
    points = np.concatenate([patch.triangles.reshape(-1, 3) for patch in content.patches])
    low, size = points.min(axis=0), float(np.ptp(points, axis=0).max())
    for cells in (400, 280, 200, 140, 100, 70, 50, 35, 25):
        patches = [_clustered(patch, low, size / cells) for patch in content.patches]
        if sum(len(patch.triangles) for patch in patches) <= most:
            break
    return tuple(patch for patch in patches if len(patch.triangles))


def _clustered(patch: Patch, low: FloatArray, cell: float) -> Patch:
    """A patch whose corners are the means of those in their cell; triangles that shrink to a line are left out."""
    corners = patch.triangles.reshape(-1, 3)
    _, label = unique_rows(np.floor((corners - low) / cell))
    count = np.bincount(label)
    means = np.stack([np.bincount(label, weights=corners[:, k]) / count for k in range(3)], axis=1)
    faces = label.reshape(-1, 3)
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    first, _ = unique_rows(np.sort(faces[whole], axis=1).astype(np.float64))
    return replace(patch, triangles=means[faces[whole]][first], uvs=patch.uvs[whole][first])
