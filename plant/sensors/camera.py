"""A camera on a link of a robot: colour or grey pictures and depth, with noise."""

from __future__ import annotations

from collections import Counter

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import ColorRenderCamera, FrameId, QueryObject

from plant.sensors.camera_spec import CameraSpec, colour_render_camera, depth_render_camera
from plant.sensors.noise import DepthDegrader, DepthNoise, NoisySensor, PictureDegrader, PictureNoise
from skills.robot import FrameTree, Image

_FAINT = 4
_NO_PICTURE = np.zeros((0, 0), dtype=np.uint8)
_NO_DEPTH = np.zeros((0, 0), dtype=np.float32)


class Camera(NoisySensor):
    """Camera of one robot; the same seed and the same order of pictures give the same noise."""

    def __init__(
        self,
        spec: CameraSpec,
        link_frame: FrameId,
        rng: np.random.Generator,
        *,
        renderer: str = "vtk",
        work: Counter[str] | None = None,
        picture_noise: PictureNoise | None = None,
        depth_noise: DepthNoise | None = None,
    ) -> None:
        """`link_frame` is the geometry frame of the link (`MultibodyPlant.GetBodyFrameIdOrThrow`).

        `work` counts the rendered pictures by size.
        """
        super().__init__(rng)
        self._work = Counter() if work is None else work
        self.spec = spec
        self._link_frame, self._X_LC = link_frame, spec.X_link_camera()
        picture, depth = spec.intrinsics(), spec.depth_intrinsics()
        self._colour_camera = colour_render_camera(picture, renderer)
        self._depth_camera = depth_render_camera(depth, renderer, spec.depth_range_m)
        self._faint_camera = colour_render_camera(spec.shrunk(_FAINT * spec.depth_shrink), renderer)
        self._picture = PictureDegrader(
            rng, picture.height, picture.width, picture_noise or PictureNoise(), spec.picture_shrink
        )
        self._depth = DepthDegrader(rng, depth, spec.depth_range_m, depth_noise or DepthNoise())

    def take(
        self,
        query_object: QueryObject,
        stamp_s: float,
        frames: FrameTree,
        *,
        visual: bool = True,
        depth: bool = True,
    ) -> Image:
        """Takes a picture, its depth, or both; `frames` is the robot's frame tree at the same time.

        The array of the part that is not taken is empty.
        """
        colour = self._picture.colour(self._render(query_object, self._colour_camera)) if visual else None
        grey = _NO_PICTURE if colour is None else _grey(colour)
        return Image(
            stamp_s=stamp_s,
            source=self.spec.name,
            camera_frame=self.spec.frame,
            intrinsics=self.spec.intrinsics(),
            depth_intrinsics=self.spec.depth_intrinsics(),
            colour=colour if self.spec.colour else None,
            grey=grey,
            depth_m=self._take_depth(query_object, grey) if depth else _NO_DEPTH,
            frames=frames,
        )

    def _take_depth(self, query_object: QueryObject, grey: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Renders noisy depth; without a picture, a small one shows the spots that are too dark or too shiny."""
        lens = self.spec.depth_intrinsics()
        seen = grey if grey.size else _grey(self._render(query_object, self._faint_camera))
        small = seen if seen.shape == (lens.height, lens.width) else cv2.resize(seen, (lens.width, lens.height))
        self._work[f"depth_pictures_{lens.width}x{lens.height}"] += 1
        image = query_object.RenderDepthImage(self._depth_camera, self._link_frame, self._X_LC)
        clean_m = np.asarray(image.data[..., 0], dtype=np.float32)  # 0 or infinite out of range
        return self._depth.depth(clean_m, np.asarray(small, dtype=np.uint8))

    def _render(self, query_object: QueryObject, camera: ColorRenderCamera) -> NDArray[np.uint8]:
        """Renders the clean picture (H, W, 3) RGB."""
        info = camera.core().intrinsics()
        self._work[f"pictures_{info.width()}x{info.height()}"] += 1
        image = query_object.RenderColorImage(camera, self._link_frame, self._X_LC)
        return np.ascontiguousarray(image.data[..., :3])


def _grey(colour: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
