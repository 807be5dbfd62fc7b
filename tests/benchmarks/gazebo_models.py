"""Gazebo models that others made, as models of ours: visuals of their SDF files, scaled to a usual size.

`gazebo_models.yaml` names the models of two public collections by class. They stay where they are; nothing of them is
part of the project. Meshes whose format is not read, and models with missing files, are left out.
"""

import re
import shutil
import tempfile
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from errand_make.mesh import Material, Mesh
from errand_make.objects.mesh_files import Patch, read_mesh
from errand_train.dataset.objects.draft import Draft
from tests.benchmarks.foreign_models import GREY, LARGEST_PICTURE_PX, Y_UP_TO_Z_UP, kept_model
from tests.benchmarks.scanned_models import smooth_normals
from tests.tables import yaml_beside

FACTS = yaml_beside(__file__, "gazebo_models.yaml")
ROUND_SIDES = 32
CREASE = 0.8
"""Least cosine between a smooth normal and that of its face."""
PICTURES, TEXTS = (".png", ".jpg", ".jpeg"), (".dae", ".obj")


def gazebo(folder, models):
    """All models by category, written to a folder. Raises FileNotFoundError where none is there."""
    made = {}
    for category, lengths in FACTS.items():
        for name, length_m in lengths.items():
            if (models / name / "model.sdf").is_file():
                number = len(made.get(category, ()))
                target = folder / f"gazebo_{category}_{number:03d}"
                model = written_gazebo(models / name, category, length_m, number, target)
                made.setdefault(category, []).append(model)
    if not made:
        raise FileNotFoundError(f"{models}: holds none of the models that gazebo_models.yaml names")
    return made


def written_gazebo(model, category, length_m, number, folder):
    """Writes a model to a folder of its own, with its longest side scaled to a length."""
    patches = [patch for visual in visuals(model) for patch in visual]
    points = np.concatenate([patch.triangles.reshape(-1, 3) for patch in patches])
    scale = length_m / np.ptp(points, axis=0).max()
    draft = Draft(np.random.default_rng(0))
    part = draft.part()
    for k, patch in enumerate(patches):
        if patch.picture is None:
            draft.paint(f"m{k}", patch.colour)
        else:
            draft.picture(f"m{k}", patch.picture.astype(float) / 255.0)
        across = np.cross(patch.triangles[:, 1] - patch.triangles[:, 0], patch.triangles[:, 2] - patch.triangles[:, 0])
        kept = np.linalg.norm(across, axis=1) > 1e-14
        triangles = patch.triangles[kept] * scale
        if len(triangles):
            normals = creased_normals(triangles).reshape(-1, 3)
            part.add_triangles(f"m{k}", triangles.reshape(-1, 3), normals, patch.uvs[kept].reshape(-1, 2))
    draft.shell(part, 1.0)
    return kept_model(draft, category, number, model.name, folder)


def creased_normals(triangles):
    """Smooth normals (N, 3, 3), and a face's own where they differ by more than a crease's angle."""
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    own = np.repeat((across / np.linalg.norm(across, axis=1, keepdims=True))[:, None], 3, axis=1)
    smooth = smooth_normals(triangles)
    return np.where((smooth * own).sum(axis=2, keepdims=True) > CREASE, smooth, own)


def visuals(model):
    """Patches of each visual of a model's SDF file, in the model's frame."""
    root = ElementTree.parse(model / "model.sdf").getroot()
    for link in root.iter("link"):
        for visual in link.findall("visual"):
            X_MV = _pose(link) @ _pose(visual)
            R, p = X_MV.rotation().matrix(), X_MV.translation()
            picture, colour = _appearance(model, visual)
            yield [_painted(patch, picture, colour).transform(R, p) for patch in _shape(model, visual.find("geometry"))]


def _pose(element):
    values = [float(value) for value in (element.findtext("pose") or "0 0 0 0 0 0").split()]
    return RigidTransform(RollPitchYaw(values[3:]), values[:3])


