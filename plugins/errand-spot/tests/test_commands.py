"""`errand serve`, `errand sdk`, and `errand run --robot`.

program missing  one line that names it, exit 2
program ends     its exit code
wrong password   one line, exit 2
right password   in no file, log or report
"""

import json
import math
import sys
import threading
import time

import numpy as np
import pytest

from executive.record.history import read_history
from tests.executive.cli.calls import done, errand, refusal

PROGRAM = """
import os, sys, time
import bosdyn.client, bosdyn.client.util
from bosdyn.client.frame_helpers import get_odom_tform_body
from bosdyn.client.lease import LeaseKeepAlive
from bosdyn.client.robot_command import RobotCommandBuilder, block_for_trajectory_cmd, blocking_stand
from beside import GOAL_M

robot = bosdyn.client.create_standard_sdk("walk").create_robot(sys.argv[1])
bosdyn.client.util.authenticate(robot)
robot.time_sync.wait_for_sync()
commands, states = robot.ensure_client("robot-command"), robot.ensure_client("robot-state")
with LeaseKeepAlive(robot.ensure_client("lease"), must_acquire=True, return_at_exit=True):
    robot.power_on(timeout_sec=20, update_frequency=5.0)
    blocking_stand(commands, timeout_sec=10, update_frequency=5.0)
    command = RobotCommandBuilder.synchro_se2_trajectory_point_command(GOAL_M, 0.0, 0.0, "odom")
    sent = commands.robot_command(command, end_time_secs=time.time() + 20)
    assert block_for_trajectory_cmd(commands, sent, timeout_sec=20)
    x_m = get_odom_tform_body(states.get_robot_state().kinematic_state.transforms_snapshot).x
    (picture,) = robot.ensure_client("image").get_image_from_sources(["hand_color_image"])
    robot.power_off(cut_immediately=False, timeout_sec=20, update_frequency=5.0)
print("walked", round(x_m, 1), picture.shot.image.cols, sys.argv[2:], sys.flags.quiet)
sys.exit(7)
"""


def test_a_map_that_cannot_be_written_is_one_error(tmp_path):
    pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")
    (tmp_path / "file").write_text("")
    result = errand("serve", "--graph", str(tmp_path / "file"))
    assert result.exit_code == 2
    assert "file: cannot write it" in result.output.replace("\n", " ") and "--graph" in result.output


@pytest.mark.mission
@pytest.mark.parametrize("pace", ["real", "client"])
def test_a_program_walks_the_robot_and_its_exit_code_is_kept(tmp_path, capfd, pace):
    """At a client's pace it runs under the interpreter and from the start that are named."""
    pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")
    (tmp_path / "beside.py").write_text("GOAL_M = 0.2\n")
    program, interpreter = tmp_path / "walk.py", tmp_path / "python-with-the-sdk"
    program.write_text(PROGRAM)
    interpreter.write_text(f'#!/bin/sh\nexec {sys.executable} -q "$@"\n')
    interpreter.chmod(0o755)
    named = ["--start", "8.6", "3.9", "1.5", "--python", str(interpreter)] if pace == "client" else []
    result = errand("sdk", "--seed", "2", "--pace", pace, *named, str(program), "127.0.0.1", "--start", "5")
    said = capfd.readouterr().out
    quiet = int(pace == "client")
    assert (result.exit_code, f"walked 0.2 640 ['--start', '5'] {quiet}" in said) == (7, True), said + result.output


def test_the_robot_starts_on_free_floor_away_from_people_with_space_ahead():
    from errand_spot.commands import free_floor
    from executive.app.prepare.worlds import open_world
    from plant.worlds.seeding import place_people
    from skills.grid_map import load_grid_map

    world = open_world("flat")
    start, ground = free_floor(world), load_grid_map(world.surveyed.keepout_map_path).with_unknown_blocked()
    line = [(start.x_m + d * math.cos(start.yaw_rad), start.y_m + d * math.sin(start.yaw_rad)) for d in (0.0, 1.0, 2.0)]
    assert min(ground.distance_m(np.array(line))) > 0.5
    people_W = [each.X_WO.translation()[:2] for seed in range(200) for each in place_people(world, seed)]
    assert min(math.dist(at, each) for at in line for each in people_W) > 1.0


