"""How often the robot finds an own object by its model, and how often it takes another object for it; prints JSON.

    python -m tests.benchmarks.own_objects [--half 0] [--scenes 5] [--seed 1] [--photographs]

Ten objects are imported, as `errand object import` does it. In each scene one of them lies on a surface of the flat
among four others: two that are imported, too, and two that are not. The robot is asked for the one, and for one that is
absent. An arm that moves as it is told carries a camera that renders the flat with the plant's noise. Half of the
objects are generated here, the others are models of Debian's package `sweethome3d-furniture`; `--half` names which half
of both is used. With `--photographs` the robot knows the objects by photographs, not by meshes.
"""

import tempfile
import time
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import cv2
import numpy as np
import trimesh
from pydrake.geometry import (
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    MakeRenderEngineVtk,
    Mesh,
    PerceptionProperties,
    RenderEngineVtkParams,
    RenderLabel,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from trimesh import creation

from errand_make.objects import (
    ImportOptions,
    ImportReports,
    ObjectImportError,
    import_object,
    import_photographs,
)
from plant.rendering import lights
from plant.scene_pictures import look_at, render_view
from skills.detect.skill import Detect, DetectInputs
from skills.detection import NoDetector
from skills.geometry import inside_polygon
from skills.inputs.errors import InputError
from skills.perception.model_matching import ModelDetector
from skills.perception.object_model import ObjectModel, read_model
from tests.benchmarks.find_things import room_bench
from tests.benchmarks.flat_scene import SURFACES, FlatScene, surface_of, viewpoint_of
from tests.benchmarks.foreign_models import CATALOGUES, OTHERS, entries
from tests.benchmarks.harness import by, command, share, tell
from tests.tables import yaml_beside

GENERATED = yaml_beside(__file__, "own_shapes.yaml")
OBJECTS, FOREIGN, OTHERS_AROUND, IMPORTED_OTHERS = 10, 10, 4, 2
UPRIGHT_SHARE, TRIES = 0.75, 300
RIM_M, CLEAR_M, REACH_M, RIGHT_WITHIN_M = 0.04, 0.04, 1.7, 0.05
SIZES_M = (0.05, 0.32)
PHOTO_PX, PHOTO_FOV_RAD = 480, 0.5
PHOTO_ELEVATIONS_DEG = (25.0, 50.0)
PHOTO_GROUND = (0.30, 0.45, 0.50)
PHOTO_NOISE, PHOTO_EXPOSURE, PHOTO_TINT = 3.0, 0.15, 0.04
STANDING, LYING, SIDES = 12, 6, 3
"""Numbers of photographs of an object as it stands, and on each other side; number of other sides."""


def revolved(*profile):
    return creation.revolve(np.array(profile, dtype=float), sections=40)


def cup(radius, height, wall):
    inner = radius - wall
    return revolved((0, 0), (radius, 0), (radius, height), (inner, height), (inner, wall), (0, wall))


def ring(radius, thick):
    upright = trimesh.transformations.rotation_matrix(np.radians(90), (1, 0, 0))
    return creation.torus(radius, thick).apply_transform(upright)


def roof(half_x, half_y, low, high):
    """Prism of a gable roof."""
    points = [[x, y, low] for x in (-half_x, half_x) for y in (-half_y, half_y)]
    return trimesh.convex.convex_hull(np.array([*points, [-half_x, 0, high], [half_x, 0, high]]))


SHAPES = {
    "revolve": revolved,
    "cup": cup,
    "ring": ring,
    "roof": roof,
    "box": lambda low, high: creation.box(bounds=[low, high]),
    "rod": lambda radius, length: creation.cylinder(radius, length, sections=32),
}


def made_part(colour, turn=(0, 0, 0, 1), by=(0, 0, 0), **shape):
    ((kind, sizes),) = shape.items()
    mesh, (degrees, *axis) = SHAPES[kind](*sizes), turn
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(degrees), axis))
    mesh.apply_translation(by)
    mesh.visual.face_colors = [*GENERATED["colours"][colour], 255]
    return mesh


def generated(folder, half):
    """Files of every second generated object, with the options of their import."""
    for name, parts in list(GENERATED["objects"].items())[half::2]:
        whole = trimesh.util.concatenate([made_part(**part) for part in parts])
        whole.apply_scale(0.001)
        whole.export(folder / f"{name}.ply")
        yield folder / f"{name}.ply", ImportOptions(name, None, None, 1.0, "z", close_holes=False)


def foreign(folder, half, catalogues=CATALOGUES):
    """Files of every second model of others that has a usual size, with the options of their import."""
    every = [entry for file in sorted(catalogues.glob("*.sh3f")) for entry in entries(file)]
    sized = [entry for entry in every if SIZES_M[0] <= entry.size_m.max() <= SIZES_M[1]]
    for number, entry in enumerate([entry for entry in sized if entry.category == OTHERS][half::2]):
        file, scale = unpacked(entry, folder / f"foreign_{number:02d}")
        yield file, ImportOptions(f"other{number}", None, None, scale, "y", close_holes=True)


