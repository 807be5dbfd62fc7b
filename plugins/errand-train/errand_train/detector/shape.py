"""Training of the shape model: clusters of rendered objects, and a network with one hidden layer.

    python -m errand_train.detector.shape [--scenes 240] [--seed 1] [--jobs 2] [--out shapes.npz]

Each scene is a table with objects of the classes and of none, as they may rest. Depth pictures of the hand camera, with
its noise, are segmented as the robot does it; each cluster gives features and the class of its object. The fit
minimises the cross-entropy with weight decay by L-BFGS. A fifth as many scenes, with held-out objects, measure
it. The objects are the project's own.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    GeometryInstance,
    MakeRenderEngineVtk,
    PerceptionProperties,
    RenderEngineVtkParams,
    RenderLabel,
    SceneGraph,
    Shape,
)
from pydrake.geometry import Mesh as MeshShape
from pydrake.math import RigidTransform, RotationMatrix
from scipy.optimize import minimize

from errand_train.dataset.compose import Placed
from errand_train.dataset.objects import CLASSES, DISTRACTORS, instance, numbers
from errand_train.dataset.resting import choose_pose, resting_poses
from errand_train.dataset.views import camera_specs
from plant.scene_pictures import look_at
from plant.sensors.camera_spec import colour_render_camera, depth_render_camera
from plant.sensors.noise import DepthDegrader, DepthNoise
from skills.api import Surface
from skills.class_forms import ANY_OBJECT
from skills.perception.shape_model import MODEL_FILE, ShapeModel
from skills.perception.surface_segmentation import Cluster, segment_surface, split_touching
from skills.robot import FloatArray, FrameTree, Image

NAMES: Final = (*(name for name in CLASSES if name != "person"), ANY_OBJECT)
TABLE_M: Final = (1.6, 0.9, 0.04)
HEIGHT_M: Final = 0.8
OBJECTS: Final = 8
VIEWS: Final = 8
OTHERS: Final = 0.4
"""Share of objects of no class."""
APART_M: Final = 0.04
HIDDEN: Final = 16
DECAY: Final = 3e-3
_LEAST_OWN: Final = 0.7
"""Least share of a cluster's points that lie on one object."""
_RENDERER: Final = "vtk"


class Table:
    """A table with objects, rendered in depth and labels."""

    def __init__(self, objects: Sequence[Placed]) -> None:
        self.objects = objects
        self._graph = SceneGraph()
        self._graph.AddRenderer(_RENDERER, MakeRenderEngineVtk(RenderEngineVtkParams()))
        self._source = self._graph.RegisterSource("table")
        self._add(Box(*TABLE_M), RigidTransform([0.0, 0.0, HEIGHT_M - 0.5 * TABLE_M[2]]), len(objects))
        for label, each in enumerate(objects):
            self._add(MeshShape(str(each.model.obj_path)), each.X_WO, label)
        self._context = self._graph.CreateDefaultContext()

    def _add(self, shape: Shape, X_WG: RigidTransform, label: int) -> None:
        appearance = GeometryInstance(X_WG, shape, f"g{self._graph.model_inspector().num_geometries()}")
        properties = PerceptionProperties()
        properties.AddProperty("label", "id", RenderLabel(label))
        appearance.set_perception_properties(properties)
        self._graph.RegisterAnchoredGeometry(self._source, appearance)

    def image(self, rng: np.random.Generator, X_WC: RigidTransform) -> tuple[Image, NDArray[np.int16]]:
        """Depth image of the hand camera with its noise, grey in colour, and the label of each pixel of the depth."""
        spec = camera_specs()["hand"]
        lens, world = spec.depth_intrinsics(), self._graph.world_frame_id()
        query = self._graph.get_query_output_port().Eval(self._context)
        clean = query.RenderDepthImage(depth_render_camera(lens, _RENDERER, spec.depth_range_m), world, X_WC)
        labels = query.RenderLabelImage(colour_render_camera(lens, _RENDERER), world, X_WC)
        grey = np.full((lens.height, lens.width), 128, np.uint8)
        noisy = DepthDegrader(rng, lens, spec.depth_range_m, DepthNoise()).depth(
            np.asarray(clean.data[..., 0], dtype=np.float32), grey
        )
        frames = FrameTree({spec.frame: ("odom", X_WC)})
        image = Image(0.0, spec.name, spec.frame, lens, lens, np.dstack([grey] * 3), grey, noisy, frames)
        return image, np.array(labels.data[..., 0], dtype=np.int16)


