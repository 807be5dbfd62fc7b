"""Queue and resume on the command line, without a plant: what is kept, in which order it is run, what is refused."""

import io
import shlex
import signal
import time
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest
from py_trees.common import Status
from rich.console import Console

from executive.app.report.run_report import RunReport
from executive.app.runs.one_run import FinishedRun
from executive.app.runs.page_view import PageView
from executive.run.visitor import TickNote
from executive.store.missions import MissionStore
from executive.store.wakeup import WakeupPipe
from executive.tree.compiler import compile_mission
from executive.tree.node import Change, NodeState
from executive.tree.node_view import node_view
from executive.tree.registry import installed_skills
from executive.words.command import Command
from executive.words.goal import RefereeReport
from executive.words.leaf_steps import steps_of_commands
from executive.words.mission import Mission
from skills.inputs.errors import InputError
from skills.robot import Pose2D
from tests.executive.cli import calls
from tests.executive.distribution import write_distribution
from tests.tables import yaml_beside

RUN_REQUEST = "executive.app.runs.queue.run_request"
SESSIONS = yaml_beside(__file__, "queue_sessions.yaml")
GO = "Take [Nothing] to [%s] and do [Nothing] to [Nothing]"
PARTS = """name: two
robots: {alice: spot, bob: fetch}
parts:
  alice: {steps: [{to: kitchen}]}
  bob: {after: alice, steps: [{to: bedroom}]}
"""


class GoneError(BaseException):
    """The process is killed."""


class Plant:
    """Stands in for `run_request`: notes one finished leaf, then ends as the test says."""

    def __init__(self):
        self.runs, self.commands, self.outcomes, self.pages = [], [], [], []

    def __call__(self, prepared, *, durable, visitors=(), **_):
        self.pages.append(next((each for each in visitors if isinstance(each, PageView)), None))
        outcome = self.outcomes.pop(0) if self.outcomes else "success"
        if outcome == "refused":
            raise InputError("the world is full")
        if outcome == "defect":
            raise ZeroDivisionError("by a plug-in")
        tree, request = prepared.tree, prepared.request
        request.out.mkdir(parents=True, exist_ok=True)
        durable.plant.with_name(f"{durable.plant.name}.a").touch()
        facts = {
            "name": prepared.mission.name,
            "seed": request.seed,
            "out": request.out.name[len("2026-11-28-1503-") :],
            "stack": request.stack,
        }
        kept = {"take_up": durable.take_up, "label": durable.take_up_label, "log": durable.log, "poses": durable.poses}
        self.runs.append(facts | kept)
        self.commands.append([list(map(str, each.tree.commands)) for each in prepared.all])
        for number, each in enumerate(prepared.all):
            done = Change(first_leaf(each.tree), NodeState(), NodeState(Status.SUCCESS, None, "done"))
            pose = Pose2D(float(number), 0.5, 0.0) if prepared.robots else None
            durable.journals[each.mission.robot_name].note(TickNote(each.tree, 1.0, (done,), {}, pose, {}))
        if outcome == "killed":
            raise GoneError
        referee = RefereeReport(outcome == "success", "seen", 0, 0)
        report = RunReport(outcome, None, "done", referee, (), "flat", 1, 1.0, 1.0, 1.0, 20, "log.mcap")
        return FinishedRun(report, node_view(tree.root))


def first_leaf(tree):
    """The path id of the first skill of a mission."""
    return next(node.path_id for node in tree.root.walk() if node.kind == "skill" and "/watch/" not in node.path_id)


