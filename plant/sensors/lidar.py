"""A spinning 16-beam LiDAR: rays against the scene's collision shapes, with range noise and lost returns.

The ray casting is compiled, one call per revolution. It tests shapes nearest first, and only on the columns (azimuths)
that their bounding boxes cover. It skips a column when all its rings end nearer than the shape begins: indoors walls
occlude most of the rest. Ranges are along the ray; `NO_RETURN_M` means no hit (finite, because the kernels use fast
arithmetic).
"""

from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial
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
from plant.sensors.ray_shapes import RayScene
from skills.robot import FloatArray, Scan

Vector = tuple[float, float, float]
Rays = tuple[Vector, Vector, Vector]
"""Of one column, in a shape's frame: origin, the horizontal direction and up."""
FunctionT = TypeVar("FunctionT", bound=Callable[..., object])

NO_RETURN_M = 1.0e6
_EPS = 1.0e-9


def _compiled(function: FunctionT, *, fastmath: bool = True) -> FunctionT:
    """Compiles a function with numba: disk cache, fast arithmetic, no GIL; keeps the function's type."""
    return cast(FunctionT, numba.njit(cache=True, nogil=True, fastmath=fastmath, error_model="numpy")(function))


@_compiled
def cast_rays(
    kinds: NDArray[np.int64],
    half_extents: FloatArray,
    poses_BG: FloatArray,
    bodies: NDArray[np.int64],
    poses_WB: FloatArray,
    X_WL: FloatArray,
    elevations: FloatArray,
    azimuths: FloatArray,
) -> FloatArray:
    """Casts rays from the lidar frame L to the shapes; returns ranges (azimuths, rings) in metres.

    Poses are (3, 4) matrices; `bodies` has the row in `poses_WB` of each shape's body. `azimuths` are evenly spaced,
    increasing, and cover one turn from azimuths[0].
    """
    shapes = len(kinds)
    columns, rings = len(azimuths), len(elevations)
    ranges = np.full((columns, rings), NO_RETURN_M)
    farthest = np.full(columns, NO_RETURN_M)
    cos_e, sin_e = np.cos(elevations), np.sin(elevations)
    cos_a, sin_a = np.cos(azimuths), np.sin(azimuths)
    poses_LG, origins, nearest = np.empty((shapes, 3, 4)), np.empty((shapes, 3)), np.empty(shapes)
    for i in range(shapes):
        _place(poses_BG[i], poses_WB[bodies[i]], X_WL, poses_LG[i])
        nearest[i] = _box_distance(poses_LG[i], half_extents[i], origins[i])
    for i in np.argsort(nearest):
        X_LG = poses_LG[i]
        half = (half_extents[i, 0], half_extents[i, 1], half_extents[i, 2])
        first, count = _columns_spanned(X_LG, half, azimuths)
        for k in range(first, first + count):
            column = k - columns * (k >= columns) + columns * (k < 0)
            if farthest[column] <= nearest[i]:
                continue
            c, s = cos_a[column], sin_a[column]
            across = (
                X_LG[0, 0] * c + X_LG[1, 0] * s,
                X_LG[0, 1] * c + X_LG[1, 1] * s,
                X_LG[0, 2] * c + X_LG[1, 2] * s,
            )
            origin, up = (origins[i, 0], origins[i, 1], origins[i, 2]), (X_LG[2, 0], X_LG[2, 1], X_LG[2, 2])
            rays, row = (origin, across, up), ranges[column]
            if kinds[i] == 0:
                _cast_box(row, rays, cos_e, sin_e, half)
            elif kinds[i] == 1:
                _cast_cylinder(row, rays, cos_e, sin_e, half)
            elif kinds[i] == 2:
                _cast_capsule(row, rays, cos_e, sin_e, half)
            else:
                _cast_ellipsoid(row, rays, cos_e, sin_e, half)
            longest = 0.0
            for ring in range(rings):
                longest = max(longest, row[ring])
            farthest[column] = longest
    return ranges


@_compiled
def _place(X_BG: FloatArray, X_WB: FloatArray, X_WL: FloatArray, X_LG: FloatArray) -> None:
    """Computes the pose of a shape in the lidar frame, in place."""
    for column in range(4):
        x, y, z = 0.0, 0.0, 0.0
        if column == 3:
            x, y, z = X_WB[0, 3] - X_WL[0, 3], X_WB[1, 3] - X_WL[1, 3], X_WB[2, 3] - X_WL[2, 3]
        for k in range(3):
            x += X_WB[0, k] * X_BG[k, column]
            y += X_WB[1, k] * X_BG[k, column]
            z += X_WB[2, k] * X_BG[k, column]
        for row in range(3):
            X_LG[row, column] = X_WL[0, row] * x + X_WL[1, row] * y + X_WL[2, row] * z


@_compiled
def _box_distance(X_LG: FloatArray, half: FloatArray, origin: FloatArray) -> float:
    """Distance from the lidar to an oriented box, 0 inside; writes its position in the box's frame to `origin`."""
    total = 0.0
    for axis in range(3):
        origin[axis] = -(X_LG[0, axis] * X_LG[0, 3] + X_LG[1, axis] * X_LG[1, 3] + X_LG[2, axis] * X_LG[2, 3])
        outside = max(abs(origin[axis]) - half[axis], 0.0)
        total += outside * outside
    return float(np.sqrt(total))


