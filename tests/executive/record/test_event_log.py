"""The event log: what is written comes back, also from a file that was cut off."""

import base64
import errno
import io
import math
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from executive.record.event_log import EventLog, plain_values
from executive.record.history import read_events
from executive.run.outcome import RunResult
from executive.run.visitor import Progress, RunSettings
from executive.words.schemas import WALL
from skills.api import Cause
from skills.inputs.errors import InputError


@dataclass(frozen=True)
class Point:
    x: float
    cause: Cause


def test_messages_come_back_in_order_with_the_robots_time(tmp_path, clock):
    log = EventLog(tmp_path / "deep" / "log.mcap", clock)
    log("transitions", {"node": "a", "to": "RUNNING"})
    clock.advance(1.25)
    log("mine", {"values": (1, 2.5), "point": Point(math.nan, Cause.PLANNING)})
    log.close()
    first, second = read_events(log.path)
    assert (first.topic, first.stamp_s, first.data["node"]) == ("transitions", 0.0, "a")
    assert (second.topic, second.stamp_s) == ("mine", 1.25)
    assert second.data == {"values": [1, 2.5], "point": {"x": None, "cause": "PLANNING"}}


def test_wall_times_are_left_out_of_the_comparison(write_log):
    path = write_log(("wall", {"wall_time_s": 1.0}), ("outcome", {"outcome": "success"}))
    assert [event.topic for event in read_events(path) if event.topic != WALL] == ["outcome"]


def test_two_logs_of_the_same_messages_are_equal_to_the_byte(tmp_path, clock):
    for name in ("a", "b"):
        log = EventLog(tmp_path / name, clock)
        log("pose", {"x": 1.0})
        log.close()
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_cut_off_log_gives_what_was_flushed(tmp_path, clock):
    log = EventLog(tmp_path / "log.mcap", clock)
    for _ in range(30):
        log("pose", {"x": clock.now()})
        clock.advance(0.1)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log.path.read_bytes())
    events = read_events(cut)
    assert 2.9 - events[-1].stamp_s <= 1.0
    cut.write_bytes(log.path.read_bytes()[:-7])
    assert len(read_events(cut)) > 0
    log.close()


KILLED = """
import sys, time
from pathlib import Path
from executive.record.event_log import EventLog
class Clock:
    time_s = 0.0
    def now(self): return self.time_s
clock = Clock()
log = EventLog(Path(sys.argv[1]), clock)
while True:
    log("pose", {"x": clock.time_s})
    clock.time_s += 0.1
    print(clock.time_s, flush=True)
"""


def test_a_killed_process_leaves_a_readable_log(tmp_path):
    path = tmp_path / "log.mcap"
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    last_s = [float(process.stdout.readline()) for _ in range(100)][-1]
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()
    assert read_events(path)[-1].stamp_s >= last_s - 1.2


class FillingDisk(io.FileIO):
    """A file on a disk with so much room: it takes a part of what is written, and refuses the rest."""

    room = 6_000

    def write(self, data):
        taken = bytes(data)[: self.room - self.tell()]
        if not taken:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(taken)


def test_on_a_disk_that_is_full_what_was_written_can_be_read(tmp_path, clock, monkeypatch):
    monkeypatch.setattr(Path, "open", lambda path, mode: io.BufferedWriter(FillingDisk(path, mode)))
    log = EventLog(tmp_path / "log.mcap", clock)
    monkeypatch.undo()
    with pytest.raises(OSError, match="No space left"):
        for number in range(200):
            clock.advance(1.0)
            log("mine", {"number": number, "noise": os.urandom(100).hex()})
    with pytest.raises(OSError, match="No space left"):
        log("mine", {"number": -1})
    log.close()
    size = log.path.stat().st_size
    log.close()
    read = [event.data["number"] for event in read_events(log.path)]
    assert read == list(range(len(read)))
    assert (len(read) > 10, size, log.path.stat().st_size) == (True, FillingDisk.room, FillingDisk.room)


def test_pictures_become_compressed_images_that_viewers_draw(write_log):
    picture = np.zeros((8, 8, 3), np.uint8)
    picture[..., 0] = 250  # red
    path = write_log(("detections", {"image": picture, "source": "hand"}))
    with path.open("rb") as file:
        (schema, _, _), (boxes, _, _) = list(make_reader(file).iter_messages())
    data = read_events(path)[0].data
    decoded = cv2.imdecode(np.frombuffer(base64.b64decode(data["data"]), np.uint8), cv2.IMREAD_COLOR)
    assert schema is not None
    assert boxes is not None and boxes.name == "foxglove.ImageAnnotations"
    assert (schema.name, data["format"], data["frame_id"]) == ("foxglove.CompressedImage", "jpeg", "hand")
    assert decoded[4, 4, 2] > 230 > 60 > decoded[4, 4, 0]


