"""Things that others modelled, as models of ours: read from where they are installed, written to a folder.

The catalogues are those of Debian's package `sweethome3d-furniture`: ZIP files of OBJ models under free licences, with
the size of each. They stay where they are; nothing of them is part of the project.
"""

import re
import zipfile
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

import cv2
import numpy as np

from errand_train.dataset.objects import CLASSES
from errand_train.dataset.objects.draft import Draft
from errand_train.dataset.objects.model import ObjectModel, read_model, write_model
from plant.models.catalogue import load_catalogue
from skills.robot import FloatArray

CATALOGUES = Path("/usr/share/sweethome3d/furniture")
OTHERS = "other"
CLASS_OF_NAME = {
    "Extinguisher": "extinguisher",
    "Hammer": "hammer",
    "Screwdriver": "screwdriver",
    "Beer bottle": "beer",
}
PEOPLE_CATALOGUE, LEAST_PERSON_M = "Reallusion", 1.0
OTHER_SIZES_M, OTHER_LEAST_MIDDLE_M = (0.07, 0.5), 0.015
NOT_OTHERS = re.compile(
    "cube|barrel|candle|crate|box|hammer|screwdriver|extinguish|beer b|lamp|light|plug|switch|socket|arrow|mannequin|"
    "bill|human|vase|wall|pole|icon|slot|rail",
    re.IGNORECASE,
)
"""Names of what could be taken for one of the nine classes, hangs on a wall, or is flat."""
LARGEST_PICTURE_PX = 512
MASS_KG = 0.5
Y_UP_TO_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
GREY = (0.7, 0.7, 0.7)

Corner = tuple[int, int | None, int | None]
"""Indices of a point, a texture coordinate and a normal."""


@dataclass(frozen=True)
class Entry:
    """A catalogue's thing: its OBJ file within the ZIP file, its size along x, y (up) and z, and its turn."""

    catalogue: Path
    name: str
    path: PurePosixPath
    size_m: FloatArray
    R: FloatArray

    @property
    def category(self):
        """Its class, `other` for what is none of ours, None for what is left out."""
        if self.catalogue.stem == PEOPLE_CATALOGUE:
            stands = self.size_m[1] > LEAST_PERSON_M and not re.search("sitting|lying", self.name, re.IGNORECASE)
            return "person" if stands else None
        if self.name in CLASS_OF_NAME:
            return CLASS_OF_NAME[self.name]
        fits = OTHER_SIZES_M[0] <= self.size_m.max() <= OTHER_SIZES_M[1]
        solid = np.sort(self.size_m)[1] >= OTHER_LEAST_MIDDLE_M
        return OTHERS if fits and solid and not NOT_OTHERS.search(f"{self.name} {self.path}") else None


def entries(catalogue):
    """All things of a catalogue that have a size."""
    with zipfile.ZipFile(catalogue) as archive:
        text = archive.read("PluginFurnitureCatalog.properties").decode("latin-1")
    facts = {}
    for key, number, value in re.findall(r"^(\w+)#(\d+)=(.*)$", text, re.MULTILINE):
        facts.setdefault(int(number), {})[key] = value.strip()
    for fact in facts.values():
        if fact.get("doorOrWindow") == "true" or not {"name", "model", "width", "height", "depth"} <= set(fact):
            continue
        size = np.array([float(fact[key]) / 100.0 for key in ("width", "height", "depth")])
        turn = np.array([float(value) for value in fact.get("modelRotation", "1 0 0 0 1 0 0 0 1").split()])
        yield Entry(catalogue, fact["name"], PurePosixPath(fact["model"].lstrip("/")), size, turn.reshape(3, 3))


@dataclass
class Wavefront:
    """Content of an OBJ file: points, texture coordinates, normals, and corners (three each) by material."""

    points: list[list[float]] = field(default_factory=list)
    textures: list[list[float]] = field(default_factory=list)
    normals: list[list[float]] = field(default_factory=list)
    corners: dict[str, list[Corner]] = field(default_factory=dict)
    libraries: list[str] = field(default_factory=list)


def read_wavefront(text):
    """Triangles of an OBJ file; faces of more corners become fans."""
    made, material = Wavefront(), ""
    rows = {"v": (made.points, 3), "vt": (made.textures, 2), "vn": (made.normals, 3)}
    for line in text.replace("\\\n", " ").splitlines():
        word, *rest = line.split() or [""]
        if word in rows:
            into, count = rows[word]
            into.append([float(value) for value in rest[:count]])
        elif word == "usemtl":
            material = " ".join(rest)
        elif word == "mtllib":
            made.libraries.append(" ".join(rest))
        elif word == "f":
            counts = [len(into) for into, _ in rows.values()]
            face = [_corner(each, counts) for each in rest]
            fan = [face[k] for j in range(1, len(face) - 1) for k in (0, j, j + 1)]
            made.corners.setdefault(material, []).extend(fan)
    return made


