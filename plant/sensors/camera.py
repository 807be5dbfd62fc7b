"""A camera on a robot's link: renders colour or grey and depth, as noisy as the real one."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import FrameId, QueryObject

from plant.sensors.camera_noise import DepthDegrader, DepthNoise, PictureDegrader, PictureNoise
from plant.sensors.camera_spec import CameraSpec, colour_render_camera, depth_render_camera
from plant.snapshot.values import State, restore_rng, rng_state
from skills.robot import FrameTree, Image


class Camera:
    """One camera of one robot. Deterministic for a seed and an order of pictures."""

    def __init__(
        self,
        spec: CameraSpec,
        link_frame: FrameId,
        rng: np.random.Generator,
        *,
        renderer: str = "vtk",
        picture_noise: PictureNoise | None = None,
        depth_noise: DepthNoise | None = None,
    ) -> None:
        """`link_frame` is the geometry frame of the link (`MultibodyPlant.GetBodyFrameIdOrThrow`)."""
        self.spec = spec
        self._link_frame, self._X_LC = link_frame, spec.X_link_camera()
        picture, depth = spec.intrinsics(), spec.depth_intrinsics()
        self._colour_camera = colour_render_camera(picture, renderer)
        self._depth_camera = depth_render_camera(depth, renderer, spec.depth_range_m)
        self._rng = rng
        self._picture = PictureDegrader(
            rng, picture.height, picture.width, picture_noise or PictureNoise(), spec.picture_shrink
        )
        self._depth = DepthDegrader(rng, depth, spec.depth_range_m, depth_noise or DepthNoise())

    def take(self, query_object: QueryObject, stamp_s: float, frames: FrameTree) -> Image:
        """A picture at the query object's state; `frames` is the robot's frame tree at that instant."""
        colour = self._picture.colour(self._render_colour(query_object))
        grey = np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        depth_size = (self.spec.depth_intrinsics().width, self.spec.depth_intrinsics().height)
        small_grey = grey if depth_size == grey.shape[::-1] else cv2.resize(grey, depth_size)
        return Image(
            stamp_s=stamp_s,
            source=self.spec.name,
            camera_frame=self.spec.frame,
            intrinsics=self.spec.intrinsics(),
            depth_intrinsics=self.spec.depth_intrinsics(),
            colour=colour if self.spec.colour else None,
            grey=grey,
            depth_m=self._depth.depth(self._render_depth(query_object), np.asarray(small_grey, dtype=np.uint8)),
            frames=frames,
        )

    def state(self) -> State:
        """What changes from one picture to the next."""
        return {"rng": rng_state(self._rng)}

    def restore(self, state: State) -> None:
        """Go on from such a state."""
        restore_rng(self._rng, state["rng"])

    def _render_colour(self, query_object: QueryObject) -> NDArray[np.uint8]:
        """The clean picture (H, W, 3) RGB."""
        image = query_object.RenderColorImage(self._colour_camera, self._link_frame, self._X_LC)
        return np.ascontiguousarray(image.data[..., :3])

    def _render_depth(self, query_object: QueryObject) -> NDArray[np.float32]:
        """The clean depth (H, W) in metres, 0 or infinite out of range."""
        image = query_object.RenderDepthImage(self._depth_camera, self._link_frame, self._X_LC)
        return np.asarray(image.data[..., 0], dtype=np.float32)
