"""Specifications of a robot's cameras: pose, intrinsics and depth range, read from a YAML file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field, ValidationError, field_validator
from pydrake.math import RigidTransform, RollPitchYaw

from skills.inputs.schema import Strict
from skills.inputs.yaml_source import YamlSource, read_yaml
from skills.robot import Intrinsics

if TYPE_CHECKING:
    from pydrake.geometry import ColorRenderCamera, DepthRenderCamera, RenderCameraCore

FAR_M = 40.0
NEAR_M = 0.05


class CameraSpec(Strict):
    """One camera. Its pose is in `link`: z forward, x right, y down; the intrinsics are those of the full picture.

    `picture_shrink` and `depth_shrink` divide the resolution of the picture and of the depth, which share the pose.
    """

    name: str
    link: str
    colour: bool
    rpy_deg: tuple[float, float, float]
    xyz_m: tuple[float, float, float]
    width: int = Field(gt=0)
    height: int = Field(gt=0)
    fx: float = Field(gt=0)
    fy: float = Field(gt=0)
    cx: float
    cy: float
    picture_shrink: int = Field(default=1, ge=1)
    depth_shrink: int = Field(default=1, ge=1)
    depth_range_m: tuple[float, float] = (0.3, 4.0)

    @field_validator("depth_range_m")
    @classmethod
    def _ordered(cls, value: tuple[float, float]) -> tuple[float, float]:
        if not NEAR_M <= value[0] < value[1] <= FAR_M:
            raise ValueError(f"must be two increasing distances between {NEAR_M} and {FAR_M}")
        return value

    @property
    def frame(self) -> str:
        """Name of the camera in the frame tree."""
        return f"{self.name}_camera"

    def X_link_camera(self) -> RigidTransform:
        """Pose of the camera in its link."""
        return RigidTransform(RollPitchYaw(np.radians(self.rpy_deg)), np.array(self.xyz_m))

    def intrinsics(self) -> Intrinsics:
        """Intrinsics of the picture."""
        return self.shrunk(self.picture_shrink)

    def depth_intrinsics(self) -> Intrinsics:
        """Intrinsics of the depth."""
        return self.shrunk(self.depth_shrink)

    def shrunk(self, factor: int) -> Intrinsics:
        """Intrinsics of the same view with 1 / factor of the pixels on each side."""
        return Intrinsics(
            width=self.width // factor,
            height=self.height // factor,
            fx=self.fx / factor,
            fy=self.fy / factor,
            cx=(self.cx + 0.5) / factor - 0.5,
            cy=(self.cy + 0.5) / factor - 0.5,
        )


def load_cameras(path: Path) -> dict[str, CameraSpec]:
    """Reads camera specs by name, in the file's order. Raises InputError with file, line, camera and field."""
    source = read_yaml(path)
    if not isinstance(source.data, dict):
        raise source.error(
            (), "it holds no mapping from camera names to their data", "see plant/robots/spot/cameras.yaml"
        )
    return {name: _spec(source, name, entry) for name, entry in source.data.items()}


def _spec(source: YamlSource, name: str, entry: object) -> CameraSpec:
    """Validates the data of one camera. Raises InputError when a field is missing or wrong."""
    if not isinstance(entry, dict):
        raise source.error((name,), f"camera {name}: should be a mapping of keys to values", "correct it")
    try:
        return CameraSpec(name=name, **entry)
    except (ValidationError, TypeError) as error:
        first = error.errors()[0] if isinstance(error, ValidationError) else {"loc": (), "msg": "its keys are no words"}
        where = ".".join(map(str, first["loc"]))
        raise source.error((name, *first["loc"]), f"camera {name}: {where}: {first['msg']}", "correct it") from error


def colour_render_camera(
    intrinsics: Intrinsics, renderer: str, *, near_m: float = NEAR_M, far_m: float = FAR_M
) -> ColorRenderCamera:
    """Drake's colour camera with these intrinsics; clips surfaces nearer than near_m and farther than far_m."""
    from pydrake.geometry import ColorRenderCamera

    return ColorRenderCamera(_core(intrinsics, renderer, near_m, far_m), False)


def depth_render_camera(intrinsics: Intrinsics, renderer: str, range_m: tuple[float, float]) -> DepthRenderCamera:
    """Drake's depth camera with these intrinsics and this range."""
    from pydrake.geometry import DepthRange, DepthRenderCamera

    return DepthRenderCamera(_core(intrinsics, renderer, NEAR_M / 2.0, range_m[1] + 1.0), DepthRange(*range_m))


def _core(intrinsics: Intrinsics, renderer: str, near_m: float, far_m: float) -> RenderCameraCore:
    from pydrake.geometry import ClippingRange, RenderCameraCore
    from pydrake.systems.sensors import CameraInfo

    info = CameraInfo(  # the renderer counts the principal point from the pixel's corner, Intrinsics from its centre
        width=intrinsics.width,
        height=intrinsics.height,
        focal_x=intrinsics.fx,
        focal_y=intrinsics.fy,
        center_x=intrinsics.cx + 0.5,
        center_y=intrinsics.cy + 0.5,
    )
    return RenderCameraCore(renderer, info, ClippingRange(near_m, far_m), RigidTransform())