def test_closing_twice_is_fine_and_writing_afterwards_is_not(tmp_path, clock):
    log = EventLog(tmp_path / "log.mcap", clock)
    log.close()
    log.close()
    with pytest.raises(ValueError, match="closed"):
        log("pose", {})


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "no such file"),
        (b"hello", "no event log"),
        (b"#ROSBAG V2.0\n" + bytes(200), "a bag of ROS 1"),
        (b"SQLite format 3\0" + bytes(200), "a bag of ROS 2"),
    ],
)
def test_a_file_that_is_no_log_or_one_of_another_form_is_named(tmp_path, content, said):
    if content is not None:
        (tmp_path / "other.mcap").write_bytes(content)
    with pytest.raises(InputError, match=said):
        read_events(tmp_path / "other.mcap")


def test_a_log_of_another_program_is_named(tmp_path):
    with (tmp_path / "other.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="rosbag2 of Humble")
        writer.finish()
    with pytest.raises(InputError, match=r"a log of another program \(rosbag2 of Humble, of the profile ros2\)"):
        read_events(tmp_path / "other.mcap")


@pytest.mark.parametrize(
    ("value", "plain"),
    [(np.float64(1.5), 1.5), (np.arange(2), [0, 1]), (math.inf, None), ({1: {2}}, {"1": [2]}), (Cause.ERROR, "ERROR")],
)
def test_plain_values(value, plain):
    assert plain_values(value) == plain


def test_a_whole_mission_is_logged(compiled, make, log_run):
    path, _ = log_run(compiled(*make.FETCH))
    events = read_events(path)
    topics = [event.topic for event in events]
    assert (topics[0], topics[-2:]) == ("tree", ["outcome", "wall"])
    assert {"transitions", "pose"} <= set(topics)
    assert events[-2].data["outcome"] == "success"


def test_each_robot_has_channels_of_its_own_that_read_back_under_their_topic(tmp_path, clock):
    # robot said        channel        topic when read
    # Bob               bob/pose       pose
    # nobody            control        control
    log = EventLog(tmp_path / "log.mcap", clock, apart=True)
    picture = {"image": np.zeros((4, 4, 3), np.uint8), "detections": []}
    messages = [("pose", {"robot": "Bob"}), ("object_to_detect", {"robot_name": "Al B"}), ("control", {"what": "x"})]
    for topic, message in [*messages, ("detections", {"robot": "Bob", **picture})]:
        log(topic, message)
    log.close()
    with log.path.open("rb") as file:
        channels = {channel.topic for channel in make_reader(file).get_summary().channels.values()}
    boxes = {"bob/detections", "bob/detections/boxes"}
    assert channels == {"bob/pose", "al-b/object_to_detect", "control", *boxes}
    topics = [event.topic for event in read_events(log.path)]
    assert topics == ["pose", "object_to_detect", "control", "detections", "detections/boxes"]


def test_the_channels_of_a_run_with_one_robot_are_the_topics(write_log):
    path = write_log(("pose", {"robot": "Alice"}))
    with path.open("rb") as file:
        assert [channel.topic for channel in make_reader(file).get_summary().channels.values()] == ["pose"]


@pytest.fixture
def ticks(tmp_path, clock):
    """Logs ticks of which every second one takes longer than the tick period; what the log tells of them."""

    def told(count):
        log = EventLog(tmp_path / "log.mcap", clock)
        log.begin(RunSettings(tick_period_s=0.05), None)
        for number in range(count):
            clock.advance(0.05)
            log.tick(Progress(clock.now(), number + 1, number // 2, {}, tick_wall_s=0.001 * number))
        log.end(RunResult((), count, count // 2, 0.05 * count, 12.5))
        log.close()
        return [event.data for event in read_events(log.path) if event.topic == "wall"]

    return told


def test_the_duration_of_every_tick_is_logged_once_with_the_overruns_so_far(ticks):
    walls = ticks(100)
    assert [tick for wall in walls for tick in wall["tick_s"]] == pytest.approx([0.001 * n for n in range(100)])
    assert (walls[-1]["overruns"], walls[-1]["wall_time_s"], walls[-1]["limit_s"]) == (50, 12.5, 0.05)


def test_durations_are_logged_once_a_second_and_at_the_end(ticks):
    assert len(ticks(200)) == 10 + 1
