"""How well objects that touch or stand close together are told apart in depth pictures, by the plant's labels.

    python -m tests.benchmarks.touching [--scenes N] [--seed S] [--alone] [--sheet FOLDER]

Each scene puts three to six objects on a surface of `flat`, forms of the classes and random shapes, each beside another
at a gap of 0 to 10 cm; with `--alone` one object. It is seen from 0.42 m, as `grasp` looks, and from 0.95 m, as
`detect` does. `found` is the share of objects whose segment has an intersection over union above 0.5 with their own
points; `merged` that of objects whose segment holds a fifth or more of another one; `split` that of objects of which
two segments hold a fifth or more each. Prints JSON.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from pydrake.geometry import QueryObject
from pydrake.math import RigidTransform, RollPitchYaw

from errand_train.dataset.views import camera_specs
from executive.app.worlds import knowledge_of, open_world
from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.models.catalogue import ModelForm, load_catalogue, read_imported
from plant.rendering import RENDERER, render_parameters
from plant.scene_pictures import look_at, save_png
from plant.sensors.camera_spec import colour_render_camera, depth_render_camera
from plant.sensors.noise import DepthDegrader, DepthNoise, PictureDegrader, PictureNoise
from plant.worlds.seeding import outline_W
from skills.api import LocalisationEstimate, Surface
from skills.geometry import inside_polygon
from skills.perception.point_cloud import camera_pose_W
from skills.perception.surface_segmentation import SurfaceView, segment_surface, split_touching
from skills.robot import FloatArray, FrameTree, Image, Picture
from tests.benchmarks.shapes import written_shape

SURFACES: Final = ("coffee table", "sideboard", "dresser", "desk", "workbench", "kitchen counter")
GAPS_M: Final = (0.0, 0.01, 0.02, 0.03, 0.05, 0.07, 0.10)
CLASSES: Final = ("beer", "coke", "hammer", "screwdriver", "wrench", "cylinder", "cube", "extinguisher")
VIEWS: Final = ((0.42, 0.73), (0.95, 0.61))
RIM_M, TRIES, FEWEST_POINTS, SHARE, SHAPES = 0.02, 300, 60, 0.2, 8
Shot = tuple[int, Image, NDArray[np.int16], list["Laid"], Surface]
PLACE: Final = LocalisationEstimate(0.0, RigidTransform(), np.zeros((3, 3)), True)


@dataclass(frozen=True)
class Laid:
    """An object that was laid on a surface, and its distance from the nearest other (m)."""

    name: str
    form: ModelForm
    X_WO: RigidTransform
    outline: FloatArray
    gap_m: float = 1.0


@dataclass(frozen=True)
class Judged:
    """What became of an object in a picture."""

    scene: int
    view: int
    name: str
    gap_m: float
    iou: float
    merged: bool
    split: bool


def laid(rng: np.random.Generator, forms: Sequence[tuple[str, ModelForm]], surface: Surface) -> list[Laid]:
    """Forms on a surface, the first near its middle, each other beside an earlier one."""
    middle, placed = np.mean(surface.polygon_W, axis=0), list[Laid]()
    for name, form in forms:
        for _ in range(TRIES):
            yaw, gap_m, turn = rng.uniform(-np.pi, np.pi), float(rng.choice(GAPS_M)), rng.uniform(-np.pi, np.pi)
            direction = np.array([np.cos(turn), np.sin(turn)])
            anchor = placed[int(rng.integers(len(placed)))] if placed else None
            start = middle if anchor is None else anchor.X_WO.translation()[:2]
            outline = _moved_off(form, start, direction, yaw, anchor, gap_m)
            if not bool(np.all(inside_polygon(outline[0], surface.polygon_W, -RIM_M))):
                continue
            if any(_distance_m(outline[0], each.outline) < max(gap_m, 1e-4) - 5e-5 for each in placed):
                continue
            z = surface.height_m + form.rest_height_m
            placed.append(Laid(name, form, RigidTransform(RollPitchYaw(0, 0, yaw), [*outline[1], z]), outline[0]))
            break
    return [
        replace(one, gap_m=min([_distance_m(one.outline, o.outline) for o in placed if o is not one], default=1.0))
        for one in placed
    ]


def _distance_m(one: FloatArray, other: FloatArray) -> float:
    return float(shapely.distance(shapely.Polygon(one), shapely.Polygon(other)))


def _moved_off(
    form: ModelForm, start: FloatArray, direction: FloatArray, yaw: float, anchor: Laid | None, gap_m: float
) -> tuple[FloatArray, FloatArray]:
    """Outline and centre of a form moved along a direction until it is a gap away from the anchor."""
    low, high = 0.0, 0.0 if anchor is None else 0.8
    for _ in range(24):
        middle = 0.5 * (low + high)
        outline = outline_W(form, (start[0] + middle * direction[0], start[1] + middle * direction[1]), yaw)
        if anchor is not None and _distance_m(outline, anchor.outline) < max(gap_m, 1e-4):
            low = middle
        else:
            high = middle
    centre = start + high * direction
    return outline_W(form, (float(centre[0]), float(centre[1])), yaw), centre


def scenes(seed: int, count: int, *, alone: bool) -> Iterator[Shot]:
    """Pictures of scenes with the labels of their depth pixels: each object's number, -1 for none."""
    world = open_world("flat")
    facts = knowledge_of(world).surfaces
    with tempfile.TemporaryDirectory() as folder:
        written = [written_shape(seed * 100 + k, Path(folder)) for k in range(SHAPES)]
        shapes = [read_imported(each).form(each) for each in written]
        for number in range(count):
            rng = np.random.default_rng([seed, number, 17])
            name = str(rng.choice(SURFACES))
            surface = Surface(name, tuple((float(x), float(y)) for x, y in facts[name].polygon), facts[name].height)
            forms = list[tuple[str, ModelForm]]()
            for k in range(1 if alone else int(rng.integers(3, 7))):
                which = CLASSES[int(rng.integers(len(CLASSES)))] if alone or rng.random() < 0.65 else "shape"
                own = [*load_catalogue()[which].forms.values()] if which != "shape" else shapes
                forms.append((f"{which} {k}", own[int(rng.integers(len(own)))]))
            objects = laid(rng, forms, surface)
            models = [LooseModel(f"thing{k}", o.form.path(), o.X_WO, fixed=True) for k, o in enumerate(objects)]
            built = build_diagram(
                DiagramConfig(
                    directives=world.directives_path,
                    models=models,
                    visuals=False,
                    renderer_parameters=render_parameters(),
                )
            )
            assert built.scene is not None
            query = built.scene.query_at(built.plant.GetPositions(built.plant.CreateDefaultContext()))
            bodies = [int(built.plant.GetBodyIndices(built.models[each.name])[0]) for each in models]
            viewpoint = facts[name].viewpoints[int(rng.integers(len(facts[name].viewpoints)))]
            target = objects[int(rng.integers(len(objects)))].X_WO.translation()
            ahead = np.array([viewpoint.x, viewpoint.y]) - target[:2]
            ahead = np.append(ahead / np.linalg.norm(ahead), 0.0)
            for distance_m, below_rad in VIEWS:
                away = np.cos(below_rad) * ahead + [0.0, 0.0, np.sin(below_rad)]
                image, numbers = picture(rng, query, look_at(target + distance_m * away, target), bodies)
                yield number, image, numbers, objects, surface


