"""What stands on a surface and was not named yet, or may be something else than was said: worth a closer look."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from skills.perception.class_forms import class_forms
from skills.perception.surface_segmentation import Cluster
from skills.perception.tracker import Track
from skills.robot import FloatArray

_NAMED_WITHIN_M = 0.06
_SAME_PLACE_M = 0.05
_DOUBTED = 0.08
"""How likely something has to be of the classes that are looked for to be worth a closer look."""
_SMALLEST, _LARGEST = 0.4, 1.3
"""Shares of the shortest and the longest objects of a class, for clusters of which a part is hidden or merged."""


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
    """Whether a track is taken for something else than the classes, and not surely."""
    return track.class_name not in classes and any(track.classes.get(name, 0.0) > _DOUBTED for name in classes)


def _may_be(cluster: Cluster, classes: Sequence[str]) -> bool:
    """Whether a cluster has the size of an object of one of the classes."""
    longest = max(cluster.shape.length_m, cluster.shape.height_m)
    ranges = (class_forms()[name].length_m for name in classes)
    return any(_SMALLEST * low < longest < _LARGEST * high for low, high in ranges)


def _near(p: FloatArray, q: FloatArray, within_m: float) -> bool:
    return float(np.linalg.norm(p - q)) < within_m