def furnished(rng: np.random.Generator, *, for_training: bool) -> Table:
    """Table with random objects of the classes and others, clear of each other."""
    objects, taken = list[Placed](), list[tuple[FloatArray, float]]()
    for _ in range(OBJECTS):
        category = str(rng.choice(DISTRACTORS if rng.random() < OTHERS else NAMES[:-1]))
        model = instance(category, int(rng.choice(numbers(category, for_training=for_training)[:80])))
        rest = choose_pose(rng, model, resting_poses(model))
        reach_m = float(np.linalg.norm((model.surface.points @ rest.R.T)[:, :2], axis=1).max())
        for _ in range(40):
            xy = rng.uniform(-1.0, 1.0, 2) * (np.array(TABLE_M[:2]) / 2 - 0.08)
            if all(float(np.linalg.norm(xy - p)) > reach_m + size_m + APART_M for p, size_m in taken):
                taken.append((xy, reach_m))
                R = RotationMatrix.MakeZRotation(float(rng.uniform(0, 2 * np.pi))).matrix() @ rest.R
                X_WO = RigidTransform(RotationMatrix.ProjectToRotationMatrix(R), [*xy, HEIGHT_M + rest.height_m])
                objects.append(Placed(model, X_WO))
                break
    return Table(objects)


def clusters_of(seed: int, number: int, *, for_training: bool = True) -> list[tuple[str, FloatArray]]:
    """Classes and features of the clusters in several views of one scene."""
    rng = np.random.default_rng([seed, number, 31])
    table = furnished(rng, for_training=for_training)
    x, y = TABLE_M[0] / 2, TABLE_M[1] / 2
    surface = Surface("table", ((-x, -y), (x, -y), (x, y), (-x, y)), HEIGHT_M)
    found = list[tuple[str, FloatArray]]()
    for k in range(VIEWS if table.objects else 0):
        aim = np.array(table.objects[k % len(table.objects)].X_WO.translation())
        turn, tilt, far_m = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 1.0), rng.uniform(0.35, 1.4)
        eye = aim + far_m * np.array([np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)])
        aim = aim + rng.normal(0.0, 0.05, 3)
        image, labels = table.image(rng, look_at(eye, aim))
        view = segment_surface(image, RigidTransform(), surface)
        if view is not None:
            found += _labelled(table, split_touching(view, eye).clusters, labels, eye)
    return found


def _labelled(
    table: Table, clusters: Iterable[Cluster], labels: NDArray[np.int16], eye: FloatArray
) -> Iterator[tuple[str, FloatArray]]:
    """Classes and features of the clusters in one view that lie on one object and are whole."""
    height, width = labels.shape
    for cluster in clusters:
        u0, v0, u1, v1 = cluster.box
        if min(u0, v0, width - 1 - u1, height - 1 - v1) < 2:
            continue
        own = labels[cluster.points.pixels[:, 1], cluster.points.pixels[:, 0]]
        own = own[(own >= 0) & (own < len(table.objects))]
        if len(own) < _LEAST_OWN * len(cluster.points):
            continue
        label = int(np.bincount(own).argmax())
        if np.mean(own == label) > _LEAST_OWN:
            category = table.objects[label].model.category
            yield category if category in NAMES else ANY_OBJECT, cluster.features(eye)


