"""The scene's proximity shapes as plain arrays, for ray casting.

Every shape is a row: a kind, half extents (3,) along its own axes, and its pose in the frame of its body. Oriented
bounding boxes replace meshes and convex hulls; a very wide box below the surface replaces a half space.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

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
from pydrake.multibody.tree import ModelInstanceIndex, RigidBody
from pydrake.systems.framework import Context

from skills.robot import FloatArray

Row = tuple["ShapeKind", FloatArray, RigidTransform]

HALF_SPACE_HALF_WIDTH_M = 500.0


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

    def __len__(self) -> int:
        return len(self.kinds)

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
    """Proximity shapes of a plant, without those of excluded model instances, at the poses in a context.

    Shapes on anchored bodies are placed once; the others follow their bodies.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        inspector: SceneGraphInspector,
        exclude_instances: Collection[ModelInstanceIndex] = (),
    ) -> None:
        """Reads the shapes of a finalized plant that is registered with the inspector's scene graph."""
        self._plant = plant
        excluded = {int(instance) for instance in exclude_instances}
        default_context = plant.CreateDefaultContext()
        anchored: list[Row] = []
        moving: list[Row] = []
        self._bodies: list[RigidBody] = []
        body_slots: list[int] = []
        for geometry in inspector.GetGeometryIds(GeometrySet(inspector.GetAllGeometryIds()), Role.kProximity):
            body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
            if body is None or int(body.model_instance()) in excluded:
                continue
            row = shape_row(inspector, geometry)
            if plant.IsAnchored(body):
                X_WF = plant.EvalBodyPoseInWorld(default_context, body)
                anchored.append((row[0], row[1], X_WF @ row[2]))
            else:
                body_slots.append(self._slot(body))
                moving.append(row)
        self._anchored = ShapeArrays.from_rows(anchored)
        self._moving = ShapeArrays.from_rows(moving)
        self._body_slots = np.array(body_slots, dtype=np.int64)
        self._kinds = np.concatenate([self._anchored.kinds, self._moving.kinds])
        self._half_extents_m = np.concatenate([self._anchored.half_extents_m, self._moving.half_extents_m])

    def world_shapes(self, plant_context: Context) -> ShapeArrays:
        """Returns all shapes in the world frame at the context's state."""
        if not len(self._moving):
            return self._anchored
        poses = [self._plant.EvalBodyPoseInWorld(plant_context, body).GetAsMatrix34() for body in self._bodies]
        R_WF, p_WF = (np.array(poses)[:, :, part][self._body_slots] for part in (slice(3), 3))
        moved_p = np.einsum("nij,nj->ni", R_WF, self._moving.positions_m) + p_WF
        return ShapeArrays(
            self._kinds,
            self._half_extents_m,
            np.concatenate([self._anchored.rotations, R_WF @ self._moving.rotations]),
            np.concatenate([self._anchored.positions_m, moved_p]),
        )

    def _slot(self, body: RigidBody) -> int:
        """Index of a moving body in the list of bodies; adds a new body to the list."""
        for slot, known in enumerate(self._bodies):
            if known.index() == body.index():
                return slot
        self._bodies.append(body)
        return len(self._bodies) - 1


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