@pytest.fixture
def plant(monkeypatch):
    stand_in = Plant()
    monkeypatch.setattr(RUN_REQUEST, stand_in)
    monkeypatch.setattr("executive.app.prepare.from_request.load_parser", lambda: None)  # no step here is a sentence
    return stand_in


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The folder of the calls: missions by name that go to the kitchen and to the bedroom, and one of two robots."""
    for name in ("first", "second", "third", "alone", "other"):
        write(tmp_path, name, "kitchen")
    (tmp_path / "two.yaml").write_text(PARTS)
    monkeypatch.chdir(tmp_path)


def write(folder, name, place):
    (folder / f"{name}.yaml").write_text(f"name: {name}\nsteps:\n  - {{to: {place}}}\n  - {{to: bedroom}}\n")


def errand(words):
    """Calls `errand` in the folder, with its store."""
    out = [] if words.startswith("resume") else ["--out", "out"]
    return calls.errand(*shlex.split(words), "--store", "out/.errand/missions.sqlite", *out)


def add(*names):
    for name in names:
        assert errand(f"queue add {name}.yaml").exit_code == 0


def store():
    return MissionStore(Path("out/.errand/missions.sqlite"))


def states():
    with store() as opened:
        return [mission.state.value for mission in opened.missions()]


def change(**values):
    """Changes the request of the first mission in the store."""
    with store() as opened:
        text = replace(opened.mission(1).request, **values).to_json()
        with opened.writing() as connection:
            connection.execute("UPDATE mission SET request = ? WHERE id = 1", (text,))


def listed():
    return calls.json_of(errand("queue list --json"))["missions"]


def holds(found, expected):
    """Whether a value is as expected; of a mapping only the expected keys count."""
    if isinstance(expected, dict):
        return all(holds(found[key], value) for key, value in expected.items())
    if isinstance(expected, list):
        return len(found) == len(expected) and all(map(holds, found, expected))
    return found == expected


def take_step(step):
    """Makes a call of a session, or changes the store."""
    if "change" in step:
        change(**step["change"])
    elif step.get("killed"):
        with pytest.raises(GoneError):
            errand(step["call"])
    else:
        result = errand(step["call"])
        assert result.exit_code == step.get("exit", 0), result.output
        assert step.get("says", "") in " ".join(result.output.split()), result.output
        assert "json" not in step or holds(calls.json_of(result), step["json"]), result.output
    assert "states" not in step or states() == step["states"]


@pytest.mark.parametrize("session", SESSIONS, ids=lambda session: session["name"])
def test_a_session_of_calls_runs_the_missions_and_leaves_the_states_that_it_says(plant, session):
    plant.outcomes = session.get("outcomes", [])
    for step in session["calls"]:
        take_step({"call": step} if isinstance(step, str) else step)
    assert "runs" not in session or holds(plant.runs, session["runs"]), plant.runs
    assert "states" not in session or states() == session["states"]


def test_a_queued_mission_keeps_its_stack_file(plant, tmp_path):
    (tmp_path / "stack.yaml").write_text("planner: {use: lattice, soft_m: 0.5}\n")
    assert errand("queue add first.yaml --stack stack.yaml").exit_code == 0
    errand("queue run --quiet")
    assert [run["stack"] for run in plant.runs] == [(tmp_path / "stack.yaml").resolve()]


def folders(out):
    return sorted(
        file.parent.name.split("-", 4)[-1] for file in Path(out).glob("*/run.json") if not file.parent.is_symlink()
    )


@pytest.mark.parametrize("command", ["queue run --quiet", "queue serve --quiet --until-idle --port 0"])
def test_the_queue_writes_into_the_folder_that_it_is_given(plant, command):
    add("first", "second")
    elsewhere = ("--store", "out/.errand/missions.sqlite", "--out", "elsewhere")
    assert calls.errand(*shlex.split(command), *elsewhere).exit_code == 0
    assert [len(folders(out)) for out in ("elsewhere", "out")] == [2, 0]


def test_without_a_folder_each_mission_writes_where_it_was_queued_for(plant):
    calls.errand("queue", "add", "first.yaml", "--store", "out/.errand/missions.sqlite", "--out", "mine")
    calls.errand("queue", "run", "--quiet", "--store", "out/.errand/missions.sqlite")
    assert [len(folders(out)) for out in ("mine", "out")] == [1, 0]


def test_a_resumed_mission_writes_into_the_folder_that_it_is_given(plant):
    plant.outcomes = ["killed"]
    with pytest.raises(GoneError):
        errand("run alone.yaml --quiet")
    assert errand("resume --quiet --out elsewhere").exit_code == 0
    assert [len(folders(out)) for out in ("elsewhere", "out")] == [1, 1]


@pytest.mark.parametrize("command", ["queue run --quiet", "queue serve --quiet --until-idle --port 0"])
def test_a_queue_leaves_no_recordings_when_asked(plant, command, monkeypatch):
    seen = []
    monkeypatch.setattr(
        RUN_REQUEST, lambda prepared, **how: seen.append(prepared.request.record) or plant(prepared, **how)
    )
    add("first")
    assert errand(f"{command} --no-record").exit_code == 0
    add("second")
    assert errand(command).exit_code == 0
    assert seen == [False, True]


def test_a_resumed_mission_leaves_no_recording_when_asked(plant, monkeypatch):
    plant.outcomes = ["killed"]
    with pytest.raises(GoneError):
        errand("run alone.yaml --quiet")
    seen = []
    monkeypatch.setattr(
        RUN_REQUEST, lambda prepared, **how: seen.append(prepared.request.record) or plant(prepared, **how)
    )
    assert errand("resume --quiet --no-record").exit_code == 0
    assert seen == [False]


FOUND = ["", " --out mine"]


@pytest.mark.parametrize("command", ["queue run --quiet", "queue serve --quiet --until-idle --port 0"])
@pytest.mark.parametrize("added", FOUND)
@pytest.mark.parametrize("ran", FOUND)
def test_a_mission_is_found_whether_it_was_queued_with_or_without_a_folder(plant, command, added, ran):
    calls.errand(*shlex.split(f"queue add first.yaml{added}"))
    assert "first" in calls.errand(*shlex.split(f"queue list{ran}")).output
    assert calls.errand(*shlex.split(f"{command}{ran}")).exit_code == 0
    assert len(folders("mine" if added or ran else "out")) == 1


def test_the_queue_is_in_the_folder_that_errand_toml_names(plant):
    Path("errand.toml").write_text('out = "runs"\n')
    calls.errand("queue", "add", "first.yaml", "--out", "mine")
    assert calls.errand("queue", "run", "--quiet", "--out", "other").exit_code == 0
    assert Path("runs/.errand/missions.sqlite").is_file() and len(folders("other")) == 1


def test_a_mission_that_ran_in_another_folder_is_resumed_there_although_a_queue_exists(plant):
    plant.outcomes = ["killed"]
    calls.errand("queue", "add", "first.yaml")
    with pytest.raises(GoneError):
        calls.errand("run", "alone.yaml", "--quiet", "--out", "mine")
    assert calls.errand("resume", "--quiet", "--out", "mine").exit_code == 0
    assert states() == ["queued"] and [len(folders("mine")), Path("out/last").exists()] == [1, False]


@pytest.mark.parametrize("command", ["run alone.yaml", "queue run", "queue serve --port 0", "resume"])
def test_a_file_as_the_folder_of_runs_is_refused_and_the_queue_stays(plant, command):
    calls.errand("queue", "add", "first.yaml")
    result = calls.errand(*shlex.split(command), "--quiet", "--out", "second.yaml")
    assert result.exit_code == 2 and "name another --out" in result.output, result.output
    assert states() == ["queued"]


# The mission that runs, the robot that is told to go elsewhere, and what is run when the mission is resumed.
CORRECTED = [
    ("first", "Alice", "bathroom", "go bathroom 2", [[GO % "bathroom"]]),
    ("two", "Bob", "office", "two", [[GO % "kitchen"], [GO % "office"]]),
]


@pytest.mark.parametrize(("name", "robot", "goal", "resumed", "commands"), CORRECTED)
def test_resume_goes_on_with_the_correction_of_a_robots_mission(
    plant, monkeypatch, name, robot, goal, resumed, commands
):
    def corrected(prepared, *, durable, **_):
        prepared.request.out.mkdir(parents=True, exist_ok=True)
        go = Mission.from_steps(steps_of_commands([Command(goal=goal)]), world="flat", robot=robot)
        other = go.model_copy(update={"name": f"go {goal} 2"})
        tree = compile_mission(other, knowledge=prepared.knowledge, registry=installed_skills())
        under_way = Change(first_leaf(tree), NodeState(), NodeState(Status.RUNNING, None, "on the way"))
        durable.journals[robot].note(TickNote(tree, 2.0, (under_way,), {}, None, {}))
        raise GoneError

    with monkeypatch.context() as patch, pytest.raises(GoneError):
        patch.setattr(RUN_REQUEST, corrected)
        errand(f"run {name}.yaml --quiet")
    result = errand("resume --quiet")
    assert result.exit_code == 0, result.output
    assert ([run["name"] for run in plant.runs], plant.commands) == ([resumed], [commands])


def test_a_killed_run_of_two_robots_is_resumed_with_each_where_it_was(plant):
    plant.outcomes = ["killed"]
    with pytest.raises(GoneError):
        errand("run two.yaml --quiet --no-record")
    result = errand("resume --quiet")
    assert (result.exit_code, states()) == (0, ["success"]), result.output
    poses = {"Alice": Pose2D(0.0, 0.5, 0.0), "Bob": Pose2D(1.0, 0.5, 0.0)}
    assert holds(plant.runs[1], {"take_up": True, "log": "log-2.mcap", "poses": poses})
    assert plant.commands == [[[GO % "kitchen"], [GO % "bedroom"]]] * 2


def test_queued_missions_of_the_same_robots_share_a_world_also_with_one_that_stands_by(plant):
    robots = ("first.yaml --robots alice=spot,bob=fetch", "two.yaml --robots alice=spot,bob=fetch")
    for words in (*robots, "first.yaml --robots alice=spot,carl=spot", "alone.yaml"):
        errand(f"queue add {words}")
    result = errand("queue run --quiet")
    assert [run["take_up"] for run in plant.runs] == [False, True, False, False], result.output
    assert list(plant.runs[1]["poses"]) == ["Alice", "Bob"]


def test_a_bar_counts_the_missions_of_run_and_resume(plant, monkeypatch):
    terminal = Console(file=io.StringIO(), force_terminal=True, width=200)
    monkeypatch.setattr("executive.cli.queue_command.console_for", lambda as_json: terminal)
    add("first", "second", "third")
    plant.outcomes = ["success", "cancelled"]
    errand("queue run --quiet")
    assert "missions" in terminal.file.getvalue() and "2/3" in terminal.file.getvalue()
    terminal.file.truncate(0)
    assert errand("resume --quiet").exit_code == 0
    assert "2/2" in terminal.file.getvalue()


def test_a_mission_file_that_was_changed_is_taken_as_it_was(plant, tmp_path):
    plant.outcomes = ["killed"]
    with pytest.raises(GoneError):
        errand("run alone.yaml --quiet")
    write(tmp_path, "alone", "sideboard")
    assert (errand("resume --quiet").exit_code, plant.commands) == (0, [[[GO % "kitchen", GO % "bedroom"]]] * 2)


@pytest.mark.parametrize(
    ("options", "trigger", "missed"),
    [
        ("--at 'every weekday 09:00'", "every weekday 09:00", "skip"),
        ("--every 30m --missed once", "every 30m", "once"),
        ("--on 'battery full'", "battery full", "skip"),
        ("--on 'call first'", "call first", None),
    ],
)
def test_a_mission_with_a_trigger_stands_until_it_is_removed(plant, options, trigger, missed):
    result = errand(f"queue add first.yaml {options}")
    assert (result.exit_code, f"({trigger}): first" in result.output) == (0, True), result.output
    (told,) = listed()
    assert (told["state"], told["trigger"], told.get("missed")) == ("standing", trigger, missed)
    assert (told["next"] is not None) == trigger.startswith("every")
    assert trigger in errand("queue list").output
    assert (errand("queue run --quiet").exit_code, errand("queue remove 1").exit_code) == (0, 0)
    assert (plant.runs, listed()) == ([], [])


def test_a_trigger_in_the_past_is_listed_as_over(plant):
    errand("queue add first.yaml --at '2999-01-01 09:00'")
    with store() as opened:
        opened._connection.execute("UPDATE mission SET trigger = '2020-01-01 09:00'")
    assert "2020-01-01 09:00, over" in errand("queue list").output


def test_serve_runs_what_is_due_and_the_list_says_where_it_came_from(plant):
    errand("queue add first.yaml --every 1d --missed once --seed 4")
    with store() as opened:
        day_before = (opened.now() - timedelta(days=1.5)).isoformat()
        opened._connection.execute("UPDATE mission SET since = ?, anchor = ?", (day_before, day_before))
    result = errand("queue serve --until-idle --quiet --json")
    assert result.exit_code == 0, result.output
    assert calls.json_of(result) == {"missions": [{"mission": 2, "outcome": "success", "achieved": True}]}
    assert holds(plant.runs, [{"name": "first", "seed": 4, "out": "first"}])
    standing, fired = listed()
    assert (standing["state"], fired["state"], fired["standing"]) == ("standing", "success", 1)
    assert fired["why"].startswith("every 1d, due 2") and fired["why"].endswith(", missed")
    assert f"1: {fired['why']}" in errand("queue list").output


def test_only_one_process_runs_or_serves_missions_of_a_store(plant):
    errand("queue add first.yaml --every 1h")
    with store() as opened, opened.claim():
        for words in ("queue serve --until-idle", "run alone.yaml --quiet"):
            result = errand(words)
            assert (result.exit_code, "runs a mission of this store" in result.output) == (2, True)
        assert errand("queue remove 1").exit_code == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_server_that_waits(plant, monkeypatch, number):
    wait = WakeupPipe.wait

    def signalled(self, until):
        signal.raise_signal(number)
        wait(self, until)

    monkeypatch.setattr(WakeupPipe, "wait", signalled)
    errand("queue add first.yaml --every 1h")
    begun = time.monotonic()
    assert errand("queue serve --for 50").exit_code == 0
    assert time.monotonic() - begun < 30


def test_a_signal_during_a_mission_ends_the_server_and_keeps_the_queue(plant):
    def signalled(prepared, *, control, **options):
        signal.raise_signal(signal.SIGTERM)
        plant.outcomes = ["cancelled" if control.poll().cancel == "cancelled by SIGTERM" else "error"]
        return plant(prepared, **options)

    add("first", "second")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RUN_REQUEST, signalled)
        result = errand("queue serve --quiet")
    assert (result.exit_code, states()) == (0, ["cancelled", "queued"])
    assert "goes on with it" in " ".join(result.output.split())
    assert (errand("resume --quiet").exit_code, states()) == (0, ["success", "success"])


PLUG_IN = """
class Bell:
    def start(self, topics, fire):
        for topic in topics:
            fire(topic, b"")

    def stop(self):
        pass
