"""`errand run --robot` with the toy backend of the page on own robots, installed as its two files say.

address                         refused, by one line that names the mend
no address, unknown scheme      before anything is connected
an option that is unknown       with its name
no robot there, robot asleep    as the backend says
"""

import os
import signal
import sys
import threading
import tomllib
from importlib.metadata import entry_points

import pytest

from executive.record.history import read_history
from skills import stack
from tests.docs.documents import ROOT, blocks
from tests.executive.cli.calls import done, errand, refusal
from tests.executive.distribution import write_distribution

PAGE = ROOT / "docs/how-to/own-robot.md"


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Installs the toy; returns the words of a run, to which the address is added."""
    files = {each.mark.removeprefix("file: "): each.text for each in blocks(PAGE) if each.mark.startswith("file: ")}
    project = tomllib.loads(files["pyproject.toml"])["project"]
    ((group, entries),) = project["entry-points"].items()
    write_distribution(tmp_path, project["name"], group, *(f"{name} = {value}" for name, value in entries.items()))
    (tmp_path / "errand_turtle.py").write_text(files["errand_turtle.py"])
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr("skills.inputs.plugins._all_installed", entry_points)
    monkeypatch.setattr(stack, "_loaded", stack._loaded.__wrapped__)  # each test has a class of its own
    yield ["run", "--say", "say hello", "--out", tmp_path / "out", "--quiet", "--robot"]
    sys.modules.pop("errand_turtle", None)


def test_a_plug_in_of_two_files_drives_a_robot(run, tmp_path):
    ended = done(*run, "turtle://pond?speed=100&wake")
    assert "success" in ended.stdout
    events = read_history(tmp_path / "out" / "last").events
    assert any("hello" in str(event.data) for event in events if event.topic == "speech")
    assert "The turtle has no LiDAR." in (tmp_path / "out" / "last" / "report.html").read_text()


@pytest.mark.parametrize(
    ("address", "refused"),
    [
        ("", "--robot : is no address; write spot://192.168.80.3 or ros2://alice"),
        ("pond", "--robot pond: is no address; write spot://192.168.80.3 or ros2://alice"),
        ("tortoise://pond", "no plug-in drives robots of 'tortoise://'"),
        ("turtle://pond?sped=3", "sped: unknown key 'sped'; did you mean 'speed'?"),
        ("turtle://pond?speed=fast", "speed: should be a number"),
        ("turtle://pond?speed=[", "speed: has no value; write each option once, as in ?option=value"),
        ("turtle://pond?speed=", "speed: has no value"),
        ("turtle://pond?speed", "speed: has no value; write speed=VALUE"),
        ("turtle://pond?speed=.nan", "speed: has no value"),
        ("turtle://pond?wake&wake", "wake: is given twice"),
        ("turtle://desert", "no turtle answers at desert; look for one at turtle://pond"),
        ("turtle://pond", "the turtle sleeps; wake it: add ?wake=yes to the address"),
    ],
)
def test_an_address_is_refused_in_one_line(run, address, refused):
    assert refused in refusal(*run, address)


def test_a_scheme_may_be_typed_in_capitals(run):
    assert "no turtle answers at desert" in refusal(*run, "TURTLE://desert")


@pytest.mark.parametrize("words", [["--fault", "gripper loses it at 20 s"], ["--light", "dim"], ["--people", "1"]])
def test_faults_and_variations_are_refused(run, words):
    assert "not for a real robot" in refusal(*run[:-1], *words, "--robot", "turtle://pond?wake")


def test_two_plug_ins_of_one_scheme_are_refused(run, tmp_path):
    write_distribution(tmp_path, "other-turtles", "errand.backends", "turtle = errand_turtle:Turtle")
    assert "several plug-ins drive robots of 'turtle://'" in refusal(*run, "turtle://pond?wake")


# defect of a plug-in              refused in one line with its class and error
# connect raises, yields nothing   before the run
# make_ready raises                before the run
# raises at the end                after it
@pytest.mark.parametrize(
    ("former", "present", "error"),
    [
        (
            "        clock = WallClock()\n",
            "        raise ConnectionRefusedError('no pond')\n",
            "ConnectionRefusedError: no pond",
        ),
        ("yield ConnectedRobot(robot, clock, make_ready, notes=", "yield dict(notes=", "TypeError: connect yields no"),
        ("name=name, capabilities", "name='zoe', capabilities", "TypeError: connect yields no ConnectedRobot"),
        ("clock.advance(2.0)", "raise ValueError('it turned over')", "ValueError: it turned over"),
        (
            "            robot.sit(",
            "            raise OSError('it swam off')\n            robot.sit(",
            "OSError: it swam off",
        ),
    ],
)
def test_a_defect_of_the_plug_in_is_one_line(run, tmp_path, former, present, error):
    file = tmp_path / "errand_turtle.py"
    assert former in file.read_text()
    file.write_text(file.read_text().replace(former, present))
    said = refusal(*run, "turtle://pond?speed=100&wake")
    assert "the backend errand_turtle:Turtle failed" in said and error in said


def test_several_robots_are_refused(run):
    words = [*run[:-1], "--robots", "alice=spot,bob=fetch@2.5,4.0,0.0", "--robot", "turtle://pond"]
    assert "a real robot runs alone" in refusal(*words)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_before_the_robot_is_ready_ends_the_command_and_leaves_the_robot_seated(run, number, monkeypatch):
    from skills.testing.robot import ScriptedRobot

    seated = threading.Event()
    monkeypatch.setattr(ScriptedRobot, "stand", lambda *_, **__: os.kill(os.getpid(), number))
    monkeypatch.setattr(ScriptedRobot, "sit", lambda *_, **__: seated.set())
    ended = errand(*run, "turtle://pond?wake")
    assert (ended.exit_code, seated.is_set()) == (130, True)
