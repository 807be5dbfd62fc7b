"""`errand ros2 bag`: bags as folders and files, of one robot or all; `errand serve-ros2`; and bad input."""

import socket

import pytest
import yaml
from mcap.reader import make_reader

from tests.executive.cli.calls import done, refusal


def topics_of(file):
    """The topics of a bag's file."""
    with file.open("rb") as opened:
        return {channel.topic for channel in make_reader(opened).get_summary().channels.values()}


def test_a_folder_gets_the_bag_under_its_own_name_with_metadata(log_file, tmp_path):
    said = done("ros2", "bag", log_file, "--out", tmp_path / "mine").stderr
    assert {file.name for file in (tmp_path / "mine").iterdir()} == {"metadata.yaml", "mine.mcap"}
    (told,) = yaml.safe_load((tmp_path / "mine/metadata.yaml").read_text()).values()
    assert said == f"{told['message_count']} messages in {tmp_path / 'mine'}\n"
    assert topics_of(tmp_path / "mine/mine.mcap") >= {"/map", "/tf", "/alice/scan", "/alice/path", "/bob/path"}


def test_a_name_that_ends_in_mcap_gets_one_file(log_file, tmp_path):
    done("ros2", "bag", log_file, "-o", tmp_path / "one.mcap")
    assert {file.name for file in tmp_path.iterdir()} == {log_file.name, "one.mcap"}
    assert "/alice/pose" in topics_of(tmp_path / "one.mcap")


def test_the_bag_of_one_robot_leaves_the_others_out(log_file, tmp_path):
    done("ros2", "bag", log_file, "--out", tmp_path / "bob.mcap", "--robot", "bob")
    topics = topics_of(tmp_path / "bob.mcap")
    assert topics >= {"/map", "/bob/path"}
    assert not [name for name in topics if name.startswith("/alice/") or name == "/tf"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("log.mcap --out bag --robot carl", "log.mcap: the log has no robot 'carl'; there are: Alice, Bob\n"),
        ("absent.mcap --out bag", "absent.mcap: there is no such file; name a log that exists\n"),
        ("log.mcap --out full", "full: cannot write it (Directory not empty); name another --out\n"),
        ("log.mcap --out no/such/bag.mcap", "no/such/bag.mcap: cannot write it"),
    ],
)
def test_bad_input_is_refused_in_one_line(words, message, log_file, tmp_path, monkeypatch):
    (tmp_path / "full").mkdir()
    (tmp_path / "full/file").touch()
    monkeypatch.chdir(tmp_path)
    said = refusal("ros2", "bag", *words.split())
    assert said.startswith(f"errand: {message}") and said.count("\n") == 1
    assert {file.name for file in tmp_path.iterdir()} == {"log.mcap", "full"}


def test_a_bag_needs_a_name(log_file):
    assert "'--out'" in refusal("ros2", "bag", log_file)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("300", "'300' is no ROS domain: domains go to 232"),
        ("0@:0", "ports from 1 to 65535"),
        ("here", "'here' is no ROS domain"),
        ("--robot 1a", "'/1a' is no name of ROS 2"),
        ("--kind crane", "no kind of robot 'crane'"),
        ("--world nowhere", "unknown world 'nowhere'"),
        ("0@192.0.2.1", "no Zenoh router answers at 192.0.2.1:7447"),
    ],
)
def test_a_robot_that_cannot_be_served_is_refused_in_one_line(words, message):
    pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")
    said = refusal("serve-ros2", *words.split())
    assert message in said
    assert said.count("\n") == 1


@pytest.mark.mission
def test_a_simulated_robot_is_served_for_a_while():
    pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    told = done("serve-ros2", f"7@127.0.0.1:{port}", "--for", "0.5", "--robot", "Bob", "--map", "--ground-truth")
    assert told.stdout == f"ROS 2: /bob, domain 7, Zenoh at tcp/127.0.0.1:{port} (the router is here); Ctrl-C ends it\n"
