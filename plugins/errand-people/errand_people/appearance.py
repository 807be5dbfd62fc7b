"""Perception of a person's pose, gesture and colour of clothes, from pictures with depth of one camera at rest.

The head of an upright person is a blob as wide as a head above shoulders; its height tells who stands and who sits.
Points beside the head, or far beside the shoulders, are an arm; face and hair tell which. Who lies is long and low.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform
from scipy import ndimage

from errand_people.looks import Appearance, Colour, Gesture, Pose
from skills.perception.point_cloud import PointCloud, camera_pose_W, cloud_from_image, project
from skills.robot import FloatArray, Image

PICTURES_S: Final = (0.0, 0.3, 0.6, 0.9, 1.2)
"""Times of the pictures of a look, in which a waving hand goes there and back."""
HEIGHTS_M: Final = (1.2, 0.45)
"""Heights at which the camera looks, the second one for people who do not stand or sit."""
_AROUND_M, _CELL_M, _STRIDE = 1.5, 0.05, 3
_HEAD_M, _HEAD_WIDTH_M = 0.20, (0.10, 0.25)
_NARROW_M, _ASIDE_M, _NEAR_M, _BEHIND_M = 0.2, 0.16, 0.6, 0.06
"""Least width of shoulders, how far the torso's middle may be beside the head's, and the head from the expected place;
how far its axis is behind its surface."""
_GAP_M, _LEVEL_M, _FILLED = (0.115, 0.155), 0.17, 0.1
"""Distances from the middle of a head at which nothing as far away is beside it, difference of what is as far, and the
part of the head's points that may be there."""
_HIGHER: Final = 0.4
"""Part of its height by which a blob may be farther beside its shoulders than a lower one."""
_STANDS_M, _SITS_M = (1.57, 2.1), (0.98, 1.51)
"""Heights of the top of the head of people who stand, and who sit."""
_LIES_NEAR_M: Final = 1.0
"""Largest distance of the middle of a body from a place where its face or hand is seen."""
_LONG_M, _WIDE_M, _THICK_M = (1.2, 2.1), (0.25, 0.95), (0.12, 0.45)
"""Lengths, widths, and heights of a body above the bed or floor on which it lies."""
_SKIN_M, _PATCH_M = (0.05, 1.9), 0.45
"""Heights of faces and hands, and the largest size of a patch of skin."""
_FEWEST: Final = 12
_STILL_M, _MOVES_M = 0.05, 0.09
"""Largest motion of a hand that is at rest, and least of one that waves."""
_NOT_SIDEWAYS_M: Final = 0.07
_ARM_M, _ARM_MOVES_M, _UP_M, _THIN_M = 0.95, 0.45, -0.18, 0.25
"""Largest distance of a hand from the axis of the head, its largest motion, the height from which it is raised, and
the largest thickness of an arm that is held out."""
_ALIKE: Final = 22.0
"""Largest difference of colours (CIE Lab, lightness less) of the same clothes."""
_DARK, _PALE, _VIVID, _PREVAILS = 58, 55, 85, 0.6
"""Limits (0 to 255) of black, of white and grey, and of vivid colours; the least share of a colour that prevails."""
_LIGHT, _UNCLEAR, _SKIN_V = 0.82, 0.06, 200.0
"""Brightness of clothes between grey and white, as a fraction of a face's, and how near to it they are not clear; the
usual brightness of a face."""
_HUES: Final[dict[Colour, tuple[int, int]]] = {
    Colour.RED: (172, 5),
    Colour.ORANGE: (7, 18),
    Colour.YELLOW: (21, 35),
    Colour.GREEN: (40, 88),
    Colour.BLUE: (96, 132),
}
"""Ranges of hue, of 180, from one colour to the next."""


@dataclass(frozen=True)
class _Head:
    """Top of a head (m), and the vertical axis (x, y) through it."""

    top_m: float
    axis_W: FloatArray


class Look:
    """A look at a person near a place (x, y): pictures from one position of the robot, the camera lower if need be."""

    def __init__(self, place_W: Sequence[float] | FloatArray) -> None:
        self.place_W = np.asarray(place_W, dtype=np.float64)
        self.result, self._looks = Appearance(), 0

    @property
    def next_height_m(self) -> float | None:
        """Height of the point at which the camera is to look next; None when the look is over."""
        return None if self.result.pose is not None or self._looks == len(HEIGHTS_M) else HEIGHTS_M[self._looks]

    def add(self, images: Sequence[Image], X_WO: RigidTransform) -> None:
        """Adds a series of pictures from one pose, of which the first has colour."""
        found, place_W = appearance_of(images, X_WO, self.place_W)
        self._looks += 1
        if found.pose is not None:
            self.result, self.place_W = found, place_W


