"""What the robot says while it runs: on the console and by the voice."""

import io
import re
from types import SimpleNamespace

import pytest
from py_trees.common import Status
from rich.console import Console
from rich.text import Text

from executive.cli.output import progress_bar
from executive.cli.screen import SILENCE, WRITTEN, ConsoleScreen, SpeechOutput, live_view, visible_rows, voice_for
from executive.run.control import Control
from executive.run.visitor import Progress
from executive.speech import voice as voices
from executive.tree.node import NodeState
from skills.api import Cause
from skills.inputs.errors import InputError


def a_voice():
    """A voice that remembers what it says."""
    texts = []
    return SimpleNamespace(texts=texts, say=texts.append)


@pytest.mark.parametrize(("quiet", "shown"), [(False, "Alice: [bold]Hello\n"), (True, "")])
def test_speech_is_printed_unless_quiet_and_said_by_the_voice(quiet, shown):
    told, voice = io.StringIO(), a_voice()
    speech = SpeechOutput(Console(file=told, width=80), voice, quiet)
    speech.message("speech", {"robot": "Alice", "text": "[bold]Hello", "t": 1.0})
    speech.message("pose", {"robot": "Alice"})
    speech.tick(Progress(1.0, 20, 0, {}))
    assert (told.getvalue(), voice.texts) == (shown, ["[bold]Hello"])


def test_the_voice_keeps_silent_in_a_silent_zone():
    told, voice = io.StringIO(), a_voice()
    SpeechOutput(Console(file=told, width=80), voice, False).message(
        "speech", {"robot": "Alice", "text": "Hello", "silent": "bedroom"}
    )
    assert voice.texts == []


def test_without_the_option_nothing_is_said_aloud():
    with voice_for(False) as voice:
        assert voice is SILENCE


def test_aloud_without_a_synthesiser_is_refused(monkeypatch):
    monkeypatch.setattr(voices.queued_voice, "__kwdefaults__", {"which": lambda name: None})
    with pytest.raises(InputError, match="no voice"), voice_for(True):
        pass


def tree_of(count, running):
    return Text("\n".join(f"{'▶' if number == running else '○'} node {number}" for number in range(count)))


@pytest.mark.parametrize("running", [0, 1, 17, 38, 39])
def test_the_running_node_is_among_the_lines_that_fit(running):
    shown = visible_rows(tree_of(40, running), 10).plain.splitlines()
    assert len(shown) == 10
    assert f"▶ node {running}" in shown


def test_a_tree_that_fits_is_shown_whole():
    picture = tree_of(8, 3)
    assert visible_rows(picture, 8) is picture


def test_a_tree_at_rest_is_shown_from_its_root():
    assert visible_rows(tree_of(40, None), 10).plain.splitlines()[0] == "○ node 0"


def test_the_tree_under_way_is_drawn_on_a_small_terminal(compiled, make):
    first, aside = compiled(*make.FETCH), compiled(make.FETCH[1], name="go aside")
    states = {path_id: NodeState(Status.RUNNING, message="at it") for path_id in (*first.path_ids, *aside.path_ids)}
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=80, height=14)
    with live_view(console, Control()) as view:
        view.tick(Progress(1.0, 20, 0, {"Alice": states}, {"Alice": aside}))
    assert "at it" in screen.getvalue()
    assert "fetch drink" not in screen.getvalue()


def test_the_bar_of_a_queue_stands_above_the_tree(compiled, make):
    tree = compiled(*make.FETCH)
    states = {path_id: NodeState(Status.RUNNING, message="at it") for path_id in tree.path_ids}
    console = Console(file=io.StringIO(), force_terminal=True, width=80, height=14)
    with progress_bar(console, "missions", 3), live_view(console, Control()) as view:
        view.tick(Progress(1.0, 20, 0, {"Alice": states}, {"Alice": tree}))
        shown = console.file.getvalue().rpartition("missions")[2]
    rows = [row for row in shown.split("\n") if row.strip()]
    assert "0/3" in rows[0] and "at it" in rows[-1] and len(rows) <= console.height


