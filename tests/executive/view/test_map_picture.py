"""A robot's way drawn on its map, from the messages of a log."""

import base64
import math

import cv2
import numpy as np
import pytest

from executive.record.history import Event
from executive.view.map_picture import WIDTH_PX, map_picture
from executive.view.text import ROBOT_COLOURS, rgb_of
from skills.inputs.errors import InputError
from skills.map_drawing import ZONE_COLOURS, draw_zone
from skills.world_model import Zone, ZoneKind
from skills.zone_map import zone_messages

SCALE = WIDTH_PX / 7.0
"""Pixels per metre of the map below, 7 m x 3.5 m from (-1, -1)."""
TRAIL, PLAN, PARTICLE, SEEN = (120, 158, 0), (178, 114, 0), (167, 121, 204), (0, 94, 213)


def ground():
    png = cv2.imencode(".png", np.full((70, 140), 255, np.uint8))[1].tobytes()
    data = {"resolution_m": 0.05, "origin_m": {"x": -1.0, "y": -1.0}, "data": base64.b64encode(png).decode()}
    return Event("map", 0.0, data)


def pose(stamp_s, x, y):
    position = {"x": x, "y": y, "z": 0.5}
    return Event("pose", stamp_s, {"robot": "Alice", "pose": {"position": position}, "yaw_rad": 0.0})


EVENTS = (
    ground(),
    pose(0.5, 0.0, 0.0),
    Event("path", 1.0, {"robot": "Alice", "poses": [{"position": {"x": x, "y": 1.5}} for x in (0.0, 5.0)]}),
    Event("navigation", 1.5, {"robot": "Alice", "particle_x": [1], "particle_y": [2], "seen_x": [5], "seen_y": [0]}),
    pose(2.0, 4.0, 0.0),
)
CLOSED, UNKNOWN, OPEN = (40, 30, 200), (150, 150, 150), (30, 74, 122)
INK = (40, 40, 40)


def doors(stamp_s, state, seen_s):
    door = {"between": ["hall", "kitchen"], "ends": [[3.0, 0.8], [3.0, 1.2]], "state": state, "seen_s": seen_s}
    return Event("doors", stamp_s, {"robot": "Alice", "doors": [door]})


def colour_at(picture, x, y):
    """The colour at a place in the world (m)."""
    return tuple(int(part) for part in picture[round((2.5 - y) * SCALE), round((x + 1.0) * SCALE)])


# What is drawn, somewhere on it (x, y), its colour, and when it came to be known.
DRAWN = [
    ("the way walked", (2.0, 0.0), TRAIL, 2.0),
    ("the planned path", (2.0, 1.5), PLAN, 1.0),
    ("a particle", (1.0, 2.0), PARTICLE, 1.5),
    ("a blocked cell", (5.0, 0.0), SEEN, 1.5),
]


@pytest.mark.parametrize(("what", "place", "colour", "known_s"), DRAWN)
def test_obstacles_are_drawn_once_the_robot_has_seen_them(what, place, colour, known_s):
    assert colour_at(map_picture(EVENTS), *place) == colour
    assert colour_at(map_picture(EVENTS, known_s - 0.1), *place) != colour


def test_a_door_is_drawn_in_the_state_in_which_it_was_last_seen():
    events = (*EVENTS, doors(0.0, "unknown", None), doors(1.0, "closed", 1.0), doors(3.0, "open", 3.0))
    drawn = [colour_at(map_picture(events, at_s), 3.0, 1.0) for at_s in (0.5, 1.5, 3.5)]
    assert drawn == [UNKNOWN, CLOSED, OPEN]


def test_a_named_pose_is_a_dot_with_a_line_to_where_the_robot_looks():
    place = {"name": "window", "x": 3.0, "y": 1.0, "yaw_rad": math.pi / 2}
    picture = map_picture((Event("map", 0.0, {**EVENTS[0].data, "places": [place]}), *EVENTS[1:]))
    assert [colour_at(picture, 3.0, y) == INK for y in (0.9, 1.0, 1.08, 1.2)] == [False, True, True, False]


def tree(stamp_s, *zones):
    return Event("tree", stamp_s, {"robot": "Alice", "zones": zone_messages(zones)})


def test_the_zones_of_the_newest_mission_are_drawn():
    zone = Zone("den", ZoneKind.SILENT, ((1.0, -0.9), (3.0, -0.9), (3.0, -0.5), (1.0, -0.5)))
    events = (*EVENTS, tree(1.0, zone), tree(3.0))
    drawn = [colour_at(map_picture(events, at_s), 1.2, -0.9) for at_s in (0.5, 2.0, 3.5)]
    assert drawn == [(255, 255, 255), ZONE_COLOURS["silent"][::-1], (255, 255, 255)]


def test_a_keep_out_zone_is_hatched_and_a_one_way_zone_has_an_arrow():
    outline = np.array([[10, 10], [190, 10], [190, 90], [10, 90]], np.int32)
    pictures = {}
    for kind, ahead in (("silent", None), ("keep_out", None), ("one_way", 0.0)):
        pictures[kind] = np.full((100, 200, 3), 255, np.uint8)
        draw_zone(pictures[kind], [outline], kind, ZONE_COLOURS[kind], ahead)
    colours = {
        kind: len(np.unique(picture[14:86, 14:186].reshape(-1, 3), axis=0)) for kind, picture in pictures.items()
    }
    assert (colours["silent"], colours["keep_out"]) == (1, 2)
    assert tuple(pictures["one_way"][50, 100]) == ZONE_COLOURS["one_way"]
    assert (pictures["silent"][5, 5] == 255).all()


def test_the_footprint_is_where_the_robot_was_at_that_time():
    then, now = map_picture(EVENTS, 1.0), map_picture(EVENTS)
    assert colour_at(then, 0.3, 0.1) == colour_at(now, 4.3, 0.1)
    assert colour_at(then, 4.3, 0.1) == (255, 255, 255)


def test_a_log_without_a_map_is_refused():
    with pytest.raises(InputError, match="no map"):
        map_picture(EVENTS[1:], math.inf)


def test_each_of_several_robots_is_drawn_in_its_own_colour_with_what_it_has_reserved():
    bob = {"robot": "Bob", "pose": {"position": {"x": 1.0, "y": -0.5, "z": 0.5}}, "yaw_rad": 0.0}
    way = {"robot": "Bob", "turn": 2, "x": [1.0, 5.0], "y": [-0.5, -0.5]}
    given_back = Event("reserved_path", 4.0, {"robot": "Bob", "turn": None, "x": [], "y": []})
    events = (*EVENTS, Event("pose", 2.0, bob), Event("reserved_path", 3.0, way), given_back)
    blue, orange = (rgb_of(colour)[::-1] for colour in ROBOT_COLOURS[:2])
    then = map_picture(events, 3.0)
    assert (colour_at(then, 2.0, 0.0), colour_at(then, 0.9, -0.4)) == (blue, orange)
    pale = colour_at(then, 3.0, -0.5)
    assert pale == tuple(round(0.35 * part + 0.65 * 255) for part in orange)
    assert colour_at(map_picture(events), 3.0, -0.5) == (255, 255, 255)


def test_the_colours_of_robots_are_all_different():
    assert len({rgb_of(colour) for colour in ROBOT_COLOURS}) == len(ROBOT_COLOURS) >= 4
