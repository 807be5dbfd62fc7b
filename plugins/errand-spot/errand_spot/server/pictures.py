"""Pictures, point clouds and distances to obstacles around the robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from bosdyn.api import gripper_camera_param_pb2, image_pb2, local_grid_pb2, point_cloud_pb2
from numpy.typing import NDArray
from pydrake.math import RigidTransform
from scipy.ndimage import distance_transform_edt

from errand_spot.messages import depth_frame, frame_tree, picture_frame, timestamp
from errand_spot.server.calls import Call, Service
from errand_spot.server.computer import Computer, Snapshot
from errand_spot.server.identity import DOMAIN
from skills.robot import CameraCapabilities, Image, Intrinsics, NoImageError, Scan

_PICTURE_TIMEOUT_S: Final = 5.0
_Pixels: Final = image_pb2.Image
_BODY_SIZE: Final = (640, 480)
_BODY_DEPTH: Final = Intrinsics(424, 240, 213.0, 213.0, 212.0, 120.0)
_HAND_DEPTH: Final = Intrinsics(224, 171, 208.0, 208.0, 112.0, 85.5)
"""Lenses of a Spot's depth cameras, by pictures that owners have published."""


@dataclass(frozen=True)
class _Source:
    """One source of the image service: a camera, its picture or depth, and its lens (None: that of the picture)."""

    name: str
    camera: CameraCapabilities
    frame: str
    coloured: bool = False
    lens: Intrinsics | None = None

    @property
    def depth(self) -> bool:
        """Whether it gives depth."""
        return "_depth" in self.name and "_color_in_" not in self.name

    @property
    def pixel_formats(self) -> Sequence[int]:
        """Formats that it offers, its own first."""
        if self.depth:
            return (_Pixels.PIXEL_FORMAT_DEPTH_U16,)
        both = (_Pixels.PIXEL_FORMAT_RGB_U8, _Pixels.PIXEL_FORMAT_GREYSCALE_U8)
        return both if self.coloured else both[::-1]

    @property
    def image_formats(self) -> Sequence[int]:
        """Formats of the data, its own first."""
        return (_Pixels.FORMAT_RAW,) if self.depth else (_Pixels.FORMAT_JPEG, _Pixels.FORMAT_RAW)

    def intrinsics(self, image: Image, size: tuple[int, int]) -> Intrinsics:
        """Lens of the pixels; `size` is that of the hand's colour camera."""
        if self.lens is not None:
            return self.lens
        own, (width, height) = image.intrinsics, size if self.camera.source == "hand" else _BODY_SIZE
        scale = width / own.width
        cy = own.cy * scale - 0.5 * (own.height * scale - height)
        return Intrinsics(width, height, own.fx * scale, own.fy * scale, own.cx * scale, cy)

    def pixels(self, image: Image, lens: Intrinsics) -> NDArray[Any]:
        """Depth (H, W) in mm as uint16, or the picture (H, W) or (H, W, 3) RGB, through a lens."""
        if not self.depth:
            seen = image.grey if image.colour is None or not self.coloured else image.colour
            return _through(seen, image.intrinsics, lens, cv2.INTER_LINEAR)
        depth = np.clip(np.nan_to_num(image.depth_m, posinf=0.0) * 1000.0, 0.0, 65535.0).astype(np.uint16)
        return _through(depth, image.depth_intrinsics, lens, cv2.INTER_NEAREST)


def _through(pixels: NDArray[Any], own: Intrinsics, lens: Intrinsics, interpolation: int) -> NDArray[Any]:
    """Pixels as another lens in the same pose shows them, 0 where the own lens does not look."""
    if own == lens:
        return pixels
    x, y = lens.fx / own.fx, lens.fy / own.fy
    mapped = np.array([[x, 0.0, lens.cx - x * own.cx], [0.0, y, lens.cy - y * own.cy]])
    return np.asarray(cv2.warpAffine(pixels, mapped, (lens.width, lens.height), flags=interpolation))


