"""A log as a ROS 2 bag: the usual types, decoded by a reader of ROS 2 messages."""

import json

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from executive.record.event_log import EventLog
from executive.record.history import read_events
from executive.record.ros2 import write_ros2
from skills.files.errors import InputError


@pytest.fixture
def decoded(tmp_path, compiled, run_tree, make, clock):
    """A mission's log and the messages of its bag: (schema name, topic, time in ns, message)."""
    log = EventLog(tmp_path / "log.mcap", clock)
    picture = np.full((24, 32, 3), 200, np.uint8)
    log("detections", {"image": picture, "source": "hand", "detections": []})
    log("path", {"robot": "Alice", "frame": "world", "poses": [[1.0, 2.0, 0.0], [3.0, 4.0, 0.5]]})
    run_tree(compiled(*make.FETCH), log=log)
    log.close()
    events = read_events(log.path)
    bag = tmp_path / "bag.mcap"
    count = write_ros2(events, bag)
    with bag.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        messages = [(schema.name, channel.topic, message.log_time, told)
                    for schema, channel, message, told in reader.iter_decoded_messages()]  # fmt: skip
    assert len(messages) == count == len([event for event in events if event.topic != "detections/boxes"])
    return events, messages


def test_poses_and_paths_are_those_of_the_log(decoded):
    events, messages = decoded
    told = {(name, topic): [] for name, topic, _, _ in messages}
    for name, topic, _, message in messages:
        told[name, topic].append(message)
    logged = [event.data["pose"]["position"] for event in events if event.topic == "pose"]
    poses = [each.pose.position for each in told["geometry_msgs/msg/PoseStamped", "/alice/pose"]]
    assert [(each.x, each.y) for each in poses] == [(each["x"], each["y"]) for each in logged]
    (path,) = told["nav_msgs/msg/Path", "/alice/path"]
    assert [(each.pose.position.x, each.pose.position.y) for each in path.poses] == [(1, 2), (3, 4)]
    assert path.header.frame_id == "world"


def test_pictures_are_compressed_images(decoded):
    (picture,) = [told for name, _, _, told in decoded[1] if name == "sensor_msgs/msg/CompressedImage"]
    assert (picture.format, bytes(picture.data)[:2]) == ("jpeg", b"\xff\xd8")


def test_other_messages_become_text_with_their_values_and_times(decoded):
    events, messages = decoded
    texts = [json.loads(told.data) for _, topic, _, told in messages if topic == "/errand/transitions"]
    assert texts == [event.data for event in events if event.topic == "transitions"]
    assert [time for _, _, time, _ in messages] == sorted(time for _, _, time, _ in messages)


def test_a_bag_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot write"):
        write_ros2((), tmp_path / "absent" / "bag.mcap")
