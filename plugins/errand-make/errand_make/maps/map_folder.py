"""A map on disk: both grids in the `map_server` form, the pose graph, and the keyframes for a later session."""

from __future__ import annotations

import math
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from errand_make.maps.mapper import Mapper, MapperOptions, Submap
from errand_make.maps.occupancy import BANDS_M, LayeredOccupancy
from errand_make.maps.pose_graph import Edge, Keyframe, PoseGraph
from skills.footprint import pose_array
from skills.inputs.errors import InputError
from skills.inputs.outside import plain_file, read_text
from skills.inputs.schema import first_error
from skills.robot import Pose2D

RESOLUTION_M: Final = 0.025
LAYER_M: Final = 0.025
"""Height of a layer of the grid."""
GRAPH_FILE: Final = "pose_graph.json"
KEYFRAMES_FILE: Final = "keyframes.npz"
MOST_GRAPH_BYTES: Final = 100_000_000
MOST_KEYFRAMES_BYTES: Final = 4_000_000_000
_HINT: Final = "copy the whole folder, or name another --out"
_SHAPES: Final[Mapping[str, tuple[int, int | None]]] = {
    "ranges_mm": (3, None),
    "elevations_rad": (1, None),
    "azimuths_rad": (1, None),
    "rotations": (3, 3),
    "translations": (2, 3),
    "odometry": (2, 3),
    "points": (3, 3),
}
"""Number of dimensions of each array, and the length of the last one."""
_FREE = 0.45
_OCCUPIED = 0.65
_SLIM_M: Final = 0.2
"""Radius of a disc that is narrower than any body."""


@dataclass(frozen=True)
class MapGrids:
    """Both grids of a map: probabilities (rows from the south up; 0.5 where nothing was observed), and their corner."""

    probabilities: Mapping[str, NDArray[np.float32]]
    observed: Mapping[str, NDArray[np.bool_]]
    origin_m: tuple[float, float]


