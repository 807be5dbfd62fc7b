"""A spinning 16-beam LiDAR: rays against the scene's collision shapes, with range noise and lost returns."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import SceneGraphInspector
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex, RigidBody
from pydrake.systems.framework import Context

from plant.sensors.camera_noise import NoiseTile
from plant.sensors.noisy import NoisySensor
from plant.sensors.ray_cast import NO_RETURN_M, cast_rays
from plant.sensors.ray_shapes import RayScene, ShapeArrays
from skills.robot import Scan


@dataclass(frozen=True)
class LidarSpec:
    """Beams and noise. The defaults are those of a Velodyne VLP-16 at 20 revolutions a second.

    Elevations run evenly over +- `half_fov_rad`; `dropout` is the share of returns lost at random. A LiDAR that does
    not see all around has `columns` about straight ahead.
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
        """Column azimuths over one turn from -pi on, counter-clockwise from the lidar's x."""
        columns = round(2.0 * np.pi / self.azimuth_step_rad)
        return -np.pi + np.arange(columns, dtype=np.float64) * (2.0 * np.pi / columns)

    def seen(self) -> slice:
        """Which of the columns it sees."""
        turn = round(2.0 * np.pi / self.azimuth_step_rad)
        columns = turn if self.columns is None else self.columns
        first = (turn - columns + 1) // 2
        return slice(first, first + columns)


class Lidar(NoisySensor):
    """The LiDAR of one robot, fixed to a body of it."""

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
        """Build for a finalized plant.

        `unseen` are the model instances that the beams pass through, by default the one that carries the lidar.
        The rays cast are counted in `work`.
        """
        super().__init__(rng)
        self._work = Counter() if work is None else work
        self.spec = spec or LidarSpec()
        self._plant, self._body, self._X_BL = plant, body, X_BL
        self._scene = RayScene(plant, inspector, (body.model_instance(),) if unseen is None else unseen)
        self._elevations, self._turn = self.spec.elevations_rad(), self.spec.azimuths_rad()
        self._azimuths = self._turn[self.spec.seen()]
        self._grain = NoiseTile(rng, len(self._elevations), len(self._azimuths))

    def scan(
        self, plant_context: Context, stamp_s: float, X_OB: RigidTransform, X_BL: RigidTransform | None = None
    ) -> Scan:
        """One revolution at the context's state. `X_OB` is the odometry at the same instant.

        `X_BL` is where the robot takes the lidar to be in its body frame, by default its pose on the body it is on.
        """
        return self.revolution(plant_context, stamp_s, X_OB, X_BL)()

    def revolution(
        self, plant_context: Context, stamp_s: float, X_OB: RigidTransform, X_BL: RigidTransform | None = None
    ) -> Callable[[], Scan]:
        """Computes such a scan when it is called, of the state that the context has now; to be called once."""
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
        """Ranges (rings, azimuths) without noise from a pose, `NO_RETURN_M` where nothing is hit."""
        return self._ranges(self._scene.world_shapes(plant_context), X_WL)

    def _ranges(self, shapes: ShapeArrays, X_WL: RigidTransform) -> NDArray[np.float32]:
        """Ranges to shapes in the world."""
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
        return np.ascontiguousarray(ranges.T[:, self.spec.seen()], dtype=np.float32)

    def _measured(self, ranges_m: NDArray[np.float32]) -> NDArray[np.float32]:
        """Ranges with noise; NaN where lost or out of range."""
        spec = self.spec
        noisy = ranges_m + np.float32(spec.sigma_m) * self._grain.crop()[..., 0]
        lost = (noisy < spec.min_range_m) | (noisy > min(spec.max_range_m, NO_RETURN_M / 2.0))
        lost.reshape(-1)[self._rng.integers(0, lost.size, self._rng.binomial(lost.size, spec.dropout))] = True
        return np.where(lost, np.float32(np.nan), noisy)