def unpacked(entry, folder):
    """Unpacks the files of a catalogue's entry into a folder; returns its mesh and the metres of one of its units."""
    with zipfile.ZipFile(entry.catalogue) as archive:
        inside = [name for name in archive.namelist() if Path(name).parent == Path(entry.path.parent)]
        archive.extractall(folder, inside)
    lines = (folder / entry.path).read_text("latin-1").splitlines()
    points = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], dtype=float)
    longest = float(np.ptp(points @ entry.R.T, axis=0).max())
    return folder / entry.path, float(entry.size_m.max()) / max(longest, 1e-9)


def imported(folder, half):
    """Imports the objects of one half, up to `FOREIGN` of others; leaves out those that no import takes."""
    folder.mkdir(parents=True, exist_ok=True)
    models = []
    with mock.patch("errand_make.objects.import_object.convex_parts", _bounding_box):  # they lie still
        for file, options in (*generated(folder, half), *foreign(folder, half)):
            if sum(model.name.startswith("other") for model in models) == FOREIGN:
                break
            (folder / options.name).mkdir(exist_ok=True)
            try:
                import_object(file, options, folder / options.name)
            except ObjectImportError as error:
                tell(f"{file.name}: {error}")
                continue
            models.append(read_model(folder / options.name))
    return models


def _bounding_box(solid):
    low, high = solid.points.min(axis=0), solid.points.max(axis=0)
    return (np.array(list(product(*zip(low, high, strict=True)))),)


def photographed(folder, model, pictures, seed=0):
    """Renders photographs of an imported object, as it stands and on other sides; the JPEG files lie in a folder.

    The background is plain, and the exposure and the tint of each are a little wrong.
    """
    pictures.mkdir(parents=True, exist_ok=True)
    scene, rng = SceneGraph(), np.random.default_rng(seed)
    scene.AddRenderer(
        "vtk", MakeRenderEngineVtk(RenderEngineVtkParams(default_clear_color=np.array(PHOTO_GROUND), lights=lights()))
    )
    mesh = Mesh(str(folder / model.name / f"{model.name}.obj"), np.ones(3))
    appearance, properties = GeometryInstance(RigidTransform(), mesh, model.name), PerceptionProperties()
    properties.AddProperty("label", "id", RenderLabel(1))
    appearance.set_perception_properties(properties)
    source = scene.RegisterSource("photograph")
    frame = scene.RegisterFrame(source, GeometryFrame("object"))
    scene.RegisterGeometry(source, frame, appearance)
    context = scene.CreateDefaultContext()
    reach_m = 1.15 * float(np.linalg.norm(model.points, axis=1).max()) / np.sin(PHOTO_FOV_RAD / 2.0)
    for side, R in enumerate(model.rests[: 1 + SIDES]):
        pose = FramePoseVector()
        pose.set_value(frame, RigidTransform(RotationMatrix.ProjectToRotationMatrix(R)))
        scene.get_source_pose_port(source).FixValue(context, pose)
        query, count = scene.get_query_output_port().Eval(context), LYING if side else STANDING
        for k in range(count):
            turn, rise = 2.0 * np.pi * k / count + rng.uniform(-0.1, 0.1), np.radians(PHOTO_ELEVATIONS_DEG[k % 2])
            eye = reach_m * np.array([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
            picture = render_view(query, look_at(eye, np.zeros(3)), (PHOTO_PX, PHOTO_PX), fov_y_rad=PHOTO_FOV_RAD)
            gain = (1.0 + rng.uniform(-PHOTO_EXPOSURE, PHOTO_EXPOSURE)) * (1.0 + rng.normal(0.0, PHOTO_TINT, 3))
            noisy = gain * picture + rng.normal(0.0, PHOTO_NOISE, picture.shape)
            cv2.imwrite(str(pictures / f"{side}{k:02d}.jpg"), np.clip(noisy, 0, 255).astype(np.uint8)[..., ::-1])
    return pictures


def by_photographs(folder, models):
    """Models of the same objects, of photographs instead of meshes; leaves out those that no import takes."""
    found = []
    for model in models:
        x, y, z = (round(float(side), 3) for side in np.ptp(model.points, axis=0))
        out = folder / f"{model.name}_seen"
        out.mkdir()
        try:
            pictures = photographed(folder, model, folder / f"{model.name}_photographs")
            import_photographs(pictures, ImportOptions(model.name), out, ImportReports(), (x, y, z))
        except InputError as error:
            tell(f"{model.name}: {error}")
            continue
        found.append(read_model(out))
    return found


@dataclass(frozen=True)
class Lying:
    model: ObjectModel
    X_WM: RigidTransform

    @property
    def middle_W(self):
        points = self.model.points @ self.X_WM.rotation().matrix().T + self.X_WM.translation()
        return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))