@pytest.fixture
def tree(compiled, make):
    return compiled(*make.FETCH)


@pytest.fixture
def show(tree):
    """Shows states of nodes of the tree at a time, whose other nodes are idle."""
    idle = {path_id: NodeState() for path_id in tree.path_ids}
    return lambda view, now_s, states: view.tick(Progress(now_s, 20, 0, {"Alice": {**idle, **states}}, {"Alice": tree}))


def node_of(tree, end):
    return next(node.path_id for node in tree.root.walk() if node.path_id.endswith(end))


def test_each_skill_that_ended_is_one_line_with_place_result_and_seconds(tree, show):
    drive, detect = node_of(tree, "counter-1/navigate"), node_of(tree, "counter-1/detect")
    told = io.StringIO()
    with live_view(Console(file=told, width=200)) as view:
        for now_s, changes in (
            (1.0, {drive: NodeState(Status.RUNNING, message="on its way")}),
            (3.5, {drive: NodeState(Status.SUCCESS, message="there")}),
            (3.6, {drive: NodeState(Status.SUCCESS, message="there"), detect: NodeState(Status.RUNNING)}),
            (4.0, {detect: NodeState(Status.FAILURE, Cause.PRECONDITION, "saw none")}),
            (4.1, {detect: NodeState(Status.FAILURE, Cause.PRECONDITION, "saw none")}),
        ):
            show(view, now_s, changes)
    first, second = told.getvalue().splitlines()
    assert re.match(r"✓ +2.5 s  go to the counter: there$", first)
    assert re.match(r"✗ +0.4 s  detect \(coke, beer; counter\): PRECONDITION: saw none$", second)


@pytest.mark.parametrize(
    ("search", "line"),
    [
        (Status.RUNNING, r"– +0.0 s  detect \(coke, beer; counter\): no coke seen$"),
        (Status.FAILURE, r"✗ +0.0 s  detect \(coke, beer; counter\): POSTCONDITION: no coke seen$"),
    ],
)
def test_a_look_that_found_nothing_has_no_cross_while_the_search_goes_on(tree, show, search, line):
    detect = node_of(tree, "counter-1/detect")
    look = detect.removesuffix("/detect")
    find = next(node.path_id for node in tree.root.walk() if look in [child.path_id for child in node.children])
    told = io.StringIO()
    with live_view(Console(file=told, width=200)) as view:
        for state in (NodeState(Status.RUNNING), NodeState(Status.FAILURE, Cause.POSTCONDITION, "no coke seen")):
            show(view, 1.0, {look: NodeState(Status.FAILURE), find: NodeState(search), detect: state})
    assert re.match(line, told.getvalue().strip())


def test_speech_is_printed_behind_the_skills_that_ended_before_it(tree, show):
    drive = node_of(tree, "counter-1/navigate")
    told = io.StringIO()
    console = Console(file=told, width=200)
    with live_view(console) as view:
        speech = SpeechOutput(console, a_voice(), quiet=False)
        speech.message("speech", {"robot": "Alice", "text": "hello", "t": 1.0})
        for visitor in (view, speech):
            show(visitor, 1.0, {drive: NodeState(Status.SUCCESS, message="there")})
    first, second = told.getvalue().splitlines()
    assert (first.endswith("there"), second) == (True, "Alice: hello")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("log-2.mcap", WRITTEN["log.mcap"]),
        ("tree_bob.svg", WRITTEN["tree.svg"]),
        ("hand_over_bob.png", WRITTEN["hand_over.png"]),
        ("hand_over.png", WRITTEN["hand_over.png"]),
        ("notes.txt", ""),
    ],
)
def test_each_log_and_picture_of_a_run_is_said_to_be_what_it_is(tmp_path, name, content):
    (tmp_path / name).touch()
    told = io.StringIO()
    ConsoleScreen(Console(file=told, width=200), quiet=True).name_files(tmp_path)
    assert told.getvalue().splitlines()[-1].strip() == f"{name}  {content}".strip()
