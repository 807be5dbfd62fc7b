"""The layout for Foxglove has Foxglove's form, and shows only topics and values that the log of a run has."""

import json
import numbers
from pathlib import Path

import pytest
from mcap.reader import make_reader

from executive import run_mission
from executive.words.schemas import schemas as log_schemas
from tests.docs.documents import DOCS

LAYOUT = json.loads((DOCS / "how-to" / "foxglove-layout.json").read_text(encoding="utf-8"))
PANELS = LAYOUT["configById"]
DRAWN = {
    "3D": {"Grid", "SceneUpdate", "LaserScan", "PosesInFrame", "PoseInFrame", "FrameTransform"},
    "Image": {"CompressedImage"},
    "annotations": {"ImageAnnotations"},
}
"""Foxglove's schemas by what draws them."""


def placed(layout):
    """The panels that a layout arranges. A node is a panel or splits its room in two, as Foxglove reads it."""
    if isinstance(layout, str):
        return [layout]
    assert layout.keys() <= {"direction", "first", "second", "splitPercentage"}
    assert layout["direction"] in ("row", "column") and 0 < layout.get("splitPercentage", 50) < 100
    return placed(layout["first"]) + placed(layout["second"])


def kind_of(panel):
    return panel.partition("!")[0]


def drawn_topics():
    """Topics with what draws them: the kind of the panel, or the annotations of a picture."""
    for panel, config in PANELS.items():
        yield from ((topic, kind_of(panel)) for topic in config.get("topics", ()))
        picture = config.get("imageMode", {})
        yield from ((picture[key], "Image") for key in ("imageTopic",) if key in picture)
        yield from ((topic, "annotations") for topic in picture.get("annotations", ()))


def plotted():
    """Paths of the plotted values: topic and field."""
    return [each["value"].split(".") for config in PANELS.values() for each in config.get("paths", ())]


def test_the_layout_has_the_parts_that_foxglove_reads():
    assert LAYOUT.keys() == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert {kind_of(panel) for panel in PANELS} <= {"3D", "Plot", "RawMessages", "Image"}
    for panel, config in PANELS.items():
        for path in config.get("paths", ()):
            assert (kind_of(panel), path["enabled"], path["timestampMethod"]) == ("Plot", True, "receiveTime")
        assert all(each["visible"] is True for each in config.get("topics", {}).values())


def test_the_layout_arranges_every_panel_that_it_describes_once():
    assert sorted(placed(LAYOUT["layout"])) == sorted(PANELS)


def test_the_schemas_of_the_log_have_each_topic_and_plotted_value():
    known = log_schemas()
    assert {topic for topic, drawn_by in drawn_topics() if drawn_by != "Image"} <= known.keys()  # any may be a picture
    for topic, field in plotted():
        assert known[topic].properties[field] == {"type": "number"}, (topic, field)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Schemas of the topics and their messages, in the log of a search in a world with a zone."""
    out = tmp_path_factory.mktemp("layout")
    search = "find a drink in the kitchen, but stay out of the office"
    short = {"start": "7.5 7.0 1.57", "time_limit_s": 6.0}  # the first look at the counter is over by then
    report = run_mission(search, **short, seed=1, out=out, record=False)
    schemas, messages = {}, {}
    with Path(report.log).open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            schemas[channel.topic] = schema.name
            messages.setdefault(channel.topic, []).append(json.loads(message.data))
    return schemas, messages


@pytest.mark.mission
def test_each_topic_of_the_layout_is_in_the_log_of_a_run_in_a_form_that_its_panel_draws(log):
    schemas, _ = log
    for topic, drawn_by in drawn_topics():
        assert schemas[topic].removeprefix("foxglove.") in DRAWN[drawn_by], topic
    raw = [config["topicPath"] for config in PANELS.values() if "topicPath" in config]
    assert raw and set(raw) <= schemas.keys()


@pytest.mark.mission
def test_each_plotted_value_is_a_number_in_the_log_of_a_run(log):
    _, messages = log
    assert len(plotted()) >= 4
    for topic, field in plotted():
        values = [message[field] for message in messages[topic]]
        assert values and all(isinstance(value, numbers.Real) for value in values), (topic, field)


@pytest.mark.mission
def test_the_scene_is_drawn_in_a_frame_of_the_log(log):
    _, messages = log
    frames = {message["parent_frame_id"] for message in messages["transform"]}
    assert {config["followTf"] for config in PANELS.values() if "followTf" in config} == frames