def appearance_of(images: Sequence[Image], X_WO: RigidTransform, place_W: FloatArray) -> tuple[Appearance, FloatArray]:
    """Appearance of the person near a place (x, y), and the axis of their head or the middle of their body (x, y)."""
    camera_W = camera_pose_W(images[0], X_WO).translation()
    clouds = [_cloud(image, X_WO, place_W) for image in images]
    head = _head(clouds[0].p_W, place_W, camera_W)
    if head is None:
        body = _lying(clouds[0], place_W)
        if body is None:
            return Appearance(), place_W
        return Appearance(Pose.LYING, Gesture.NONE, _colour(body[1])), np.asarray(body[0].p_W[:, :2].mean(axis=0))
    off = clouds[0].p_W - [*head.axis_W, head.top_m]
    r = np.hypot(off[:, 0], off[:, 1])
    torso = clouds[0].where((r < 0.25) & (off[:, 2] > -0.74) & (off[:, 2] < -0.42))
    gesture = _gesture(clouds, head, camera_W) if _shows_arms(images[0], X_WO, head, camera_W) else None
    face = clouds[0].where((r < 0.17) & (off[:, 2] > -0.25) & _is_skin(clouds[0].colours))
    skin_v = float(np.median(_hsv(face.colours)[:, 2])) if len(face) >= _FEWEST else None
    return Appearance(_upright(head.top_m), gesture, _colour(torso, skin_v)), head.axis_W


def candidates(image: Image, X_WO: RigidTransform) -> list[tuple[float, float]]:
    """Places (x, y) of patches of skin in a picture, which may be faces or hands."""
    cloud = cloud_from_image(_thinned(image), X_WO, heights_m=(_SKIN_M[0], _SKIN_M[1]))
    p_W = cloud.p_W[_is_skin(cloud.colours)]
    if not len(p_W):
        return []
    cells = np.floor(p_W[:, :2] / _CELL_M).astype(np.int64)
    cells -= cells.min(axis=0)
    grid = np.zeros(cells.max(axis=0) + 1, dtype=bool)
    grid[tuple(cells.T)] = True
    labels, count = ndimage.label(grid, np.ones((3, 3)))
    of_points = labels[tuple(cells.T)]
    patches = [p_W[of_points == label] for label in range(1, count + 1)]
    small = [patch for patch in patches if len(patch) >= _FEWEST / 2 and np.ptp(patch, axis=0).max() < _PATCH_M]
    return [(float(x), float(y)) for x, y, _ in (patch.mean(axis=0) for patch in small)]


def _thinned(image: Image) -> Image:
    """Picture with the depth of every third row and column only."""
    thin = np.zeros_like(image.depth_m)
    thin[::_STRIDE, ::_STRIDE] = image.depth_m[::_STRIDE, ::_STRIDE]
    return replace(image, depth_m=thin)


def _cloud(image: Image, X_WO: RigidTransform, place_W: FloatArray) -> PointCloud:
    """Points around a place, of every third row and column of the depth."""
    if not image.grey.size:
        image = replace(image, grey=np.zeros((image.intrinsics.height, image.intrinsics.width), np.uint8))
    cloud = cloud_from_image(_thinned(image), X_WO, heights_m=(0.03, 2.4))
    return cloud.where(np.linalg.norm(cloud.p_W[:, :2] - place_W, axis=1) < _AROUND_M)


