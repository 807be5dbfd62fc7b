"""Which pictures of a run are kept for an answer."""

import base64
import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from executive.app.report.artifacts import (
    MOST_SHOWN,
    MOST_VIEWS,
    Artifacts,
    draw_answer,
    save_pictures,
    save_views,
    to_jpeg,
)
from executive.app.report.report_page import _pictures
from executive.record.history import Event
from executive.testing.bench import scripted_bench
from plant.robots.spot.kind import spot_capabilities


def looked(*boxes, grey=False):
    picture = np.full((48, 64) if grey else (48, 64, 3), 90, np.uint8)
    found = [{"class_name": "hammer", "score": 0.9, "box": list(box)} for box in boxes]
    return {"detections": found, "image": picture}


def began(artifacts, node="alice/q"):
    artifacts.message("transitions", {"robot": "", "node": node, "t": 0.0, "to": "RUNNING", "message": ""})


def answered(artifacts, answer):
    return artifacts.message("answer", {"node": "alice/q", "question": "q", "answer": answer, "message": "m"})


def test_a_positive_answer_shows_the_found_object_with_its_box(tmp_path):
    artifacts = Artifacts()
    began(artifacts)
    artifacts.message("detections", looked())
    artifacts.message("detections", looked((10, 10, 40, 30)))
    artifacts.message("object_destination", {"class_name": "hammer"})
    told = answered(artifacts, True)
    assert told["image"].shape == (48, 64, 3)
    assert np.any(told["image"] != 90)
    assert draw_answer(artifacts, tmp_path).stat().st_size > 100


def test_a_negative_answer_shows_all_views():
    artifacts = Artifacts()
    began(artifacts)
    for grey in (False, True, False, False, False):
        artifacts.message("detections", looked(grey=grey))
    assert answered(artifacts, False)["image"].shape == (480, 960, 3)


def test_a_picture_that_stands_on_end_keeps_its_shape_among_the_views():
    # 48 x 64 upright in a tile of 320 x 240: 180 wide, with empty sides
    artifacts = Artifacts()
    began(artifacts)
    artifacts.message("detections", {"detections": [], "image": np.full((64, 48, 3), 90, np.uint8)})
    sheet = answered(artifacts, False)["image"]
    assert sheet.shape == (240, 320, 3)
    assert int(np.all(sheet[120] == 90, axis=1).sum()) == 180


def test_an_answer_about_a_person_shows_the_person_and_not_an_object_of_an_earlier_answer():
    # a hammer is found and confirmed, then a person is seen: no object is confirmed
    artifacts = Artifacts()
    began(artifacts)
    artifacts.message("detections", looked((10, 10, 40, 30)))
    artifacts.message("object_destination", {"class_name": "hammer"})
    hammer = answered(artifacts, True)["image"]
    artifacts.message("detections", looked())
    artifacts.message("detections", looked((30, 20, 60, 44)))
    assert np.any(answered(artifacts, True)["image"] != hammer)


def test_an_answer_of_a_person_has_no_picture_of_what_the_robot_saw_before():
    # a beer is seen on the way; the person then declines a drink
    artifacts = Artifacts()
    ask = {"id": "alice/ask", "name": "ask", "children": []}
    artifacts.message("tree", {"robot": "", "root": {"id": "alice", "name": "drinks", "children": [ask]}})
    artifacts.message("detections", looked((10, 10, 40, 30)))
    artifacts.message("object_destination", {"class_name": "beer"})
    began(artifacts, "alice/ask")
    artifacts.message("detections", looked((10, 10, 40, 30)))
    said = {
        "node": "alice/ask",
        "question": "Do you want a drink?",
        "answer": "no",
        "message": "Do you want a drink?: no",
    }
    assert "image" not in artifacts.message("answer", said)


def test_an_answer_shows_no_view_from_before_its_node_began():
    artifacts = Artifacts()
    artifacts.message("detections", looked((10, 10, 40, 30)))
    began(artifacts)
    assert "image" not in answered(artifacts, True)


