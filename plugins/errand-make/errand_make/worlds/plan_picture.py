"""Pictures of the plans of worlds: rooms, doors, walls, surfaces, zones, people, dock, start, and coordinates."""

from collections.abc import Sequence

import cv2
import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from executive.words.knowledge import Knowledge
from plant.scene_pictures import MapView, draw_path
from plant.worlds.seeding import place_people
from plant.worlds.world import World
from skills.grid_map import load_grid_map
from skills.map_drawing import ZONE_COLOURS, Names, draw_zone, drawable, with_legend
from skills.robot import FloatArray, Intrinsics, Picture, Pose2D
from skills.zone_map import zone_messages

_Colour = tuple[int, int, int]
WIDTH_PX = 1400
_WIDEST_PX, _CLEAR_PX_PER_M = 2600, 55
_CLOSEST_PX_PER_M = 30
_RIM_PX, _TICK_PX, _ROW_PX, _AXIS_PX = 44, 8, 26, 66
_ABOVE_M = 10.0
_TINTS = ((214, 232, 246), (250, 228, 208), (220, 242, 214), (246, 216, 226), (238, 234, 200), (226, 216, 244))
_SURFACE, _TOP, _LINE = (160, 120, 70), (240, 224, 196), (120, 120, 120)
_INK, _PLATE = (25, 25, 25), (255, 255, 255)
_START, _DOCK, _PERSON = (225, 60, 30), (0, 114, 178), (150, 50, 140)
_ARROW_M, _PERSON_M = 0.8, 0.25
_FONT, _FONT_SCALE = cv2.FONT_HERSHEY_SIMPLEX, 0.5


def draw_world(world: World, knowledge: Knowledge, *, grid: bool = False) -> Picture:
    """Draws the plan of a world over its surveyed map, with coordinates at its rim, or as a grid of one metre.

    Rooms are tinted, doors are circles of their width with numbers that a list below explains, start and dock are
    arrows. Rooms, surfaces, zones and people have their names; people stand where seed 0 puts them.
    """
    view = plan_view(world)
    picture = view.picture
    zones = zone_messages(knowledge.known_zones())
    for zone in zones:
        outlines = [view.whole_pixels(outline) for outline in zone["outlines"]]
        draw_zone(picture, outlines, zone["kind"], ZONE_COLOURS[zone["kind"]], zone.get("direction_rad"))
    _draw_coordinates(view, whole=grid)
    arrows = {"start": (world.start, _START)} | ({} if world.dock is None else {"dock": (world.dock, _DOCK)})
    people = {each.name: each.X_WO.translation()[:2] for each in place_people(world, 0)}
    lines = [view.pixels(_arrow(pose)) for pose, _ in arrows.values()]
    names = Names(picture, lines)
    for pixels, (_, colour) in zip(lines, arrows.values(), strict=True):
        draw_path(picture, pixels, colour)
        names.keep_clear(pixels[0], 12.0)
        names.keep_clear(pixels[-1], 16.0)
    for at in people.values():
        _draw_disc(view, names, at, _PERSON)
    _draw_doors(view, knowledge, names)
    for name, surface in world.surfaces.items():
        _write_small(picture, name, view.pixels(np.array(surface.polygon_W)).mean(axis=0), names, _TOP)
    for name, at in people.items():
        names.write(name, view.pixels(np.array([at]))[0] + [0.0, 30.0])
    for name, pixels in zip(arrows, lines, strict=True):
        names.write(name, pixels.mean(axis=0) - [0.0, 26.0])
    for zone in zones:
        names.write(str(zone["name"]), view.pixels(np.array(zone["outlines"][0])).mean(axis=0))
    for name, place in knowledge.places.items():
        names.write(name, view.pixels(np.array([[place.pose.x, place.pose.y]]))[0])
    entries = [(name, colour) for name, (_, colour) in arrows.items()] + ([("person", _PERSON)] if people else [])
    entries += [("surface", _TOP)] if world.surfaces else []
    entries += [(zone["rule"], ZONE_COLOURS[zone["kind"]]) for zone in zones]
    return np.vstack([with_legend(picture, view.pixels_per_m, entries), _door_list(knowledge, picture.shape[1])])


