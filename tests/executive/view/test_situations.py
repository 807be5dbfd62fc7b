"""Statements of page and report during real runs, each compared with the log of the run."""

import os
import re
import signal
import subprocess
import sys
from collections import defaultdict
from contextlib import ExitStack

import pytest

from executive.record.history import read_history

playwright_api = pytest.importorskip("playwright.sync_api", reason="not installed: pip install playwright")
expect = playwright_api.expect
pytest_plugins = ["tests.browser"]
pytestmark = [pytest.mark.browser, pytest.mark.mission, pytest.mark.nightly]

ERRAND = (sys.executable, "-u", "-m", "executive.cli")
STANDS_M_S = 0.06
"""Odometry of a standing robot is not quite still, and the page shows one digit."""
LOOKS = {"RUNNING": {"running"}, "SUCCESS": {"success", "skipped"}, "FAILURE": {"failure", "expected"}, None: {"idle"}}

SAMPLE = """async () => {
  const { store } = window.errand.page, frame = () => new Promise((done) => requestAnimationFrame(done));
  let before = -1;
  while (before !== store.messages.length) { before = store.messages.length; await frame(); await frame(); }
  const counts = {}, text = (root, one) => (root.querySelector(one) || { innerText: "" }).innerText.trim();
  for (const { topic } of store.messages) counts[topic] = (counts[topic] || 0) + 1;
  const several = document.querySelector("main").classList.contains("several");
  const panels = several ? [...document.querySelectorAll(".robot")] : [document.body];
  const pair = (each) => [...each.children].map((part) => part.textContent);
  const facts = (root) => Object.fromEntries([...root.querySelectorAll(".strip .facts div")].map(pair));
  const rows = (root) => [...root.querySelectorAll(".tree li")].filter((each) => each.offsetParent);
  const pill = (root) => (several ? root.querySelector(".mode") : document.querySelector("#mode")).lastElementChild;
  const panel = (root) => ({
    robot: facts(root).robot, facts: facts(root), pill: pill(root).textContent,
    rows: rows(root).map((each) => [each.dataset.id, each.querySelector(".row").dataset.look]),
  });
  return { counts, connection: text(document, "#connection"), panels: panels.map(panel) };
}"""
"""What the page says, and how many messages of each topic it had when it said so."""


class Run:
    """A command of errand with a page, and what the page said at some moments."""

    def __init__(self, page, out, *command):
        self.page, self.out, self.samples = page, out, []
        words = [*ERRAND, *command, "--view", "60"]
        self.process = subprocess.Popen(
            words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
        )
        lines = iter(self.process.stdout.readline, "")
        self.url = next(found[1] for line in lines if (found := re.search(r"The page: (http\S+)", line)))
        page.goto(self.url)

    def pill(self, text, timeout_s=30):
        expect(self.page.locator("#mode-text")).to_have_text(text, timeout=1000 * timeout_s)
        self.sample()

    def sample(self):
        self.samples.append(self.page.evaluate(SAMPLE))

    def until(self, seconds):
        self.page.wait_for_function("t => window.errand.page.store.end >= t", arg=seconds, timeout=90_000)
        self.sample()

    def finish(self):
        self.page.locator("#verdicts").wait_for(timeout=150_000)
        self.sample()
        said = [each.inner_text() for each in self.page.locator("#verdicts .verdict").all()]
        with self.page.context.expect_page() as opened:
            self.page.get_by_role("link", name="Report").click()
        self.kill()
        return said, opened.value

    def kill(self):
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()

    @property
    def events(self):
        found = defaultdict(list)
        for event in read_history(self.out / "last" / "log.mcap").events:
            found[event.topic].append(event)
        return found

    def check(self):
        events = self.events
        for number, sample in enumerate(self.samples):
            wrong = list(
                wrong_statements(
                    sample, {topic: own[: sample["counts"].get(topic, 0)] for topic, own in events.items()}
                )
            )
            assert wrong == [], (number, wrong)
        return events


