"""Sizes and overflow of the page and the report in a browser, on a desk and on a telephone, light and dark."""

import base64
import re

import cv2
import numpy as np
import pytest

from executive.app.evaluate.results import Case, Evidence, Results, RunSpec
from executive.app.evaluate.summary import to_page
from executive.app.report.report_page import ReportPage, ReportPart, StepRow
from executive.app.report.run_report import ReportedAnswer, ReportedObject, RobotReport, RunReport
from executive.mission.request import Request
from executive.record.announce import map_message
from executive.run.control_state import ControlState, Mode
from executive.run.outcome import Said
from executive.tree.compiler import compile_mission
from executive.tree.node_view import node_view
from executive.view.feed import Feed
from executive.view.formats import to_svg
from executive.view.html import render
from executive.view.page_control import RefusedError, control_json
from executive.view.server import PageContent, PageServer
from executive.view.text import Styles, readable
from executive.words.goal import RefereeReport
from executive.words.knowledge import Pose
from executive.words.mission import Mission
from skills.grid_map import GridMap
from skills.world_model import Zone, ZoneKind
from skills.zone_map import zone_messages

DESK, TELEPHONE = {"width": 1400, "height": 900}, {"width": 390, "height": 844}
LONG = f"waits until sixty seconds are over, as the mission says, and goes on with the rest of the round {'x' * 60}"

playwright_api = pytest.importorskip("playwright.sync_api", reason="not installed: pip install playwright")
expect = playwright_api.expect
pytest_plugins = ["tests.browser"]
pytestmark = pytest.mark.browser

OVERFLOWING = """() => [...document.querySelectorAll('body *')].filter((each) => {
  const box = each.getBoundingClientRect();
  if (!box.width || !box.height || getComputedStyle(each).position === 'absolute') return false;
  for (let up = each.parentElement; up; up = up.parentElement)
    if (['auto', 'scroll'].includes(getComputedStyle(up).overflowX) && up.clientWidth < innerWidth) return false;
  return box.right > innerWidth + 1 || box.left < -1;
}).map((each) => `${each.tagName}.${each.className}: ${each.textContent.trim().slice(0, 60)}`)"""
"""Elements that stick out of the page, and do not scroll inside another one."""


@pytest.fixture(params=[(DESK, "light"), (TELEPHONE, "dark")], ids=["desk, light", "telephone, dark"])
def page(tab, request):
    """A page of a size and a colour scheme; each test has both of both, and some the other pairs of them."""
    size, scheme = request.param
    tab.set_viewport_size(size)
    tab.emulate_media(color_scheme=scheme)
    return tab


@pytest.fixture
def nested(knowledge, registry):
    """The tree of a mission in which steps stand four levels below others."""
    wait = {"wait": {"seconds": 60}}
    inner = {"repeat": {"times": 3}, "steps": [wait, {"to": "counter"}]}
    choice = {"if": {"object": "coke", "at": "kitchen"}, "then": [inner], "else": [wait]}
    group = {"group": [{"to": "kitchen"}, choice], "timeout": 600, "retries": 2, "on_failure": "skip"}
    steps = [{"to": "kitchen"}, {"repeat": {"times": 2}, "steps": [group]}, wait]
    mission = Mission.model_validate({"name": "evening round", "robot": "Alice", "steps": steps})
    return compile_mission(mission, knowledge=knowledge, registry=registry)


@pytest.fixture
def running(nested):
    """The address of the page of the nested mission, in which the innermost wait has a long message."""
    feed = Feed()
    feed("tree", 0.0, {"robot": "Alice", "root": node_view(nested.root).structure()})
    wait = next(node.path_id for node in nested.root.walk() if node.kind == "pause")
    for node in nested.root.walk():
        if any(below.path_id == wait for below in node.walk()):
            change = {"t": 1.0, "robot": "Alice", "node": node.path_id, "to": "RUNNING", "cause": None, "message": ""}
            feed("transitions", 1.0, change)
    feed("activity", 2.0, {"t": 2.0, "robot": "Alice", "node": wait, "message": LONG})
    state = {"holding": True, "charge": 0.9, "localised": True, "position_sigma_m": 0.02, "speed_m_s": 0.4}
    feed("state", 2.0, {"robot": "Alice", **state})
    with PageServer(
        PageContent(feed, {name: lambda values: "" for name in ("pause", "step", "cancel", "stop", "say", "queue")})
    ) as server:
        yield server.url


the_other_pairs = pytest.mark.parametrize(
    "page", [(DESK, "dark"), (TELEPHONE, "light")], ids=["desk, dark", "telephone, light"], indirect=True
)


def expect_fit(page):
    assert page.evaluate(OVERFLOWING) == []
    assert page.evaluate("document.documentElement.scrollWidth") == page.viewport_size["width"]


def test_the_page_of_a_nested_mission_is_readable_and_has_no_empty_panel_for_a_scene(page, running):
    page.goto(running)
    note = page.locator(".row.leaf[data-look=running] .note")
    expect(note).to_contain_text(LONG)
    expect_fit(page)
    widths = page.locator(".tree li:not([hidden]) > .row .name").evaluate_all("rows => rows.map((r) => r.clientWidth)")
    assert min(width for width in widths if width) > 150
    assert page.locator(".tree").evaluate("tree => tree.scrollHeight") < 900
    assert page.locator("#scene-panel").is_hidden()
    assert page.locator("#map-panel").bounding_box()["height"] > 300