def picture(
    rng: np.random.Generator, query: QueryObject, X_WC: RigidTransform, bodies: Sequence[int]
) -> tuple[Image, NDArray[np.int16]]:
    """The hand camera's picture, and the object of each of its depth pixels."""
    spec = camera_specs()["hand"]
    lens, depth_lens, world = spec.intrinsics(), spec.depth_intrinsics(), query.inspector().world_frame_id()
    clean = query.RenderColorImage(colour_render_camera(lens, RENDERER), world, X_WC).data[..., :3]
    camera = depth_render_camera(depth_lens, RENDERER, spec.depth_range_m)
    depth = np.asarray(query.RenderDepthImage(camera, world, X_WC).data[..., 0], dtype=np.float32)
    labels = query.RenderLabelImage(colour_render_camera(lens, RENDERER), world, X_WC).data[..., 0]
    colour = PictureDegrader(rng, lens.height, lens.width, PictureNoise()).colour(np.ascontiguousarray(clean))
    grey = np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    small = cv2.resize(grey, (depth_lens.width, depth_lens.height))
    noisy = DepthDegrader(rng, depth_lens, spec.depth_range_m, DepthNoise()).depth(depth, small)
    numbers = np.full(labels.shape, -1, dtype=np.int16)
    for number, body in enumerate(bodies):
        numbers[labels == body] = number
    frames = FrameTree({"hand_camera": ("odom", X_WC)})
    return Image(0.0, "hand", "hand_camera", lens, depth_lens, colour, grey, noisy, frames), numbers