"""


def test_serve_runs_what_a_plug_in_hears(plant, tmp_path, monkeypatch):
    (tmp_path / "bell_source.py").write_text(PLUG_IN)
    write_distribution(tmp_path, "bell_source", "errand.triggers", "bell = bell_source:Bell")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert errand("queue add first.yaml --on 'topic bell:front door'").exit_code == 0
    result = errand("queue serve --until-idle --quiet")
    assert (result.exit_code, [run["name"] for run in plant.runs]) == (0, ["first"]), result.output
    assert "(topic bell:front door)" in result.output


def test_serve_names_a_plug_in_that_is_gone_and_runs_what_is_queued(plant):
    errand("queue add first.yaml --every 1h")
    with store() as opened:
        opened._connection.execute("UPDATE mission SET trigger = 'topic gone:x'")
    add("second")
    result = errand("queue serve --until-idle --quiet")
    assert (result.exit_code, [run["name"] for run in plant.runs]) == (0, ["second"])
    assert "missions that wait for topics of gone are not heard of" in result.output
    assert "entry-point group 'errand.triggers'" in result.output


SERVE, RUN = "queue serve --until-idle --quiet", "queue run --quiet"


@pytest.mark.parametrize("command", [RUN, SERVE])
def test_a_name_of_300_letters_is_run_in_a_folder_with_a_short_name(plant, tmp_path, command):
    for number in range(2):
        (tmp_path / f"{number}.yaml").write_text(f"name: {'go there ' * 34}{number}\nsteps: [{{to: kitchen}}]\n")
        add(number)
    assert errand(command).exit_code == 0
    folders = [run["out"] for run in plant.runs]
    assert [len(folder) <= 100 for folder in folders] == [True, True]
    assert folders[0] != folders[1]


@pytest.mark.parametrize("command", [RUN, SERVE])
@pytest.mark.parametrize(
    ("changed", "cause"),
    [
        ({"world": "nowhere"}, "unknown world 'nowhere'"),
        ({"text": "name: ["}, "alone"),
        ({"text": "name: alone\nsteps: [{skill: dance}]\n"}, "there is no skill 'dance'"),
    ],
)
def test_a_mission_that_cannot_begin_is_set_aside_and_the_next_one_runs(plant, command, changed, cause):
    add("alone", "second")
    change(**changed)
    result = errand(command)
    assert (states(), [run["name"] for run in plant.runs]) == (["error", "success"], ["second"])
    assert cause in listed()[0]["message"]
    assert "Mission 1 (alone) is set aside: " in result.output


def test_a_defect_in_a_run_sets_its_mission_aside_and_keeps_the_traceback(plant):
    add("first", "second")
    plant.outcomes = ["defect"]
    assert (errand(RUN).exit_code, states()) == (1, ["error", "success"])
    assert "(ZeroDivisionError: by a plug-in)" in listed()[0]["message"]
    assert "raise ZeroDivisionError" in Path("out/mission-1-traceback.txt").read_text()


@pytest.mark.parametrize("command", ["queue run --quiet", "queue serve --quiet --until-idle --port 0"])
def test_each_mission_of_a_queue_has_its_page_and_the_one_before_is_closed(plant, command, monkeypatch):
    closed = []
    monkeypatch.setattr("executive.app.runs.page_view.PageView.close", lambda page: closed.append(page))
    errand("queue add first.yaml")
    errand("queue add second.yaml")
    result = errand(f"{command} --view 0")
    assert result.exit_code == 0, result.output
    assert len(plant.pages) == 2
    assert None not in plant.pages
    assert closed == plant.pages


def test_a_resumed_mission_has_a_page(plant):
    plant.outcomes = ["killed"]
    with pytest.raises(GoneError):
        errand("run first.yaml --quiet")
    assert errand("resume --quiet --view 0").exit_code == 0
    assert [page is not None for page in plant.pages] == [False, True]