def plan_view(world: World) -> MapView:
    """View from above of walls, tinted rooms and surfaces, within a white rim for the coordinates."""
    grid = load_grid_map(world.surveyed.keepout_map_path)
    cells = grid.grey(free=255, unknown=150, occupied=0)
    rows, columns = cells.shape
    longest = max(columns, rows)
    whole_px = np.clip(_CLEAR_PX_PER_M * longest * grid.resolution_m, WIDTH_PX, _WIDEST_PX)
    scale = (float(whole_px) - 2 * _RIM_PX) / longest
    size = (round(columns * scale), round(rows * scale))
    grey = cv2.resize(np.ascontiguousarray(cells[::-1]), size, interpolation=cv2.INTER_AREA)
    rim = ((_RIM_PX, _RIM_PX), (_RIM_PX, _RIM_PX), (0, 0))
    walls = np.asarray(np.pad(np.repeat(grey[..., None], 3, axis=2), rim, "maximum"), np.uint8)
    pixels_per_m = scale / grid.resolution_m
    origin_m = (grid.origin_m[0] - _RIM_PX / pixels_per_m, grid.origin_m[1] - _RIM_PX / pixels_per_m)
    view = _view(walls, origin_m, pixels_per_m)
    ground = np.full_like(walls, 255)
    for index, polygon in enumerate(world.rooms.values()):
        cv2.fillPoly(ground, [view.whole_pixels(polygon)], _TINTS[index % len(_TINTS)])
    picture = np.asarray(np.minimum(walls, ground), np.uint8)
    for side in (np.s_[:_RIM_PX], np.s_[-_RIM_PX:], np.s_[:, :_RIM_PX], np.s_[:, -_RIM_PX:]):
        picture[side] = 255
    for surface in world.surfaces.values():
        corners = [view.whole_pixels(surface.polygon_W)]
        cv2.fillPoly(picture, corners, _TOP, cv2.LINE_AA)
        cv2.polylines(picture, corners, True, _SURFACE, 2, cv2.LINE_AA)
    return MapView(picture, view.X_WC, view.intrinsics)


def _view(picture: Picture, origin_m: tuple[float, float], pixels_per_m: float) -> MapView:
    """Returns the grid as the picture of a camera high above the centre of the floor."""
    height, width = picture.shape[:2]
    focal = pixels_per_m * _ABOVE_M
    down = RotationMatrix(np.diag([1.0, -1.0, -1.0]))
    middle = np.array([width, height]) / 2.0 / pixels_per_m + origin_m
    X_WC = RigidTransform(down, np.array([*middle, _ABOVE_M]))
    return MapView(picture, X_WC, Intrinsics(width, height, focal, focal, width / 2.0 - 0.5, height / 2.0 - 0.5))


def _draw_coordinates(view: MapView, *, whole: bool) -> None:
    """Draws x at the lower rim and y at the left one, each metre; `whole` lines go through the plan."""
    picture = view.picture
    height, width = picture.shape[:2]
    left, right, top, bottom = _RIM_PX, width - _RIM_PX, _RIM_PX, height - _RIM_PX
    x_zero, y_zero = view.pixels(np.zeros((1, 2)))[0]
    scale = view.pixels_per_m
    step = 1 if scale >= _CLOSEST_PX_PER_M else 5
    for metre in _metres((left - x_zero) / scale, (right - x_zero) / scale, step):
        x = round(x_zero + metre * scale)
        if whole:
            cv2.line(picture, (x, top), (x, bottom), _LINE, 1)
        cv2.line(picture, (x, bottom), (x, bottom + _TICK_PX), _INK, 2)
        if x < width - _AXIS_PX:
            _write_small(picture, f"{metre}", (x, bottom + 22))
    for metre in _metres((y_zero - bottom) / scale, (y_zero - top) / scale, step):
        y = round(y_zero - metre * scale)
        if whole:
            cv2.line(picture, (left, y), (right, y), _LINE, 1)
        cv2.line(picture, (left - _TICK_PX, y), (left, y), _INK, 2)
        _write_small(picture, f"{metre}", (left - 22, y))
    _write_small(picture, "x (m)", (width - 24, bottom + 22))
    _write_small(picture, "y (m)", (left, 14))