def shared_rows(node):
    """The nodes of each row of a logged tree, by the path id of the last of them."""
    chain, found = [node], {}
    while following := next((child for child in chain[-1]["children"] if child["row"] is None), None):
        chain.append(following)
    for each in chain:
        for child in each["children"]:
            if child not in chain:
                found |= shared_rows(child)
    return {**found, chain[-1]["id"]: [each["id"] for each in chain]}


def wrong_statements(sample, log):
    """Yields the statements of the page that its messages do not bear out."""
    status, rows = {}, {}
    for event in log.get("transitions", ()):
        cancelled = event.data["to"] == "INVALID" and event.data["cause"] == "CANCELLED"
        status[event.data["node"]] = "CANCELLED" if cancelled else event.data["to"]
    for event in log.get("tree", ()):
        rows |= shared_rows(event.data["root"])
    for panel in sample["panels"]:
        states = [e.data for e in log.get("state", ()) if panel["robot"] in (None, e.data["robot"])]
        if states:
            speed, shown = states[-1]["speed_m_s"], float(panel["facts"]["speed"].split()[0])
            if abs(speed - shown) > 0.051:
                yield panel["robot"], "speed", speed, shown
            if states[-1]["holding"] != (panel["facts"]["holds"] != "nothing"):
                yield panel["robot"], "holds", states[-1]["holding"]
            if panel["pill"] == "paused" and speed > STANDS_M_S:
                yield panel["robot"], "paused", speed
        outcomes = [e.data for e in log.get("outcome", ()) if panel["robot"] in (None, e.data["robot"])]
        if outcomes and outcomes[-1]["outcome"] not in panel["pill"]:
            yield panel["robot"], "pill", panel["pill"], outcomes[-1]["outcome"]
        if not outcomes and panel["pill"] in ("success", "failure", "cancelled", "ended"):
            yield panel["robot"], "pill", panel["pill"]
        for last, look in panel["rows"]:
            found = status.get(rows[last][0])
            if look not in LOOKS.get(found, {"cancelled", "idle", "failure"}):
                yield last, look, found


def wrong_in_report(report, events):
    """Yields the statements of a report that the log does not bear out."""
    told = report.locator("main").inner_text()
    for event in events["outcome"][-1:]:
        first = report.locator(".verdict").first.inner_text()
        if event.data["outcome"] not in first or any(
            part.strip() not in first for part in re.split("[;.] ?", event.data["message"])
        ):
            yield "outcome", event.data["message"], first
    run = events["run"][0].data
    if f"{run['world']}, seed {run['seed']}" not in told:
        yield "world", run
    answers = [each.data for each in events["answer"]]
    if report.locator(".answer").count() != len(answers):
        yield "answers", len(answers)
    shown = report.locator(".answer .pill").all_inner_texts()
    plain = [{True: "yes", False: "no", None: "no answer"}.get(each["answer"], str(each["answer"])) for each in answers]
    if shown != plain:
        yield "answers", shown, plain
    pictures = [bool(article.locator("img").count()) for article in report.locator(".answer").all()]
    if pictures != ["format" in each for each in answers]:
        yield "pictures", pictures
    for event in events["speech"]:
        if event.data["text"] not in told:
            yield "speech", event.data["text"]
    addresses = [each.get_attribute("href") for each in report.locator(".links a").all()]
    if not addresses or any("/" in address for address in addresses):
        yield "link", addresses


