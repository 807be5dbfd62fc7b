"""Whether a door is open, looked at in the plant from where the compiler sends the robot."""

import shutil
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from executive.app.prepare.from_request import prepare
from executive.app.prepare.placed_robots import only_robot
from executive.app.runs.one_run import run_request
from executive.app.runs.simulated import SimulatedBackend
from executive.mission.request import Request
from plant.worlds.world import load_world
from skills.robot import Pose2D

pytestmark = pytest.mark.mission
AT = (5.1, 5.4)
"""Middle of the bathroom's door."""

LOOK = """
name: look at the kitchen door
steps:
  - check: {door: [kitchen, hall]}
"""


@pytest.mark.nightly
def test_a_door_that_is_open_is_found_so(tmp_path):
    (tmp_path / "look.yaml").write_text(LOOK)
    report = run_request(prepare(Request(file=tmp_path / "look.yaml", seed=1, out=tmp_path, record=False))).report
    assert "the door between hall and kitchen is open" in report.message, report.message
    assert report.referee.collisions == 0


def test_a_door_that_bars_the_way_to_where_it_is_looked_at_is_found_closed(tmp_path):
    (tmp_path / "look.yaml").write_text(LOOK.replace("kitchen", "bathroom"))
    (tmp_path / "closed.yaml").write_text("events:\n  - {door: [hall, bathroom], opens: 900}\n")
    given = {"file": tmp_path / "look.yaml", "scenario_files": (tmp_path / "closed.yaml",)}
    report = run_request(prepare(Request(**given, start=Pose2D(5.2, 6.35, 1.57), out=tmp_path, record=False))).report
    assert "the door between hall and bathroom is closed" in report.message, report.message
    assert report.referee.collisions == 0


@pytest.fixture
def flat_with_opener(tmp_path):
    """The flat with a bathroom door that opens by a call: the world's folder, and the server of the door."""
    folder = tmp_path / "flat"
    shutil.copytree(load_world("flat").folder, folder)

    class Door(BaseHTTPRequestHandler):
        def do_POST(self):
            self.server.opens(AT)
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_):
            pass

    server = HTTPServer(("127.0.0.1", 0), Door)
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()
    facts, between = folder / "knowledge.yaml", "between: [hall, bathroom]"
    assert between in facts.read_text()
    opens = f"opens: {{plugin: http, url: 'http://127.0.0.1:{server.server_port}/open'}}"
    facts.write_text(facts.read_text().replace(between, f"{between}, {opens}"))
    yield folder, server
    server.shutdown()
    server.server_close()


def test_a_door_opens_by_a_call_and_the_robot_goes_through(tmp_path, flat_with_opener):
    world, server = flat_with_opener
    (tmp_path / "go.yaml").write_text("name: go\nsteps:\n  - open: {door: bathroom}\n  - to: bathroom\n")
    (tmp_path / "closed.yaml").write_text("events:\n  - {door: [hall, bathroom], opens: 900}\n")
    given = {"file": tmp_path / "go.yaml", "world": str(world), "scenario_files": (tmp_path / "closed.yaml",)}
    request = Request(**given, start=Pose2D(5.2, 4.5, 0.0), out=tmp_path / "out", record=False)
    prepared = prepare(request)
    robots = {"Alice": only_robot("Alice", prepared.world, start=request.start)}
    backend = SimulatedBackend(prepared.world, robots, seed=1, record=False)
    server.opens = backend._simulation.engine.doors.call
    report = run_request(prepared, backend).report
    assert (report.outcome, report.referee.success, report.referee.collisions) == ("success", True, 0), report.message
    assert "The door between hall and bathroom was" in report.referee.why
