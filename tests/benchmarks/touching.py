"""How well objects that touch or stand close together are told apart in depth pictures, by the plant's labels.

    python -m tests.benchmarks.touching [--scenes N] [--seed S] [--alone] [--sheet FOLDER]

Each scene puts three to six objects on a surface of `flat`, forms of the classes and random shapes, each beside another
at a gap of 0 to 10 cm; with `--alone` one object. It is seen from 0.42 m, as `grasp` looks, and from 0.95 m, as
`detect` does. `found` is the share of objects whose segment has an intersection over union above 0.5 with their own
points; `merged` that of objects whose segment holds a fifth or more of another one; `split` that of objects of which
two segments hold a fifth or more each. `--sheet` writes pictures with the segments in colours. Prints JSON.
"""

import tempfile
import time
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import shapely
from pydrake.math import RigidTransform, RollPitchYaw

from errand_train.dataset.views import camera_specs
from plant.models.catalogue import load_catalogue, read_imported
from plant.scene_pictures import look_at, save_png
from plant.worlds.seeding import outline_W
from skills.geometry import inside_polygon
from skills.perception.point_cloud import camera_pose_W
from skills.perception.surface_segmentation import segment_surface, split_touching
from tests.benchmarks.flat_scene import SURFACES, FlatScene, surface_of, viewpoint_of
from tests.benchmarks.harness import command, quantile, share
from tests.benchmarks.shapes import written_shape

CLASSES = ("beer", "coke", "hammer", "screwdriver", "wrench", "cylinder", "cube", "extinguisher")
ON = tuple(name for name in SURFACES if name != "bathroom cabinet")
GAPS_M = (0.0, 0.01, 0.02, 0.03, 0.05, 0.07, 0.10)
VIEWS = {"near": (0.42, 0.73), "far": (0.95, 0.61)}
RIM_M, TRIES, FEWEST_POINTS, SHARE, SHAPES = 0.02, 300, 60, 0.2, 8


def lay(rng, forms, surface):
    """Lays forms on a surface, the first near its middle, each other beside an earlier one, at a `gap_m`."""
    middle, placed = np.mean(surface.polygon_W, axis=0), []
    for name, form in forms:
        for _ in range(TRIES):
            yaw, gap_m, turn = rng.uniform(-np.pi, np.pi), float(rng.choice(GAPS_M)), rng.uniform(-np.pi, np.pi)
            direction = np.array([np.cos(turn), np.sin(turn)])
            anchor = placed[int(rng.integers(len(placed)))] if placed else None
            start = middle if anchor is None else anchor.X_WO.translation()[:2]
            outline, centre = _moved_off(form, start, direction, yaw, anchor, gap_m)
            if not bool(np.all(inside_polygon(outline, surface.polygon_W, -RIM_M))):
                continue
            if any(_distance_m(outline, each.outline) < max(gap_m, 1e-4) - 5e-5 for each in placed):
                continue
            p_W = [*centre, surface.height_m + form.rest_height_m]
            X_WO = RigidTransform(RollPitchYaw(0, 0, yaw), p_W)
            placed.append(SimpleNamespace(name=name, form=form, X_WO=X_WO, outline=outline))
            break
    for one in placed:
        gaps_m = (_distance_m(one.outline, other.outline) for other in placed if other is not one)
        one.gap_m = min(gaps_m, default=1.0)
    return placed


def _distance_m(one, other):
    return float(shapely.distance(shapely.Polygon(one), shapely.Polygon(other)))


def _moved_off(form, start, direction, yaw, anchor, gap_m):
    """Outline and centre of a form moved along a direction until it is a gap away from the anchor."""
    low, high = 0.0, 0.0 if anchor is None else 0.8
    for _ in range(24):
        middle = 0.5 * (low + high)
        outline = outline_W(form, tuple(start + middle * direction), yaw)
        if anchor is not None and _distance_m(outline, anchor.outline) < max(gap_m, 1e-4):
            low = middle
        else:
            high = middle
    centre = start + high * direction
    return outline_W(form, tuple(centre), yaw), centre