def _sources(cameras: tuple[CameraCapabilities, ...]) -> Mapping[str, _Source]:
    """The sources of a real Spot that the cameras have."""
    made: list[_Source] = []
    for camera in cameras:
        colour, depth = picture_frame(camera.source), depth_frame(camera.source)
        if camera.source == "hand":
            made += [
                _Source("hand_color_image", camera, colour, coloured=True),
                _Source("hand_image", camera, depth, lens=_HAND_DEPTH),
                _Source("hand_depth", camera, depth, lens=_HAND_DEPTH),
                _Source("hand_depth_in_hand_color_frame", camera, colour),
                _Source("hand_color_in_hand_depth_frame", camera, depth, coloured=True, lens=_HAND_DEPTH),
            ]
        else:
            made += [
                _Source(f"{camera.source}_fisheye_image", camera, colour),
                _Source(f"{camera.source}_depth", camera, depth, lens=_BODY_DEPTH),
                _Source(f"{camera.source}_depth_in_visual_frame", camera, colour),
            ]
    return {source.name: source for source in made}


class ImageService(Service):
    """Takes pictures. Each camera is a pinhole here, and depth is registered to the picture."""

    name, type, authority = "image", "bosdyn.api.ImageService", f"api.{DOMAIN}"

    def __init__(self, computer: Computer, gripper_camera: GripperCameraParamService) -> None:
        self._computer, self._sources = computer, _sources(computer.capabilities.cameras)
        self.sizes = dict[tuple[str, float], tuple[int, int]]()
        """Columns and rows of the pictures that clients have seen, by the frame and focal length (pixels)."""
        self._gripper_camera = gripper_camera

    def ListImageSources(self, _request: Any, _call: Call) -> Any:
        """Lists all sources."""
        made = image_pb2.ListImageSourcesResponse(transforms_snapshot=frame_tree(self._computer.snapshot.frames))
        for source in self._sources.values():
            lens = source.lens or source.intrinsics(self._take(source), self._gripper_camera.size)
            made.image_sources.append(self._described(source, lens))
        return made

    def GetImage(self, request: Any, _call: Call) -> Any:
        """Takes the requested pictures; each has its own status."""
        made = image_pb2.GetImageResponse()
        for each in request.image_requests:
            made.image_responses.append(self.take(each))
        return made

    def has(self, source: str) -> bool:
        """True when there is a source of a name."""
        return source in self._sources

    def take(self, request: Any) -> Any:
        """Takes one picture and returns the message, with its status."""
        made = image_pb2.ImageResponse()
        self._answer(made, request)
        return made

    def _take(self, source: _Source) -> Image:
        """Takes a picture between two steps. Raises NoImageError or TimeoutError."""
        taken = self._computer.do(
            lambda: self._computer.robot.image(source.camera.source, visual=not source.depth, depth=source.depth)
        )
        return taken.result(_PICTURE_TIMEOUT_S)

    def _answer(self, made: Any, request: Any) -> None:
        Response, source = image_pb2.ImageResponse, self._sources.get(request.image_source_name)
        if source is None:
            made.status = Response.STATUS_UNKNOWN_CAMERA
            return
        ratio = request.resize_ratio or 1.0
        if not 0.0 < ratio <= 1.0:
            made.status = Response.STATUS_UNSUPPORTED_RESIZE_RATIO_REQUESTED
            return
        if request.image_format and request.image_format not in source.image_formats:
            made.status = Response.STATUS_UNSUPPORTED_IMAGE_FORMAT_REQUESTED
            return
        coded = request.pixel_format or source.pixel_formats[0]
        if coded not in source.pixel_formats:
            made.status = Response.STATUS_UNSUPPORTED_PIXEL_FORMAT_REQUESTED
            return
        try:
            image = self._take(source)
        except (NoImageError, TimeoutError):
            made.status = Response.STATUS_IMAGE_DATA_ERROR
            return
        snapshot = self._computer.snapshot
        lens = source.intrinsics(image, self._gripper_camera.size)
        pixels = _converted(source.pixels(image, lens), coded)
        if ratio < 1.0:
            size = (max(1, round(pixels.shape[1] * ratio)), max(1, round(pixels.shape[0] * ratio)))
            pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_NEAREST if source.depth else cv2.INTER_AREA)
        made.status = Response.STATUS_OK
        made.source.CopyFrom(self._described(source, lens, ratio))
        made.shot.acquisition_time.CopyFrom(timestamp(snapshot.time_s))
        made.shot.transforms_snapshot.CopyFrom(frame_tree(snapshot.frames))
        made.shot.frame_name_image_sensor = source.frame
        _encode(made.shot.image, pixels, coded, request)

    def _described(self, source: _Source, lens: Intrinsics, ratio: float = 1.0) -> Any:
        """The message of a source, with its intrinsics at a size."""
        made = image_pb2.ImageSource(name=source.name, cols=round(lens.width * ratio), rows=round(lens.height * ratio))
        k = made.pinhole.intrinsics
        k.focal_length.x, k.focal_length.y = lens.fx * ratio, lens.fy * ratio
        k.principal_point.x, k.principal_point.y = lens.cx * ratio, lens.cy * ratio
        Source = image_pb2.ImageSource
        made.image_type = Source.IMAGE_TYPE_DEPTH if source.depth else Source.IMAGE_TYPE_VISUAL
        made.depth_scale = 1000.0 if source.depth else 0.0
        made.pixel_formats.extend(source.pixel_formats)
        made.image_formats.extend(source.image_formats)
        self.sizes[source.frame, round(k.focal_length.x, 3)] = made.cols, made.rows
        return made