def _metres(low: float, high: float, step: int) -> range:
    """Multiples of a step within two coordinates, m."""
    return range(int(np.ceil(low / step - 1e-6)) * step, int(np.floor(high + 1e-6)) + 1, step)


def _draw_disc(view: MapView, names: Names, at: Sequence[float] | FloatArray, colour: _Colour) -> None:
    centre, radius = view.pixels(np.array([at]))[0], max(6, round(_PERSON_M * view.pixels_per_m))
    pixel = (round(centre[0]), round(centre[1]))
    cv2.circle(view.picture, pixel, radius, _PLATE, cv2.FILLED, cv2.LINE_AA)
    cv2.circle(view.picture, pixel, radius - 2, colour, cv2.FILLED, cv2.LINE_AA)
    names.keep_clear(centre, float(radius))


def _draw_doors(view: MapView, knowledge: Knowledge, names: Names) -> None:
    """Draws each door as a circle of its width, with its number in the middle."""
    for number, door in enumerate(knowledge.doors, 1):
        radius = max(3, round(door.width / 2.0 * view.pixels_per_m))
        centre = view.pixels(np.array([door.at]))[0]
        cv2.circle(view.picture, (round(centre[0]), round(centre[1])), radius, _INK, 2, cv2.LINE_AA)
        _write_small(view.picture, f"{number}", centre, names)


def _door_list(knowledge: Knowledge, width_px: int) -> Picture:
    """Draws a strip with the number of each door, its rooms and its clear width, in columns."""
    lines = [f"door {n}: {' - '.join(door.between)}, {door.width:g} m" for n, door in enumerate(knowledge.doors, 1)]
    wide = max((cv2.getTextSize(drawable(line), _FONT, _FONT_SCALE, 1)[0][0] for line in lines), default=0) + 40
    columns = max(1, (width_px - 20) // wide)
    rows = -(-len(lines) // columns)
    strip = np.full((_ROW_PX * rows + (_ROW_PX // 2 if rows else 0), width_px, 3), 255, np.uint8)
    for number, line in enumerate(lines):
        column, row = divmod(number, rows)
        at = (20 + column * wide, _ROW_PX * (row + 1) - 8)
        cv2.putText(strip, drawable(line), at, _FONT, _FONT_SCALE, _INK, 1, cv2.LINE_AA)
    return strip


def _write_small(
    picture: Picture,
    text: str,
    centre: Sequence[float] | FloatArray,
    names: Names | None = None,
    ground: _Colour = _PLATE,
) -> None:
    """Writes a small text on a plate around a pixel; later labels keep clear of it."""
    (width, height), _ = cv2.getTextSize(drawable(text), _FONT, _FONT_SCALE, 1)
    x = round(float(np.clip(centre[0] - width / 2.0, 3, max(3, picture.shape[1] - width - 3))))
    y = round(float(centre[1] + height / 2.0))
    cv2.rectangle(picture, (x - 3, y - height - 3), (x + width + 3, y + 4), ground, cv2.FILLED)
    cv2.putText(picture, drawable(text), (x, y), _FONT, _FONT_SCALE, _INK, 1, cv2.LINE_AA)
    if names is not None:
        for along in np.arange(x, x + width + 1.0, height):
            names.keep_clear((along, y - height / 2.0), 0.7 * height)


def _arrow(start: Pose2D) -> FloatArray:
    ahead = np.array([np.cos(start.yaw_rad), np.sin(start.yaw_rad)])
    steps = np.array([[0.0], [_ARROW_M / 2.0], [_ARROW_M]])
    return np.asarray(np.array([start.x_m, start.y_m]) + steps * ahead)
