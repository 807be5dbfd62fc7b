"""Pictures of worlds and runs: maps with paths and labels, detections, and views from free cameras.

Pictures are (H, W, 3) uint8 RGB arrays. Drawing is antialiased; text has a plate, and is legible on any ground. All
lengths in metres, all poses in the world frame.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import QueryObject
from pydrake.math import RigidTransform, RotationMatrix

from plant.sensors.camera_spec import FAR_M, NEAR_M, colour_render_camera, depth_render_camera
from plant.worlds.world import Point
from skills.map_drawing import INK, PLATE, ZONE_COLOURS, Colour, Names, draw_zone, label, text_size, with_legend
from skills.robot import FloatArray, Intrinsics, Picture

Bounds = tuple[float, float, float, float]

PATH_COLOUR: Colour = (225, 60, 30)
START_COLOUR: Colour = (30, 140, 60)
BOX_COLOUR: Colour = (255, 190, 0)

_CAMERA_ABOVE_M = 60.0
_CUT_HEIGHT_M = 1.9
_SUBPIXEL_BITS = 4
_ROBOT_M, _PERSON_M = 0.6, 0.4
"""Radii about a robot and a person that labels leave free."""


@dataclass(frozen=True)
class MapView:
    """Picture of the world from above, with its camera: the world's y points up, its x right."""

    picture: Picture
    X_WC: RigidTransform
    intrinsics: Intrinsics

    def pixels(self, points_W: FloatArray, z_m: float = 0.0) -> FloatArray:
        """Projects points (N, 2 or more columns: x, y) at a height to pixels (N, 2)."""
        points = np.asarray(points_W, dtype=np.float64).reshape(len(points_W), -1)[:, :2]
        at_height = np.column_stack([points, np.full(len(points), z_m)])
        x, y, z = (self.X_WC.inverse() @ at_height.T).reshape(3, -1)
        k = self.intrinsics
        return np.stack([k.fx * x / z + k.cx, k.fy * y / z + k.cy], axis=-1)

    def whole_pixels(self, points_W: Sequence[Point]) -> NDArray[np.int32]:
        """Projects points on the floor to whole pixels (N, 2), as OpenCV draws them."""
        return np.asarray(np.round(self.pixels(np.array(points_W))), dtype=np.int32)

    @property
    def pixels_per_m(self) -> float:
        """Scale at the floor, in pixels per metre."""
        return self.intrinsics.fx / float(self.X_WC.translation()[2])


def render_view(
    query_object: QueryObject,
    X_WC: RigidTransform,
    size: tuple[int, int] = (720, 540),
    *,
    fov_y_rad: float = float(np.radians(50.0)),
    renderer: str = "vtk",
) -> Picture:
    """Renders the view of a free camera at X_WC (z forward, x right, y down); `size` is (width, height)."""
    intrinsics = _centred_intrinsics(size, size[1] / 2.0 / float(np.tan(fov_y_rad / 2.0)))
    return _render(query_object, X_WC, intrinsics, renderer, NEAR_M, FAR_M)


def look_at(eye_W: ArrayLike, target_W: ArrayLike) -> RigidTransform:
    """Pose X_WC of a camera at eye_W that faces target_W with a level horizon. Raises ValueError if they coincide."""
    forward = np.asarray(target_W, dtype=np.float64) - np.asarray(eye_W, dtype=np.float64)
    if float(np.linalg.norm(forward)) < 1e-6:
        raise ValueError("look_at: eye and target are the same point")
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-6 else np.array([1.0, 0.0, 0.0])
    R_WC = RotationMatrix(np.column_stack([right, np.cross(forward, right), forward]))
    return RigidTransform(R_WC, np.asarray(eye_W, dtype=np.float64))


def best_view(
    query_object: QueryObject,
    target_W: ArrayLike,
    *,
    distance_m: float = 1.8,
    height_m: float = 0.7,
    facing_W: Sequence[float] | None = None,
    renderer: str = "vtk",
) -> RigidTransform:
    """Pose X_WC of a camera around the target, on the side with the clearest line of sight.

    `facing_W` (x, y) is the direction of the preferred side, for a robot its left or right.
    """
    target = np.asarray(target_W, dtype=np.float64)
    first = float(np.arctan2(facing_W[1], facing_W[0])) if facing_W is not None else 0.0
    views = []
    for turn in (0.0, 0.5, -0.5, 1.0, -1.0, 1.6, -1.6, 2.3, -2.3, np.pi):
        side = np.array([np.cos(first + turn), np.sin(first + turn), 0.0])
        views.append(look_at(target + distance_m * side + [0.0, 0.0, height_m], target))
    clear = [_clear_share(query_object, X_WC, target, renderer) for X_WC in views]
    good = [X_WC for X_WC, share in zip(views, clear, strict=True) if share > 0.9]
    return good[0] if good else views[int(np.argmax(clear))]


