"""A map on disk: both grids in the `map_server` form, the pose graph, and the keyframes from which it goes on."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.mapping.keyframe import Keyframe
from skills.mapping.mapper import Mapper, MapperOptions, Submap
from skills.mapping.occupancy import BANDS_M, LayeredOccupancy
from skills.mapping.pose_graph import Edge, PoseGraph
from skills.navigate.footprint import pose_array
from skills.robot import Pose2D

RESOLUTION_M: Final = 0.025
LAYER_M: Final = 0.025
"""Sizes of the grid's cells, across and up."""
GRAPH_FILE: Final = "pose_graph.json"
KEYFRAMES_FILE: Final = "keyframes.npz"
_FORM: Final = 1
_FREE, _OCCUPIED = 0.45, 0.65
_SLIM_M: Final = 0.2
"""Less than half the body's width."""


class MapFolderError(ValueError):
    """A folder does not hold a map that can be continued; the text names the file."""


@dataclass(frozen=True)
class Surveyed:
    """Both grids of a map: probabilities (rows from the south up; 0.5 where nothing was observed), and their place."""

    probabilities: Mapping[str, NDArray[np.float32]]
    observed: Mapping[str, NDArray[np.bool_]]
    origin_m: tuple[float, float]


def surveyed(mapper: Mapper, resolution_m: float = RESOLUTION_M) -> Surveyed:
    """Both grids of all keyframes at their optimised poses, cut to what was observed.

    Keep-out ground that the body cannot reach counts as unknown.
    """
    grid = LayeredOccupancy(resolution_m, layer_m=LAYER_M)
    for index, (frame, pose) in enumerate(zip(mapper.keyframes, mapper.graph.poses, strict=True)):
        grid.insert(frame, pose, stride=2, first=index % 2)
    bands = {band: grid.probability(band) for band in BANDS_M}
    probability, observed = bands["keepout"]
    hollow = _hollow(observed & (probability < _FREE), grid.origin_m, resolution_m, mapper.graph.poses)
    bands["keepout"] = np.where(hollow, np.float32(0.5), probability), observed & ~hollow
    seen = np.any([observed for _, observed in bands.values()], axis=0)
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    cut = slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
    origin_m = tuple(
        start + first.start * resolution_m for start, first in zip(grid.origin_m, (cut[1], cut[0]), strict=True)
    )
    return Surveyed(
        {band: probability[cut] for band, (probability, _) in bands.items()},
        {band: observed[cut] for band, (_, observed) in bands.items()},
        (origin_m[0], origin_m[1]),
    )