def judge(
    scene: int,
    view: int,
    clusters: Sequence[NDArray[np.int64]],
    image: Image,
    numbers: NDArray[np.int16],
    objects: Sequence[Laid],
) -> Iterator[Judged]:
    """What became of each object that the picture shows whole, from the pixels (N, 2) of the clusters."""
    rim = {*numbers[:3].flat, *numbers[-3:].flat, *numbers[:, :3].flat, *numbers[:, -3:].flat}
    own = [np.bincount(numbers[p[:, 1], p[:, 0]] + 1, minlength=len(objects) + 1)[1:] for p in clusters]
    counts = np.array(own).reshape(-1, len(objects))
    scale = (image.intrinsics.fx / image.depth_intrinsics.fx) ** 2
    for number, each in enumerate(objects):
        area = np.count_nonzero(numbers == number) / scale
        if area < FEWEST_POINTS or number in rim:
            continue
        sizes = np.array([len(p) for p in clusters])
        ious = counts[:, number] / np.maximum(sizes + area - counts[:, number], 1)
        best = int(np.argmax(ious)) if len(ious) else -1
        total = counts.sum(axis=0)
        holds = counts / np.maximum(total, 1)
        merged = best >= 0 and bool(np.any(np.delete(holds[best], number) > SHARE))
        yield Judged(
            scene,
            view,
            each.name,
            round(each.gap_m, 3),
            round(float(ious.max(initial=0.0)), 3),
            merged,
            int(np.count_nonzero(holds[:, number] > SHARE)) > 1,
        )


def segmented(image: Image, surface: Surface) -> SurfaceView | None:
    """The view of a surface with what touches split."""
    view = segment_surface(image, PLACE.X_WO, surface, margin_m=0.0)
    return None if view is None else split_touching(view, camera_pose_W(image, PLACE.X_WO).translation())


def drawn(image: Image, clusters: Sequence[NDArray[np.int64]]) -> Picture:
    """The picture with its segments in colours."""
    assert image.colour is not None
    shown = image.colour.copy()
    for k, p in enumerate(clusters):
        hue = cv2.cvtColor(np.array([[[k * 47 % 180, 255, 255]]], dtype=np.uint8), cv2.COLOR_HSV2RGB)[0, 0]
        shown[p[:, 1], p[:, 0]] = 0.4 * shown[p[:, 1], p[:, 0]] + 0.6 * hue
    return shown


def rates(judged: Sequence[Judged]) -> dict[str, Any]:
    """Shares over some objects."""
    if not judged:
        return {"objects": 0}
    return {
        "objects": len(judged),
        "found": round(float(np.mean([each.iou > 0.5 for each in judged])), 3),
        "merged": round(float(np.mean([each.merged for each in judged])), 3),
        "split": round(float(np.mean([each.split for each in judged])), 3),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--alone", action="store_true")
    parser.add_argument("--sheet", type=Path, help="a folder for pictures with the segments in colours")
    options = parser.parse_args()
    judged, spent_s = list[Judged](), list[float]()
    for shot, (scene, image, numbers, objects, surface) in enumerate(
        scenes(options.seed, options.scenes, alone=options.alone)
    ):
        begun_s = time.perf_counter()
        view = segmented(image, surface)
        spent_s.append(time.perf_counter() - begun_s)
        clusters = [] if view is None else [each.points.pixels for each in view.clusters]
        judged += judge(scene, shot % len(VIEWS), clusters, image, numbers, objects)
        if options.sheet is not None:
            options.sheet.mkdir(parents=True, exist_ok=True)
            save_png(options.sheet / f"{shot:03d}.png", drawn(image, clusters))
    print(json.dumps(summary(judged, spent_s), indent=1))


def summary(judged: Sequence[Judged], spent_s: Sequence[float]) -> dict[str, Any]:
    """Rates by distance from the camera and by gap, names of split objects, time of the segmentation (ms)."""
    ranges = pairwise((-1.0, *(gap_m + 0.002 for gap_m in GAPS_M), 2.0))
    gaps = {f"{1000 * low:.0f}-{1000 * high:.0f} mm": (low, high) for low, high in ranges}
    return {
        "all": rates(judged),
        **{name: rates([each for each in judged if each.view == k]) for k, name in enumerate(("near", "far"))},
        "gaps": {name: rates([o for o in judged if low <= o.gap_m < high]) for name, (low, high) in gaps.items()},
        "split": sorted({each.name.split()[0] for each in judged if each.split}),
        "ms": {"median": round(1000 * float(np.median(spent_s))), "most": round(1000 * max(spent_s))},
    }


if __name__ == "__main__":
    main()