def _head(p_W: FloatArray, place_W: FloatArray, camera_W: FloatArray) -> _Head | None:
    """Blob of a head's size high above shoulders, near a place; None when there is none."""
    high = p_W[(p_W[:, 2] > _SITS_M[0]) & (p_W[:, 2] < _STANDS_M[1])]
    if not len(high):
        return None
    along = place_W - camera_W[:2]
    along /= np.linalg.norm(along)
    across = np.array([along[1], -along[0]])
    cells = np.floor(high[:, :2] / _CELL_M).astype(np.int64)
    _, index = np.unique(cells, axis=0, return_inverse=True)
    tops = ndimage.maximum_position(high[:, 2], index.ravel(), np.arange(index.max() + 1))
    best: tuple[float, _Head] | None = None
    for row in (int(each[0]) for each in tops):
        off = p_W - high[row]
        r, u, z = np.hypot(off[:, 0], off[:, 1]), off[:, :2] @ across, off[:, 2]
        crown = (r < _HEAD_M) & (z > -0.22)
        if np.any(z[r < 0.12] > 0.02) or np.count_nonzero(crown) < _FEWEST:
            continue
        ends = np.percentile(u[crown], (3, 97))
        beside = np.abs(u - ends.mean())
        depth = off[:, :2] @ along
        level = np.abs(depth - np.median(depth[crown])) < _LEVEL_M
        gap = level & (r < 0.4) & (z > -0.18) & (beside > _GAP_M[0]) & (beside < _GAP_M[1])
        if np.count_nonzero(gap) > _FILLED * np.count_nonzero(crown):
            continue
        shoulders = (beside < 0.36) & (r < 0.42) & (z < -0.32) & (z > -0.52)
        torso = (beside < 0.36) & (r < 0.42) & (z < -0.42) & (z > -0.7)
        if not _HEAD_WIDTH_M[0] < ends[1] - ends[0] < _HEAD_WIDTH_M[1]:
            continue
        if min(np.count_nonzero(shoulders), np.count_nonzero(torso)) < 2 * _FEWEST:
            continue
        wide = np.percentile(u[shoulders], (3, 97))
        aside_m = max(abs(wide.mean() - ends.mean()), abs(float(np.median(u[torso])) - ends.mean()))
        axis_W = high[row, :2] + ends.mean() * across + (np.median(depth[crown]) + _BEHIND_M) * along
        if wide[1] - wide[0] < _NARROW_M or aside_m > _ASIDE_M or np.linalg.norm(axis_W - place_W) > _NEAR_M:
            continue
        badness = aside_m - _HIGHER * float(high[row, 2])
        if best is None or badness < best[0]:
            best = (badness, _Head(float(high[row, 2]), axis_W))
    return None if best is None else best[1]


def _upright(top_m: float) -> Pose | None:
    """Pose of a person by the height of the top of the head."""
    if _STANDS_M[0] < top_m < _STANDS_M[1]:
        return Pose.STANDING
    return Pose.SITTING if _SITS_M[0] < top_m < _SITS_M[1] else None


def _shows_arms(image: Image, X_WO: RigidTransform, head: _Head, camera_W: FloatArray) -> bool:
    """Returns whether a picture shows what is beside and above a head, with nothing in front."""
    along = (head.axis_W - camera_W[:2]) / np.linalg.norm(head.axis_W - camera_W[:2])
    across = np.array([along[1], -along[0]])
    corners = [
        [*(head.axis_W + side * across), head.top_m + up] for side in (-0.5, 0.0, 0.5) for up in (-0.4, -0.2, 0.05)
    ]
    p_C = camera_pose_W(image, X_WO).inverse().multiply(np.array(corners).T).T
    lens = image.depth_intrinsics
    u, v = (each.astype(int) for each in project(p_C, lens))
    if np.any((u < 0) | (u >= lens.width) | (v < 0) | (v >= lens.height)):
        return False
    window = image.depth_m[v.min() : v.max() + 1, u.min() : u.max() + 1]
    return bool(np.mean((window > 0.0) & (window < p_C[:, 2].mean() - 0.75)) < 0.05)


def _gesture(clouds: Sequence[PointCloud], head: _Head, camera_W: FloatArray) -> Gesture | None:
    """Gesture of a person from several clouds, of which the first has colours; None when it is not sure."""
    own = _clothes_and_skin(clouds[0], head)
    first = _arms(clouds[0], head, own)
    if first is not None and not first:
        first = _arms(clouds[0], head, own, attached=True)
    later = [_arms(cloud, head, None) for cloud in clouds[1:]]
    if first is None or any(each is None for each in later):
        return None
    if not first:
        return Gesture.NONE
    if len(first) > 1:
        return None
    (arm,) = first
    track = [arm]
    for arms in later if arm[2] > _UP_M else ():
        near = [each for each in arms or () if np.linalg.norm(each - arm) < _ARM_MOVES_M]
        if not near:
            return None
        track.append(min(near, key=lambda each: float(np.linalg.norm(each - arm))))
    motion_m = float(np.ptp(np.array(track)[:, :2], axis=0).max())
    if motion_m > _STILL_M:
        return Gesture.WAVING if motion_m > _MOVES_M and arm[2] > _UP_M else None
    forward = _facing(clouds[0], head, camera_W)
    left_m = 0.0 if forward is None else float(arm[:2] @ [-forward[1], forward[0]])
    if abs(left_m) < _NOT_SIDEWAYS_M:
        return None
    if arm[2] > _UP_M:
        return Gesture.RAISING_LEFT_ARM if left_m > 0 else Gesture.RAISING_RIGHT_ARM
    return Gesture.POINTING_LEFT if left_m > 0 else Gesture.POINTING_RIGHT