@_compiled
def _columns_spanned(X_LG: FloatArray, half: Vector, azimuths: FloatArray) -> tuple[int, int]:
    """First column and number of columns whose vertical plane may meet the box; all columns around the axis."""
    columns = len(azimuths)
    cx, cy = (X_LG[0, 3], X_LG[1, 3]) if np.hypot(X_LG[0, 3], X_LG[1, 3]) > _EPS else (1.0, 0.0)
    low, high = 0.0, 0.0
    left, right = (1.0, 0.0), (1.0, 0.0)
    for corner in range(8):
        sx = half[0] if corner & 1 else -half[0]
        sy = half[1] if corner & 2 else -half[1]
        sz = half[2] if corner & 4 else -half[2]
        x = X_LG[0, 3] + X_LG[0, 0] * sx + X_LG[0, 1] * sy + X_LG[0, 2] * sz
        y = X_LG[1, 3] + X_LG[1, 0] * sx + X_LG[1, 1] * sy + X_LG[1, 2] * sz
        ahead, aside = cx * x + cy * y, cx * y - cy * x
        turned = aside / max(abs(ahead) + abs(aside), _EPS * _EPS)
        if ahead < 0.0:
            turned = (2.0 if aside >= 0.0 else -2.0) - turned
        if turned > high:
            high, left = turned, (ahead, aside)
        elif turned < low:
            low, right = turned, (ahead, aside)
    low, high = np.arctan2(right[1], right[0]), np.arctan2(left[1], left[0])
    if high - low >= np.pi - 1e-6:
        return 0, columns
    step, centre = 2.0 * np.pi / columns, np.arctan2(cy, cx)
    first = int(np.ceil((centre + low - azimuths[0]) / step - 1e-6))
    last = int(np.floor((centre + high - azimuths[0]) / step + 1e-6))
    return first, max(0, last - first + 1)


@_compiled
def _cast_box(row: FloatArray, rays: Rays, cos_e: FloatArray, sin_e: FloatArray, half: Vector) -> None:
    """Shortens one column's ranges to a box; the loop has no branches, so that it is vectorised."""
    origin, across, up = rays
    ox, oy, oz = origin
    hx, hy, hz = half
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
def _cast_cylinder(row: FloatArray, rays: Rays, cos_e: FloatArray, sin_e: FloatArray, half: Vector) -> None:
    """Shortens one column's ranges to a cylinder along its z axis: its wall, cut by the slab between the caps."""
    origin, across, up = rays
    ox, oy, oz = origin
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
def _cast_ellipsoid(row: FloatArray, rays: Rays, cos_e: FloatArray, sin_e: FloatArray, half: Vector) -> None:
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
def _cast_capsule(row: FloatArray, rays: Rays, cos_e: FloatArray, sin_e: FloatArray, half: Vector) -> None:
    """Shortens one column's ranges to a capsule along its z axis: a cylinder and two spheres (half[2] includes one)."""
    origin, across, up = rays
    straight = half[2] - half[0]
    ball = (half[0], half[0], half[0])
    _cast_cylinder(row, rays, cos_e, sin_e, (half[0], half[0], straight))
    _cast_ellipsoid(row, ((origin[0], origin[1], origin[2] - straight), across, up), cos_e, sin_e, ball)
    _cast_ellipsoid(row, ((origin[0], origin[1], origin[2] + straight), across, up), cos_e, sin_e, ball)


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

    def revolution(
        self, plant_context: Context, stamp_s: float, X_OB: RigidTransform, X_BL: RigidTransform | None = None
    ) -> Callable[[], Scan]:
        """Returns a function that computes a scan for the context's present state; call it once.

        `X_OB` is the odometry at the same time, `X_BL` the LiDAR's pose in the body frame according to the robot (None:
        the mounted pose).
        """
        X_WL = self._plant.EvalBodyPoseInWorld(plant_context, self._body) @ self._X_BL
        poses_WB = self._scene.body_poses(plant_context)
        return lambda: Scan(
            stamp_s=stamp_s,
            ranges_m=self._measured(poses_WB, X_WL),
            elevations_rad=self._elevations,
            azimuths_rad=self._azimuths,
            X_BL=self._X_BL if X_BL is None else X_BL,
            X_OB=X_OB,
        )

    def _measured(self, poses_WB: FloatArray, X_WL: RigidTransform) -> NDArray[np.float32]:
        """Ranges (rings, azimuths) with noise; lost returns and returns out of range become NaN."""
        spec, scene, pose = self.spec, self._scene, np.ascontiguousarray(X_WL.GetAsMatrix34())
        self._work["lidar_rays"] += len(self._elevations) * len(self._turn)
        shapes, rays = (scene.kinds, scene.half_extents_m, scene.poses_BG, scene.bodies), (self._elevations, self._turn)
        ranges_m = cast_rays(*shapes, poses_WB, pose, *rays)[spec.visible_columns()]
        limits = np.float32(spec.min_range_m), np.float32(min(spec.max_range_m, NO_RETURN_M / 2.0))
        noisy = _with_noise(ranges_m, self._grain.crop()[..., 0], spec.sigma_m, limits)
        noisy.reshape(-1)[self._rng.integers(0, noisy.size, self._rng.binomial(noisy.size, spec.dropout))] = np.nan
        return noisy


@partial(_compiled, fastmath=False)
def _with_noise(
    ranges_m: FloatArray, grain: NDArray[np.float32], sigma_m: float, limits_m: tuple[np.float32, np.float32]
) -> NDArray[np.float32]:
    """Adds grain (rings, azimuths) to ranges (azimuths, rings), in single precision; NaN outside the limits."""
    columns, rings = ranges_m.shape
    noisy = np.empty((rings, columns), np.float32)
    for ring in range(rings):
        for column in range(columns):
            r = np.float32(ranges_m[column, ring]) + np.float32(sigma_m) * grain[ring, column]
            noisy[ring, column] = r if limits_m[0] <= r <= limits_m[1] else np.float32(np.nan)
    return noisy
