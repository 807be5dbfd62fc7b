"""A spinning 16-beam LiDAR: rays against the scene's collision shapes, with range noise and lost returns.

The ray casting is compiled, one call per revolution. It tests shapes nearest first, and only on the columns (azimuths)
that their bounding boxes cover. It skips a column when all its rings end nearer than the shape begins: indoors walls
occlude most of the rest. Ranges are along the ray; `NO_RETURN_M` means no hit (finite, because the kernels use fast
arithmetic).
"""

from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import SceneGraphInspector
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex, RigidBody
from pydrake.systems.framework import Context

from plant.sensors.noise import NoiseTile, NoisySensor
from plant.sensors.ray_shapes import RayScene, ShapeArrays
from skills.robot import FloatArray, Scan

Rays = tuple[FloatArray, FloatArray, FloatArray]
"""Of one column, in a shape's frame: origin, the horizontal direction and up, (3,) each."""
FunctionT = TypeVar("FunctionT", bound=Callable[..., object])

NO_RETURN_M = 1.0e6
_EPS = 1.0e-9


def _compiled(function: FunctionT) -> FunctionT:
    """Compiles a function with numba: disk cache, fast arithmetic, no GIL; keeps the function's type."""
    return cast(FunctionT, numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")(function))


@_compiled
def cast_rays(
    kinds: NDArray[np.int64],
    half_extents: FloatArray,
    rotations_W: FloatArray,
    positions_W: FloatArray,
    R_WL: FloatArray,
    p_WL: FloatArray,
    elevations: FloatArray,
    azimuths: FloatArray,
) -> FloatArray:
    """Casts rays from the lidar frame L to the shapes; returns ranges (azimuths, rings) in metres.

    `azimuths` are evenly spaced, increasing, and cover one turn from azimuths[0]; the shapes are in the world frame.
    """
    shapes, columns, rings = len(kinds), len(azimuths), len(elevations)
    ranges = np.full((columns, rings), NO_RETURN_M)
    farthest = np.full(columns, NO_RETURN_M)
    cos_e, sin_e = np.cos(elevations), np.sin(elevations)
    cos_a, sin_a = np.cos(azimuths), np.sin(azimuths)
    R_LG, p_LG, origin, nearest = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(shapes)
    for i in range(shapes):
        nearest[i] = _box_distance(rotations_W[i], positions_W[i], half_extents[i], p_WL)
    for i in np.argsort(nearest):
        R_WG, offset = rotations_W[i], positions_W[i] - p_WL
        for k in range(3):  # written out, because a call of BLAS takes longer than these products
            p_LG[k] = R_WL[0, k] * offset[0] + R_WL[1, k] * offset[1] + R_WL[2, k] * offset[2]
            for j in range(3):
                R_LG[k, j] = R_WL[0, k] * R_WG[0, j] + R_WL[1, k] * R_WG[1, j] + R_WL[2, k] * R_WG[2, j]
            origin[k] = -(R_WG[0, k] * offset[0] + R_WG[1, k] * offset[1] + R_WG[2, k] * offset[2])
        first, count = _columns_spanned(R_LG, p_LG, half_extents[i], azimuths)
        for k in range(count):
            column = (first + k) % columns
            if farthest[column] <= nearest[i]:
                continue
            across = R_LG[0] * cos_a[column] + R_LG[1] * sin_a[column]
            row = ranges[column]
            rays = (origin, across, R_LG[2])
            if kinds[i] == 0:
                _cast_box(row, rays, cos_e, sin_e, half_extents[i])
            elif kinds[i] == 1:
                _cast_cylinder(row, rays, cos_e, sin_e, half_extents[i])
            elif kinds[i] == 2:
                _cast_capsule(row, rays, cos_e, sin_e, half_extents[i])
            else:
                _cast_ellipsoid(row, rays, cos_e, sin_e, half_extents[i])
            farthest[column] = row.max()
    return ranges


@_compiled
def _box_distance(R_WG: FloatArray, p_WG: FloatArray, half: FloatArray, p_W: FloatArray) -> float:
    """Distance from a point to an oriented box, 0 inside."""
    total = 0.0
    for axis in range(3):
        along = 0.0
        for j in range(3):
            along += R_WG[j, axis] * (p_W[j] - p_WG[j])
        outside = max(abs(along) - half[axis], 0.0)
        total += outside * outside
    return float(np.sqrt(total))


@_compiled
def _columns_spanned(R_LG: FloatArray, p_LG: FloatArray, half: FloatArray, azimuths: FloatArray) -> tuple[int, int]:
    """First column and number of columns whose vertical plane may meet the box; all columns around the axis."""
    columns = len(azimuths)
    centre = np.arctan2(p_LG[1], p_LG[0])
    low, high = 0.0, 0.0
    for corner in range(8):
        sx = half[0] if corner & 1 else -half[0]
        sy = half[1] if corner & 2 else -half[1]
        sz = half[2] if corner & 4 else -half[2]
        x = p_LG[0] + R_LG[0, 0] * sx + R_LG[0, 1] * sy + R_LG[0, 2] * sz
        y = p_LG[1] + R_LG[1, 0] * sx + R_LG[1, 1] * sy + R_LG[1, 2] * sz
        angle = np.arctan2(y, x) - centre
        if angle > np.pi:
            angle -= 2.0 * np.pi
        elif angle < -np.pi:
            angle += 2.0 * np.pi
        low, high = min(low, angle), max(high, angle)
    if high - low >= np.pi - 1e-6:
        return 0, columns
    step = 2.0 * np.pi / columns
    first = int(np.ceil((centre + low - azimuths[0]) / step - 1e-6))
    last = int(np.floor((centre + high - azimuths[0]) / step + 1e-6))
    return first, max(0, last - first + 1)


@_compiled
def _cast_box(row: FloatArray, rays: Rays, cos_e: FloatArray, sin_e: FloatArray, half: FloatArray) -> None:
    """Shortens one column's ranges to a box; the loop has no branches, so that it is vectorised."""
    origin, across, up = rays
    ox, oy, oz = origin[0], origin[1], origin[2]
    hx, hy, hz = half[0], half[1], half[2]
    for ring in range(len(cos_e)):
        dx = cos_e[ring] * across[0] + sin_e[ring] * up[0]
        dy = cos_e[ring] * across[1] + sin_e[ring] * up[1]
        dz = cos_e[ring] * across[2] + sin_e[ring] * up[2]
        ix = 1.0 / (dx if abs(dx) > _EPS else _EPS)
        iy = 1.0 / (dy if abs(dy) > _EPS else _EPS)
        iz = 1.0 / (dz if abs(dz) > _EPS else _EPS)
        ax, bx = (-hx - ox) * ix, (hx - ox) * ix
        ay, by = (-hy - oy) * iy, (hy - oy) * iy
        az, bz = (-hz - oz) * iz, (hz - oz) * iz
        near = max(max(min(ax, bx), min(ay, by)), min(az, bz))
        far = min(min(max(ax, bx), max(ay, by)), max(az, bz))
        hit = near if (near <= far) & (near > 0.0) else NO_RETURN_M
        row[ring] = min(row[ring], hit)


@_compiled
def _cast_cylinder(row: FloatArray, rays: Rays, cos_e: FloatArray, sin_e: FloatArray, half: FloatArray) -> None:
    """Shortens one column's ranges to a cylinder along its z axis: its wall, cut by the slab between the caps."""
    origin, across, up = rays
    ox, oy, oz = origin[0], origin[1], origin[2]
    c = ox * ox + oy * oy - half[0] * half[0]
    for ring in range(len(cos_e)):
        dx = cos_e[ring] * across[0] + sin_e[ring] * up[0]
        dy = cos_e[ring] * across[1] + sin_e[ring] * up[1]
        dz = cos_e[ring] * across[2] + sin_e[ring] * up[2]
        a = max(dx * dx + dy * dy, 1e-12)
        b = ox * dx + oy * dy
        discriminant = b * b - a * c
        root = np.sqrt(max(discriminant, 0.0))
        iz = 1.0 / (dz if abs(dz) > _EPS else _EPS)
        az, bz = (-half[2] - oz) * iz, (half[2] - oz) * iz
        near = max((-b - root) / a, min(az, bz))
        far = min((-b + root) / a, max(az, bz))
        hit = near if (near <= far) & (near > 0.0) & (discriminant >= 0.0) else NO_RETURN_M
        row[ring] = min(row[ring], hit)


@_compiled
def _cast_ellipsoid(row: FloatArray, rays: Rays, cos_e: FloatArray, sin_e: FloatArray, half: FloatArray) -> None:
    """Shortens one column's ranges to an ellipsoid, by scaling space until it is the unit ball."""
    origin, across, up = rays
    ox, oy, oz = origin[0] / half[0], origin[1] / half[1], origin[2] / half[2]
    c = ox * ox + oy * oy + oz * oz - 1.0
    for ring in range(len(cos_e)):
        dx = (cos_e[ring] * across[0] + sin_e[ring] * up[0]) / half[0]
        dy = (cos_e[ring] * across[1] + sin_e[ring] * up[1]) / half[1]
        dz = (cos_e[ring] * across[2] + sin_e[ring] * up[2]) / half[2]
        a = dx * dx + dy * dy + dz * dz
        b = ox * dx + oy * dy + oz * dz
        discriminant = b * b - a * c
        near = (-b - np.sqrt(max(discriminant, 0.0))) / a
        hit = near if (discriminant >= 0.0) & (near > 0.0) else NO_RETURN_M
        row[ring] = min(row[ring], hit)


@_compiled
def _cast_capsule(row: FloatArray, rays: Rays, cos_e: FloatArray, sin_e: FloatArray, half: FloatArray) -> None:
    """Shortens one column's ranges to a capsule along its z axis: a cylinder and two spheres (half[2] includes one)."""
    origin, across, up = rays
    straight = half[2] - half[0]
    barrel = np.array([half[0], half[0], straight])
    ball = np.array([half[0], half[0], half[0]])
    end = np.array([0.0, 0.0, straight])
    _cast_cylinder(row, rays, cos_e, sin_e, barrel)
    _cast_ellipsoid(row, (origin - end, across, up), cos_e, sin_e, ball)
    _cast_ellipsoid(row, (origin + end, across, up), cos_e, sin_e, ball)


@dataclass(frozen=True)
class LidarSpec:
    """Beams and noise. The defaults are those of a Velodyne VLP-16 at 20 revolutions per second.

    `half_fov_rad`: elevations are evenly spaced over +- this. `dropout`: fraction of returns lost at random. `columns`:
    for a LiDAR with less than a full turn, they are centred ahead.
    """

    rings: int = 16
    half_fov_rad: float = float(np.radians(15.0))
    azimuth_step_rad: float = float(np.radians(0.4))
    min_range_m: float = 0.5
    max_range_m: float = 100.0
    sigma_m: float = 0.03
    dropout: float = 0.003
    columns: int | None = None

    def elevations_rad(self) -> NDArray[np.float64]:
        """Ring elevations (rings,), lowest first."""
        return np.linspace(-self.half_fov_rad, self.half_fov_rad, self.rings, dtype=np.float64)

    def azimuths_rad(self) -> NDArray[np.float64]:
        """Column azimuths over one turn from -pi, counter-clockwise from the lidar's x."""
        columns = round(2.0 * np.pi / self.azimuth_step_rad)
        return -np.pi + np.arange(columns, dtype=np.float64) * (2.0 * np.pi / columns)

    def visible_columns(self) -> slice:
        """Slice of the full turn's columns that the LiDAR sees."""
        turn = round(2.0 * np.pi / self.azimuth_step_rad)
        columns = turn if self.columns is None else self.columns
        first = (turn - columns + 1) // 2
        return slice(first, first + columns)


class Lidar(NoisySensor):
    """LiDAR of one robot, fixed to one of its bodies."""

    def __init__(
        self,
        plant: MultibodyPlant,
        inspector: SceneGraphInspector,
        body: RigidBody,
        X_BL: RigidTransform,
        rng: np.random.Generator,
        *,
        unseen: Collection[ModelInstanceIndex] | None = None,
        spec: LidarSpec | None = None,
        work: Counter[str] | None = None,
    ) -> None:
        """`plant` is finalized; beams pass `unseen` instances (None: the LiDAR's own); `work` counts the rays."""
        super().__init__(rng)
        self._work = Counter() if work is None else work
        self.spec = spec or LidarSpec()
        self._plant, self._body, self._X_BL = plant, body, X_BL
        self._scene = RayScene(plant, inspector, (body.model_instance(),) if unseen is None else unseen)
        self._elevations, self._turn = self.spec.elevations_rad(), self.spec.azimuths_rad()
        self._azimuths = self._turn[self.spec.visible_columns()]
        self._grain = NoiseTile(rng, len(self._elevations), len(self._azimuths))

    def scan(
        self, plant_context: Context, stamp_s: float, X_OB: RigidTransform, X_BL: RigidTransform | None = None
    ) -> Scan:
        """Takes one revolution at the context's state. `X_OB` is the odometry at the same time.

        `X_BL` is the LiDAR's pose in the body frame according to the robot, by default the mounted pose.
        """
        return self.revolution(plant_context, stamp_s, X_OB, X_BL)()

    def revolution(
        self, plant_context: Context, stamp_s: float, X_OB: RigidTransform, X_BL: RigidTransform | None = None
    ) -> Callable[[], Scan]:
        """Returns a function that computes a scan for the context's present state; call it once."""
        X_WL = self._plant.EvalBodyPoseInWorld(plant_context, self._body) @ self._X_BL
        shapes = self._scene.world_shapes(plant_context)
        return lambda: Scan(
            stamp_s=stamp_s,
            ranges_m=self._measured(self._ranges(shapes, X_WL)),
            elevations_rad=self._elevations,
            azimuths_rad=self._azimuths,
            X_BL=self._X_BL if X_BL is None else X_BL,
            X_OB=X_OB,
        )

    def true_ranges(self, plant_context: Context, X_WL: RigidTransform) -> NDArray[np.float32]:
        """Noise-free ranges (rings, azimuths) from a pose; `NO_RETURN_M` where a ray hits nothing."""
        return self._ranges(self._scene.world_shapes(plant_context), X_WL)

    def _ranges(self, shapes: ShapeArrays, X_WL: RigidTransform) -> NDArray[np.float32]:
        """Casts all rays of a revolution; returns ranges (rings, azimuths) in metres."""
        self._work["lidar_rays"] += len(self._elevations) * len(self._turn)
        ranges = cast_rays(
            shapes.kinds,
            shapes.half_extents_m,
            shapes.rotations,
            shapes.positions_m,
            np.ascontiguousarray(X_WL.rotation().matrix()),
            np.ascontiguousarray(X_WL.translation()),
            self._elevations,
            self._turn,
        )
        return np.ascontiguousarray(ranges.T[:, self.spec.visible_columns()], dtype=np.float32)

    def _measured(self, ranges_m: NDArray[np.float32]) -> NDArray[np.float32]:
        """Adds noise to ranges; lost returns and returns out of range become NaN."""
        spec = self.spec
        noisy = ranges_m + np.float32(spec.sigma_m) * self._grain.crop()[..., 0]
        lost = (noisy < spec.min_range_m) | (noisy > min(spec.max_range_m, NO_RETURN_M / 2.0))
        lost.reshape(-1)[self._rng.integers(0, lost.size, self._rng.binomial(lost.size, spec.dropout))] = True
        return np.where(lost, np.float32(np.nan), noisy)