def _painted(patch, picture, colour):
    """Gives a patch the visual's picture or colour, unless its own file has a picture."""
    if patch.picture is not None:
        return patch
    if picture is not None:
        return replace(patch, picture=picture)
    return patch if colour is None else replace(patch, colour=colour)


def _appearance(model, visual):
    """Picture of the visual's material script, and its plain colour; None where it names none."""
    diffuse = visual.findtext("material/diffuse")
    colour = tuple(float(value) for value in diffuse.split()[:3]) if diffuse else None
    name = visual.findtext("material/script/name") or ""
    for uri in visual.findall("material/script/uri"):
        place = model.parent / (uri.text or "").removeprefix("model://")
        scripts = [place] if place.is_file() else sorted(place.glob("*.material"))
        for script in scripts:
            match = re.search(
                rf"material {re.escape(name)}\b.*?texture ([\w.]+)", script.read_text("latin-1"), re.DOTALL
            )
            file = script.parent.parent / "textures" / match.group(1) if match else None
            if file is not None and file.is_file():
                return _picture(file), colour
    return None, colour


def _picture(file):
    picture = cv2.imread(str(file), cv2.IMREAD_COLOR)
    shrink = min(1.0, LARGEST_PICTURE_PX / max(picture.shape[:2]))
    return np.ascontiguousarray(
        cv2.resize(picture, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)[..., ::-1]
    )


def _shape(model, geometry):
    """Patches of a mesh, a box, a cylinder or a sphere."""
    mesh = geometry.find("mesh")
    if mesh is not None:
        scale = [float(value) for value in (mesh.findtext("scale") or "1 1 1").split()]
        file = model.parent / mesh.findtext("uri").removeprefix("model://")
        yield from (patch.transform(np.diag(scale), np.zeros(3)) for patch in _mesh(file))
        return
    plain = Mesh({"m": Material(GREY)})
    if (size := geometry.findtext("box/size")) is not None:
        half = np.array([float(value) for value in size.split()]) / 2
        plain.add_box("m", -half, half)
    elif (radius := geometry.findtext("cylinder/radius")) is not None:
        half = float(geometry.findtext("cylinder/length")) / 2
        for profile in (
            [(0.0, -half), (float(radius), -half)],
            [(float(radius), -half), (float(radius), half)],
            [(float(radius), half), (0.0, half)],
        ):
            plain.add_lathe("m", profile, sides=ROUND_SIDES)
    elif (radius := geometry.findtext("sphere/radius")) is not None:
        angles = np.linspace(-np.pi / 2, np.pi / 2, ROUND_SIDES // 2)
        plain.add_lathe(
            "m", [(float(radius) * np.cos(a), float(radius) * np.sin(a)) for a in angles], sides=ROUND_SIDES
        )
    for _, points, _, uvs in plain.groups():
        uvs = (
            1.0 - uvs if geometry.find("cylinder") is not None else uvs
        )  # Gazebo's cylinders turn their picture by 180 degrees
        yield Patch(points.reshape(-1, 3, 3), uvs.reshape(-1, 3, 2), GREY)


def _mesh(file):
    """Patches of a mesh file with z up; its pictures may lie in the model's folder of textures."""
    with tempfile.TemporaryDirectory() as folder:
        beside = Path(folder) / file.name
        text = file.read_text("latin-1") if file.suffix.lower() in TEXTS else None
        if text is None:
            shutil.copyfile(file, beside)
        else:
            beside.write_text(text.replace("../materials/textures/", ""), "latin-1")
        for picture in (path for path in file.parent.parent.rglob("*") if path.suffix.lower() in PICTURES):
            inside = Path(folder) / picture.relative_to(file.parent) if picture.is_relative_to(file.parent) else beside
            for target in {Path(folder) / picture.name, inside} - {beside}:
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(picture, target)
        content = read_mesh(beside)
    turn = Y_UP_TO_Z_UP if content.up == "y" else np.eye(3)
    return [patch.transform(turn, np.zeros(3)) for patch in content.patches]
