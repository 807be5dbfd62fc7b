"""Pictures with depth and true boxes of the nine classes in generated rooms, to measure where objects are said to be.

The rooms, objects and views are those of the data set's held-out part. The exposure is automatic, and depth is as noisy
as the hand camera's, which finds none where it is dark.
"""

import gzip
import pickle
import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import FramePoseVector

from errand_train.dataset.coco import box_of
from errand_train.dataset.compose import Scene, compose
from errand_train.dataset.degrade import expose
from errand_train.dataset.lighting import random_lighting
from errand_train.dataset.render import Stage, is_validation
from errand_train.dataset.silhouette import silhouette
from errand_train.dataset.views import View, camera_specs, view_of
from plant.models.catalogue import load_catalogue
from plant.sensors.camera_spec import depth_render_camera
from plant.sensors.noise import DepthDegrader, DepthNoise
from skills.api import Detection
from skills.robot import FloatArray, FrameTree, Image

VIEWS = 8
FARTHEST_M = 2.0
MEAN_EXPOSURE = 114.0
LEAST_LONG_PX, LEAST_SHORT_PX, LEAST_VISIBLE = 24, 8, 0.4


@dataclass(frozen=True)
class Truth:
    """An object in a picture: its box there, its true middle from the camera (m), share seen."""

    detection: Detection
    p_CT: FloatArray
    visibility: float
    truncation: float


class DepthStage(Stage):
    def seen(self, view, range_m):
        colour, labels = self.take(view)
        poses = FramePoseVector()
        poses.set_value(self._hand, self.hand_pose(view))
        self._graph.get_source_pose_port(self._source).FixValue(self._context, Value(poses))
        query = self._graph.get_query_output_port().Eval(self._context)
        camera = depth_render_camera(view.intrinsics, "vtk", range_m)
        depth = query.RenderDepthImage(camera, self._world, view.X_WC)
        return colour, labels, np.asarray(depth.data[..., 0], dtype=np.float32)


def shots(seed, scenes, views=VIEWS):
    """Pictures of held-out scenes; the same for the same seed."""
    held_out = (index for index in range(10 * scenes) if is_validation(index))
    for _, index in zip(range(scenes), held_out, strict=False):
        rng = np.random.default_rng([seed, index, 5])
        scene = compose(rng, index, for_training=False)
        lighting = random_lighting(rng, scene.room)
        with tempfile.TemporaryDirectory(prefix="errand-scene-") as folder:
            stage = DepthStage(Scene(scene.room, scene.objects, None, scene.seats), lighting, Path(folder), 1.0)
            yield from _shots_of(rng, stage, scene, views)


def _shots_of(rng, stage, scene, views):
    objects = [thing for thing in scene.objects if thing.model.class_id]
    order = [objects[k] for k in rng.permutation(len(objects))]
    for number in range(min(views, 3 * len(order))):
        view = _hand_view(rng, scene, order[number % len(order)])
        if view is not None:
            yield _shot(rng, stage, view)


def _hand_view(rng, scene, thing):
    """A view of the hand camera, with its own intrinsics, within 2 m or a little more."""
    for _ in range(30):
        view = view_of(rng, scene.room, thing, camera_specs())
        if view is None or view.camera != "hand":
            continue
        if float(np.linalg.norm(view.X_WC.inverse() @ thing.X_WO.translation())) < FARTHEST_M + 0.3:
            return View("hand", view.X_WC, camera_specs()["hand"].intrinsics(), False, False)
    return None


def _shot(rng, stage, view):
    range_m = camera_specs()[view.camera].depth_range_m
    rendered, labels, clean = stage.seen(view, range_m)
    colour = np.asarray(np.round(expose(rendered.astype(np.float32), MEAN_EXPOSURE)), dtype=np.uint8)
    grey = np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    depth = DepthDegrader(rng, view.intrinsics, range_m, DepthNoise()).depth(clean, grey)
    frames = FrameTree({"hand_camera": ("odom", view.X_WC)})
    image = Image(0.0, "hand", "hand_camera", view.intrinsics, view.intrinsics, colour, grey, depth, frames)
    return SimpleNamespace(image=image, truths=truths(stage, labels, view))


def truths(stage, labels, view):
    found = (_truth(stage, int(label), labels == label, view) for label in np.unique(labels) if label in stage.labelled)
    return tuple(truth for truth in found if truth is not None)


def _truth(stage, label, mask, view):
    model, X_WO, _ = stage.labelled[label]
    if mask.sum() < 20:
        return None
    points = model.surface.points
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    X_CO = view.X_WC.inverse() @ X_WO
    alone = silhouette(np.asarray(X_CO @ points.T).T, model.surface.faces, view.intrinsics)
    x, y, w, h = box_of(mask)
    name = next(name for name, entry in load_catalogue().items() if entry.id == model.class_id)
    return Truth(
        Detection(name, 1.0, (float(x), float(y), float(x + w), float(y + h))),
        np.asarray(X_CO @ middle),
        min(1.0, float(mask.sum()) / max(alone.inside_px, 1)),
        1.0 - alone.inside_px / max(alone.whole_px, alone.inside_px, 1),
    )


def counts(truth):
    """True if an object counts for position errors: near, large and well seen."""
    return float(np.linalg.norm(truth.p_CT)) < FARTHEST_M and well_seen(truth)


def well_seen(truth):
    """True if an object is large in the picture, and little of it hidden or cut off."""
    u0, v0, u1, v1 = truth.detection.box
    long, short = max(u1 - u0, v1 - v0), min(u1 - u0, v1 - v0)
    seen = truth.visibility * (1.0 - truth.truncation)
    return long >= LEAST_LONG_PX and short >= LEAST_SHORT_PX and seen >= LEAST_VISIBLE


def stored_shots(folder, seed, scenes):
    """Pictures that a folder stores; an empty one stores new ones first."""
    folder.mkdir(parents=True, exist_ok=True)
    if not any(folder.iterdir()):
        for number, shot in enumerate(shots(seed, scenes)):
            with gzip.open(folder / f"{number:04d}.pickle.gz", "wb", compresslevel=1) as file:
                pickle.dump(shot, file)
    for path in sorted(folder.iterdir()):
        with gzip.open(path) as file:
            yield pickle.load(file)