def map_grids(mapper: Mapper, resolution_m: float = RESOLUTION_M) -> MapGrids:
    """Both grids of all keyframes at their optimised poses, cropped to the observed cells.

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
    return MapGrids(
        {band: probability[cut] for band, (probability, _) in bands.items()},
        {band: observed[cut] for band, (_, observed) in bands.items()},
        (origin_m[0], origin_m[1]),
    )


def _hollow(
    free: NDArray[np.bool_], origin_m: tuple[float, float], resolution_m: float, poses: Sequence[Pose2D]
) -> NDArray[np.bool_]:
    """Returns whether each free cell is out of reach from the robot's poses, as under tables."""
    clear = cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * resolution_m > _SLIM_M
    _, parts = cv2.connectedComponents(clear.astype(np.uint8))
    columns, rows = ((pose_array(poses)[:, :2] - origin_m) / resolution_m).astype(int).T
    reached = np.isin(parts, np.setdiff1d(parts[rows, columns], [0]))
    away = cv2.distanceTransform((~reached).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * resolution_m
    return np.asarray(free & (away > _SLIM_M + resolution_m))


def save_grids(folder: Path, grids: MapGrids, resolution_m: float = RESOLUTION_M) -> Path:
    """Writes `scan` and `keepout` as PGM and YAML; returns the path of the scan map's YAML. Raises OSError."""
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
    """Writes the pose graph and the keyframes, which `load_mapper` reads. Raises OSError."""
    frames, graph = mapper.keyframes, mapper.graph
    document = _GraphFile(
        form=1,
        poses=[_triple(pose) for pose in graph.poses],
        stamps_s=[frame.stamp_s for frame in frames],
        edges=[
            _EdgeFile(
                first=edge.first,
                second=edge.second,
                measured=_triple(edge.measured),
                covariance=edge.covariance.tolist(),
                closure=edge.closure,
            )
            for edge in graph.edges
        ],
        submaps=[
            _SubmapFile(anchor=each.anchor, members={index: _triple(pose) for index, pose in each.members.items()})
            for each in mapper.submaps
        ],
    )
    first, most = frames[0], max(len(frame.points_F) for frame in frames)
    points = np.full((len(frames), most, 3), np.nan, dtype=np.float32)
    for row, frame in zip(points, frames, strict=True):
        row[: len(frame.points_F)] = frame.points_F
    millimetres = np.stack([np.nan_to_num(1000.0 * frame.ranges_m, nan=0.0) for frame in frames])
    partial = folder / f".{KEYFRAMES_FILE}"
    with partial.open("wb") as file:
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
    partial.replace(folder / KEYFRAMES_FILE)
    _write(folder / GRAPH_FILE, document.model_dump_json(by_alias=True).encode())


Triple = tuple[float, float, float]


def _triple(pose: Pose2D) -> Triple:
    return pose.x_m, pose.y_m, pose.yaw_rad


class _FilePart(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False, populate_by_name=True)


class _EdgeFile(_FilePart):
    first: int = Field(validation_alias="from", serialization_alias="from", ge=0)
    second: int = Field(validation_alias="to", serialization_alias="to", ge=0)
    measured: Triple
    covariance: tuple[Triple, Triple, Triple]
    closure: bool

    def edge(self) -> Edge:
        return Edge(self.first, self.second, Pose2D(*self.measured), np.array(self.covariance), self.closure)


class _SubmapFile(_FilePart):
    anchor: int = Field(ge=0)
    members: dict[int, Triple]


class _GraphFile(_FilePart):
    """The file of the pose graph."""

    form: Literal[1]
    poses: list[Triple] = Field(min_length=1)
    stamps_s: list[float]
    edges: list[_EdgeFile]
    submaps: list[_SubmapFile]

    @model_validator(mode="after")
    def _belongs_together(self) -> _GraphFile:
        count = len(self.poses)
        named = [end for edge in self.edges for end in (edge.first, edge.second)]
        named += [index for submap in self.submaps for index in (submap.anchor, *submap.members)]
        beyond = next((index for index in named if not 0 <= index < count), None)
        if beyond is not None:
            raise ValueError(f"it names keyframe {beyond}, and there are {count}")
        if len(self.stamps_s) != count:
            raise ValueError(f"it has {len(self.stamps_s)} stamps for {count} keyframes")
        if any(np.linalg.eigvalsh(np.array(edge.covariance)).min() <= 0.0 for edge in self.edges):
            raise ValueError("a covariance is not positive definite")
        return self


def load_mapper(folder: Path, options: MapperOptions | None = None) -> Mapper:
    """Reads a mapper that `save_graph` wrote; it localises the robot on the map before it goes on.

    Raises InputError when a file is missing or damaged, or when the two do not belong together.
    """
    graph_file, keyframes_file = folder / GRAPH_FILE, folder / KEYFRAMES_FILE
    try:
        stored = _GraphFile.model_validate_json(read_text(graph_file, most_bytes=MOST_GRAPH_BYTES, hint=_HINT))
    except ValidationError as error:
        where, why, _ = first_error(error.errors())
        what = f"it is no pose graph ({': '.join(filter(None, ('.'.join(map(str, where)), why)))})"
        raise InputError(what, hint=_HINT, file=graph_file) from error
    plain_file(keyframes_file, most_bytes=MOST_KEYFRAMES_BYTES, hint=_HINT)
    try:
        with zipfile.ZipFile(keyframes_file) as packed:
            if sum(part.file_size for part in packed.infolist()) > MOST_KEYFRAMES_BYTES:
                raise InputError("its keyframes unfold to too much", hint=_HINT, file=keyframes_file)
        with np.load(keyframes_file, allow_pickle=False) as arrays:
            frames = _frames(dict(arrays), stored.stamps_s)
    except (OSError, ValueError, KeyError, IndexError, TypeError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"it is no recording of keyframes ({error})"[:300], hint=_HINT, file=keyframes_file) from error
    graph = PoseGraph([Pose2D(*pose) for pose in stored.poses], [edge.edge() for edge in stored.edges])
    submaps = [
        Submap(each.anchor, None, {index: Pose2D(*pose) for index, pose in each.members.items()})
        for each in stored.submaps
    ]
    return Mapper.from_map(graph, frames, submaps, options)


def _frames(arrays: Mapping[str, Any], stamps_s: list[float]) -> list[Keyframe]:
    for name, (dimensions, last) in _SHAPES.items():
        array = arrays[name]
        fits = array.ndim == dimensions and (last is None or array.shape[-1] == last) and array.dtype.kind in "fu"
        if not fits or (dimensions > 1 and len(array) != len(stamps_s)):
            raise ValueError(f"{name} is {array.dtype} of {array.shape}, for {len(stamps_s)} keyframes")
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
    """Writes a file, which appears only when it is whole."""
    partial = path.with_name(f".{path.name}")
    partial.write_bytes(content)
    partial.replace(path)