def shots(seed, count, *, alone):
    """Pictures of scenes from each view with the numbers of their pixels' objects, -1 for none."""
    spec = camera_specs()["hand"]
    with tempfile.TemporaryDirectory() as folder:
        written = [written_shape(seed * 100 + k, Path(folder)) for k in range(SHAPES)]
        shapes = [read_imported(each).form(each) for each in written]
        for number in range(count):
            rng = np.random.default_rng([seed, number, 17])
            surface, forms = surface_of(str(rng.choice(ON))), []
            for k in range(1 if alone else int(rng.integers(3, 7))):
                which = CLASSES[int(rng.integers(len(CLASSES)))] if alone or rng.random() < 0.65 else "shape"
                own = [*load_catalogue()[which].forms.values()] if which != "shape" else shapes
                forms.append((f"{which} {k}", own[int(rng.integers(len(own)))]))
            objects = lay(rng, forms, surface)
            flat = FlatScene([(each.form.path(), each.X_WO) for each in objects])
            viewpoint = viewpoint_of(rng, surface.name)
            target = objects[int(rng.integers(len(objects)))].X_WO.translation()
            ahead = np.array([viewpoint.x_m, viewpoint.y_m]) - target[:2]
            ahead = np.append(ahead / np.linalg.norm(ahead), 0.0)
            for view, (distance_m, below_rad) in VIEWS.items():
                away = np.cos(below_rad) * ahead + [0.0, 0.0, np.sin(below_rad)]
                X_WC = look_at(target + distance_m * away, target)
                labels = flat.labels(X_WC, spec.intrinsics())
                numbers = np.full(labels.shape, -1, dtype=np.int16)
                for index, body in enumerate(flat.bodies):
                    numbers[labels == body] = index
                yield view, flat.image(rng, spec, X_WC), numbers, objects, surface


def judge(view, segments, image, numbers, objects):
    rim = {*numbers[:3].flat, *numbers[-3:].flat, *numbers[:, :3].flat, *numbers[:, -3:].flat}
    own = [np.bincount(numbers[p[:, 1], p[:, 0]] + 1, minlength=len(objects) + 1)[1:] for p in segments]
    counts, sizes = np.array(own).reshape(-1, len(objects)), np.array([len(p) for p in segments])
    holds = counts / np.maximum(counts.sum(axis=0), 1)
    scale = (image.intrinsics.fx / image.depth_intrinsics.fx) ** 2
    for number, each in enumerate(objects):
        area = np.count_nonzero(numbers == number) / scale
        if area < FEWEST_POINTS or number in rim:
            continue
        ious = counts[:, number] / np.maximum(sizes + area - counts[:, number], 1)
        merged = bool(len(ious)) and bool(np.any(np.delete(holds[int(np.argmax(ious))], number) > SHARE))
        split = int(np.count_nonzero(holds[:, number] > SHARE)) > 1
        own = {"view": view, "name": each.name, "gap_m": round(each.gap_m, 3)}
        yield SimpleNamespace(**own, iou=round(float(ious.max(initial=0.0)), 3), merged=merged, split=split)


def segments_of(image, surface):
    here = RigidTransform()
    view = segment_surface(image, here, surface, margin_m=0.0)
    split = None if view is None else split_touching(view, camera_pose_W(image, here).translation())
    return [] if split is None else [each.points.pixels for each in split.clusters]


def drawn(image, segments):
    assert image.colour is not None
    shown = image.colour.copy()
    for k, p in enumerate(segments):
        hue = cv2.cvtColor(np.array([[[k * 47 % 180, 255, 255]]], dtype=np.uint8), cv2.COLOR_HSV2RGB)[0, 0]
        shown[p[:, 1], p[:, 0]] = 0.4 * shown[p[:, 1], p[:, 0]] + 0.6 * hue
    return shown


def rates(judged):
    if not judged:
        return {"objects": 0}
    found = {"found": share([each.iou > 0.5 for each in judged])}
    return {"objects": len(judged), **found, **{n: share([getattr(e, n) for e in judged]) for n in ("merged", "split")}}


def measure(scenes: int = 20, seed: int = 1, alone: bool = False, sheet: Path | None = None):
    """Rates by distance from the camera and by gap, names of split objects, time of the segmentation (ms)."""
    judged, spent_ms = [], []
    for shot, (view, image, numbers, objects, surface) in enumerate(shots(seed, scenes, alone=alone)):
        begun_s = time.perf_counter()
        segments = segments_of(image, surface)
        spent_ms.append(1000.0 * (time.perf_counter() - begun_s))
        judged += judge(view, segments, image, numbers, objects)
        if sheet is not None:
            save_png(sheet / f"{shot:03d}.png", drawn(image, segments))
    ranges = pairwise((-1.0, *(gap_m + 0.002 for gap_m in GAPS_M), 2.0))
    gaps = {f"{1000 * low:.0f}-{1000 * high:.0f} mm": (low, high) for low, high in ranges}
    return {
        "all": rates(judged),
        **{name: rates([each for each in judged if each.view == name]) for name in VIEWS},
        "gaps": {name: rates([o for o in judged if low <= o.gap_m < high]) for name, (low, high) in gaps.items()},
        "split": sorted({each.name.split()[0] for each in judged if each.split}),
        "ms": {"median": quantile(spent_ms, digits=0), "most": quantile(spent_ms, 1.0, 0)},
    }


if __name__ == "__main__":
    command(measure)