def _corner(text, counts):
    """Indices of a corner such as `3/1/2` or `-1//-1`; negative numbers count from the last of so many."""
    numbers = [int(each) if each else None for each in [*text.split("/"), "", ""][:3]]
    point, texture, normal = (
        None if number is None else number - 1 if number > 0 else count + number
        for number, count in zip(numbers, counts, strict=True)
    )
    if point is None:
        raise ValueError(f"a face's corner without a point: {text!r}")
    return point, texture, normal


def read_materials(text):
    made, name = {}, ""
    for line in text.splitlines():
        word, *rest = line.split() or [""]
        if word == "newmtl":
            name = " ".join(rest)
        elif word:
            made.setdefault(name, {})[word] = rest
    return made


def written(entry, number, category, folder):
    """Writes the model of an entry to a folder of its own, in the size that its catalogue tells."""
    draft, materials = Draft(np.random.default_rng(0)), {}
    with zipfile.ZipFile(entry.catalogue) as archive:
        source = read_wavefront(archive.read(str(entry.path)).decode("latin-1"))
        for library in source.libraries:
            inside = str(entry.path.parent / library)
            if inside in archive.namelist():
                materials |= read_materials(archive.read(inside).decode("latin-1"))
        names = {material: f"m{k}" for k, material in enumerate(sorted(source.corners))}
        for material, name in names.items():
            _paint(draft, name, materials.get(material, {}), archive, entry.path.parent)
    turned = np.array(source.points) @ entry.R.T
    scale = entry.size_m / np.maximum(np.ptp(turned, axis=0), 1e-9)
    to_normal = np.diag(1.0 / scale) @ entry.R
    part = draft.part()
    for material, corners in source.corners.items():
        points, textures, normals = zip(*corners, strict=True)
        faces = (turned * scale)[list(points)].reshape(-1, 3, 3)
        across = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        keep = np.linalg.norm(across, axis=1) > 1e-12
        told = _chosen(source.normals, normals, 3) @ to_normal.T
        own = np.linalg.norm(told, axis=2, keepdims=True) > 1e-9
        unit = np.where(own, told, across[:, None])
        unit /= np.maximum(np.linalg.norm(unit, axis=2, keepdims=True), 1e-12)
        uvs = _chosen(source.textures, textures, 2)
        uvs -= np.floor(uvs.min(axis=1, keepdims=True) + 1e-6)  # each triangle begins within the first texture
        if keep.any():
            placed = (faces[keep].reshape(-1, 3) @ Y_UP_TO_Z_UP.T, unit[keep].reshape(-1, 3) @ Y_UP_TO_Z_UP.T)
            part.add_triangles(names[material], *placed, uvs[keep].reshape(-1, 2))
    draft.shell(part, 1.0)
    return kept_model(draft, category, number, entry.name, folder)


def _chosen(values, indices, width):
    """Values of the corners (N, 3, width) of triangles, zero where there is none."""
    every = np.array([*values, [0.0] * width])
    return every[[-1 if k is None else k for k in indices]].reshape(-1, 3, width)


def kept_model(draft, category, number, name, folder):
    """Writes the model of a draft to a folder of its own; of no class where its category is none of the nine."""
    made = draft.finish(MASS_KG, on_floor=category == "person")
    x, y, z = (float(value) for value in made.mass.com)
    class_id = load_catalogue()[category].id if category in CLASSES else 0
    model = ObjectModel(folder, category, number, class_id, name, "", MASS_KG, (x, y, z), made.size_m)
    folder.mkdir(parents=True)
    write_model(folder, model, made)
    return read_model(folder)


def _paint(draft, name, material, archive, folder):
    """Paints a material by its picture where the archive has it, else by its colour."""
    inside = str(folder / " ".join(material.get("map_Kd", [])))
    if "map_Kd" in material and inside in archive.namelist():
        picture = cv2.imdecode(np.frombuffer(archive.read(inside), np.uint8), cv2.IMREAD_COLOR)
        if picture is not None:
            shrink = min(1.0, LARGEST_PICTURE_PX / max(picture.shape[:2]))
            small = cv2.resize(picture, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
            draft.picture(name, small[..., ::-1].astype(float) / 255.0)
            return
    colour = [float(value) for value in material.get("Kd", [])[:3]]
    draft.paint(name, colour if len(colour) == 3 else GREY)


def supplied(folder, catalogues=CATALOGUES):
    """Writes all models to a folder; returns them by category. Raises FileNotFoundError without the catalogues."""
    files = sorted(catalogues.glob("*.sh3f"))
    if not files:
        raise FileNotFoundError(f"{catalogues}: no catalogue *.sh3f; install Debian's sweethome3d-furniture")
    made = {}
    for entry in (entry for file in files for entry in entries(file)):
        category = entry.category
        if category is not None:
            number = len(made.setdefault(category, []))
            made[category].append(written(entry, number, category, folder / f"{category}_{number:03d}"))
    return made