def _arms(
    cloud: PointCloud, head: _Head, own: NDArray[np.bool_] | None, *, attached: bool = False
) -> list[FloatArray] | None:
    """Middles (3,) of what is raised or held out, from the top of the head; None when something may be such an arm.

    Only thin pieces count, and where the points of clothes and skin are known (`own`), only those. `attached`
    parts them from all others, such as a wall that a hand touches, and a piece must begin at the body.
    """
    off = cloud.p_W - [*head.axis_W, head.top_m]
    r = np.hypot(off[:, 0], off[:, 1])
    near = np.flatnonzero((off[:, 2] > -0.62) & (r < _ARM_M + 0.1) & (own if attached else True))
    off, r = off[near], r[near]
    cells = np.floor(off / 0.06).astype(np.int64)
    cells -= cells.min(axis=0, initial=0)
    grid = np.zeros(cells.max(axis=0, initial=0) + 1, dtype=bool)
    grid[tuple(cells.T)] = True
    labels, _ = ndimage.label(grid, np.ones((3, 3, 3)))
    of_points = labels[tuple(cells.T)]
    up = (off[:, 2] > _UP_M) & (r > 0.19)
    aside = (off[:, 2] > -0.52) & (off[:, 2] <= _UP_M) & (r > 0.47)
    found = list[FloatArray]()
    for label in np.unique(of_points[up | aside]):
        piece = of_points == label
        rows = np.flatnonzero(piece & up)
        if len(rows) < _FEWEST:
            rows = np.flatnonzero(piece & aside)
        if len(rows) < _FEWEST or (attached and not np.any(r[piece] < 0.25)):
            continue
        if own is not None and np.mean(own[near[rows]]) < 0.5:
            continue
        thin = np.ptp(np.percentile(off[rows, 2], (4, 96))) < _THIN_M or off[rows, 2].min() > _UP_M
        if own is None or (thin and r[rows].max() < _ARM_M):
            found.append(off[rows].mean(axis=0))
        elif np.any(r[piece] < 0.2):
            return None
    return found


def _clothes_and_skin(cloud: PointCloud, head: _Head) -> NDArray[np.bool_]:
    """Mask of the points in the colours of a person's skin and upper clothing."""
    off = cloud.p_W - [*head.axis_W, head.top_m]
    torso = (np.hypot(off[:, 0], off[:, 1]) < 0.25) & (off[:, 2] > -0.74) & (off[:, 2] < -0.42)
    lab = cv2.cvtColor(cloud.colours.reshape(1, -1, 3), cv2.COLOR_RGB2LAB)[0].astype(np.float64)
    alike = np.linalg.norm((lab - np.median(lab[torso], axis=0)) * [0.4, 1.0, 1.0], axis=1) < _ALIKE
    return np.asarray(alike | _is_skin(cloud.colours))


def _facing(cloud: PointCloud, head: _Head, camera_W: FloatArray) -> FloatArray | None:
    """Direction (x, y) in which a person looks, from the hair to the face; None without a face in view."""
    off = cloud.p_W - [*head.axis_W, head.top_m]
    near = (np.hypot(off[:, 0], off[:, 1]) < 0.17) & (off[:, 2] > -0.22) & (off[:, 2] < -0.05)
    face = _is_skin(cloud.colours)
    skin, hair = off[near & face][:, :2], off[near & ~face][:, :2]
    if len(skin) < 0.15 * (len(skin) + len(hair)) or len(skin) < _FEWEST:
        return None
    ahead = skin.mean(axis=0) - hair.mean(axis=0) if len(hair) > _FEWEST / 2 else camera_W[:2] - head.axis_W
    return np.asarray(ahead / np.linalg.norm(ahead))