def test_a_count_shows_every_view_that_confirmed_an_object():
    artifacts = Artifacts()
    began(artifacts)
    for _ in range(2):
        artifacts.message("detections", looked((10, 10, 40, 30)))
        artifacts.message("object_destination", {"class_name": "hammer"})
        artifacts.message("detections", looked())
    assert answered(artifacts, 2)["image"].shape == (240, 640, 3)


def taken(of, **more):
    facts = {"robot": "Alice", "of": of, "camera": "hand", "stamp_s": 4.0, "pose": {"position": {"x": 1.0}}}
    return {"caption": of, **facts, **more}


def test_the_answer_to_a_wanted_picture_is_that_picture_alone():
    artifacts = Artifacts()
    artifacts.message("detections", looked((10, 10, 40, 30)))
    artifacts.message("pictures", taken("the stove", image=np.full((48, 64, 3), 17, np.uint8)))
    told = artifacts.message("answer", {"node": "a/b", "robot": "Alice", "answer": "taken", "message": "m"})
    assert np.array_equal(told["image"], np.full((48, 64, 3), 17))
    assert artifacts.of_robot("Alice").shown == []


def test_wanted_pictures_are_written_with_their_poses_and_times(tmp_path):
    data = base64.b64encode(to_jpeg(np.full((48, 64, 3), 90, np.uint8))).decode()
    events = [Event("pictures", 4.0, taken(of, data=data, format="jpeg")) for of in ("the stove", "the pump")]
    others = [Event("pictures", 5.0, {"caption": "another", "data": data}), Event("answer", 5.0, {})]
    files = save_pictures([*events, *others], tmp_path / "pictures")
    assert [file.name for file in files] == ["01-stove.jpg", "02-pump.jpg"]
    assert cv2.imread(str(files[1])).shape == (48, 64, 3)
    facts = json.loads((tmp_path / "pictures" / "pictures.json").read_text())
    assert [(each["file"], each["of"], each["stamp_s"]) for each in facts] == [
        ("01-stove.jpg", "the stove", 4.0),
        ("02-pump.jpg", "the pump", 4.0),
    ]
    assert save_pictures(others, tmp_path / "none") == () and not (tmp_path / "none").exists()


def test_without_a_question_there_is_no_picture(tmp_path):
    artifacts = Artifacts()
    artifacts.message("detections", looked((10, 10, 40, 30)))
    assert draw_answer(artifacts, tmp_path) is None
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("restored", "moments"), [({}, {"place": 5.0}), ({"restored": True}, {})])
def test_a_placement_from_before_a_restart_is_no_moment_of_this_run(restored, moments):
    artifacts = Artifacts()
    placed = {"robot": "Alice", "node": "alice/tidy/place", "t": 5.0, "to": "SUCCESS", "message": "put it down"}
    artifacts.message("transitions", {**placed, **restored})
    assert artifacts.of_robot("Alice").moments == moments


def test_only_the_last_views_before_an_answer_are_kept():
    artifacts = Artifacts()
    for _ in range(100):
        artifacts.message("detections", looked())
    assert len(artifacts.of_robot("").looked) == 12


def test_pictures_that_a_skill_shows_go_into_the_report_with_their_captions():
    artifacts = Artifacts()
    context = replace(
        scripted_bench(spot_capabilities())[0].context(), publish=lambda topic, message: logged.append((topic, message))
    )
    logged = []
    for number in range(MOST_SHOWN + 2):
        context.show_picture(np.full((48, 64, 3), 90, np.uint8), f"gauge {number}")
    for topic, message in logged:
        artifacts.message(topic, {"robot": "Alice", **message})
    pictures = list(_pictures(artifacts, "Alice", ["Alice"]))
    assert [caption for caption, _ in pictures] == [f"gauge {number}" for number in range(MOST_SHOWN)]
    assert all(data.startswith(b"\xff\xd8") for _, data in pictures)