def fit(x: FloatArray, y: NDArray[np.int64], seed: int) -> ShapeModel:
    """Fits the network to features (N, F) and classes (N,) as indices of `NAMES`."""
    rng, mean, scale = np.random.default_rng(seed), x.mean(axis=0), x.std(axis=0) + 1e-6
    z, one_hot = (x - mean) / scale, np.eye(len(NAMES))[y]
    sizes = ((x.shape[1] + 1, HIDDEN), (HIDDEN + 1, len(NAMES)))
    cut = sizes[0][0] * HIDDEN

    def loss(w: FloatArray) -> tuple[float, FloatArray]:
        a, b = w[:cut].reshape(sizes[0]), w[cut:].reshape(sizes[1])
        h = np.tanh(z @ a[:-1] + a[-1])
        logits = h @ b[:-1] + b[-1]
        logits = logits - logits.max(axis=1, keepdims=True)
        p = np.exp(logits)
        p /= p.sum(axis=1, keepdims=True)
        error = (p - one_hot) / len(z)
        back = (error @ b[:-1].T) * (1.0 - h**2)
        grad_b = np.vstack([h.T @ error, error.sum(axis=0)]) + DECAY * b
        grad_a = np.vstack([z.T @ back, back.sum(axis=0)]) + DECAY * a
        cross = -float(np.mean(np.log(np.maximum((p * one_hot).sum(axis=1), 1e-12))))
        return cross + 0.5 * DECAY * float(w @ w), np.concatenate([grad_a.ravel(), grad_b.ravel()])

    w = minimize(loss, rng.normal(0, 0.2, cut + sizes[1][0] * sizes[1][1]), jac=True, method="L-BFGS-B").x
    shares = np.maximum(one_hot.mean(axis=0), 1e-3)
    return ShapeModel(NAMES, mean, scale, w[:cut].reshape(sizes[0]), w[cut:].reshape(sizes[1]), shares)


def table_of(found: Iterable[Sequence[tuple[str, FloatArray]]]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Features (N, F) and classes (N,) of the clusters of several scenes."""
    rows = [row for scene in found for row in scene]
    return np.array([x for _, x in rows]), np.array([NAMES.index(name) for name, _ in rows], dtype=np.int64)


def accuracy(model: ShapeModel, x: FloatArray, y: NDArray[np.int64]) -> float:
    """Share of the clusters whose class is the likeliest by shape and share."""
    p = np.array([[*model.likelihoods(row).values()] for row in x]) * model.shares
    return float(np.mean(p.argmax(axis=1) == y))


def write(model: ShapeModel, file: Path) -> None:
    """Writes a model, from which `shape_model` reads it."""
    arrays = {key: getattr(model, key).astype(np.float32) for key in ("mean", "scale", "hidden", "output", "shares")}
    np.savez_compressed(file, names=np.array(model.names), **arrays)


def main(argv: Sequence[str] | None = None) -> int:
    """Renders clusters, fits the model and writes it."""
    parser = argparse.ArgumentParser(
        prog="python -m errand_train.detector.shape", description="Trains the shape model."
    )
    parser.add_argument("--scenes", type=int, default=240, help="number of tables (default: 240)")
    parser.add_argument("--seed", type=int, default=1, help="sets objects, views and first weights (default: 1)")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: 2)")
    parser.add_argument("--out", type=Path, default=MODEL_FILE, help="file of the model (default: the robot's own)")
    options = parser.parse_args(argv)
    with ProcessPoolExecutor(options.jobs, get_context("spawn")) as pool:
        found = [*pool.map(partial(clusters_of, options.seed), range(options.scenes))]
        held = range(options.scenes, options.scenes + max(1, options.scenes // 5))
        held_out = [*pool.map(partial(clusters_of, options.seed, for_training=False), held)]
    model = fit(*table_of(found), options.seed)
    write(model, options.out)
    x, y = table_of(held_out)
    known = f"of {len(y)} held-out clusters {accuracy(model, x, y):.0%} are known by shape alone"
    sys.stdout.write(f"{sum(map(len, found))} clusters; {known}\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
