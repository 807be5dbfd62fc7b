import pytest

from plant.diagram import build_diagram
from plant.recording import Recorder, save_html
from plant.simulation import Engine
from skills.robot import Pose2D


@pytest.fixture
def engine():
    world = build_diagram(directives=None, models=[], robots={"Alice": "spot"}, visuals=False, render=False)
    return Engine(world, {"Alice": Pose2D(0, 0, 0)})


def test_frames_come_at_the_recorders_rate_and_are_found_by_time(engine):
    recorder = Recorder(engine.world, engine.context, frames_per_second=10.0)
    engine.observe(recorder)
    engine.advance(1.0)
    times = [frame.time_s for frame in recorder.frames]
    assert len(times) == 10
    assert recorder.at(0.55).time_s == pytest.approx(max(t for t in times if t <= 0.55))


def test_an_empty_recording_says_so(engine):
    with pytest.raises(LookupError, match="nothing was recorded"):
        Recorder(engine.world, engine.context).at(0.0)


def test_the_animation_is_one_html_file_with_the_robot_in_it(engine, tmp_path):
    recorder = Recorder(engine.world, engine.context)
    engine.observe(recorder)
    engine.advance(0.5)
    path = tmp_path / "recording.html"
    save_html(engine.world, recorder.frames, path)
    text = path.read_text()
    assert "<html" in text and 'src="http' not in text
    assert len(text) > 100_000