# options of the command -> what the refusal says
@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--start", "0", "0", "0"], "stands in an obstacle"),
        (["--start", "nan", "0", "0"], "--start"),
        (["--python", "no-such-python"], "--python no-such-python: there is no such program"),
    ],
)
def test_a_start_or_an_interpreter_that_cannot_be_used_is_refused(tmp_path, options, said):
    pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")
    (tmp_path / "walk.py").write_text("")
    result = errand("sdk", *options, str(tmp_path / "walk.py"))
    assert (result.exit_code, said in result.output.replace("\n", " ")) == (2, True), result.output


def test_nothing_but_the_server_loads_the_sdk():
    before = {name for name in sys.modules if name.startswith("bosdyn")}
    errand("sdk", "--help")
    assert {name for name in sys.modules if name.startswith("bosdyn")} == before


SECRET = "wOmbat-7391-password"


@pytest.fixture
def served(request, tmp_path, monkeypatch):
    """Serves a scripted Spot; returns the words of `errand run` for it, its address last."""
    pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")
    from lock_step import USER, scripted_spot

    from errand_spot.server.identity import credentials

    held = credentials(tmp_path / "credentials")
    monkeypatch.setenv("BOSDYN_CLIENT_PASSWORD", SECRET)
    with scripted_spot(held, password=SECRET) as (server, _):
        request.node.server = server
        files = ["--out", str(tmp_path / "out"), "--store", str(tmp_path / "missions.db")]
        robot = ["--robot", f"spot://127.0.0.1:{server.port}?user={USER}&certificate={held.certificate}"]
        yield ["run", "--say", "say hello", "--start", "9.3", "4.05", "0", *files, *robot]


def test_a_wrong_password_is_one_line(served, monkeypatch):
    monkeypatch.setenv("BOSDYN_CLIENT_PASSWORD", "guessed-password")
    result = errand(*served)
    assert (result.exit_code, "refuses user 'user' with this password" in result.output) == (2, True), result.output
    assert "guessed-password" not in result.output


# option       refused
# take         without a typed yes
# estop=own    without a typed yes
# padding=nan  no number
# estop=both   neither of the two holders
# padd=1       unknown
@pytest.mark.parametrize(
    ("option", "refused"),
    [
        ("take", "take=yes needs a yes; type yes"),
        ("estop=own", "estop=own needs a yes; type yes"),
        ("padding=nan", "padding: should be"),
        ("estop=both", "estop: should be"),
        ("padd=1", "padd: unknown key 'padd'; did you mean 'padding'?"),
    ],
)
def test_an_option_of_the_address_is_refused_by_its_name(served, option, refused):
    assert refused in refusal(*served[:-1], f"{served[-1]}&{option}")


def test_the_password_stands_in_no_file_and_no_output(served, tmp_path):
    result = done(*served[:-1], f"{served[-1]}&power_on&padding=0.1")
    assert SECRET not in result.output
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert {"log.mcap", "report.html", "missions.db"} <= {path.name for path in files}
    assert [path for path in files if SECRET.encode() in path.read_bytes()] == []
    assert not any(SECRET in repr(event) for event in read_history(tmp_path / "out" / "last").events)


def test_a_password_that_is_missing_is_named_where_nobody_can_type_it(served, monkeypatch):
    monkeypatch.delenv("BOSDYN_CLIENT_PASSWORD")
    assert "set BOSDYN_CLIENT_PASSWORD" in refusal(*served)


def test_a_pressed_estop_ends_the_run_by_that_cause(request, served, tmp_path):
    def press():
        late_s = time.monotonic() + 30.0
        while request.node.server.computer.motors.value != "on" and time.monotonic() < late_s:
            time.sleep(0.05)
        time.sleep(2.0)
        request.node.server.computer.estop._held["tablet"].level = 1

    pressing = threading.Thread(target=press)
    pressing.start()
    mission = ["run", "--say", "go to the kitchen", "--json", *served[3:-1], f"{served[-1]}&power_on=yes"]
    result = errand(*mission)
    pressing.join()
    report = json.loads(result.output.splitlines()[-1])
    assert (report["outcome"], report["message"]) == ("failure", "the E-stop is pressed"), result.output
    assert request.node.server.computer.motors.value == "off"
