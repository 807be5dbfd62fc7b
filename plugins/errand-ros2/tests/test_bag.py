"""A log as a ROS 2 bag: the usual types, decoded by three readers of ROS 2 messages."""

import json
import math

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.reader import read_ros2_messages
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from errand_ros2.bag import GRID, VIEWER_COPIES, write_bag
from executive.record.history import read_history
from executive.words.schemas import DERIVED
from skills.inputs.errors import InputError


@pytest.fixture(scope="module")
def events(log_of_session):
    return read_history(log_of_session).events


@pytest.fixture(scope="module")
def bag(tmp_path_factory, events):
    """Folder of the bag."""
    folder = tmp_path_factory.mktemp("bag")
    write_bag(events, folder / "bag")
    return folder / "bag"


@pytest.fixture(scope="module")
def decoded(bag):
    """Messages of the bag: (schema name, topic, time in ns, message)."""
    with (bag / "bag.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        return [(schema.name, channel.topic, message.log_time, told)
                for schema, channel, message, told in reader.iter_decoded_messages()]  # fmt: skip


def of_topic(decoded, topic):
    return [told for _, name, _, told in decoded if name == topic]


def test_poses_and_paths_are_those_of_the_log(events, decoded):
    logged = [event.data["pose"]["position"] for event in events if event.topic == "pose"]
    poses = [each.pose.position for each in of_topic(decoded, "/alice/pose")]
    assert [(each.x, each.y) for each in poses] == [(each["x"], each["y"]) for each in logged]
    (path,) = of_topic(decoded, "/alice/path")
    assert [(each.pose.position.x, each.pose.position.y) for each in path.poses] == [(1, 2), (3, 4)]
    assert path.header.frame_id == "world"


def test_transforms_lead_from_the_map_to_the_body_and_the_lidar(events, decoded):
    moves = [each for told in of_topic(decoded, "/tf") for each in told.transforms]
    assert len(moves) == len([event for event in events if event.topic == "pose"])
    assert {(each.header.frame_id, each.child_frame_id) for each in moves} == {("world", "alice/body")}
    last = of_topic(decoded, "/tf_static")[-1].transforms
    frames = [(each.header.frame_id, each.child_frame_id) for each in last]
    assert frames == [("map", "world"), ("alice/body", "alice/lidar")]
    assert last[1].transform.translation.z == pytest.approx(0.4)


def test_the_map_is_an_occupancy_grid(decoded):
    (grid,) = of_topic(decoded, "/map")
    cells = np.array(grid.data).reshape(grid.info.height, grid.info.width)
    assert (cells[0, 0], cells[3, 5], cells[1, 1]) == (100, -1, 0)
    assert (grid.info.resolution, grid.info.origin.position.x, grid.info.origin.position.y) == (0.5, -1.0, -2.0)


def test_scans_and_joint_states_have_the_usual_types(decoded):
    scan = of_topic(decoded, "/alice/scan")[0]
    assert scan.header.frame_id == "alice/lidar"
    assert math.isinf(scan.ranges[0]) and scan.ranges[1] == pytest.approx(2.0)
    assert scan.angle_min + scan.angle_increment * (len(scan.ranges) - 1) == pytest.approx(scan.angle_max)
    joints = of_topic(decoded, "/alice/joint_states")[0]
    assert (joints.name, joints.position, joints.effort) == (["elbow"], [0.5], [2.0])


def test_pictures_are_compressed_images_under_the_name_that_viewers_expect(decoded):
    (picture,) = of_topic(decoded, "/errand/detections/compressed")
    assert (picture.format, bytes(picture.data)[:2]) == ("jpeg", b"\xff\xd8")


def test_other_messages_become_text_with_their_values(events, decoded):
    texts = [json.loads(told.data) for told in of_topic(decoded, "/errand/transitions")]
    assert texts == [event.data for event in events if event.topic == "transitions"]
    assert not {topic.removeprefix("/errand/") for _, topic, _, _ in decoded} & DERIVED


def test_of_what_the_log_repeats_for_viewers_only_the_grid_is_read():
    assert VIEWER_COPIES | {GRID} == DERIVED


def test_times_are_those_of_the_wall_clock(events, decoded):
    start_s = next(event.data["start_s"] for event in events if event.topic == "wall")
    times = [time for _, _, time, _ in decoded]
    assert times == sorted(times)
    assert start_s > 1.6e9
    assert times[0] * 1e-9 == pytest.approx(start_s, abs=0.01)
    assert of_topic(decoded, "/alice/pose")[0].header.stamp.sec == pytest.approx(start_s, abs=1.0)


def test_late_listeners_get_the_map_and_static_transforms(bag):
    with (bag / "bag.mcap").open("rb") as file:
        channels = make_reader(file).get_summary().channels.values()
    latched = {each.topic for each in channels if "durability: 1" in each.metadata["offered_qos_profiles"]}
    assert latched == {"/map", "/tf_static"}


def test_the_metadata_say_what_the_bag_holds(bag, decoded):
    told = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (told["storage_identifier"], told["relative_file_paths"]) == ("mcap", ["bag.mcap"])
    assert told["starting_time"]["nanoseconds_since_epoch"] == decoded[0][2]
    assert told["duration"]["nanoseconds"] == decoded[-1][2] - decoded[0][2]
    counts = [each["message_count"] for each in told["topics_with_message_count"]]
    assert told["message_count"] == len(decoded) == sum(counts)


def test_rosbags_reads_the_folder_as_a_bag(bag, decoded):
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = {}
    with Reader(bag) as reader:
        for connection, _, data in reader.messages():
            kinds.setdefault(connection.topic, store.deserialize_cdr(data, connection.msgtype))
        map_qos = next(each.ext.offered_qos_profiles for each in reader.connections if each.topic == "/map")
        assert reader.message_count == len(decoded)
    assert (map_qos[0].durability.name, kinds["/map"].info.width) == ("TRANSIENT_LOCAL", 6)
    assert kinds["/tf"].transforms[0].child_frame_id == "alice/body"
    assert kinds["/alice/scan"].ranges[1] == pytest.approx(2.0)
    assert kinds["/alice/joint_states"].name == ["elbow"]


def test_a_bag_may_be_one_file(tmp_path, events, decoded):
    count = write_bag(events, tmp_path / "one.mcap")
    topics = [message.channel.topic for message in read_ros2_messages(str(tmp_path / "one.mcap"))]
    assert count == len(topics) == len(decoded)


def test_a_bag_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot write"):
        write_bag((), tmp_path / "absent" / "bag.mcap")
