"""Skills of doors: a plug-in opens one, the wait for it, a person who leaves the doorway, and failures by name."""

import dataclasses
import math
import socket
import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest
from planar_robot import Bench, Box

from executive.testing.bench import scripted_bench
from skills.api import Cause, Failed, Running, Succeeded
from skills.doorway import Doorway
from skills.navigate.door_openers import ArmDoor, HttpDoor
from skills.navigate.skill import Navigate, NavigateInputs
from skills.robot import CommandCause, CommandId, CommandState, CommandStatus, Pose2D
from skills.small.doors import CheckDoor, CheckDoorInputs, OpenDoor
from skills.stack import StackError, door_opener
from skills.testing.blocks import Block
from skills.testing.robot import BASE_ONLY
from tests.tables import table

PANEL = Box(7.0, 4.03, 7.9, 4.07, 0.0, 2.0)
INPUTS = CheckDoorInputs((7.45, 4.05), 0.9, math.pi / 2, "door between corridor and kitchen")
BEFORE, KITCHEN = Pose2D(6.8, 5.4, 0.0), Pose2D(8.5, 2.0, -1.57)
WALL = (Block(1.45, 0.45, 1.55, 2.5), Block(1.45, -2.5, 1.55, -0.45), Block(4.0, -3.0, 4.1, 3.0))
SOMEBODY = Block(1.35, -0.2, 1.65, 0.2, 0.0, 1.7)


@contextmanager
def served(status=200, opens=lambda: None, waits_s=0.0):
    """A door's server on this machine, which answers with a status after a while; yields address and calls."""
    calls, done = [], threading.Event()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            calls.append((self.command, self.path))
            done.wait(waits_s)
            opens()
            self.send_response(status)
            self.end_headers()

        def log_message(self, *_):
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/open", calls
    finally:
        done.set()
        server.shutdown()
        server.server_close()
        thread.join()


def unused_address():
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        return f"http://127.0.0.1:{bound.getsockname()[1]}/open"


def run(skill_class, inputs, opener, bench=None):
    """Runs a skill before the closed door; returns bench and last step."""
    bench = bench or Bench(BEFORE, unmapped=[PANEL])
    door = Doorway(INPUTS.middle_W, INPUTS.width_m, INPUTS.through_rad, ("corridor", "kitchen"), opener)
    skill = skill_class(dataclasses.replace(bench.context(), doors=(door,)))
    bench.tick(10)
    return bench, bench.run(skill, inputs, limit_s=60.0)


@pytest.mark.parametrize(("skill", "inputs"), [(OpenDoor, INPUTS), (Navigate, NavigateInputs(KITCHEN))])
def test_a_door_that_opens_after_its_call_is_passed(skill, inputs):
    bench = Bench(BEFORE, unmapped=[PANEL])
    with served(opens=lambda: bench.robot.blocks.remove(PANEL)) as (address, calls):
        _, step = run(skill, inputs, HttpDoor(address), bench)
    assert isinstance(step, Succeeded), step
    assert calls == [("POST", "/open")]


def test_a_door_that_does_not_move_after_its_call_is_named():
    with served() as (address, calls):
        bench, step = run(OpenDoor, INPUTS, HttpDoor(address))
    assert (type(step), step.cause, len(calls)) == (Failed, Cause.EXECUTION, 1)
    assert step.message == "The door between corridor and kitchen was called, and did not open within 15 s."
    assert 15.0 < bench.clock.now() < 18.0


# Server and time limit of the call -> end of the sentence.
@pytest.mark.parametrize(
    ("server", "why"),
    [({"status": 404}, "answered 404 Not Found."), ({"waits_s": 5.0}, "did not answer within 0.2 s.")],
)
def test_a_call_that_fails_is_the_cause(server, why):
    with served(**server) as (address, _):
        _, step = run(OpenDoor, INPUTS, HttpDoor(address, timeout_s=0.2))
    assert step.cause is Cause.EXECUTION
    assert step.message == f"The call of the door between corridor and kitchen failed: {address} {why}"


