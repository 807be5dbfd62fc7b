"""Messages in the forms that viewers draw."""

import base64
import math

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader

from executive.record.announce import map_message
from executive.record.event_log import EventLog, box_annotations, compress_picture, viewer_messages
from executive.record.history import read_events
from skills.grid_map import GridMap
from skills.world_model import Zone, ZoneKind
from skills.zone_map import zone_messages

SEEN = {"class_name": "coke", "score": 0.9, "box": [10, 20, 30, 40]}


def test_a_path_becomes_poses_in_a_frame():
    ((topic, message),) = viewer_messages(
        "path", {"robot": "Alice", "frame": "world", "poses": [[1, 2, math.pi / 2]]}, 3.5
    )
    assert (topic, message["frame_id"], message["timestamp"]) == ("path", "world", {"sec": 3, "nsec": 500000000})
    assert message["poses"][0]["position"] == {"x": 1.0, "y": 2.0, "z": 0.0}
    assert message["poses"][0]["orientation"]["z"] == pytest.approx(math.sqrt(0.5))


def test_boxes_become_closed_lines_and_captions():
    message = box_annotations([SEEN], 1.0)
    assert message["points"][0]["type"] == 2
    assert [(p["x"], p["y"]) for p in message["points"][0]["points"]] == [(10, 20), (30, 20), (30, 40), (10, 40)]
    assert message["texts"][0]["text"] == "coke 0.90"


def test_a_message_without_a_picture_is_left_alone():
    message = {"image": None, "x": 1}
    assert compress_picture(message, 0.0) is message


def test_a_picture_is_small(write_log):
    """A key image of 640 x 480 with fine texture stays below 200 kB in the log."""
    noise = np.random.default_rng(0).normal(128, 12, (480, 640, 3)).clip(0, 255).astype(np.uint8)
    path = write_log(("detections", {"image": noise, "source": "hand", "detections": []}))
    assert path.stat().st_size < 200_000


def test_a_map_comes_back_the_right_way_up(knowledge, write_log):
    occupied = np.zeros((4, 6), bool)
    occupied[0, 0] = True  # smallest x and y: the lower left of the picture
    path = write_log(("map", map_message(GridMap(occupied, 0.5, (-1.0, -2.0)), knowledge, world="flat")))
    event, grid = read_events(path)
    assert (event.data["origin_m"], event.data["size_m"]) == ({"x": -1.0, "y": -2.0}, {"x": 3.0, "y": 2.0})
    assert {place["name"] for place in event.data["places"]} == {"kitchen", "bedroom", "hall", "bathroom"}
    outlines = {place["name"]: place.get("outline") for place in event.data["places"]}
    assert outlines["hall"] == [list(corner) for corner in knowledge.rooms["hall"]]
    picture = cv2.imdecode(np.frombuffer(base64.b64decode(event.data["data"]), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture.shape == (4, 6)
    assert (picture[3, 0], picture[0, 0]) == (0, 255)
    cells = np.frombuffer(base64.b64decode(grid.data["data"]), np.uint8).reshape(4, 6)
    assert (grid.topic, grid.data["column_count"], cells[0, 0], cells[1, 1]) == ("map/grid", 6, 100, 0)


def test_zones_become_outlines_on_the_floor_with_their_rules():
    zone = Zone("den", ZoneKind.KEEP_OUT, ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0)))
    tree, (topic, scene) = viewer_messages("tree", {"robot": "Alice", "zones": zone_messages([zone])}, 1.5)
    (entity,) = scene["entities"]
    assert (tree[0], topic, entity["frame_id"]) == ("tree", "map/zones", "world")
    assert [(p["x"], p["y"]) for p in entity["lines"][0]["points"]] == [(0, 0), (2, 0), (2, 2)]
    assert (entity["texts"][0]["text"], len(scene["deletions"])) == ("keep out of: den", 1)
    assert len([*viewer_messages("tree", {"robot": "Alice"}, 1.5)]) == 1


def test_viewers_remove_the_zones_of_the_mission_before(tmp_path, clock):
    log = EventLog(tmp_path / "log.mcap", clock)
    for more in (
        {},
        {"zones": zone_messages([Zone("den", ZoneKind.SILENT, ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0)))])},
        {},
    ):
        log("tree", {"robot": "Alice", "root": {}, **more})
    log.close()
    scenes = [event.data for event in read_events(log.path) if event.topic == "map/zones"]
    assert [len(scene["entities"]) for scene in scenes] == [1, 0]


def test_every_topic_of_a_mission_has_a_schema_of_its_own(compiled, make, log_run):
    path, _ = log_run(compiled(*make.FETCH))
    with path.open("rb") as file:
        named = {channel.topic: schema.name for schema, channel, _ in make_reader(file).iter_messages() if schema}
    assert (named["pose"], named["transform"]) == ("foxglove.PoseInFrame", "foxglove.FrameTransform")
    assert (named["scan"], named["joints"]) == ("foxglove.LaserScan", "foxglove.JointStates")
    assert "errand.Message" not in named.values()