def _converted(pixels: NDArray[Any], wanted: int) -> NDArray[Any]:
    """Pixels in a format that the source offers."""
    if wanted == _Pixels.PIXEL_FORMAT_RGB_U8:
        return pixels if pixels.ndim == 3 else cv2.cvtColor(pixels, cv2.COLOR_GRAY2RGB)
    if wanted == _Pixels.PIXEL_FORMAT_GREYSCALE_U8:
        return pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
    return pixels


def _encode(made: Any, pixels: NDArray[Any], pixel_format: int, request: Any) -> None:
    """Fills in the data of an image: JPEG by default, raw for depth and on request."""
    made.rows, made.cols, made.pixel_format = pixels.shape[0], pixels.shape[1], pixel_format
    if pixels.dtype == np.uint16 or request.image_format == _Pixels.FORMAT_RAW:
        made.format, made.data = _Pixels.FORMAT_RAW, np.ascontiguousarray(pixels).tobytes()
        return
    quality = max(1, round(request.quality_percent or 75.0))
    bgr = pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
    made.format, made.data = _Pixels.FORMAT_JPEG, data.tobytes()


class PointCloudService(Service):
    """Gives the last revolution of the LiDAR as points."""

    name, type, authority = "velodyne-point-cloud", "bosdyn.api.PointCloudService", f"velodyne.{DOMAIN}"
    SOURCE: Final = "velodyne-point-cloud"

    def __init__(self, computer: Computer) -> None:
        self._computer = computer

    def ListPointCloudSources(self, _request: Any, _call: Call) -> Any:
        """Lists the LiDAR."""
        return point_cloud_pb2.ListPointCloudSourcesResponse(point_cloud_sources=[self._source()])

    def GetPointCloud(self, request: Any, _call: Call) -> Any:
        """Returns points (N, 3) as 32-bit floats in the frame `odom`."""
        made, Response = point_cloud_pb2.GetPointCloudResponse(), point_cloud_pb2.PointCloudResponse
        for each in request.point_cloud_requests:
            one, scan = made.point_cloud_responses.add(), self._computer.snapshot.scan
            if each.point_cloud_source_name != self.SOURCE:
                one.status = Response.STATUS_UNKNOWN_SOURCE
            elif scan is None:
                one.status = Response.STATUS_SOURCE_DATA_ERROR
            else:
                one.status = Response.STATUS_OK
                self.fill(one.point_cloud, scan)
        return made

    def fill(self, made: Any, scan: Scan) -> None:
        """Fills in the message of a scan."""
        points = (scan.X_OB @ scan.points_B().T).T.astype(np.float32)
        made.source.CopyFrom(self._source())
        made.num_points, made.encoding = len(points), point_cloud_pb2.PointCloud.ENCODING_XYZ_32F
        made.data = np.ascontiguousarray(points).tobytes()

    def _source(self) -> Any:
        snapshot = self._computer.snapshot
        made = point_cloud_pb2.PointCloudSource(name=self.SOURCE, frame_name_sensor="odom")
        made.acquisition_time.CopyFrom(timestamp(snapshot.time_s))
        made.transforms_snapshot.CopyFrom(frame_tree(snapshot.frames))
        return made