@pytest.fixture
def of_three(nested, knowledge):
    """The feed of three robots at one place, with their missions, on a map with rooms and a dock."""
    feed, names = Feed(), ("Alice", "Bob", "Carol")
    known = knowledge.model_copy(update={"dock": Pose(x=0.5, y=0.5, yaw=0.0)})
    feed("map", 0.0, map_message(GridMap(np.eye(40, dtype=bool), 0.25, (-5.0, -5.0)), known, world="test"))
    feed("run", 0.0, {"world": "t", "seed": 3, "commands": [], "versions": {}, "robots": dict.fromkeys(names, "spot")})
    zones = zone_messages([Zone("den", ZoneKind.KEEP_OUT, ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)))])
    for name in names:
        feed("tree", 0.0, {"robot": name, "root": node_view(nested.root).structure(), "zones": zones})
        turn, position = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}, {"x": 0.4, "y": 0.4, "z": 0.0}
        feed("pose", 0.5, {"robot": name, "pose": {"position": position, "orientation": turn}})
        feed("object_destination", 0.6, {"robot": name, "class_name": "coke", "goal_x": 0.8, "goal_y": 0.6})
        state = {"holding": True, "charge": 0.1, "localised": False, "position_sigma_m": 0.02, "speed_m_s": 0.4}
        feed("state", 0.7, {"robot": name, **state})
    row = {"sentence": f"fetch it {LONG}", "robot": "Alice", "outcome": "running", "message": LONG, "reassigned": 2}
    feed("missions", 1.0, {"missions": [{"id": number, **row} for number in range(3)]})
    return feed


@pytest.fixture
def several(of_three):
    """The address of the page of three robots."""
    actions = {name: lambda values: "" for name in ("pause", "step", "cancel", "stop", "say")}
    with PageServer(PageContent(of_three, actions)) as server:
        yield server.url


@pytest.fixture
def fleet(of_three):
    """The address of the page of a fleet, which refuses each mission with a long reason."""

    def refuse(values):
        raise RefusedError(f"I do not understand '{values['text']}': {LONG}")

    actions = {name: lambda values: "" for name in ("pause", "step", "cancel", "stop")}
    with PageServer(PageContent(of_three, {**actions, "queue": refuse})) as server:
        yield server.url


def test_the_page_of_several_robots_fits_and_no_name_on_the_map_covers_another(page, several):
    page.goto(several)
    expect(page.locator("#legend li")).to_have_text(["object found", "dock", "keep out of: den"])
    expect(page.locator("#where")).to_contain_text("Alice at x 0.40 m, y 0.40 m, 0°, keep out of: den")
    expect_fit(page)
    uncovered = """() => {
      const { taken, later } = window.errand.page.map.names, names = taken.slice(-later.length);
      const side = (a, b, k) => Math.max(0, Math.min(a[k + 2], b[k + 2]) - Math.max(a[k], b[k]));
      return names.flatMap((a, n) => names.slice(n + 1).map((b) => side(a, b, 0) * side(a, b, 1)))
        .every((area) => area <= 1);
    }"""
    page.wait_for_function(uncovered)  # the map is drawn once more when its panel has its size


@the_other_pairs
def test_the_page_of_a_fleet_fits_three_screens_of_a_telephone_and_its_stop_button_stays_in_view(page, fleet):
    page.goto(fleet)
    page.locator("#legend li").first.wait_for()
    page.locator("#mission").fill("fly to the moon")
    page.locator("#add button").click()
    expect(page.locator("#added.bad")).to_contain_text("I do not understand 'fly to the moon'")
    expect_fit(page)
    width, height = page.viewport_size["width"], page.viewport_size["height"]
    if width > 900:
        return
    assert page.evaluate("document.documentElement.scrollHeight") <= 3 * height
    for share in (0.0, 0.5, 1.0):
        page.evaluate("share => scrollTo(0, share * document.documentElement.scrollHeight)", share)
        expect(page.locator("#stop")).to_be_in_viewport(ratio=1)


@pytest.fixture
def driven():
    """The address of the page of a robot that is driven by hand, with three cameras."""
    feed, dot = Feed(), base64.b64encode(cv2.imencode(".jpg", np.full((48, 64, 3), 90, np.uint8))[1]).decode()
    feed("control", 1.0, {"t": 1.0, "what": "stop button", "message": "released"})
    for source in ("frontleft", "frontright", "hand"):
        feed.tell(f"camera/{source}", {"format": "jpeg", "data": dot, "width": 64, "height": 48})
    feed.tell("control", control_json(ControlState(mode=Mode.RUNNING)))
    own = {"robot": "Alice", "note": "", "base": [1.0, 2.0, 0.0], "joints_rad": [0.0] * 6, "opening": 0.0, "now_s": 2.0}
    feed.tell("teleop", own)
    turn, position = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}, {"x": 1.0, "y": 2.0, "z": 0.0}
    feed("pose", 0.5, {"robot": "Alice", "pose": {"position": position, "orientation": turn}})
    actions = {name: lambda values: "" for name in ("teleop", "save_pose", "stop", "release")}
    with PageServer(PageContent(feed, actions)) as server:
        yield server.url