@pytest.fixture
def start(browser, tmp_path):
    """Starts a command with `--view` and opens its page."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    with ExitStack() as stack:

        def started(*command, out=tmp_path / "out"):
            run = Run(context.new_page(), out, *command, "--out", str(out))
            stack.callback(lambda: run.process.poll() is None and run.kill())
            return run

        yield started
    context.close()


FETCH = ("run", "fetch_drink", "--quiet", "--no-record")


def test_pause_step_stop_and_cancel_are_what_the_robot_does(start):
    run = start(*FETCH)
    run.until(3.0)
    run.page.click("#pause")
    run.pill("paused")
    run.page.click("#step")
    expect(run.page.locator("#events")).to_contain_text("step until a node changes", timeout=20_000)
    run.pill("paused", 90)
    run.page.click("#pause")
    run.pill("running")
    run.page.click("#stop")
    run.pill("stop button")
    run.page.click("#stop")
    run.pill("running")
    run.page.click("#cancel")
    run.pill("cancelled")
    said, report = run.finish()
    events = run.check()
    whats = [event.data["what"] for event in events["control"]]
    assert [each for each in whats if each in ("pause", "step", "resume", "stop button", "cancel")] == [
        "pause",
        "step",
        "resume",
        "stop button",
        "cancel",
    ]
    assert events["outcome"][-1].data["message"] in said[0] and "cancelled" in said[0]
    assert list(wrong_in_report(report, events)) == []


def test_a_breakpoint_is_named_and_holds_the_robot(start):
    run = start(*FETCH)
    run.until(2.0)
    row = run.page.locator('#tree .row:has(.name:has-text("carry the drink"))').first
    row.locator(".dot").evaluate("dot => dot.click()")
    run.pill("paused", 120)
    assert "/" not in run.page.locator("#mode").get_attribute("title")
    run.page.click("#pause")
    run.pill("running")
    run.page.click("#cancel")
    run.pill("cancelled")
    run.finish()
    run.check()


def test_a_killed_run_is_not_said_to_have_ended(start):
    run = start(*FETCH)
    run.until(4.0)
    run.kill()
    run.pill("no connection")
    assert "The connection to Errand is lost" in run.samples[-1]["connection"]
    assert "ended" not in run.page.locator("body").inner_text()


def test_a_page_that_was_disconnected_says_so_and_catches_up(start):
    run = start(*FETCH)
    run.until(2.0)
    sockets = []

    def through(socket):
        server = socket.connect_to_server()
        sockets.append(socket)
        server.on_message(socket.send)

    run.page.route_web_socket(re.compile("/feed"), through)
    run.page.reload()
    run.until(3.0)
    sockets[-1].close(code=1011)
    expect(run.page.locator("#connection")).to_contain_text("lost")
    run.page.wait_for_function("() => document.getElementById('connection').hidden", timeout=20_000)
    run.pill("running")
    run.page.click("#cancel")
    run.pill("cancelled")
    run.finish()
    run.check()


@pytest.mark.parametrize(("mission", "answer"), [("tea_or_coffee", "tea"), ("greet_and_ask", "no")])
def test_people_are_greeted_and_asked_as_the_report_says(start, mission, answer):
    run = start("run", mission, "--quiet")
    card = run.page.locator(".question")
    card.wait_for(timeout=120_000)
    run.sample()
    run.page.locator(".question button", has_text=answer).first.click()
    expect(card).to_have_count(0)
    said, report = run.finish()
    events = run.check()
    assert answer in said[0]
    assert list(wrong_in_report(report, events)) == []


def test_two_robots_have_states_of_their_own(start):
    run = start("run", "two_robots", "--quiet", "--no-record")
    for seconds in (2.0, 5.0, 8.0):
        run.until(seconds)
    run.page.locator('.robot[data-robot="Bob"] .pause').click()
    expect(run.page.locator('.robot[data-robot="Bob"] .mode')).to_contain_text("paused", timeout=20_000)
    run.sample()
    assert [each["pill"] for each in run.samples[-1]["panels"]] == ["running", "paused"]
    run.page.click("#cancel")
    said, _ = run.finish()
    run.check()
    assert len(said) == 4


def test_a_fleet_says_what_came_of_each_mission(start, tmp_path):
    store = tmp_path / "queue.sqlite"
    for sentence in ("go to the office", "go to the kitchen"):
        added = [*ERRAND, "queue", "add", "--say", sentence, "--store", str(store)]
        subprocess.run(added, check=True, capture_output=True)
    out = tmp_path / "fleet"
    run = start("fleet", "run", str(store), "--robots", "alice=spot,bob=spot", "--quiet", "--no-record", out=out)
    run.until(3.0)
    said, report = run.finish()
    events = run.check()
    done = [each["outcome"] for each in events["missions"][-1].data["missions"]]
    assert said == [f"The fleet: ✓ {done.count('success')} of 2 missions achieved"]
    assert report.locator("h1").inner_text().lower() == "go office and go kitchen"
    assert report.locator("table .pill").all_inner_texts() == [f"{each}, fulfilled" for each in done]


def test_a_mission_that_is_added_on_the_page_of_a_fleet_is_done(start, tmp_path):
    store = tmp_path / "queue.sqlite"
    added = [
        *ERRAND,
        "queue",
        "add",
        "--say",
        "wait in the office for 2 minutes",
        "--store",
        str(store),
    ]
    subprocess.run(added, check=True, capture_output=True)
    out = tmp_path / "fleet"
    run = start("fleet", "run", str(store), "--robots", "alice=spot,bob=spot", "--quiet", "--no-record", out=out)
    run.page.click("#pause")
    run.pill("paused")
    box, button, told = (run.page.locator(f"#{each}") for each in ("mission", "add button", "added"))
    box.fill("fly to the moon")
    button.click()
    expect(told).to_have_class("bad", timeout=30_000)
    expect(told).to_contain_text("I do not understand 'fly to the moon'")
    expect(box).to_have_value("fly to the moon")
    box.fill("go to the kitchen")
    button.click()
    expect(told).to_have_text("Mission 2 is queued: go kitchen", timeout=30_000)
    expect(box).to_have_value("")
    expect(run.page.locator("#missions tr")).to_have_count(2)
    run.page.click("#pause")
    said, _ = run.finish()
    assert said == ["The fleet: ✓ 2 of 2 missions achieved"]
    expect(button).to_have_text("The fleet has ended")
    expect(button).to_be_disabled()
    missions = run.events["missions"][-1].data["missions"]
    assert [each["outcome"] for each in missions] == ["success", "success"]


def test_a_restarted_mission_reports_the_whole_of_it(start, tmp_path, browser):
    run = start(*FETCH, "--store", str(tmp_path / "store.sqlite"))
    run.until(12.0)
    run.kill()
    again = [
        *ERRAND,
        "resume",
        "--store",
        str(tmp_path / "store.sqlite"),
        "--out",
        str(tmp_path / "again"),
        "--quiet",
        "--json",
    ]
    done = subprocess.run(again, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    log = next((tmp_path / "again").rglob("*.mcap"), None) or next((tmp_path / "out").rglob("*.mcap"))
    page = browser.new_page()
    page.goto(log.with_name("report.html").as_uri())
    events = defaultdict(list)
    for event in read_history(log).events:
        events[event.topic].append(event)
    assert list(wrong_in_report(page, events)) == []
    page.close()


def test_a_robot_driven_by_hand_is_where_the_page_says(browser):
    words = [*ERRAND, "teleop", "--start", "5.2", "4.5", "3.14"]
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    try:
        lines = iter(process.stdout.readline, "")
        page.goto(next(found[1] for line in lines if (found := re.search(r"The page: (http\S+)", line))))
        expect(page.locator("#camera img")).to_have_count(3, timeout=30_000)
        where = "() => window.errand.page.store.live.teleop.base"
        before = page.evaluate(where)
        page.keyboard.down("w")
        page.wait_for_function(
            "x => window.errand.page.store.live.teleop.base[0] < x - 0.5", arg=before[0], timeout=20_000
        )
        page.keyboard.up("w")
        page.click("#stop")
        expect(page.locator("#mode-text")).to_have_text("stop button")
        expect(page.locator("#state")).to_contain_text("speed0.0 m/s", timeout=20_000)
        stood = page.evaluate(where)
        page.keyboard.down("w")
        page.wait_for_timeout(1500)
        page.keyboard.up("w")
        assert page.evaluate(where) == pytest.approx(stood, abs=0.03)
        mapped = re.search(r"Alice at x (\S+) m, y (\S+) m", page.locator("#map").get_attribute("aria-label"))
        assert [float(mapped[1]), float(mapped[2])] == pytest.approx(stood[:2], abs=0.03)
        expect(page.locator("#events")).to_contain_text("stop button stopped")
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        page.close()
