"""Draws the robots in a log on their map at one time."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.record.history import Event
from executive.view.text import ROBOT_COLOURS, rgb_of
from executive.words.schemas import DOORS, MAP, NAVIGATION, PATH, POSE, RESERVED_PATH, TREE
from skills.inputs.errors import InputError
from skills.map_drawing import ZONE_COLOURS, Names, draw_zone, with_legend

WIDTH_PX: Final = 1400
_POSE_PX: Final = 18.0
FOOTPRINT_M: Final = (1.1, 0.5)
_CELL_M: Final = 0.05
_TRAIL: Final = (120, 158, 0)
"""Blue, green, red; so the other colours."""
_PLAN: Final = (178, 114, 0)
_PARTICLE: Final = (167, 121, 204)
_OBSTACLE: Final = (0, 94, 213)
_ROBOT: Final = (233, 180, 86)
_INK: Final = (40, 40, 40)
_DOCK: Final = (0, 190, 255)
_OPEN: Final = (30, 74, 122)
_LEGEND: Final = (
    ("path driven", _TRAIL),
    ("path planned", _PLAN),
    ("where it may be", _PARTICLE),
    ("obstacle that the map lacks", _OBSTACLE),
)
Colour = tuple[int, int, int]
_DOORS: Final[Mapping[str, tuple[Colour, str]]] = {
    "closed": ((40, 30, 200), "closed door"),
    "open": (_OPEN, "open door"),
    "unknown": ((150, 150, 150), "door not seen"),
}


@dataclass(frozen=True)
class _Frame:
    """Geometry of the picture: `height_px` rows, and the lower left corner at `origin_m` in the world frame."""

    origin_m: tuple[float, float]
    height_px: int
    pixels_per_m: float

    def pixels(self, points_W: Sequence[Sequence[float]]) -> NDArray[np.int32]:
        """Returns the pixels (N, 2), as column and row, of points (x, y) in metres."""
        xy = np.asarray(points_W, dtype=np.float64).reshape(-1, 2) - self.origin_m
        return np.column_stack(
            [np.round(xy[:, 0] * self.pixels_per_m), np.round(self.height_px - xy[:, 1] * self.pixels_per_m)]
        ).astype(np.int32)


def map_picture(events: Sequence[Event], at_s: float = math.inf) -> NDArray[np.uint8]:
    """Draws the map (height, width, 3; blue, green, red) at a time on the robot's clock.

    It shows the trajectory, the planned and the reserved path, the particles of the localiser, the cells of the
    obstacle layer, the footprint, the dock, and the zones, with a legend and a scale below. Each of several robots has
    its own colour. Raises InputError if the log has no map.
    """
    known = [event for event in events if event.stamp_s <= at_s]
    maps = [event.data for event in events if event.topic == MAP]
    if not maps:
        raise InputError("the log has no map", hint="give the log.mcap of a run with a world that has one")
    picture, frame = _ground(maps[-1])
    zones = newest_zones([event.data for event in known if event.topic == TREE])
    for zone in zones:
        outlines = [frame.pixels(outline) for outline in zone["outlines"]]
        draw_zone(picture, outlines, zone["kind"], _colour_of(zone), zone.get("direction_rad"))
    robots = sorted({event.data["robot"] for event in known if event.topic == POSE})
    colours = {name: rgb_of(ROBOT_COLOURS[n % len(ROBOT_COLOURS)])[::-1] for n, name in enumerate(robots)}
    one = len(robots) < 2
    for robot in robots:
        own = [event for event in known if event.data.get("robot") == robot]
        _draw_robot(picture, frame, own, None if one else colours[robot])
    doors = _draw_doors(picture, frame, [event.data["doors"] for event in known if event.topic == DOORS])
    _write_names(picture, frame, maps[-1], [event.data for event in known if event.topic == POSE], zones)
    entries = list(_LEGEND) if one else [*((f"path of {name}", colours[name]) for name in robots), *_LEGEND[2:]]
    entries += [(text, colour) for state, (colour, text) in _DOORS.items() if state in doors]
    entries += [(zone["rule"], _colour_of(zone)) for zone in zones]
    return with_legend(picture, frame.pixels_per_m, entries)


def newest_zones(trees: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Zones in the newest logged tree of each robot; each zone once."""
    last = {tree["robot"]: tree.get("zones", ()) for tree in trees}
    return list({zone["rule"]: zone for zones in last.values() for zone in zones}.values())


def _colour_of(zone: Mapping[str, Any]) -> Colour:
    red, green, blue = ZONE_COLOURS[zone["kind"]]
    return blue, green, red