def unknown(x_m, *views, size_m=(0.0723, 0.07, 0.241)):
    """A skill's message about an object that nothing recognised."""
    picture = np.full((48, 64, 3), 90, np.uint8)
    encoded = [base64.b64encode(view).decode() for view in views]
    return {"robot": "Alice", "caption": "What is this?", "image": picture} | (
        {"views": encoded, "position_W": [x_m, 2.0, 0.9], "size_m": list(size_m)} if views else {}
    )


def test_views_of_each_unexplained_object_are_written_for_the_import(tmp_path):
    artifacts = Artifacts()
    thin = (0.2, 0.004, 0.03)
    seen = unknown(1.0, b"a", b"b"), unknown(3.0, *[b"c"] * 4, size_m=thin), unknown(2.0), unknown(4.0, b"f")
    for message in (*seen, unknown(1.02, b"d", b"e"), unknown(5.0, *[b"g"] * 4, size_m=(0.7, 0.1, 0.1))):
        artifacts.message("pictures", message)
    save_views(artifacts, tmp_path)
    files = {str(file.relative_to(tmp_path)): file.read_bytes() for file in sorted(tmp_path.rglob("*.png"))}
    views = (b"a", b"b", b"d", b"e"), [b"c"] * 4, [b"f"], [b"g"] * 4
    expected = {
        f"what_is_this_{n}/view_{k}.png": data
        for n, own in enumerate(views, start=1)
        for k, data in enumerate(own, start=1)
    }
    assert files == expected
    commands = [caption.rpartition("folder: ")[2] for caption, _ in artifacts.of_robot("Alice").shown]
    assert commands == [
        "errand object import what_is_this_2 --name NAME --size 200x10x30",
        "What is this?",  # without views
        "What is this?",  # too few for the import
        "errand object import what_is_this_1 --name NAME --size 72x70x241",
        "What is this?",  # too long
    ]


def test_the_views_of_one_object_are_limited(tmp_path):
    artifacts = Artifacts()
    for _ in range(MOST_SHOWN):
        artifacts.message("pictures", unknown(1.0, *[b"a"] * 6))
    save_views(artifacts, tmp_path)
    assert len(list(tmp_path.rglob("*.png"))) == MOST_VIEWS


def captions(*messages):
    """The steps of a robot whose mission has a drive and, beside it or before it, a charge."""
    leaves = [{"id": f"a/{name}", "name": name, "step": True, "children": []} for name in ("drive", "charge")]
    artifacts = Artifacts()
    artifacts.message("tree", {"robot": "Alice", "root": {"id": "a", "name": "round", "children": leaves}})
    for t, node, to, text in messages:
        own = {"robot": "Alice", "node": f"a/{node}", "t": t, "message": text}
        artifacts.message("transitions" if to else "activity", own | ({"to": to} if to else {}))
    return artifacts.steps["Alice"]


def test_the_caption_is_of_the_node_that_still_runs_when_another_has_ended():
    told = captions(
        (0.1, "drive", "RUNNING", "on the way"),
        (2.0, "charge", "RUNNING", "charging"),
        (5.0, "charge", "SUCCESS", "charged"),
    )
    assert told == [(0.1, "drive – on the way"), (2.0, "charge – charging"), (5.0, "drive – on the way")]


def test_the_last_caption_is_the_result():
    told = captions((0.1, "drive", "RUNNING", "on the way"), (2.0, "drive", "SUCCESS", "standing there"))
    assert told[-1] == (2.0, "drive – standing there")


def test_a_node_that_begins_when_another_ends_has_the_caption():
    told = captions(
        (0.1, "drive", "RUNNING", "on the way"),
        (2.0, "drive", "SUCCESS", "standing there"),
        (2.0, "charge", "RUNNING", "charging"),
    )
    assert told == [(0.1, "drive – on the way"), (2.0, "charge – charging")]


def test_a_caption_has_no_distance_that_is_soon_wrong():
    told = captions((0.1, "drive", "RUNNING", "planning"), (0.4, "drive", "", "on the way, 4.6 m to go"))
    assert told[-1] == (0.4, "drive – on the way")