@the_other_pairs
def test_a_robot_is_driven_by_hand_by_its_own_cameras_with_map_events_and_stop_button(page, driven):
    page.goto(driven)
    expect(page.locator("#camera img")).to_have_count(3)
    assert page.locator("#camera img").first.get_attribute("alt") == "Camera hand"
    expect(page.locator("#map")).to_have_attribute("aria-label", re.compile("Alice at x 1.00 m, y 2.00 m"))
    expect(page.locator("#events")).to_contain_text("stop button released")
    expect(page.locator("#stop")).to_be_in_viewport(ratio=1)
    assert [page.locator(f"#{each}").is_visible() for each in ("pause", "step", "cancel")] == [False] * 3
    expect_fit(page)
    if page.viewport_size["width"] < 900:
        assert page.locator("#teleop-panel").bounding_box()["y"] < page.locator("#map-panel").bounding_box()["y"]
    else:
        boxes = [page.locator(f"#{each}-panel").bounding_box() for each in ("teleop", "map", "camera", "events")]
        assert all(box["y"] + box["height"] <= page.viewport_size["height"] for box in boxes)


def test_the_picture_of_a_nested_mission_has_the_size_of_a_page(page, nested, tmp_path):
    # a tree with long names and messages; no text leaves its box
    svg = to_svg(readable(node_view(nested.root), 40), title="evening round " + "m" * 90)
    (tmp_path / "tree.svg").write_text(svg, encoding="utf-8")
    page.goto((tmp_path / "tree.svg").as_uri())
    width, height = page.evaluate("['width', 'height'].map((each) => document.documentElement[each].baseVal.value)")
    assert (width < 700, height < 2100) == (True, True), (width, height)
    beyond = """() => [...document.querySelectorAll('g > text')].filter((text) => {
      const box = text.parentElement.querySelector('rect');
      return box && text.getBoundingClientRect().right > box.getBoundingClientRect().right;
    }).map((text) => text.textContent)"""
    assert page.evaluate(beyond) == []


@pytest.fixture
def report_page(tmp_path, nested):
    """The report of a run with everything that a report may have, with long texts."""
    whole = "x" * 120
    why = f"The coke stands on the counter. Robin has no coke. X{whole}"
    referee = RefereeReport(False, why, 1, 2, events=("1.0 s: it fell",))
    done = Styles.SUCCESS.value
    names = ("go to the hall", "go to the hall", f"go to the hall {whole}", "go to the hall")
    steps = tuple(StepRow(name, done, "success", n, (0.0, 9.0), why) for n, name in enumerate(names))
    report = RobotReport("failure", "EXECUTION", why, referee, (), "spot")
    svg = to_svg(readable(node_view(nested.root), 40))
    page = ReportPage(
        title="evening round",
        request="patrol.yaml",
        facts=(("world", "flat, seed 3"), ("contacts", "1 collision, 2 drops")),
        alone=ReportPart("Alice", "#0072b2", report, steps, tree_svg=svg),
        answers=(ReportedAnswer("hammer in the office", False, f"no hammer {whole}", 1.0, "office"),),
        said=(Said(1.0, f"Dinner is ready {whole}"),),
        seen=(ReportedObject(f"coke {whole}", "counter", "kitchen", (1.0, 2.0, 0.9), 3.0),),
    )
    path = tmp_path / "report.html"
    path.write_text(render("run.html", page=page), encoding="utf-8")
    return path


@the_other_pairs
def test_the_report_fits_its_page_and_wide_parts_scroll_inside_themselves(page, report_page):
    page.goto(report_page.as_uri())
    assert page.locator(".verdict li").count() == 6
    page.locator("details.tree summary").click()
    expect_fit(page)
    assert min(page.locator("td.why").evaluate_all("cells => cells.map((cell) => cell.clientWidth)")) > 200


def test_the_report_of_an_evaluation_fits_its_page(page, tmp_path):
    runs = [(1, "success", True, None), (2, "success", False, None), (3, "failure", False, "PLANNING")]
    cases = []
    for seed, outcome, success, cause in runs:
        referee = RefereeReport(success, LONG, 0, 0)
        report = RunReport(outcome, cause, LONG, referee, (), "flat", seed, 9.0, 1.0, 9.0, 90, "", work={"steps": 9})
        cases.append(Case(RunSpec(Request("fetch me the hammer", world="flat", seed=seed), "fetch"), report))
    found = Results(tuple(cases), {"scenario": "random.yaml", "code": "1", "logs": str(tmp_path)})
    told = Evidence(timeline=((1.0, "navigate", LONG),))
    html = to_page(found, lambda _: told, against=cases[:2], other="before.json")
    (tmp_path / "results.html").write_text(html, encoding="utf-8")
    page.goto((tmp_path / "results.html").as_uri())
    page.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    expect_fit(page)