def _write_names(
    picture: NDArray[np.uint8],
    frame: _Frame,
    data: Mapping[str, Any],
    poses: Sequence[Mapping[str, Any]],
    zones: Sequence[Mapping[str, Any]],
) -> None:
    """Draws the dock, named poses and, above all else, the names of robots, dock, places and other zones."""
    driven: dict[str, list[tuple[float, float]]] = {}
    for pose in poses:
        driven.setdefault(pose["robot"], []).append(_position(pose))
    lines = {name: frame.pixels(places) for name, places in driven.items()}
    names = Names(picture, [line.astype(np.float64) for line in lines.values()])
    for line in lines.values():
        names.keep_clear(line[-1].tolist(), 0.6 * frame.pixels_per_m)
    if (dock := data.get("dock")) is not None:
        pixel = frame.pixels([(dock["x"], dock["y"])])[0]
        column, row = pixel.tolist()
        for colour, thick in ((_DOCK, cv2.FILLED), (_INK, 2)):
            cv2.rectangle(picture, (column - 9, row - 9), (column + 9, row + 9), colour, thick)
        names.keep_clear(pixel.tolist(), 12.0)
        names.write("dock", pixel.tolist())
    for name, line in lines.items():
        names.write(name, line[-1].tolist())
    places = data.get("places", ())
    for place in (each for each in places if "yaw_rad" in each):
        at, yaw = frame.pixels([(place["x"], place["y"])])[0], place["yaw_rad"]
        ahead = np.round(at + _POSE_PX * np.array([math.cos(yaw), -math.sin(yaw)])).astype(int)
        cv2.line(picture, at.tolist(), ahead.tolist(), _INK, 3, cv2.LINE_AA)
        cv2.circle(picture, at.tolist(), 6, _INK, cv2.FILLED, cv2.LINE_AA)
        names.keep_clear(at.tolist(), _POSE_PX)
    written = {place["name"]: (place["x"], place["y"]) for place in places}
    for zone in zones:
        written.setdefault(zone["name"], np.mean(zone["outlines"][0], axis=0).tolist())
    for name, middle in written.items():
        names.write(name, frame.pixels([middle])[0].tolist())


def _position(pose: Mapping[str, Any]) -> tuple[float, float]:
    return pose["pose"]["position"]["x"], pose["pose"]["position"]["y"]


def _ground(data: Mapping[str, Any]) -> tuple[NDArray[np.uint8], _Frame]:
    """Draws the enlarged grid; returns the picture with its geometry."""
    grey = cv2.imdecode(np.frombuffer(base64.b64decode(data["data"]), np.uint8), cv2.IMREAD_GRAYSCALE)
    if grey is None:
        raise InputError("the log's map is no picture")
    scale = WIDTH_PX / grey.shape[1]
    size = (WIDTH_PX, max(1, round(grey.shape[0] * scale)))
    enlarged = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    picture = np.asarray(cv2.cvtColor(enlarged, cv2.COLOR_GRAY2BGR), np.uint8)
    origin = (float(data["origin_m"]["x"]), float(data["origin_m"]["y"]))
    return picture, _Frame(origin, size[1], scale / float(data["resolution_m"]))


def _draw_doors(picture: NDArray[np.uint8], frame: _Frame, seen: Sequence[Sequence[Mapping[str, Any]]]) -> set[str]:
    """Draws each door as a robot saw it last, a closed door thickest; returns the states that occur."""
    doors = sorted((door for each in seen for door in each), key=lambda door: door["seen_s"] or -1.0)
    latest = {str(door["ends"]): door for door in doors}.values()
    for door in latest:
        ends, closed = frame.pixels(door["ends"]).tolist(), door["state"] == "closed"
        cv2.line(picture, ends[0], ends[1], _DOORS[door["state"]][0], 9 if closed else 4, cv2.LINE_AA)
    return {door["state"] for door in latest}


def _draw_robot(picture: NDArray[np.uint8], frame: _Frame, events: Sequence[Event], colour: Colour | None) -> None:
    """Draws one robot from its events; `colour` (blue, green, red) is given for several robots."""
    poses = [event.data for event in events if event.topic == POSE]
    paths = [event.data["poses"] for event in events if event.topic == PATH]
    views = [event.data for event in events if event.topic == NAVIGATION]
    if views:
        side = max(1, round(0.5 * _CELL_M * frame.pixels_per_m))
        for column, row in frame.pixels(_pairs(views[-1], "seen")).tolist():
            cv2.rectangle(picture, (column - side, row - side), (column + side, row + side), _OBSTACLE, -1)
    reserved = [event.data for event in events if event.topic == RESERVED_PATH]
    if reserved and reserved[-1]["turn"] is not None:
        band, ring = frame.pixels(_pairs(reserved[-1], "")), colour or _PLAN
        pale = tuple(round(0.35 * part + 0.65 * 255) for part in ring)
        cv2.polylines(picture, [band], False, pale, 15, cv2.LINE_AA)
        cv2.circle(picture, band[-1].tolist(), 9, ring, 3, cv2.LINE_AA)
    places = [_position(pose) for pose in poses]
    cv2.polylines(picture, [frame.pixels(places)], False, colour or _TRAIL, 2, cv2.LINE_AA)
    if paths:
        plan = [(pose["position"]["x"], pose["position"]["y"]) for pose in paths[-1]]
        cv2.polylines(picture, [frame.pixels(plan)], False, colour or _PLAN, 3, cv2.LINE_AA)
    yaw = float(poses[-1]["yaw_rad"])
    corners = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * FOOTPRINT_M / 2.0
    turned = corners @ np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]]) + places[-1]
    body = frame.pixels(turned.tolist())
    cv2.fillPoly(picture, [body], colour or _ROBOT, cv2.LINE_AA)
    cv2.polylines(picture, [body], True, _INK, 2, cv2.LINE_AA)
    cv2.line(picture, body[0].tolist(), body[1].tolist(), _INK, 5, cv2.LINE_AA)
    if views:
        for column, row in frame.pixels(_pairs(views[-1], "particle")).tolist():
            cv2.circle(picture, (column, row), 2, _PARTICLE, -1, cv2.LINE_AA)


def _pairs(data: Mapping[str, Any], name: str) -> list[tuple[float, float]]:
    x, y = (data[f"{name}_{axis}" if name else axis] for axis in "xy")
    return list(zip(x, y, strict=True))
