import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from executive.testing.bench import write_small_room
from plant.diagram import DiagramConfig, build_diagram
from plant.engine import Engine
from plant.recording import Frame, Recorder, save_html, thin_out
from plant.robots.robot_kind import PlacedRobot
from skills.robot import Pose2D
from tests.plant.kept_engine import KeptEngine


@pytest.fixture(scope="module")
def kept():
    robot = PlacedRobot("Alice", "spot", Pose2D(0, 0, 0))
    return KeptEngine(Engine(build_diagram(DiagramConfig(robots=[robot], visuals=False, render=False))))


@pytest.fixture
def engine(kept):
    return kept.again()


def test_frames_come_at_the_recorders_rate_and_are_found_by_time(engine):
    recorder = Recorder(engine.world, engine.context, frames_per_second=10.0)
    engine.observe(recorder)
    engine.advance(1.0)
    times = [frame.time_s for frame in recorder.frames]
    assert (len(times), recorder.frame_at(0.55).time_s) == (10, pytest.approx(max(t for t in times if t <= 0.55)))


def test_an_empty_recording_says_so(engine):
    with pytest.raises(LookupError, match="nothing was recorded"):
        Recorder(engine.world, engine.context).frame_at(0.0)


def test_the_animation_is_one_html_file_with_the_robot_in_it(engine, tmp_path):
    recorder = Recorder(engine.world, engine.context)
    engine.observe(recorder)
    engine.advance(0.5)
    path = tmp_path / "recording.html"
    save_html(engine.world, recorder.frames, path)
    text = path.read_text()
    assert "<html" in text and 'src="http' not in text and len(text) > 100_000


@pytest.fixture
def moved():
    """A recorder of 100 frames at most, and the positions that it records."""
    positions = np.zeros(3)
    plant = SimpleNamespace(GetPositions=lambda context: positions, num_bodies=lambda: 1)
    return Recorder(SimpleNamespace(plant=plant), None, most_frames=100), positions


def test_a_long_recording_has_few_frames_mostly_of_motion(moved):
    recorder, positions = moved
    for number in range(20_000):
        time_s = number / 16.0
        if 100.0 < time_s < 110.0:
            positions[0] = np.sin(time_s)
        recorder(time_s)
    times = [frame.time_s for frame in recorder.frames]
    assert len(times) <= 100 and (times[0], times == sorted(times)) == (0.0, True)
    assert times[-1] > 1240.0 and sum(100.0 < time_s < 111.0 for time_s in times) > 20


def test_a_recording_that_is_written_in_a_hurry_has_few_frames():
    recorder = Recorder(SimpleNamespace(plant=SimpleNamespace(num_bodies=lambda: 1)), None)
    recorder.frames = [Frame(float(t), np.array([float(t)])) for t in range(5000)]
    recorder.shorten()
    times = [frame.time_s for frame in recorder.frames]
    assert len(times) <= 400 and (times[0], times[-1]) == (0.0, 4999.0)


def test_a_frame_that_lies_between_its_neighbours_goes_first():
    frames = [Frame(float(t), np.array([x])) for t, x in enumerate((0.0, 1.0, 2.0, 9.0, 4.0))]
    assert [frame.time_s for frame in thin_out(frames)] == [0.0, 2.0, 3.0, 4.0]


def test_a_run_is_recorded_as_it_began_and_its_meshcat_is_freed_in_the_thread_that_made_it(tmp_path):
    # in another thread, such as that of the page's server, its end would end the process
    script = f"""
import gc, threading
from pathlib import Path
from plant.simulation import Simulation
from plant.worlds.world import load_world
simulation = Simulation(load_world({str(write_small_room(tmp_path, can=False))!r}), seed=1, visuals=False, record=True)
simulation.save_recording(Path({str(tmp_path / "recording.html")!r}))
assert [frame.time_s for frame in simulation.recorder.frames] == [0.0]
assert gc.isenabled()
collecting = threading.Thread(target=gc.collect)
collecting.start()
collecting.join()
"""
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    assert "<html" in (tmp_path / "recording.html").read_text()
