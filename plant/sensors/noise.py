"""Sensor noise: a random generator for each sensor, and the degradation of clean pictures and depth images.

Grain is a random crop of a tile drawn once from the seed, because a million normals for every picture would cost more
than rendering it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from plant.saved_state import Stateful
from skills.robot import Intrinsics


class NoisySensor(Stateful, saved=("noise",)):
    """A sensor with its own random generator; the generator's state is saved."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    @property
    def noise(self) -> Mapping[str, Any]:
        """State of the random generator."""
        return self._rng.bit_generator.state

    @noise.setter
    def noise(self, state: Mapping[str, Any]) -> None:
        self._rng.bit_generator.state = state


ColourArray = NDArray[np.uint8]
DepthArray = NDArray[np.float32]

_TILE_MARGIN = 64


@dataclass(frozen=True)
class PictureNoise:
    """Grain (standard deviation in counts of 255), blur (pixels of the full picture) and vignetting."""

    grain: float = 2.5
    blur_px: float = 0.6
    vignette: float = 0.15


@dataclass(frozen=True)
class DepthNoise:
    """Depth errors: sigma = `sigma_m` + `sigma_per_m` z^2; holes at edges, grazing angles, dark and shiny spots.

    `edge_m`, `edge_share` and `edge_loss`: a step between neighbours above `edge_m` + `edge_share` z is an edge, where
    this fraction of the pixels is lost. `grazing`: a surface within asin of this from the ray's direction is lost.
    `dark` and `shiny`: grey values beyond which patches are lost. `speck`: fraction of pixels that are lost anywhere.
    """

    sigma_m: float = 0.0015
    sigma_per_m: float = 0.0012
    edge_m: float = 0.02
    edge_share: float = 0.03
    edge_loss: float = 0.6
    grazing: float = 0.1
    dark: float = 18.0
    shiny: float = 250.0
    speck: float = 0.002


class NoiseTile:
    """Tile of standard normal grain, larger than the picture, cropped at a random position for each picture."""

    def __init__(self, rng: np.random.Generator, height: int, width: int, channels: int = 1) -> None:
        """Draws the tile for pictures of height x width x channels."""
        self._rng, self._height, self._width = rng, height, width
        shape = (height + _TILE_MARGIN, width + _TILE_MARGIN, channels)
        self._tile = rng.standard_normal(shape, dtype=np.float32)

    def crop(self) -> NDArray[np.float32]:
        """Returns grain (height, width, channels), a view that must not be written."""
        top, left = self._rng.integers(0, _TILE_MARGIN, 2)
        return self._tile[top : top + self._height, left : left + self._width]


class PictureDegrader:
    """Degrades clean colour pictures of one size: blur, vignette and grain."""

    def __init__(self, rng: np.random.Generator, height: int, width: int, noise: PictureNoise, shrink: int = 1) -> None:
        """`shrink` is the ratio of the sensor's size to the picture's; it divides the blur."""
        self._noise, self._sigma = noise, noise.blur_px / shrink
        self._grain = NoiseTile(rng, height, width, 3)
        y, x = (axis.astype(np.float32) for axis in np.ogrid[0:height, 0:width])
        radius2 = ((x - width / 2) ** 2 + (y - height / 2) ** 2) / ((width / 2) ** 2 + (height / 2) ** 2)
        self._gain = np.repeat((1.0 - noise.vignette * radius2)[..., None], 3, axis=2).astype(np.float32)

    def colour(self, clean: ColourArray) -> ColourArray:
        """Returns a noisy (H, W, 3) uint8 picture."""
        blurred = cv2.GaussianBlur(clean, (3, 3), self._sigma)
        lit = cv2.multiply(blurred, self._gain, dtype=cv2.CV_32F)
        noisy = cv2.scaleAdd(self._grain.crop(), self._noise.grain, lit)
        return np.asarray(cv2.convertScaleAbs(np.maximum(noisy, 0.0, out=noisy)), dtype=np.uint8)


class DepthDegrader:
    """Degrades clean depth images of one size: noise, holes and range limits."""

    def __init__(
        self, rng: np.random.Generator, intrinsics: Intrinsics, range_m: tuple[float, float], noise: DepthNoise
    ) -> None:
        """Depth outside range_m becomes 0."""
        self._rng, self._noise, self._range = rng, noise, range_m
        self._intrinsics = intrinsics
        self._grain = NoiseTile(rng, intrinsics.height, intrinsics.width)
        self._patches = NoiseTile(rng, intrinsics.height // 8 + 1, intrinsics.width // 8 + 1)

    def depth(self, clean_m: DepthArray, grey: ColourArray | None) -> DepthArray:
        """Returns noisy depth (H, W) in m, rounded to 1 mm, 0 where lost; `grey` (H, W) shows dark and shiny spots."""
        near, far = self._range
        valid = np.isfinite(clean_m) & (clean_m >= near) & (clean_m <= far)
        z = np.where(valid, clean_m, np.float32(0.0)).astype(np.float32)
        grain = self._grain.crop()[..., 0]
        noisy = z + grain * (self._noise.sigma_m + self._noise.sigma_per_m * z * z)
        edge = self._edge(z)
        lost = edge & (self._rng.random(z.shape, dtype=np.float32) < self._noise.edge_loss)
        lost |= ~edge & self._grazing(z)
        lost |= False if grey is None else self._unseen(grey)
        keep = valid & ~lost & (noisy >= near) & (noisy <= far)
        keep &= self._rng.random(z.shape, dtype=np.float32) >= self._noise.speck
        return np.where(keep, np.round(noisy, 3), np.float32(0.0)).astype(np.float32)

    def _edge(self, z: DepthArray) -> NDArray[np.bool_]:
        """Mask of the pixels at steps in depth that are steeper than any visible surface and exceed the noise."""
        kernel = np.ones((3, 3), dtype=np.uint8)
        step = cv2.dilate(z, kernel) - cv2.erode(z, kernel)
        steepest = 2.0 / (self._intrinsics.fx * self._noise.grazing)
        return np.asarray(step > self._noise.edge_m + (self._noise.edge_share + steepest) * z)

    def _grazing(self, z: DepthArray) -> NDArray[np.bool_]:
        """Mask of the pixels whose surface is nearly parallel to the ray."""
        dx = cv2.Sobel(z, cv2.CV_32F, 1, 0, ksize=3, scale=self._intrinsics.fx / 8.0)
        dy = cv2.Sobel(z, cv2.CV_32F, 0, 1, ksize=3, scale=self._intrinsics.fy / 8.0)
        return np.asarray(dx * dx + dy * dy > z * z / self._noise.grazing**2)

    def _unseen(self, grey: ColourArray) -> NDArray[np.bool_]:
        """Mask of the patches that are lost because they are dark or shiny."""
        patches = cv2.resize(self._patches.crop()[..., 0], (grey.shape[1], grey.shape[0]))
        return np.asarray(((grey < self._noise.dark) | (grey > self._noise.shiny)) & (patches > 0.0))
