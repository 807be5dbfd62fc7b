"""How well AprilTags are found and placed in the pictures of a robot's own cameras, in the plant's flat.

`python -m tests.benchmarks.tags --camera hand --size 0.1 --distance 2.5 --tilt 45 --seed 1` sets up plates at
random places of the flat. It takes pictures from that distance, with the face of the tag turned away from the line of
sight by that angle, anywhere in the middle of the picture, by the plant's light and noise. It prints the share that is
found, and the errors of position and rotation (median, 95 %).
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.geometry import QueryObject
from pydrake.math import RigidTransform, RotationMatrix

from executive.app.worlds import open_world
from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.models.builder.tags import write_plate
from plant.rendering import RENDERER, render_parameters
from plant.robots.spot.description import CAMERAS
from plant.sensors.camera_spec import CameraSpec, colour_render_camera, depth_render_camera, load_cameras
from plant.sensors.noise import DepthDegrader, DepthNoise, PictureDegrader, PictureNoise
from skills.perception.fiducials import SeenTag, find_tags
from skills.robot import FrameTree, Image

VIEWS_OF_A_PLATE = 20
MOST_TAG = 586
TRIES = 1000
FRONT = RotationMatrix(np.diag([1.0, -1.0, -1.0]))
"""Rotation of a tag that faces the camera upright."""


@dataclass(frozen=True)
class Setting:
    """Camera, size and distance of the tag (m), and angle of its face to the line of sight (degrees)."""

    camera: str
    size_m: float
    distance_m: float
    tilt_deg: float


@dataclass(frozen=True)
class Sight:
    """One view of a tag: whether it was found, the errors of its pose (m, degrees) and how sure it is."""

    found: bool
    off_m: float = np.nan
    off_deg: float = np.nan
    error_px: float = np.nan
    ambiguity: float = np.nan


def sights(setting: Setting, views: int, seed: int) -> Iterator[Sight]:
    """Views of random tags; the same for the same seed."""
    rng, spec = np.random.default_rng([seed, 11]), load_cameras(CAMERAS)[setting.camera]
    world = open_world("flat")
    for first in range(0, views, VIEWS_OF_A_PLATE):
        tag, place = int(rng.integers(MOST_TAG + 1)), rng.uniform((8.0, 2.2, 0.7), (8.4, 3.6, 1.3))
        X_WT = RigidTransform(RotationMatrix.MakeZRotation(float(rng.uniform(-0.6, 0.6))) @ UPRIGHT, place)
        with tempfile.TemporaryDirectory(prefix="errand-tag-") as folder:
            plate = LooseModel("plate", write_plate(Path(folder), tag, setting.size_m), X_WT, fixed=True)
            parameters = render_parameters()
            built = build_diagram(
                DiagramConfig(world.directives_path, [plate], visuals=False, renderer_parameters=parameters)
            )
            assert built.scene is not None
            query = built.scene.query_at(built.plant.GetPositions(built.plant.CreateDefaultContext()))
            for _ in range(min(VIEWS_OF_A_PLATE, views - first)):
                tried = (X_WT @ _seen_from(rng, spec, setting).inverse() for _ in range(TRIES))
                X_WC = next(X for X in tried if _in_room(X.translation()))
                image = _picture(rng, query, spec, X_WC, built.scene_graph.world_frame_id())
                yield _judged(find_tags(image, {tag: setting.size_m}), X_WT)


def _in_room(p_W: NDArray[np.float64]) -> bool:
    """Whether a camera is in the living room, no lower and no higher than a robot's."""
    return bool(np.all(p_W > (7.7, 0.3, 0.3)) and np.all(p_W < (11.7, 5.1, 1.6)))


UPRIGHT = RotationMatrix(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
"""Rotation of an upright tag that looks along x."""


def _seen_from(rng: np.random.Generator, spec: CameraSpec, setting: Setting) -> RigidTransform:
    """Pose X_CT of a tag at a random place in the middle of the picture, tilted in a random direction and turned."""
    lens, about = spec.intrinsics(), float(rng.uniform(0.0, 2.0 * np.pi))
    u, v = rng.uniform(0.2, 0.8, 2) * (lens.width, lens.height)
    ray = np.array([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, 1.0])
    ray /= np.linalg.norm(ray)
    aside = np.cross([0.0, 0.0, 1.0], ray)
    towards = RotationMatrix(AngleAxis(float(np.arcsin(np.linalg.norm(aside))), aside / np.linalg.norm(aside)))
    tilt = RotationMatrix(AngleAxis(np.radians(setting.tilt_deg), np.array([np.cos(about), np.sin(about), 0.0])))
    turn = RotationMatrix.MakeZRotation(float(rng.uniform(0.0, 2.0 * np.pi)))
    return RigidTransform(towards @ tilt @ FRONT @ turn, setting.distance_m * ray)


def _picture(
    rng: np.random.Generator, query: QueryObject, spec: CameraSpec, X_WC: RigidTransform, world: object
) -> Image:
    """Picture with depth as the plant's camera takes it."""
    lens, fine = spec.depth_intrinsics(), spec.intrinsics()
    clean = np.ascontiguousarray(
        query.RenderColorImage(colour_render_camera(fine, RENDERER), world, X_WC).data[..., :3]
    )
    colour = PictureDegrader(rng, fine.height, fine.width, PictureNoise(), spec.picture_shrink).colour(clean)
    grey = np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    rendered = query.RenderDepthImage(depth_render_camera(lens, RENDERER, spec.depth_range_m), world, X_WC)
    small: NDArray[np.uint8] = np.asarray(cv2.resize(grey, (lens.width, lens.height)), dtype=np.uint8)
    clean_m = np.asarray(rendered.data[..., 0], dtype=np.float32)
    depth = DepthDegrader(rng, lens, spec.depth_range_m, DepthNoise()).depth(clean_m, small)
    return Image(0.0, spec.name, spec.frame, fine, lens, colour, grey, depth, FrameTree({spec.frame: ("odom", X_WC)}))


def _judged(found: tuple[SeenTag, ...], X_WT: RigidTransform) -> Sight:
    if not found:
        return Sight(False)
    off = X_WT.inverse() @ found[0].X_OT
    angle = float(np.degrees(off.rotation().ToAngleAxis().angle()))
    return Sight(True, float(np.linalg.norm(off.translation())), angle, found[0].error_px, found[0].ambiguity)


def summary(seen: list[Sight]) -> dict[str, float]:
    """Share found, and medians and 95th percentiles of the errors."""
    found = [each for each in seen if each.found]
    figures = {"views": len(seen), "found": len(found) / len(seen)}
    for name in ("off_m", "off_deg", "error_px", "ambiguity"):
        values = [getattr(each, name) for each in found] or [np.nan]
        figures |= {
            f"{name}_50": round(float(np.median(values)), 4),
            f"{name}_95": round(float(np.percentile(values, 95)), 4),
        }
    return figures


def main() -> None:
    """Measure, and print the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--camera", default="hand")
    parser.add_argument("--size", type=float, default=0.1)
    parser.add_argument("--distance", type=float, default=2.5)
    parser.add_argument("--tilt", type=float, default=45.0)
    parser.add_argument("--views", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    setting = Setting(args.camera, args.size, args.distance, args.tilt)
    sys.stdout.write(json.dumps({**vars(args), **summary(list(sights(setting, args.views, args.seed)))}) + "\n")


if __name__ == "__main__":
    main()