def laid(rng, models, surface, pose):
    """Objects laid on a surface where they fit; a quarter of them on another side."""
    corners, taken = np.asarray(surface.polygon_W), []
    for model in models:
        for _ in range(TRIES):
            rest = 0 if rng.random() < UPRIGHT_SHARE else int(rng.integers(min(4, len(model.rests))))
            yaw = float(rng.uniform(0, 2 * np.pi))
            R = RotationMatrix.MakeZRotation(yaw).matrix() @ model.rests[rest]
            points, xy = model.points @ R.T, rng.uniform(corners.min(axis=0), corners.max(axis=0))
            reach = float(np.linalg.norm(points[:, :2], axis=1).max())
            fits = bool(np.all(inside_polygon(xy + points[:, :2], surface.polygon_W, -RIM_M)))
            near = float(np.hypot(*(xy - [pose.x_m, pose.y_m]))) < REACH_M
            if fits and near and all(np.linalg.norm(xy - other) > reach + size + CLEAR_M for other, size in taken):
                taken.append((xy, reach))
                p = [*xy, surface.height_m - points[:, 2].min() + 0.0005]
                yield Lying(model, RigidTransform(RotationMatrix.ProjectToRotationMatrix(R), p))
                break


class FlatStage(FlatScene):
    """The flat with objects, as the robot of a rendered room sees it."""

    labelled: Mapping[int, Any] = {}

    def seen(self, view, range_m):
        """Clean picture, labels and depth (m)."""
        lens = view.intrinsics
        return self.colour(view.X_WC, lens), self.labels(view.X_WC, lens), self.depth_m(view.X_WC, lens, range_m)


def scene(rng, target, pool):
    """Lays an object and four others; None where the object finds no place."""
    surface = surface_of(str(rng.choice(SURFACES)))
    pose = viewpoint_of(rng, surface.name)
    known = [pool[k] for k in rng.permutation(OBJECTS) if pool[k] is not target]
    unknown = [pool[k] for k in OBJECTS + rng.permutation(len(pool) - OBJECTS)]
    around = [*known[:IMPORTED_OTHERS], *unknown[: OTHERS_AROUND - IMPORTED_OTHERS]]
    objects = list(laid(rng, [target, *around], surface, pose))
    if not objects or objects[0].model is not target:
        return None
    absent = known[IMPORTED_OTHERS].name
    return SimpleNamespace(objects=objects, surface=surface, pose=pose, absent=absent)


def ask(made, number, name, detector, folder, seed):
    begun = time.perf_counter()
    files = [(folder / each.model.name / f"{each.model.name}.sdf", each.X_WM) for each in made.objects]
    bench = room_bench(FlatStage(files), made.pose, detector, seed, seed)
    run = bench.run(Detect, DetectInputs((name,), (made.surface,)))
    places = [each.middle_W for each in made.objects if each.model.name == name]
    found = claimed = run.outcome == "success"
    if claimed:
        position_W = run.outputs["observation"].position_W
        found = bool(places) and bool(np.linalg.norm(position_W - places[0]) < RIGHT_WITHIN_M)
    asked = {"name": name, "scene": number, "there": bool(places), "found": found}
    told = {"message": run.message, "wall_s": round(time.perf_counter() - begun, 1)}
    return SimpleNamespace(**asked, mistaken=claimed and not found, **told)


def measure(half: int = 0, scenes: int = 5, seed: int = 1, photographs: bool = False):
    """Asks in all scenes of all objects, which the robot knows by their meshes or by photographs."""
    rng, every = np.random.default_rng([seed, half]), []
    with tempfile.TemporaryDirectory(prefix="errand-own-") as made:
        folder = Path(made)
        models = imported(folder, half)
        pool = [models[k] for k in rng.permutation(len(models))]
        known = by_photographs(folder, pool[:OBJECTS]) if photographs else pool[:OBJECTS]
        detector = ModelDetector(NoDetector(), known)
        for target, number in product(pool[:OBJECTS], range(scenes)):
            drawn = scene(rng, target, pool)
            for name in () if drawn is None else (target.name, drawn.absent):
                every.append(ask(drawn, number, name, detector, folder, seed))
                tell(every[-1])
    return summary(every)


def summary(every):
    """Shares of the objects found, and of questions to which another object was claimed."""
    there, absent = ([each for each in every if each.there is so] for so in (True, False))
    return {
        "asked": len(there),
        "found": share([each.found for each in there]),
        "mistaken_of_there": share([each.mistaken for each in there]),
        "absent": len(absent),
        "mistaken_of_absent": share([each.mistaken for each in absent]),
        "by_object": {name: f"{sum(e.found for e in own)}/{len(own)}" for name, own in by(there, "name").items()},
        "wall_s": round(sum(each.wall_s for each in every) / max(len(every), 1), 1),
    }


if __name__ == "__main__":
    command(measure)
