"""How often the robot finds an own object by its model, and how often it takes another object for it.

Run it by hand: `python -m tests.benchmarks.own_objects --half 0 --scenes 5 --seed 1`. Ten objects are imported, as
`errand object import` does it. In each scene one of them lies on a surface of the flat among four others: two that are
imported, too, and two that are not. The robot is asked for the one, and for one that is absent. An arm that moves as it
is told carries a camera that renders the flat with the plant's noise. Half of the objects are generated here, the
others are models of Debian's package `sweethome3d-furniture`; `--half` names which half of both is used. Prints JSON.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Any
from unittest import mock

import cv2
import numpy as np
from numpy.typing import NDArray
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

from errand_train.dataset.views import View
from executive.app.worlds import knowledge_of, open_world
from executive.testing.bench import SkillBench
from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.models.builder.importing import (
    ImportOptions,
    ImportReports,
    ObjectImportError,
    import_object,
    import_photographs,
)
from plant.models.builder.importing.solid import Solid
from plant.rendering import RENDERER, lights, render_parameters
from plant.scene_pictures import look_at, render_view
from plant.sensors.camera_spec import colour_render_camera, depth_render_camera
from plant.worlds.world import World
from skills.api import Surface
from skills.detect.skill import Detect, DetectInputs
from skills.detection import NoDetector
from skills.files.errors import InputError
from skills.files.object_model import ObjectModel, read_model
from skills.geometry import inside_polygon
from skills.perception.model_detector import ModelDetector
from skills.robot import Pose2D
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace
from tests.benchmarks.find_things import RoomRobot, TrueBoxes
from tests.benchmarks.foreign_models import CATALOGUES, OTHERS, entries

SURFACES = ("coffee table", "sideboard", "dresser", "bathroom cabinet", "desk", "workbench", "kitchen counter")
OBJECTS, FOREIGN, OTHERS_AROUND, IMPORTED_OTHERS = 10, 10, 4, 2
UPRIGHT_SHARE = 0.75
RIM_M, CLEAR_M, REACH_M = 0.04, 0.04, 1.7
RIGHT_WITHIN_M = 0.05
SIZES_M = (0.05, 0.32)

FloatArray = NDArray[np.float64]


def revolved(*profile: tuple[float, float]) -> Any:
    """Body of revolution from a closed profile of (radius, height) in mm."""
    import trimesh

    return trimesh.creation.revolve(np.array(profile, dtype=float), sections=40)


def block(low: Sequence[float], high: Sequence[float]) -> Any:
    """Box between two corners (mm)."""
    import trimesh

    return trimesh.creation.box(bounds=[low, high])


def turned(mesh: Any, axis: Sequence[float], degrees: float, by: Sequence[float] = (0, 0, 0)) -> Any:
    """The mesh, turned about an axis and moved."""
    import trimesh

    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(degrees), axis))
    mesh.apply_translation(by)
    return mesh


def ring(radius: float, thick: float, by: Sequence[float]) -> Any:
    """Standing ring of a handle."""
    import trimesh

    return turned(trimesh.creation.torus(radius, thick), (1, 0, 0), 90, by)


def rod(radius: float, length: float) -> Any:
    """Cylinder along z."""
    import trimesh

    return trimesh.creation.cylinder(radius, length, sections=32)


def shapes() -> Mapping[str, Sequence[tuple[Any, tuple[int, int, int]]]]:
    """Generated objects: parts (mm, z up) with their colours, by name; every second is of the other half."""
    white, red, blue, green = (235, 235, 230), (190, 40, 35), (40, 80, 185), (50, 140, 70)
    yellow, black, brown, grey = (225, 185, 40), (35, 35, 38), (120, 80, 50), (150, 150, 155)
    return {
        "blue_mug": [(cup(40, 95, 4), blue), (ring(22, 5, (48, 0, 48)), blue)],
        "red_cup": [
            (revolved((0, 0), (30, 0), (42, 85), (38, 85), (26, 4), (0, 4)), red),
            (ring(18, 5, (44, 0, 45)), red),
        ],
        "white_bowl": [(revolved((0, 0), (35, 0), (75, 60), (71, 60), (32, 5), (0, 5)), white)],
        "green_dish": [(revolved((0, 0), (60, 0), (95, 28), (91, 28), (58, 5), (0, 5)), green)],
        "cereal": [(block((-95, -30, 0), (95, 30, 270)), yellow), (block((-70, -31, 60), (70, 31, 200)), red)],
        "parcel": [(block((-80, -60, 0), (80, 60, 110)), brown), (block((-82, -15, -1), (82, 15, 112)), white)],
        "toy_car": [
            (block((-70, -30, 12), (70, 30, 45)), red),
            (block((-35, -27, 45), (40, 27, 75)), white),
            *((turned(rod(16, 14), (1, 0, 0), 90, (x, y, 16)), black) for x in (-42, 42) for y in (-32, 32)),
        ],
        "toy_house": [(block((-45, -35, 0), (45, 35, 60)), white), (roof(52, 42, 60, 100), red)],
        "bracket": [(block((0, -25, 0), (110, 25, 8)), grey), (block((0, -25, 8), (8, 25, 90)), grey)],
        "pipe_bend": [(rod(18, 120), green), (turned(rod(18, 90), (0, 1, 0), 90, (45, 0, -42)), green)],
        "squeeze_bottle": [
            (revolved((0, 0), (32, 0), (34, 120), (14, 150), (0, 150)), yellow),
            (revolved((0, 150), (12, 150), (5, 190), (0, 190)), red),
        ],
        "spray_can": [
            (revolved((0, 0), (26, 0), (26, 150), (12, 165), (0, 165)), blue),
            (turned(rod(9, 18), (0, 0, 1), 0, (0, 0, 174)), white),
        ],
        "tape_roll": [(revolved((38, 0), (55, 0), (55, 48), (38, 48), (38, 0)), brown)],
        "hand_weight": [
            (turned(rod(15, 130), (0, 1, 0), 90, (0, 0, 30)), black),
            (turned(rod(30, 40), (0, 1, 0), 90, (-75, 0, 30)), grey),
            (turned(rod(30, 40), (0, 1, 0), 90, (75, 0, 30)), grey),
        ],
        "white_mug": [(cup(40, 95, 4), white), (ring(22, 5, (48, 0, 48)), white)],
        "steel_jug": [(cup(48, 150, 3), grey), (ring(40, 6, (60, 0, 85)), black)],
    }


def cup(radius: float, height: float, wall: float) -> Any:
    """Hollow cylinder with a bottom."""
    inner = radius - wall
    return revolved((0, 0), (radius, 0), (radius, height), (inner, height), (inner, wall), (0, wall))


def roof(half_x: float, half_y: float, low: float, high: float) -> Any:
    """Prism of a gable roof."""
    import trimesh

    points = [[x, y, low] for x in (-half_x, half_x) for y in (-half_y, half_y)]
    return trimesh.convex.convex_hull(np.array([*points, [-half_x, 0, high], [half_x, 0, high]]))


def generated(folder: Path, half: int) -> Iterator[Path]:
    """Files of every second generated object."""
    import trimesh

    for name, parts in list(shapes().items())[half::2]:
        for mesh, colour in parts:
            mesh.visual.face_colors = [*colour, 255]
        whole = trimesh.util.concatenate([mesh for mesh, _ in parts])
        whole.apply_scale(0.001)
        file = folder / f"{name}.ply"
        whole.export(file)
        yield file


def foreign(folder: Path, half: int, catalogues: Path = CATALOGUES) -> Iterator[tuple[Path, float, str]]:
    """Files of every second model of others that has a usual size, its scale and upward axis."""
    fitting = [
        entry
        for file in sorted(catalogues.glob("*.sh3f"))
        for entry in entries(file)
        if entry.category == OTHERS and SIZES_M[0] <= entry.size_m.max() <= SIZES_M[1]
    ]
    for number, entry in enumerate(fitting[half::2]):
        with zipfile.ZipFile(entry.catalogue) as archive:
            inside = [name for name in archive.namelist() if Path(name).parent == Path(str(entry.path.parent))]
            own = folder / f"foreign_{number:02d}"
            for name in inside:
                archive.extract(name, own)
        file = own / str(entry.path)
        points = [line.split()[1:4] for line in file.read_text("latin-1").splitlines() if line.startswith("v ")]
        longest = float(np.ptp(np.array(points, dtype=float) @ entry.R.T, axis=0).max())
        yield file, float(entry.size_m.max()) / max(longest, 1e-9), "y"


def imported(folder: Path, half: int) -> list[ObjectModel]:
    """Imports the objects of one half, up to `FOREIGN` of others; leaves out those that no import takes."""
    folder.mkdir(parents=True, exist_ok=True)
    files = [(file, 1.0, "z", file.stem) for file in generated(folder, half)]
    files += [(file, scale, up, f"other{k}") for k, (file, scale, up) in enumerate(foreign(folder, half))]
    models = list[ObjectModel]()
    with mock.patch("plant.models.builder.importing.import_object.convex_parts", _bounding_box):  # they lie still
        for file, scale, up, name in files:
            options = ImportOptions(name, None, None, scale, up, close_holes=name.startswith("other"))
            out = folder / name
            out.mkdir(exist_ok=True)
            try:
                import_object(file, options, out)
            except ObjectImportError as error:
                sys.stderr.write(f"{file.name}: {error}\n")
                continue
            models.append(read_model(out))
            if sum(model.name.startswith("other") for model in models) == FOREIGN:
                break
    return models


PHOTO_PX, PHOTO_FOV_RAD = 480, 0.5
PHOTO_ELEVATIONS_DEG = (25.0, 50.0)
PHOTO_GROUND = (0.30, 0.45, 0.50)
PHOTO_NOISE, PHOTO_EXPOSURE, PHOTO_TINT = 3.0, 0.15, 0.04
STANDING, LYING, SIDES = 12, 6, 3
"""Numbers of photographs of an object as it stands, and on each other side; number of other sides."""


def photographed(folder: Path, model: ObjectModel, pictures: Path, seed: int = 0) -> Path:
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


def by_photographs(folder: Path, models: Sequence[ObjectModel]) -> list[ObjectModel]:
    """Models of the same objects, of photographs instead of meshes; leaves out those that no import takes."""
    found = list[ObjectModel]()
    for model in models:
        x, y, z = (round(float(side), 3) for side in np.ptp(model.points, axis=0))
        out = folder / f"{model.name}_seen"
        out.mkdir()
        try:
            pictures = photographed(folder, model, folder / f"{model.name}_photographs")
            import_photographs(pictures, ImportOptions(model.name), out, ImportReports(), (x, y, z))
        except InputError as error:
            sys.stderr.write(f"{model.name}: {error}\n")
            continue
        found.append(read_model(out))
    return found


def _bounding_box(solid: Solid) -> tuple[FloatArray, ...]:
    low, high = solid.points.min(axis=0), solid.points.max(axis=0)
    return (np.array(list(product(*zip(low, high, strict=True)))),)


@dataclass(frozen=True)
class Lying:
    """An object that lies in the flat."""

    model: ObjectModel
    X_WM: RigidTransform

    @property
    def middle_W(self) -> FloatArray:
        """Centre of its bounding box."""
        points = self.model.points @ self.X_WM.rotation().matrix().T + self.X_WM.translation()
        return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))


def laid(rng: np.random.Generator, models: Sequence[ObjectModel], surface: Surface, pose: Pose2D) -> Iterator[Lying]:
    """Objects laid on a surface where they fit; a quarter of them on another side."""
    corners = np.asarray(surface.polygon_W)
    taken: list[tuple[FloatArray, float]] = []
    for model in models:
        for _ in range(300):
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


class FlatStage:
    """The flat with objects in it, rendered in colour and depth."""

    labelled: Mapping[int, Any] = {}

    def __init__(self, world: World, objects: Sequence[Lying], folder: Path) -> None:
        """Builds the flat with the objects, whose models are in a folder."""
        loose = [
            LooseModel(f"thing{k}", folder / each.model.name / f"{each.model.name}.sdf", each.X_WM, fixed=True)
            for k, each in enumerate(objects)
        ]
        built = build_diagram(
            DiagramConfig(
                directives=world.directives_path, models=loose, visuals=False, renderer_parameters=render_parameters()
            )
        )
        assert built.scene is not None
        self._built = built
        self._query = built.scene.query_at(built.plant.GetPositions(built.plant.CreateDefaultContext()))
        self.bodies = [int(built.plant.GetBodyIndices(built.models[each.name])[0]) for each in loose]

    def seen(self, view: View, range_m: tuple[float, float]) -> tuple[Any, Any, Any]:
        """Clean picture, labels and depth (m)."""
        camera, frame = colour_render_camera(view.intrinsics, RENDERER), self._built.scene_graph.world_frame_id()
        colour = self._query.RenderColorImage(camera, frame, view.X_WC)
        labels = self._query.RenderLabelImage(camera, frame, view.X_WC)
        depth = self._query.RenderDepthImage(depth_render_camera(view.intrinsics, RENDERER, range_m), frame, view.X_WC)
        return (
            np.ascontiguousarray(colour.data[..., :3]),
            np.array(labels.data[..., 0], dtype=np.int16),
            np.asarray(depth.data[..., 0], dtype=np.float32),
        )


@dataclass(frozen=True)
class Scene:
    """Objects on one surface of the flat, and where the robot stands."""

    objects: Sequence[Lying]
    surface: Surface
    pose: Pose2D
    absent: str


def scene(rng: np.random.Generator, world: World, target: ObjectModel, pool: Sequence[ObjectModel]) -> Scene | None:
    """Lays an object and four others; None where the object finds no place."""
    facts = knowledge_of(world).surfaces
    name = str(rng.choice(SURFACES))
    surface = Surface(name, tuple((float(x), float(y)) for x, y in facts[name].polygon), facts[name].height)
    view = facts[name].viewpoints[int(rng.integers(len(facts[name].viewpoints)))]
    pose = Pose2D(view.x, view.y, view.yaw)
    known = [pool[k] for k in rng.permutation(OBJECTS) if pool[k] is not target]
    unknown = [pool[k] for k in OBJECTS + rng.permutation(len(pool) - OBJECTS)]
    around = [*known[:IMPORTED_OTHERS], *unknown[: OTHERS_AROUND - IMPORTED_OTHERS]]
    objects = list(laid(rng, [target, *around], surface, pose))
    if not objects or objects[0].model is not target:
        return None
    return Scene(objects, surface, pose, known[IMPORTED_OTHERS].name)


@dataclass(frozen=True)
class Asked:
    """One question: whether the object was there, found, or claimed elsewhere, and what was said."""

    name: str
    scene: int
    there: bool
    found: bool
    mistaken: bool
    message: str
    wall_s: float


def ask(made: Scene, number: int, name: str, detector: ModelDetector, folder: Path, seed: int) -> Asked:
    """Asks for an object by its name."""
    begun = time.perf_counter()
    clock = VirtualClock()
    robot = RoomRobot(clock, FlatStage(open_world("flat"), made.objects, folder), made.pose, seed, TrueBoxes())
    bench = SkillBench(
        robot, clock, localiser=KnownPlace(made.pose), costmap=BlockCostmap(), detector=detector, seed=seed
    )
    run = bench.run(Detect, DetectInputs((name,), (made.surface,)))
    places = [each.middle_W for each in made.objects if each.model.name == name]
    claimed = run.outcome == "success"
    found = bool(
        claimed and places and np.linalg.norm(run.outputs["observation"].position_W - places[0]) < RIGHT_WITHIN_M
    )
    wall_s = round(time.perf_counter() - begun, 1)
    return Asked(name, number, bool(places), found, claimed and not found, run.message, wall_s)


def results(
    folder: Path, half: int, scenes: int, seed: int, tell: Callable[[Asked], None], *, photographs: bool = False
) -> list[Asked]:
    """Asks in all scenes of all objects, which the robot knows by their meshes or by photographs."""
    rng, world = np.random.default_rng([seed, half]), open_world("flat")
    models = imported(folder, half)
    pool = [models[k] for k in rng.permutation(len(models))]
    known = by_photographs(folder, pool[:OBJECTS]) if photographs else pool[:OBJECTS]
    detector, every = ModelDetector(NoDetector(), known), list[Asked]()
    for target in pool[:OBJECTS]:
        for number in range(scenes):
            made = scene(rng, world, target, pool)
            for name in () if made is None else (target.name, made.absent):
                assert made is not None
                every.append(ask(made, number, name, detector, folder, seed))
                tell(every[-1])
    return every


def summary(every: Sequence[Asked]) -> dict[str, object]:
    """Shares of the objects found, and of questions to which another object was claimed."""
    there = [each for each in every if each.there]
    names = list(dict.fromkeys(each.name for each in there))
    return {
        "asked": len(there),
        "found": round(sum(each.found for each in there) / max(len(there), 1), 3),
        "mistaken_of_there": round(sum(each.mistaken for each in there) / max(len(there), 1), 3),
        "absent": len(every) - len(there),
        "mistaken_of_absent": round(
            sum(each.mistaken for each in every if not each.there) / max(len(every) - len(there), 1), 3
        ),
        "by_object": {
            n: f"{sum(e.found for e in there if e.name == n)}/{sum(e.name == n for e in there)}" for n in names
        },
        "wall_s": round(sum(each.wall_s for each in every) / max(len(every), 1), 1),
    }


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--half", type=int, choices=(0, 1), default=0)
    parser.add_argument("--scenes", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--photographs", action="store_true", help="photographs of each object, no meshes")
    args = parser.parse_args()

    def tell(one: Asked) -> None:
        sys.stderr.write(f"{json.dumps(asdict(one))}\n")

    with tempfile.TemporaryDirectory(prefix="errand-own-") as folder:
        every = results(Path(folder), args.half, args.scenes, args.seed, tell, photographs=args.photographs)
    sys.stdout.write(json.dumps(summary(every), indent=1) + "\n")


if __name__ == "__main__":
    main()