def test_a_drive_names_the_closed_door_and_its_failed_call():
    address = unused_address()
    bench, step = run(Navigate, NavigateInputs(KITCHEN), HttpDoor(address))
    assert (step.cause, step.final) == (Cause.PLANNING, True)
    assert step.message.startswith("The door between the corridor and the kitchen is closed, so no path leads to")
    assert f"failed: {address} cannot be reached: [Errno 111] Connection refused." in step.message
    assert bench.clock.now() < 15.0


def test_a_door_without_plug_in_is_not_called():
    _, step = run(OpenDoor, INPUTS, None)
    assert (step.cause, step.message) == (
        Cause.PRECONDITION,
        "nothing opens the door between corridor and kitchen but people",
    )


def test_a_robot_that_opens_no_doors_says_so():
    _, step = run(OpenDoor, INPUTS, ArmDoor((7.8, 4.05, 1.0), 0.0))
    assert (step.cause, step.message) == (
        Cause.PRECONDITION,
        "this robot cannot open the door between corridor and kitchen with an arm",
    )


def test_the_plug_in_is_made_of_its_options():
    assert door_opener({"plugin": "http", "url": "http://door/open"}) == HttpDoor("http://door/open")


@pytest.mark.parametrize(*table(__file__, "wrong_options"))
def test_wrong_options_are_refused_at_their_place(given, path, message):
    with pytest.raises(StackError) as refused:
        door_opener(given)
    assert refused.value.path == tuple(path)
    assert message in refused.value.message


# Where the robot stands before a door in a wall along x, whose handle is on its east side -> hinge left, pull.
@pytest.mark.parametrize(
    ("here", "p_BH", "hinge_left", "pull"),
    [
        (Pose2D(7.45, 5.25, -math.pi / 2), (1.2, 0.35, 0.48), False, False),
        (Pose2D(7.45, 2.85, math.pi / 2), (1.2, -0.35, 0.48), True, True),
    ],
)
def test_the_handle_is_seen_from_the_side_of_the_robot(here, p_BH, hinge_left, pull):
    handle = ArmDoor((7.8, 4.05, 1.0), -math.pi / 2).handle_from(here, 0.52, (7.45, 4.05))
    assert handle.p_BH == pytest.approx(p_BH)
    assert (handle.hinge_left, handle.pull) == (hinge_left, pull)


# How the door command ends -> the skill's last step.
@pytest.mark.parametrize(
    ("state", "cause", "ends"),
    [(CommandState.DONE, None, None), (CommandState.STOPPED, CommandCause.BLOCKED, Cause.EXECUTION)],
)
def test_a_robot_with_an_arm_opens_the_door_itself(state, cause, ends):
    bench, handles = Bench(BEFORE, unmapped=[PANEL]), []
    capabilities = dataclasses.replace(bench.robot.capabilities(), opens_doors=True)
    bench.robot.capabilities = lambda: capabilities
    bench.robot.open_door = lambda handle, **_: handles.append(handle) or CommandId(99)
    bench.robot.command_status = lambda _: CommandStatus(state, "the door is stalled", cause)
    _, step = run(OpenDoor, INPUTS, ArmDoor((7.8, 4.05, 1.0), -math.pi / 2), bench)
    assert handles[0].pull is False
    assert getattr(step, "cause", None) is ends, step


def test_it_looks_again_once_somebody_has_gone_on():
    bench, robot = scripted_bench(BASE_ONLY, blocks=(*WALL, SOMEBODY))
    said = []
    skill = CheckDoor(bench.context())
    skill.begin(CheckDoorInputs((1.5, 0.0), 0.9, 0.0, "kitchen door"))
    while isinstance(step := skill.step(), Running):
        bench.clock.advance(0.1)
        said.append(step.message)
        if "waiting" in step.message and SOMEBODY in robot.blocks:
            robot.blocks.remove(SOMEBODY)
    skill.end()
    assert isinstance(step, Succeeded)
    assert step.outputs["open"] is True
    assert step.outputs["free_m"] == pytest.approx(0.9, abs=0.1)
    assert "waiting until more is seen of the kitchen door" in said
    assert robot.moving_parts == ()
