"""Imports a mesh file as an SDF model: visual geometry with normals, convex collision parts, mass and inertia."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from errand_make.errors import ObjectImportError
from errand_make.mesh import (
    SMOOTH_COSINE,
    Colour,
    Material,
    Mesh,
    mtl_text,
    obj_text,
    palette_picture,
    plain_colours,
    write_text,
)
from errand_make.objects.mesh_files import MeshContent, Patch, read_mesh
from errand_make.objects.recognition import recognition_model
from errand_make.objects.resting_pose import feet, resting_rotation
from errand_make.objects.solid import Solid, convex_parts, hull_of, solid_of, unique_points
from errand_make.shapes import ConvexMesh, MassProperties, Model, model_sdf, scale_mass, solid_mass
from plant.models.catalogue import OBJECT_NAME, ImportedObject, load_catalogue
from plant.scene_pictures import save_png
from skills.robot import FloatArray, Picture

LARGEST_M: Final = 5.0
SMALLEST_M: Final = 0.005
PROUD_M: Final = 0.0003
"""Distance by which the small spheres stand out to carry the body."""
PLACES: Final = 6
USUAL_KG_M3: Final = 600.0
"""Density of an object of unknown mass: between wood and a plastic bottle that is full."""
LIGHTEST_KG, HEAVIEST_KG = 1e-4, 100.0
"""Limits of the mass that follows from the volume."""
PERSON: Final = "person"
_UNITS: Final = (("metres", 1.0), ("millimetres", 0.001), ("centimetres", 0.01), ("inches", 0.0254), ("feet", 0.3048))
_PLAUSIBLE_M: Final = (0.02, 1.5)
"""Plausible lengths of an object for a table."""
_DIVIDED_BY: Final = (100, 1000)
_FLAT_M: Final = 0.01
"""Height of a resting object under which the robot does not recognise it by its model."""
_UP: Final = {
    "x": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
}
_MOST_NEIGHBOURS: Final = 32
_ROUND_SAME, _ROUND_WIDEST = 0.02, 0.52


@dataclass(frozen=True)
class ImportOptions:
    """Options of an import: name, mass (kg), class, metres per unit, the vertical axis, and closing of holes.

    Without a class, the robot recognises the object by its model. The default mass is by volume (`USUAL_KG_M3`).
    """

    name: str
    mass_kg: float | None = None
    class_name: str | None = None
    scale: float = 1.0
    up: str | None = None
    close_holes: bool = False

    def check(self) -> None:
        """Checks the options. Raises ObjectImportError for an invalid value."""
        catalogue = load_catalogue()
        if re.fullmatch(OBJECT_NAME, self.name) is None:
            hint = "use letters, digits and _, a letter first, at most 40"
            raise ObjectImportError(f"the name {self.name[:60]!r} is no identifier", hint)
        if self.name.lower() in catalogue:
            raise ObjectImportError(
                f"the name {self.name!r} is taken by a class of objects", "give another one, and the class by --class"
            )
        classes = [name for name in catalogue if name != PERSON]
        if self.class_name is not None and self.class_name not in classes:
            hint = f"known are {', '.join(classes)}; leave it out for an object of another kind"
            raise ObjectImportError(f"there is no class {self.class_name[:60]!r}", hint)
        if self.mass_kg is not None and not (math.isfinite(self.mass_kg) and self.mass_kg > 0.0):
            raise ObjectImportError(f"the mass {self.mass_kg:g} kg is not positive", "weigh the object")
        if not (math.isfinite(self.scale) and self.scale > 0.0):
            raise ObjectImportError(f"the scale {self.scale:g} is not positive", "give metres per unit")
        if self.up is not None and self.up not in _UP:
            raise ObjectImportError(f"there is no axis {self.up[:20]!r}", "give x, y or z")


@dataclass(frozen=True)
class _Body:
    """A mesh: the patches of its appearance, and the solid that it bounds."""

    patches: tuple[Patch, ...]
    solid: Solid

    def transform(self, R: FloatArray, p: FloatArray) -> _Body:
        patches = tuple(patch.transform(R, p) for patch in self.patches)
        return _Body(patches, Solid(self.solid.points @ R.T + p, self.solid.faces))


def _ignore(text: str) -> None:
    """Ignores a text."""


STEPS: Final = ("reading the mesh", "closing its surface", "fitting convex parts", "writing the model")


@dataclass(frozen=True)
class ImportReports:
    """Receivers of the `STEPS` of an import, as each begins, and of remarks on the file."""

    step: Callable[[str], None] = _ignore
    note: Callable[[str], None] = _ignore


_NO_REPORTS: Final = ImportReports()


def import_object(
    mesh: Path, options: ImportOptions, folder: Path, reports: ImportReports = _NO_REPORTS
) -> ImportedObject:
    """Writes the model of a mesh file into an existing folder: SDF, OBJ, pictures, and its facts.

    The object keeps its bottom side if it can rest on it; else it lies on the side with the lowest centre of mass.

    Raises:
        ObjectImportError: the file or an option cannot be used.
        LibraryMissingError: the libraries are not installed.
        OSError: the folder cannot be written.
    """
    options.check()
    reports.step(STEPS[0])
    return import_content(read_mesh(mesh), options, folder, reports)


def import_content(
    content: MeshContent, options: ImportOptions, folder: Path, reports: ImportReports = _NO_REPORTS
) -> ImportedObject:
    """Writes the model of a mesh that has been read; raises as `import_object` does."""
    _, closing, fitting, writing = STEPS
    reports.step(closing)
    body = _at_rest(_placed(content, options))
    size_m = np.ptp(body.solid.points, axis=0)
    doubts = (*_size_doubts(size_m, options.scale), *_flat_doubts(size_m, options), *_apart_doubts(body.solid))
    for note in (*content.notes, *doubts):
        reports.note(note)
    mass = scale_mass(_mass(body.solid), _mass_kg(body.solid, options))
    _refuse_impossible(mass)
    reports.step(fitting)
    convex = convex_parts(body.solid)
    parts = [_shrunk(part, body.solid.points) for part in convex]
    reports.step(writing)
    bearing = feet(body.solid.points, mass.com, convex)
    files = [f"{options.name}_part_{number}.obj" for number in range(len(parts))]
    for file, part in zip(files, parts, strict=True):
        write_text(folder / file, hull_text(part))
    model = Model(
        options.name,
        f"{options.name}.obj",
        [*(ConvexMesh(file=file) for file in files), *bearing],
        mass,
        comment=options.name,
        maker="`errand object import`",
    )
    write_text(folder / f"{options.name}.sdf", model_sdf(model))
    write_appearance(folder, options.name, body.patches)
    made = _facts(options, body, mass, len(parts))
    recognition_model(made.class_name, body.patches, body.solid.points, mass.com).write(folder)
    made.write(folder)
    return made


def _mass_kg(solid: Solid, options: ImportOptions) -> float:
    """Mass that the user gives, else that of the volume. Raises ObjectImportError for an implausible volume."""
    if options.mass_kg is not None:
        return options.mass_kg
    mass_kg = solid.volume_m3 * USUAL_KG_M3
    if not LIGHTEST_KG <= mass_kg <= HEAVIEST_KG:
        hint = _scale_hint(float(np.ptp(solid.points, axis=0).max()), options.scale)
        raise ObjectImportError(f"by its volume it weighs {mass_kg:.3g} kg", f"{hint}; or give --mass")
    return mass_kg


def _placed(content: MeshContent, options: ImportOptions) -> _Body:
    """The mesh in metres, z up, as a body. Raises ObjectImportError."""
    R = options.scale * _UP[options.up or content.up]
    patches = tuple(patch.transform(R, np.zeros(3)) for patch in content.patches)
    triangles = np.concatenate([patch.triangles for patch in patches])
    _refuse_size(np.ptp(triangles.reshape(-1, 3), axis=0), options.scale)
    solid, turned = solid_of(triangles, close_holes=options.close_holes)
    ends = np.cumsum([len(patch.triangles) for patch in patches])[:-1]
    patches = tuple(_turned(patch, which) for patch, which in zip(patches, np.split(turned, ends), strict=True))
    return _Body(patches, solid)


def _turned(patch: Patch, which: NDArray[np.bool_]) -> Patch:
    """Flips the triangles of a mask (T,)."""
    both = which[:, None, None]
    triangles = np.where(both, patch.triangles[:, ::-1], patch.triangles)
    return replace(patch, triangles=triangles, uvs=np.where(both, patch.uvs[:, ::-1], patch.uvs))


def _refuse_size(size_m: FloatArray, scale: float) -> None:
    """Refuses a mesh of implausible size, whose file has another unit. Raises ObjectImportError."""
    size = " x ".join(f"{value:.3g}" for value in size_m)
    if size_m.max() > LARGEST_M:
        raise ObjectImportError(f"it is {size} m large", _scale_hint(float(size_m.max()), scale))
    if size_m.max() < SMALLEST_M:
        raise ObjectImportError(f"it is {size} m small", _scale_hint(float(size_m.max()), scale))


def _size_doubts(size_m: FloatArray, scale: float) -> tuple[str, ...]:
    """Remark on an object of a possible, but unusual size, whose scale the user has not given."""
    largest_m = float(size_m.max())
    if scale != 1.0 or _PLAUSIBLE_M[0] <= largest_m <= _PLAUSIBLE_M[1]:
        return ()
    return (f"it is {largest_m:.3g} m long; if that is wrong, {_scale_hint(largest_m, scale)}",)


def _flat_doubts(size_m: FloatArray, options: ImportOptions) -> tuple[str, ...]:
    """Remark on an object without a class that lies too flat to be recognised."""
    high_m = float(size_m[2])
    if options.class_name is not None or high_m >= _FLAT_M:
        return ()
    what = f"it is {high_m:.2g} m high, and the robot does not recognise objects under {_FLAT_M:g} m by their models"
    return (f"{what}; give --class if it is of a known class",)


def _apart_doubts(solid: Solid) -> tuple[str, ...]:
    """Remark on several bodies with wide gaps between them, which one model moves as one."""
    many, gap_m = solid.bodies_apart()
    if many == 1:
        return ()
    return (
        f"it holds {many} bodies, {gap_m:.2g} m apart, which move as one; if they are several objects, part the file",
    )


def _is_plausible(length_m: float) -> bool:
    return _PLAUSIBLE_M[0] <= length_m <= _PLAUSIBLE_M[1]


def _scale_hint(largest_m: float, scale: float) -> str:
    """Hint on the unit that gives the object a plausible length."""
    units = largest_m / scale
    fitting = [(unit, unit_m) for unit, unit_m in _UNITS if unit_m != scale and _is_plausible(unit_m * units)]
    if not fitting:
        scales = (f"{by} ({by * units:.3g} m long)" for by in _DIVIDED_BY if _is_plausible(by * units))
        found = " or ".join(scales)
        if found:
            return f"give --scale {found}, if its lengths were divided by that when it was saved"
        return "give --scale, the metres of one unit of the file"
    scales = (f"{unit_m:g} if its unit is {unit} ({unit_m * units:.3g} m long)" for unit, unit_m in fitting)
    return f"give --scale {', '.join(scales)}"


def _refuse_impossible(mass: MassProperties) -> None:
    """Refuses an impossible inertia, as from pieces that are inside out. Raises ObjectImportError."""
    moments = np.linalg.eigvalsh(mass.inertia)
    if moments[0] <= 0.0 or moments[2] > (1.0 + 1e-6) * (moments[0] + moments[1]):
        hint = "unite its pieces to one body and let its normals be calculated again, or import its hull"
        raise ObjectImportError("some of its pieces are inside out, so its inertia is impossible", hint)


def _at_rest(body: _Body) -> _Body:
    """Lays the body down in its resting pose, with the centre of its bounding box at the origin."""
    turned = body.transform(resting_rotation(body.solid.points, _mass(body.solid).com), np.zeros(3))
    points = turned.solid.points
    return turned.transform(np.eye(3), -(points.min(axis=0) + points.max(axis=0)) / 2.0)


def _mass(solid: Solid) -> MassProperties:
    """Mass properties of the solid at a density of 1 kg/m^3."""
    mesh = Mesh({"": Material()})
    corners = solid.triangles
    mesh.add_triangles("", corners, np.zeros_like(corners), np.zeros((len(corners), 3, 2)))
    return solid_mass(mesh, 1.0)


def _shrunk(part: FloatArray, points: FloatArray) -> FloatArray:
    """Shrinks a convex part slightly, so that the spheres at the body's corners stand out."""
    low, high = part.min(axis=0), part.max(axis=0)
    scale = np.clip(1.0 - 2.0 * PROUD_M / np.maximum(high - low, 1e-9), 0.8, 1.0)
    smaller = (low + high) / 2.0 + (part - (low + high) / 2.0) * scale
    inset = np.minimum(PROUD_M, np.ptp(points, axis=0) / 10.0)
    return np.asarray(np.clip(smaller, points.min(axis=0) + inset, points.max(axis=0) - inset))