def _is_skin(colours: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Mask of colours of skin: bright, and of a reddish hue without being vivid."""
    h, s, v = (each.astype(int) for each in _hsv(colours).T)
    return np.asarray((h > 2) & (h < 20) & (s > 40) & (s < 150) & (v > 100))


def _hsv(colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.cvtColor(colours.reshape(1, -1, 3), cv2.COLOR_RGB2HSV)[0], dtype=np.uint8)


def _lying(cloud: PointCloud, place_W: FloatArray) -> tuple[PointCloud, PointCloud] | None:
    """Points of a long, low body near a place, and those of its upper clothing; None when there is none."""
    p_W = cloud.p_W
    counts, edges = np.histogram(p_W[:, 2], bins=np.arange(0.0, 0.8, 0.02))
    for base_m in (*edges[np.argsort(-counts)[:6]], 0.0):
        above = p_W[:, 2] - base_m
        rows = np.flatnonzero((above > _THICK_M[0]) & (above < _THICK_M[1]))
        if len(rows) < 8 * _FEWEST:
            continue
        cells = np.floor((p_W[rows, :2] - place_W + 2.0) / 0.06).astype(np.int64)
        grid = np.zeros((70, 70), dtype=bool)
        grid[tuple(cells.T)] = True
        labels, count = ndimage.label(grid, np.ones((3, 3)))
        of_rows = labels[tuple(cells.T)]
        for label in range(1, count + 1):
            body = cloud.where(np.isin(np.arange(len(p_W)), rows[of_rows == label]))
            middle = body.p_W[:, :2].mean(axis=0)
            if len(body) < 8 * _FEWEST or np.linalg.norm(middle - place_W) > _LIES_NEAR_M:
                continue
            _, _, axes = np.linalg.svd(body.p_W[:, :2] - middle, full_matrices=False)
            along, across = axes @ (p_W[:, :2] - middle).T
            own = np.isin(np.arange(len(p_W)), rows[of_rows == label])
            low, high = np.percentile(along[own], (1, 99))
            if (
                _LONG_M[0] < high - low < _LONG_M[1]
                and _WIDE_M[0] < np.ptp(np.percentile(across[own], (2, 98))) < _WIDE_M[1]
            ):
                spine = (np.abs(across) < 0.2) & (above > 0.06)
                return body, cloud.where(spine & _chest(_is_skin(cloud.colours) & spine, along, low, high))
    return None


def _chest(skin: NDArray[np.bool_], along: FloatArray, low_m: float, high_m: float) -> NDArray[np.bool_]:
    """Mask of the points a little below the head, which is at the end with skin; empty where the face is not seen."""
    from_ends = (along - low_m, high_m - along)
    shown = [np.count_nonzero(skin & (each < 0.25) & (each > -0.4)) for each in from_ends]
    if max(shown) < _FEWEST / 2 or min(shown) > 0.5 * max(shown):
        return np.zeros(len(skin), dtype=bool)
    from_head = from_ends[int(np.argmax(shown))]
    return np.asarray((from_head > 0.3) & (from_head < 0.5))


def _colour(cloud: PointCloud, skin_v: float | None = None) -> Colour | None:
    """Colour of most points of clothes; None when there are too few, or no colour prevails.

    `skin_v` is the brightness of the person's face (0 to 255), with which white and grey are compared.
    """
    if len(cloud) < 4 * _FEWEST:
        return None
    h, s, v = (each.astype(int) for each in _hsv(cloud.colours).T)
    dark, pale = v < _DARK, s < _PALE
    bright = float(np.median(v)) / (_SKIN_V if skin_v is None else skin_v) - _LIGHT
    votes: dict[Colour, float] = {
        Colour.BLACK: float(np.mean(dark)),
        Colour.WHITE: float(np.mean(~dark & pale)) if bright > _UNCLEAR else 0.0,
        Colour.GREY: float(np.mean(~dark & pale)) if bright < -_UNCLEAR else 0.0,
    }
    for colour, (low, high) in _HUES.items():
        hue = (h >= low) & (h <= high) if low < high else (h >= low) | (h <= high)
        votes[colour] = float(np.mean(~dark & ~pale & (s > _VIVID) & hue))
    best = max(votes, key=lambda colour: votes[colour])
    return best if votes[best] > _PREVAILS else None
