"""The scene's proximity shapes as plain arrays, for ray casting.

Every shape is a row: a kind, half extents (3,) along its own axes, and its pose in the frame of its body. Oriented
bounding boxes replace meshes and convex hulls; a very wide box below the surface replaces a half space.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    GeometryId,
    GeometrySet,
    HalfSpace,
    Role,
    SceneGraphInspector,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, ModelInstanceIndex
from pydrake.systems.framework import Context

from skills.robot import FloatArray

Row = tuple["ShapeKind", FloatArray, RigidTransform]

HALF_SPACE_HALF_WIDTH_M = 500.0
BAND_M = (0.05, 1.8)
"""Shapes between these heights are obstacles for a person."""
_ROUND_SIDES = 16


class ShapeKind(enum.IntEnum):
    """Kind of a shape, which determines the ray intersection."""

    BOX = 0
    CYLINDER = 1
    CAPSULE = 2
    ELLIPSOID = 3


@dataclass(frozen=True)
class ShapeArrays:
    """N shapes: kinds (N,), half extents (N, 3), rotations R_FG (N, 3, 3) and positions p_FG (N, 3) in a frame F."""

    kinds: NDArray[np.int64]
    half_extents_m: FloatArray
    rotations: FloatArray
    positions_m: FloatArray

    @staticmethod
    def from_rows(rows: list[Row]) -> ShapeArrays:
        """Stacks rows of (kind, half extents, X_FG)."""
        return ShapeArrays(
            kinds=np.array([kind for kind, _, _ in rows], dtype=np.int64),
            half_extents_m=np.array([half for _, half, _ in rows], dtype=np.float64).reshape(-1, 3),
            rotations=np.array([X.rotation().matrix() for _, _, X in rows], dtype=np.float64).reshape(-1, 3, 3),
            positions_m=np.array([X.translation() for _, _, X in rows], dtype=np.float64).reshape(-1, 3),
        )


class RayScene:
    """Proximity shapes of a plant, without those of excluded model instances, for `cast_rays`.

    `poses_BG` are poses (N, 3, 4) in the frames of the shapes' bodies, `bodies` the rows (N,) of these in `body_poses`.
    Row 0 is the world, to which anchored bodies belong.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        inspector: SceneGraphInspector,
        exclude_instances: Collection[ModelInstanceIndex] = (),
    ) -> None:
        """Reads the shapes of a finalized plant that is registered with the inspector's scene graph."""
        excluded = {int(instance) for instance in exclude_instances}
        default_context = plant.CreateDefaultContext()
        rows: list[Row] = []
        bodies: list[int] = []
        row_of = {int(plant.world_body().index()): 0}
        for geometry in inspector.GetGeometryIds(GeometrySet(inspector.GetAllGeometryIds()), Role.kProximity):
            body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
            if body is None or int(body.model_instance()) in excluded:
                continue
            kind, half, X_BG = shape_row(inspector, geometry)
            if plant.IsAnchored(body):
                X_BG, body = plant.EvalBodyPoseInWorld(default_context, body) @ X_BG, plant.world_body()
            rows.append((kind, half, X_BG))
            bodies.append(row_of.setdefault(int(body.index()), len(row_of)))
        shapes = ShapeArrays.from_rows(rows)
        self.kinds, self.half_extents_m = shapes.kinds, shapes.half_extents_m
        self.poses_BG = np.concatenate([shapes.rotations, shapes.positions_m[..., None]], axis=2)
        self.bodies = np.array(bodies, dtype=np.int64)
        self._plant, self._bodies = plant, [plant.get_body(BodyIndex(index)) for index in row_of]

    def body_poses(self, plant_context: Context) -> FloatArray:
        """Poses (bodies, 3, 4) in the world of the bodies with shapes, at the context's state."""
        return np.array([self._plant.EvalBodyPoseInWorld(plant_context, each).GetAsMatrix34() for each in self._bodies])


def shape_row(inspector: SceneGraphInspector, geometry: GeometryId) -> Row:
    """Row (kind, half extents, X_FG) of one geometry in its frame F. Raises ValueError for an unbounded shape."""
    shape, X_FG = inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry)
    maker = _MAKERS.get(type(shape))
    if maker is not None:
        kind, half = maker(shape)
        return kind, np.asarray(half, dtype=np.float64), X_FG
    if isinstance(shape, HalfSpace):
        half_width = HALF_SPACE_HALF_WIDTH_M
        return ShapeKind.BOX, np.array([half_width, half_width, 1.0]), X_FG @ RigidTransform(np.array([0.0, 0.0, -1.0]))
    box = inspector.GetObbInGeometryFrame(geometry)
    if box is None:
        raise ValueError(f"{inspector.GetName(geometry)}: the lidar has no bounding box for a {type(shape).__name__}")
    return ShapeKind.BOX, np.asarray(box.half_width(), dtype=np.float64), X_FG @ box.pose()


_MAKERS: Mapping[type[Shape], Callable[..., tuple[ShapeKind, Sequence[float]]]] = {
    Box: lambda shape: (ShapeKind.BOX, shape.size() / 2.0),
    Cylinder: lambda shape: (ShapeKind.CYLINDER, (shape.radius(), shape.radius(), shape.length() / 2.0)),
    Capsule: lambda shape: (ShapeKind.CAPSULE, (shape.radius(), shape.radius(), shape.length() / 2.0 + shape.radius())),
    Sphere: lambda shape: (ShapeKind.ELLIPSOID, (shape.radius(),) * 3),
    Ellipsoid: lambda shape: (ShapeKind.ELLIPSOID, (shape.a(), shape.b(), shape.c())),
}


def outlines_W(
    plant: MultibodyPlant, inspector: SceneGraphInspector, band_m: tuple[float, float] = BAND_M
) -> Iterator[tuple[GeometryId, FloatArray]]:
    """Yields the shapes of a finalized plant that are fixed to the world and reach into the band, with their outlines.

    An outline (K, 2) is that from above.
    """
    context = plant.CreateDefaultContext()
    for body in (plant.get_body(BodyIndex(index)) for index in range(plant.num_bodies())):
        if not plant.IsAnchored(body):
            continue
        X_WB = plant.EvalBodyPoseInWorld(context, body)
        for geometry in plant.GetCollisionGeometriesForBody(body):
            kind, half_m, X_BG = shape_row(inspector, geometry)
            corners_W = (X_WB @ X_BG).multiply((_unit_corners(kind) * half_m).T).T
            if corners_W[:, 2].max() > band_m[0] and corners_W[:, 2].min() < band_m[1]:
                outline = cv2.convexHull(corners_W[:, :2].astype(np.float32))
                yield geometry, outline.reshape(-1, 2).astype(np.float64)


def _unit_corners(kind: ShapeKind) -> FloatArray:
    """Corner points (N, 3) around a shape with half extents of 1."""
    turn = np.arange(_ROUND_SIDES) * math.tau / _ROUND_SIDES
    ring = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], dtype=np.float64)
    if kind is not ShapeKind.BOX:
        ring = np.column_stack([np.cos(turn), np.sin(turn)])
    return np.vstack([np.column_stack([ring, np.full(len(ring), z)]) for z in (-1.0, 1.0)])