def hull_text(points: FloatArray) -> str:
    """Convex hull of points as OBJ text, with outward triangles."""
    hull = hull_of(points)
    corners, faces = points[hull.vertices], np.searchsorted(hull.vertices, hull.simplices)
    a, b, c = (corners[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces = np.where(inward[:, None], faces[:, ::-1], faces)
    lines = [f"v {x:.{PLACES}f} {y:.{PLACES}f} {z:.{PLACES}f}" for x, y, z in corners]
    return "\n".join([*lines, *(f"f {i} {j} {k}" for i, j, k in faces + 1)]) + "\n"


def write_appearance(folder: Path, name: str, patches: Sequence[Patch]) -> None:
    """Writes the visual geometry with its pictures; equal colours or pictures are one material."""
    materials, pictures = dict[str, Material](), dict[str, Picture]()
    mesh, known = Mesh(materials), dict[Colour | bytes, str]()
    normals = _corner_normals(np.concatenate([patch.triangles for patch in patches]))
    start = 0
    for patch in patches:
        key = patch.colour if patch.picture is None else patch.picture.tobytes()
        material = known.setdefault(key, f"surface_{len(known):03d}")
        if patch.picture is None:
            materials[material] = Material(patch.colour)
        else:
            materials[material], pictures[f"{material}.png"] = Material(texture=f"{material}.png"), patch.picture
        mesh.add_triangles(material, patch.triangles, normals[start : start + len(patch.triangles)], patch.uvs)
        start += len(patch.triangles)
    write_text(folder / f"{name}.obj", obj_text(mesh, f"{name}.mtl", places=PLACES))
    write_text(folder / f"{name}.mtl", mtl_text(mesh, "palette.png"))
    for file, picture in pictures.items():
        save_png(folder / file, picture)
    if plain_colours(materials):
        save_png(folder / "palette.png", palette_picture(materials))


def _corner_normals(triangles: FloatArray) -> FloatArray:
    """Unit normals (T, 3, 3) of corners: the mean over the triangles that meet there without an edge.

    A triangle is weighted by its angle at the corner.
    """
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    facing = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-20)
    _, index = unique_points(triangles)
    order = np.argsort(index.reshape(-1), kind="stable")
    place, own = index.reshape(-1)[order], facing[order // 3]
    weighted = own * _corner_angles(triangles).reshape(-1, 1)[order]
    sums = weighted.copy()
    for step in range(1, _MOST_NEIGHBOURS):
        together = place[step:] == place[:-step]
        if not together.any():
            break
        smooth = together & (np.einsum("ij,ij->i", own[step:], own[:-step]) > SMOOTH_COSINE)
        sums[step:][smooth] += weighted[:-step][smooth]
        sums[:-step][smooth] += weighted[step:][smooth]
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    sums = np.where(lengths > 1e-20, sums / np.maximum(lengths, 1e-20), (0.0, 0.0, 1.0))
    normals = np.empty_like(sums)
    normals[order] = sums
    return normals.reshape(-1, 3, 3)


def _corner_angles(triangles: FloatArray) -> FloatArray:
    """Angles (T, 3) of triangles at their corners."""
    ahead = np.roll(triangles, -1, axis=1) - triangles
    behind = np.roll(triangles, 1, axis=1) - triangles
    lengths = np.linalg.norm(ahead, axis=2) * np.linalg.norm(behind, axis=2)
    cosine = np.einsum("tij,tij->ti", ahead, behind) / np.maximum(lengths, 1e-20)
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _facts(options: ImportOptions, body: _Body, mass: MassProperties, parts: int) -> ImportedObject:
    points = body.solid.points
    size = np.ptp(points, axis=0)
    x, y, z = (round(float(value), 6) for value in size)
    com_x, com_y, com_z = (round(float(value), 6) for value in mass.com)
    widest = float(np.hypot(points[:, 0], points[:, 1]).max())
    m = mass.inertia
    return ImportedObject(
        name=options.name,
        class_name=options.class_name or options.name,
        mass_kg=round(mass.mass_kg, 4),
        size_m=(x, y, z),
        com_m=(com_x, com_y, com_z),
        inertia_kg_m2=(m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2]),
        collision_parts=parts,
        triangles=sum(len(patch.triangles) for patch in body.patches),
        round=bool(abs(size[0] - size[1]) < _ROUND_SAME * size[0] and widest < _ROUND_WIDEST * size[0]),
    )