class LocalGridService(Service):
    """Gives the distance to the nearest obstacle in a square around the robot, by the last revolution of the LiDAR."""

    name, type, authority = "local-grid-service", "bosdyn.api.LocalGridService", f"localgrid.{DOMAIN}"
    GRID: Final = "obstacle_distance"
    _CELLS, _CELL_M, _SCALE_M = 128, 0.03, 0.001
    _LOW_M, _HIGH_M = 0.15, 1.0

    def __init__(self, computer: Computer) -> None:
        self._computer = computer

    def GetLocalGridTypes(self, _request: Any, _call: Call) -> Any:
        """Lists the one kind of grid."""
        made = local_grid_pb2.GetLocalGridTypesResponse()
        made.local_grid_type.add(name=self.GRID)
        return made

    def GetLocalGrids(self, request: Any, _call: Call) -> Any:
        """Returns grids of 16-bit millimetres. The grid's frame is a corner of the square, turned as `odom`."""
        made, Response = local_grid_pb2.GetLocalGridsResponse(), local_grid_pb2.LocalGridResponse
        for each in request.local_grid_requests:
            one, snapshot = made.local_grid_responses.add(), self._computer.snapshot
            one.local_grid_type_name = each.local_grid_type_name
            if each.local_grid_type_name != self.GRID:
                one.status = Response.STATUS_NO_SUCH_GRID
            elif snapshot.scan is None:
                one.status = Response.STATUS_DATA_UNAVAILABLE
            else:
                one.status = Response.STATUS_OK
                self.fill(one.local_grid, snapshot, snapshot.scan)
        made.num_local_grid_errors = sum(one.status != Response.STATUS_OK for one in made.local_grid_responses)
        return made

    def fill(self, made: Any, snapshot: Snapshot, scan: Scan) -> None:
        """Fills in the message of a grid."""
        points_O = (scan.X_OB @ scan.points_B().T).T
        corner = snapshot.odometry.X_OB.translation()[:2] - 0.5 * self._CELLS * self._CELL_M
        high = points_O[(points_O[:, 2] > self._LOW_M) & (points_O[:, 2] < self._HIGH_M)]
        cells = np.floor((high[:, :2] - corner) / self._CELL_M).astype(int)
        inside = cells[np.all((cells >= 0) & (cells < self._CELLS), axis=1)]
        free = np.ones((self._CELLS, self._CELLS), dtype=bool)
        free[inside[:, 1], inside[:, 0]] = False
        far = np.full(free.shape, 0.5 * self._CELLS) if free.all() else distance_transform_edt(free)
        millimetres = np.round(far * self._CELL_M / self._SCALE_M).astype(np.int16)
        made.local_grid_type_name, made.frame_name_local_grid_data = self.GRID, f"{self.GRID}_corner"
        made.acquisition_time.CopyFrom(timestamp(snapshot.time_s))
        frames = {**snapshot.frames, f"{self.GRID}_corner": ("odom", RigidTransform([*corner, 0.0]))}
        made.transforms_snapshot.CopyFrom(frame_tree(frames))
        made.extent.cell_size, made.extent.num_cells_x, made.extent.num_cells_y = self._CELL_M, self._CELLS, self._CELLS
        made.cell_format = local_grid_pb2.LocalGrid.CELL_FORMAT_INT16
        made.encoding = local_grid_pb2.LocalGrid.ENCODING_RAW
        made.cell_value_scale, made.data = self._SCALE_M, millimetres.tobytes()


class GripperCameraParamService(Service):
    """Stores parameters of the hand's camera; its mode sets the size of the colour picture, the others do nothing."""

    name, type, authority = "gripper-camera-param", "bosdyn.api.GripperCameraParamService", f"api.{DOMAIN}"

    def __init__(self) -> None:
        Params = gripper_camera_param_pb2.GripperCameraParams
        self._params = Params(camera_mode=Params.MODE_640_480)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the colour picture, which the name of the mode says."""
        _, width, height, *_ = self._params.CameraMode.Name(self._params.camera_mode).split("_")
        return int(width), int(height)

    def GetParams(self, _request: Any, _call: Call) -> Any:
        """Returns the parameters."""
        return gripper_camera_param_pb2.GripperCameraGetParamResponse(params=self._params)

    def SetParams(self, request: Any, _call: Call) -> Any:
        """Changes the given parameters."""
        changed = gripper_camera_param_pb2.GripperCameraParams()
        changed.CopyFrom(self._params)
        changed.MergeFrom(request.params)
        self._params = changed
        return gripper_camera_param_pb2.GripperCameraParamResponse()