def _clear_share(query_object: QueryObject, X_WC: RigidTransform, target_W: FloatArray, renderer: str) -> float:
    """Fraction of the lines of sight around the target that no nearer surface occludes."""
    intrinsics = _centred_intrinsics((48, 48), 90.0)
    distance = float(np.linalg.norm(X_WC.translation() - target_W))
    camera = depth_render_camera(intrinsics, renderer, (NEAR_M, distance + 5.0))
    world = query_object.inspector().world_frame_id()
    depth = query_object.RenderDepthImage(camera, world, X_WC).data[..., 0]
    return float(np.mean(depth > distance - 0.45))


def top_view(
    query_object: QueryObject,
    bounds_W: Bounds,
    *,
    width: int = 1200,
    cut_height_m: float = _CUT_HEIGHT_M,
    renderer: str = "vtk",
) -> MapView:
    """Renders the world from above, cut open at a height; `bounds_W` is (x_min, y_min, x_max, y_max) on the floor.

    Raises ValueError for bounds without an area.
    """
    x_min, y_min, x_max, y_max = bounds_W
    if not (x_min < x_max and y_min < y_max):
        raise ValueError(f"top_view: bounds must be (x_min, y_min, x_max, y_max) with an area, not {bounds_W}")
    scale = width / (x_max - x_min)
    intrinsics = _centred_intrinsics((width, round(scale * (y_max - y_min))), scale * _CAMERA_ABOVE_M)
    down = RotationMatrix(np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]))
    X_WC = RigidTransform(down, np.array([(x_min + x_max) / 2.0, (y_min + y_max) / 2.0, _CAMERA_ABOVE_M]))
    near = _CAMERA_ABOVE_M - cut_height_m
    picture = _render(query_object, X_WC, intrinsics, renderer, near, _CAMERA_ABOVE_M + 1.0)
    return MapView(picture, X_WC, intrinsics)


def draw_map(
    view: MapView,
    paths_W: Mapping[str, tuple[FloatArray, Colour]],
    *,
    labels: Mapping[str, tuple[float, float]] | None = None,
    marks: Mapping[str, tuple[float, float]] | None = None,
    zones: Sequence[Mapping[str, Any]] = (),
    people: Sequence[Point] = (),
) -> Picture:
    """Draws paths (N, 2 or more columns: x, y), labels and marked points on a copy of a map, with a legend below it.

    Each path has a legend text and a colour. No label covers another one, a mark, a robot at the end of its path, or
    one of the `people` on the map. The zones, in the form of `skills.zone_map.zone_messages`, are drawn first.
    """
    picture = view.picture.copy()
    for zone in zones:
        outlines = [view.whole_pixels(outline) for outline in zone["outlines"]]
        draw_zone(picture, outlines, zone["kind"], ZONE_COLOURS[zone["kind"]], zone.get("direction_rad"))
    paths = {text: (view.pixels(path), ink) for text, (path, ink) in paths_W.items() if len(path)}
    names = Names(picture, [pixels for pixels, _ in paths.values()])
    dots = {text: view.pixels(np.array([point]))[0] for text, point in (marks or {}).items()}
    for pixel in dots.values():
        _dot(picture, pixel, BOX_COLOUR)
        names.keep_clear(pixel, 12.0)
    for pixels, ink in paths.values():
        draw_path(picture, pixels, ink)
        names.keep_clear(pixels[0], 12.0)
        names.keep_clear(pixels[-1], max(16.0, _ROBOT_M * view.pixels_per_m))
    for at in people:
        names.keep_clear(view.pixels(np.array([at]))[0], _PERSON_M * view.pixels_per_m)
    for text, pixel in dots.items():
        names.write(text, pixel, ground=BOX_COLOUR)
    for text, centre in (labels or {}).items():
        names.write(text, view.pixels(np.array([centre]))[0])
    entries = [(text, ink) for text, (_, ink) in paths.items()]
    entries += [("begin of a path", START_COLOUR)] if paths else []
    entries += [(zone["rule"], ZONE_COLOURS[zone["kind"]]) for zone in zones]
    return with_legend(picture, view.pixels_per_m, entries)


