"""What stands on a surface, whether the detector has a label for it or not.

Among objects of some classes, what was not named yet, or may be something else than was said, is worth a closer look.
Where any object is wanted (`THING`), each segment is one: under its label where a detection is joined to it, else as a
`THING` with pose and extent.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import reduce

import numpy as np

from skills.api import Detection, LocalisationEstimate, Surface
from skills.geometry import inside_polygon
from skills.perception.class_forms import THING, class_forms
from skills.perception.detection_3d import Detection3D, place_covariance
from skills.perception.point_cloud import camera_pose_W
from skills.perception.surface_segmentation import Cluster, SurfaceView, apart, cluster_of, parted
from skills.perception.tracker import SURE_SCORE, Track
from skills.robot import FloatArray, Image

_NAMED_WITHIN_M = 0.06
_SAME_PLACE_M = 0.05
_DOUBTED = 0.08
"""How likely something has to be of the classes that are looked for to be worth a closer look."""
_SMALLEST, _LARGEST = 0.4, 1.3
"""Shares of the shortest and the longest objects of a class, for clusters of which a part is hidden or merged."""
_SEGMENT_SCORE = 0.7
"""How likely a segment is an object: what one picture shows may be noise, or a part of one."""
_RIM_M, _BORDER_PX = 0.02, 2
_LONGEST_M = 0.6
_SIGMA_M = (0.012, 0.012, 0.008)
_FREE_M = 0.15
"""An object with so much space around it is free: more does not count."""


def segments_3d(
    image: Image,
    place: LocalisationEstimate,
    views: Iterable[SurfaceView],
    labelled: Sequence[Detection3D],
    surfaces: Sequence[Surface],
) -> tuple[Detection3D, ...]:
    """What stands on some surfaces without a label, as detections of `THING`.

    Left out are segments that the picture's edge cuts off, that stand beside the surface, such as a wall, or that are
    longer than 0.6 m. Objects that touch are parted by their labels, and by their outline.
    """
    outlines = {surface.name: surface.polygon_W for surface in surfaces}
    sure = [each for each in labelled if each.detection.score >= SURE_SCORE]
    p_WC = camera_pose_W(image, place.X_WO).translation()
    clusters = (cluster for view in views for cluster in _unlabelled(view, sure, p_WC))
    kept = (one for one in clusters if _stands_on(one, outlines[one.surface]) and not _is_cut_off(one, image))
    return tuple(_thing(one, image, place) for one in kept)


def _unlabelled(view: SurfaceView, labelled: Sequence[Detection3D], p_WC: FloatArray) -> Iterator[Cluster]:
    """The objects of a view to which no detection is joined."""
    view = apart(reduce(parted, labelled, view), p_WC)
    named = {id(cluster_of(view.clusters, each)) for each in labelled}
    return (cluster for cluster in view.clusters if id(cluster) not in named)


def _stands_on(cluster: Cluster, outline_W: tuple[tuple[float, float], ...]) -> bool:
    centre = np.array([cluster.shape.centre])
    return cluster.shape.length_m < _LONGEST_M and bool(inside_polygon(centre, outline_W, -_RIM_M)[0])


def _is_cut_off(cluster: Cluster, image: Image) -> bool:
    u0, v0, u1, v1 = cluster.box
    lens = image.intrinsics
    return min(u0, v0, lens.width - 1 - u1, lens.height - 1 - v1) < _BORDER_PX


def _thing(cluster: Cluster, image: Image, place: LocalisationEstimate) -> Detection3D:
    """A segment as the detection of an object without a class."""
    shape, X_WO = cluster.shape, place.X_WO
    u0, v0, u1, v1 = (float(value) for value in cluster.box)
    p_W = np.array([*shape.centre, cluster.base_m + 0.5 * shape.height_m])
    covariance = np.diag(np.square(_SIGMA_M))
    return Detection3D(
        stamp_s=image.stamp_s,
        detection=Detection(THING, _SEGMENT_SCORE, (u0, v0, u1, v1)),
        position_W=p_W,
        covariance=covariance,
        place_covariance=covariance + place_covariance(p_W, X_WO.translation(), place.covariance),
        size_m=(shape.length_m, shape.width_m, shape.height_m),
        yaw_rad=shape.yaw_rad,
        eye_W=camera_pose_W(image, X_WO).translation(),
        pixels=cluster.points.pixels,
        colours=cluster.points.colours,
        surface=cluster.surface,
    )


def most_free_first(tracks: Sequence[Track], here_W: FloatArray) -> list[Track]:
    """The tracks in the order in which to take them: the nearest and those with the most space around them first."""

    def cost(track: Track) -> float:
        others = (_off(track.position_W, other.position_W) for other in tracks if other is not track)
        return _off(track.position_W, here_W) - 2.0 * min(_FREE_M, min(others, default=_FREE_M))

    return sorted(tracks, key=cost)


def _off(p_W: FloatArray, q_W: FloatArray) -> float:
    """Level distance of two points."""
    return float(np.linalg.norm(p_W[:2] - q_W[:2]))


def unnamed(clusters: Iterable[Cluster], tracks: Sequence[Track], classes: Sequence[str]) -> list[Cluster]:
    """Clusters about as large as objects of some classes where no track is, each place once; the largest first.

    A track that is likely enough to be of the classes after all, though it is likelier something else, is none here.
    """
    named = [track.position_W[:2] for track in tracks if not _doubted(track, classes)]
    left: list[Cluster] = []
    for cluster in sorted(clusters, key=lambda one: -len(one.points)):
        centre = np.array(cluster.shape.centre)
        old = any(_near(centre, np.array(one.shape.centre), _SAME_PLACE_M) for one in left)
        known = any(_near(centre, place, _NAMED_WITHIN_M + 0.5 * cluster.shape.width_m) for place in named)
        if not old and not known and _may_be(cluster, classes):
            left.append(cluster)
    return left


def _doubted(track: Track, classes: Sequence[str]) -> bool:
    """Returns whether a track is taken for something else than the classes, and not surely."""
    return track.class_name not in classes and any(track.classes.get(name, 0.0) > _DOUBTED for name in classes)


def _may_be(cluster: Cluster, classes: Sequence[str]) -> bool:
    """Returns whether a cluster has the size of an object of one of the classes."""
    longest = max(cluster.shape.length_m, cluster.shape.height_m)
    ranges = (class_forms()[name].length_m for name in classes)
    return any(_SMALLEST * low < longest < _LARGEST * high for low, high in ranges)


def _near(p: FloatArray, q: FloatArray, within_m: float) -> bool:
    return float(np.linalg.norm(p - q)) < within_m