def _hollow(
    free: NDArray[np.bool_], origin_m: tuple[float, float], resolution_m: float, poses: Sequence[Pose2D]
) -> NDArray[np.bool_]:
    """The free cells that no body reaches from where the robot was: under tables, between specks of furniture."""
    room = cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * resolution_m > _SLIM_M
    _, parts = cv2.connectedComponents(room.astype(np.uint8))
    columns, rows = ((pose_array(poses)[:, :2] - origin_m) / resolution_m).astype(int).T
    reached = np.isin(parts, np.setdiff1d(parts[rows, columns], [0]))
    away = cv2.distanceTransform((~reached).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * resolution_m
    return np.asarray(free & (away > _SLIM_M + resolution_m))


def save_grids(folder: Path, grids: Surveyed, resolution_m: float = RESOLUTION_M) -> Path:
    """Write `scan` and `keepout` as PGM and YAML; the path of the scan map's YAML. Raises OSError."""
    for band, probability in grids.probabilities.items():
        grey = np.where(grids.observed[band], np.rint(254.0 * (1.0 - probability)), 128.0).astype(np.uint8)
        rows, columns = grey.shape
        _write(folder / f"{band}.pgm", f"P5\n{columns} {rows}\n255\n".encode() + grey[::-1].tobytes())
        low, high = BANDS_M[band]
        text = (
            f"image: {band}.pgm\nmode: trinary\nresolution: {resolution_m}\n"
            f"origin: [{grids.origin_m[0]:.4f}, {grids.origin_m[1]:.4f}, 0.0]\nnegate: 0\n"
            f"occupied_thresh: {_OCCUPIED}\nfree_thresh: {_FREE}\nheight_band_m: [{low}, {high}]\n"
        )
        _write(folder / f"{band}.yaml", text.encode())
    return folder / "scan.yaml"


def save_graph(folder: Path, mapper: Mapper) -> None:
    """Write pose graph and keyframes, from which `load_mapper` goes on. Raises OSError."""
    frames, graph = mapper.keyframes, mapper.graph
    document = {
        "form": _FORM,
        "poses": [[pose.x_m, pose.y_m, pose.yaw_rad] for pose in graph.poses],
        "stamps_s": [frame.stamp_s for frame in frames],
        "edges": [
            {
                "from": edge.first,
                "to": edge.second,
                "measured": [edge.measured.x_m, edge.measured.y_m, edge.measured.yaw_rad],
                "covariance": edge.covariance.tolist(),
                "closure": edge.closure,
            }
            for edge in graph.edges
        ],
        "submaps": [
            {
                "anchor": submap.anchor,
                "members": {str(index): [pose.x_m, pose.y_m, pose.yaw_rad] for index, pose in submap.members.items()},
            }
            for submap in mapper.submaps
        ],
    }
    first, most = frames[0], max(len(frame.points_F) for frame in frames)
    points = np.full((len(frames), most, 3), np.nan, dtype=np.float32)
    for row, frame in zip(points, frames, strict=True):
        row[: len(frame.points_F)] = frame.points_F
    millimetres = np.stack([np.nan_to_num(1000.0 * frame.ranges_m, nan=0.0) for frame in frames])
    draft = folder / f".{KEYFRAMES_FILE}"
    with draft.open("wb") as file:
        np.savez_compressed(
            file,
            ranges_mm=millimetres.clip(0.0, 65535.0).astype(np.uint16),
            elevations_rad=first.elevations_rad,
            azimuths_rad=first.azimuths_rad,
            rotations=np.stack([frame.rotation for frame in frames]),
            translations=np.stack([frame.translation for frame in frames]),
            odometry=np.array([(f.X_OF.x_m, f.X_OF.y_m, f.X_OF.yaw_rad) for f in frames]),
            points=points,
        )
    draft.replace(folder / KEYFRAMES_FILE)
    _write(folder / GRAPH_FILE, json.dumps(document).encode())


def load_mapper(folder: Path, options: MapperOptions | None = None) -> Mapper:
    """A mapper with all that `save_graph` wrote; it does not know yet where the robot is. Raises MapFolderError."""
    try:
        document = json.loads((folder / GRAPH_FILE).read_text(encoding="utf-8"))
        with np.load(folder / KEYFRAMES_FILE) as kept:
            arrays = dict(kept)
        graph = PoseGraph([Pose2D(*pose) for pose in document["poses"]], [_edge(told) for told in document["edges"]])
        frames = _frames(arrays, document["stamps_s"])
        submaps = [_submap(told) for told in document["submaps"]]
        if document["form"] != _FORM or not len(frames) == len(graph.poses) > 0:
            raise ValueError("its parts do not belong together")
    except (OSError, ValueError, KeyError, TypeError, EOFError) as error:
        why = f"{type(error).__name__}: {error}"
        raise MapFolderError(f"{folder}: no map that can be continued ({why}); name another --out") from error
    return Mapper.going_on(graph, frames, submaps, options)


def _edge(told: Mapping[str, Any]) -> Edge:
    return Edge(told["from"], told["to"], Pose2D(*told["measured"]), np.array(told["covariance"]), told["closure"])


def _submap(told: Mapping[str, Any]) -> Submap:
    return Submap(told["anchor"], None, {int(index): Pose2D(*pose) for index, pose in told["members"].items()})


def _frames(arrays: Mapping[str, Any], stamps_s: list[float]) -> list[Keyframe]:
    ranges = arrays["ranges_mm"].astype(np.float32) / np.float32(1000.0)
    ranges[arrays["ranges_mm"] == 0] = math.nan
    return [
        Keyframe(
            stamp_s=stamp_s,
            X_OF=Pose2D(*arrays["odometry"][n].tolist()),
            ranges_m=ranges[n],
            elevations_rad=arrays["elevations_rad"],
            azimuths_rad=arrays["azimuths_rad"],
            rotation=arrays["rotations"][n],
            translation=arrays["translations"][n],
            points_F=arrays["points"][n][np.isfinite(arrays["points"][n][:, 0])].astype(np.float64),
        )
        for n, stamp_s in enumerate(stamps_s)
    ]


def _write(path: Path, content: bytes) -> None:
    """Put a file in its place when it is whole."""
    draft = path.with_name(f".{path.name}")
    draft.write_bytes(content)
    draft.replace(path)