def draw_path(picture: Picture, pixels: FloatArray, ink: Colour = PATH_COLOUR) -> None:
    """Draws a path in pixels (N, 2): a line with a light rim, a dot at its start, an arrow head at its end."""
    if len(pixels) < 1:
        return
    thick = max(3, picture.shape[1] // 320)
    line = [_fixed_point(pixels)]
    for colour, width in ((PLATE, thick + 4), (ink, thick)):
        cv2.polylines(picture, line, False, colour, width, cv2.LINE_AA, _SUBPIXEL_BITS)
    _arrow_head(picture, pixels, 5.0 * thick, ink)
    _dot(picture, pixels[0], START_COLOUR)


def draw_detection(picture: Picture, box: tuple[float, float, float, float], name: str, score: float) -> Picture:
    """Draws a box (left, top, right, bottom in pixels) with its name and score (0 to 1) on a copy of a picture."""
    drawn = np.ascontiguousarray(picture).copy()
    corners = np.array([[box[0], box[1]], [box[2], box[1]], [box[2], box[3]], [box[0], box[3]]])
    for colour, width in ((INK, 5), (BOX_COLOUR, 2)):
        cv2.polylines(drawn, [_fixed_point(corners)], True, colour, width, cv2.LINE_AA, _SUBPIXEL_BITS)
    text = f"{name} {score:.2f}"
    height = text_size(text, drawn)[1]
    above = box[1] - 8 if box[1] - height - 16 > 0 else box[3] + height + 10
    label(drawn, text, (int(box[0]), int(above)), ground=BOX_COLOUR)
    return drawn


def png_bytes(picture: Picture, compression: int = 1) -> bytes:
    """Encodes an RGB picture as PNG. A compression of 9 gives the smallest file and takes five times as long."""
    encoded, data = cv2.imencode(
        ".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_PNG_COMPRESSION, compression]
    )
    if not encoded:
        raise OSError("the picture cannot be encoded as PNG")
    return data.tobytes()


def save_png(path: Path, picture: Picture, compression: int = 1) -> None:
    """Writes an RGB picture as PNG, creating its folder. Raises OSError when it cannot be written."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(png_bytes(picture, compression))


def _centred_intrinsics(size: tuple[int, int], focal_px: float) -> Intrinsics:
    return Intrinsics(size[0], size[1], focal_px, focal_px, size[0] / 2.0 - 0.5, size[1] / 2.0 - 0.5)


def _render(
    query_object: QueryObject, X_WC: RigidTransform, intrinsics: Intrinsics, renderer: str, near_m: float, far_m: float
) -> Picture:
    """Renders at twice the size and downsamples, because the renderer draws jagged edges."""
    k = intrinsics
    double = Intrinsics(2 * k.width, 2 * k.height, 2 * k.fx, 2 * k.fy, 2 * k.cx + 0.5, 2 * k.cy + 0.5)
    camera = colour_render_camera(double, renderer, near_m=near_m, far_m=far_m)
    image = query_object.RenderColorImage(camera, query_object.inspector().world_frame_id(), X_WC)
    small = cv2.resize(image.data[..., :3], (k.width, k.height), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8)


def _fixed_point(pixels: FloatArray) -> NDArray[np.int32]:
    """Pixels in OpenCV's fixed-point form."""
    return np.asarray(np.round(pixels * 2.0**_SUBPIXEL_BITS), dtype=np.int32).reshape(-1, 1, 2)


def _arrow_head(picture: Picture, pixels: FloatArray, length: float, ink: Colour) -> None:
    """Draws a filled triangle at the end of a path, pointing along its last piece."""
    tip = pixels[-1]
    behind = pixels[np.linalg.norm(pixels - tip, axis=1) > length / 2.0]
    if not len(behind):
        _dot(picture, tip, ink)
        return
    along = (tip - behind[-1]) / np.linalg.norm(tip - behind[-1])
    across = np.array([-along[1], along[0]])
    head = np.array([tip + 0.6 * length * along, tip + 0.5 * length * across, tip - 0.5 * length * across])
    cv2.fillPoly(picture, [_fixed_point(head)], ink, cv2.LINE_AA, _SUBPIXEL_BITS)
    cv2.polylines(picture, [_fixed_point(head)], True, PLATE, 2, cv2.LINE_AA, _SUBPIXEL_BITS)


def _dot(picture: Picture, pixel: FloatArray, colour: Colour) -> None:
    """Draws a filled dot with a light rim."""
    radius = max(5, picture.shape[1] // 180)
    centre = (round(float(pixel[0])), round(float(pixel[1])))
    cv2.circle(picture, centre, radius + 2, PLATE, cv2.FILLED, cv2.LINE_AA)
    cv2.circle(picture, centre, radius, colour, cv2.FILLED, cv2.LINE_AA)
