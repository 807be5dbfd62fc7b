"""Queue and resume on the command line, without a plant: what is kept, in which order it is run, what is refused."""

import io
import json
import signal
import time
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest
from py_trees.common import Status
from rich.console import Console
from typer.testing import CliRunner

from executive.app.mission_run import FinishedRun
from executive.app.report import RunReport
from executive.cli import entry
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
from skills.files.errors import InputError
from skills.robot import Pose2D

RUN_REQUEST = "executive.app.runs.run_request"


class GoneError(BaseException):
    """The process is killed."""


class Plant:
    """Stands in for `run_request`: notes one finished leaf, then ends as the test says."""

    def __init__(self):
        self.runs = []
        self.stacks = []
        self.commands = []
        self.outcomes = []

    def __call__(self, prepared, *, durable, **_):
        tree, out = prepared.tree, prepared.request.out
        out.mkdir(parents=True, exist_ok=True)
        durable.plant.with_name(f"{durable.plant.name}.a").touch()
        self.runs.append((prepared.mission.name, prepared.request.seed, out.name, durable))
        self.stacks.append(prepared.request.stack)
        self.commands.append([list(map(str, each.tree.commands)) for each in prepared.all])
        for number, each in enumerate(prepared.all):
            done = Change(first_leaf(each.tree), NodeState(), NodeState(Status.SUCCESS, None, "done"))
            pose = Pose2D(float(number), 0.5, 0.0) if prepared.robots else None
            durable.journals[each.mission.robot_name].note(TickNote(each.tree, 1.0, (done,), {}, pose, {}))
        outcome = self.outcomes.pop(0) if self.outcomes else "success"
        if outcome == "killed":
            raise GoneError
        return FinishedRun(report(outcome), node_view(tree.root))


def first_leaf(tree):
    """The path id of the first skill of a mission."""
    return next(node.path_id for node in tree.root.walk() if node.kind == "skill" and "/watch/" not in node.path_id)


def corrected_to(goal, prepared, robot="Alice"):
    """A note of going elsewhere being under way."""
    go = Mission.from_steps(steps_of_commands([Command(goal=goal)]), world="flat", robot=robot)
    other = compile_mission(
        go.model_copy(update={"name": f"go {goal} 2"}), knowledge=prepared.knowledge, registry=installed_skills()
    )
    change = Change(first_leaf(other), NodeState(), NodeState(Status.RUNNING, None, "on the way"))
    return TickNote(other, 2.0, (change,), {}, None, {})


def report(outcome):
    referee = RefereeReport(outcome == "success", "seen", 0, 0)
    return RunReport(outcome, None, "done", referee, (), "flat", 1, 1.0, 1.0, 1.0, 20, "log.mcap")


def change(store, **values):
    """Change the request of the first mission in the store."""
    text = replace(store.mission(1).request, **values).to_json()
    with store.writing() as connection:
        connection.execute("UPDATE mission SET request = ? WHERE id = 1", (text,))


@pytest.fixture
def plant(monkeypatch):
    stand_in = Plant()
    monkeypatch.setattr(RUN_REQUEST, stand_in)
    monkeypatch.setattr("executive.app.prepare.load_parser", lambda: None)  # no step here is a sentence
    return stand_in


@pytest.fixture
def mission(tmp_path: Path):
    def write(name, place="kitchen"):
        path = tmp_path / f"{name}.yaml"
        path.write_text(f"name: {name}\nsteps:\n  - {{to: {place}}}\n  - {{to: bedroom}}\n")
        return str(path)

    return write


@pytest.fixture
def errand(tmp_path):
    def invoke(*arguments):
        where = ("--store", str(tmp_path / "out" / ".errand" / "missions.sqlite"))
        out = () if arguments[0] == "resume" else ("--out", str(tmp_path / "out"))
        return CliRunner().invoke(entry.app, [*arguments, *where, *out])

    return invoke


@pytest.fixture
def states(tmp_path):
    def read():
        with MissionStore(tmp_path / "out" / ".errand" / "missions.sqlite") as store:
            return [mission.state.value for mission in store.missions()]

    return read


def test_missions_are_run_in_the_order_in_which_they_came(errand, mission, plant, states):
    for name in ("first", "second"):
        assert errand("queue", "add", mission(name), "--seed", "4").exit_code == 0
    assert errand("queue", "run", "--quiet").exit_code == 0
    assert [run[:3] for run in plant.runs] == [("first", 4, "001-first"), ("second", 4, "002-second")]
    assert [run[3].take_up for run in plant.runs] == [False, True]
    assert states() == ["success", "success"]


def test_a_mission_with_another_seed_begins_in_a_fresh_world(errand, mission, plant):
    errand("queue", "add", mission("first"), "--seed", "4")
    errand("queue", "add", mission("second"), "--seed", "5")
    errand("queue", "run", "--quiet")
    assert [run[3].take_up for run in plant.runs] == [False, False]


def test_a_queued_mission_keeps_its_stack_file(errand, mission, plant, tmp_path):
    stack = tmp_path / "stack.yaml"
    stack.write_text("planner: {use: lattice, soft_m: 0.5}\n")
    assert errand("queue", "add", mission("first"), "--stack", str(stack)).exit_code == 0
    errand("queue", "run", "--quiet")
    assert plant.stacks == [stack.resolve()]


def test_a_mission_with_a_broken_stack_file_is_not_queued(errand, mission, tmp_path):
    stack = tmp_path / "stack.yaml"
    stack.write_text("planer: {}\n")
    result = errand("queue", "add", mission("first"), "--stack", str(stack))
    assert (result.exit_code, f"{stack}:1" in "".join(result.output.split())) == (2, True)
    assert not (tmp_path / "out" / ".errand" / "missions.sqlite").exists()


def test_a_failed_mission_does_not_keep_the_next_from_running(errand, mission, plant, states):
    plant.outcomes = ["failure"]
    errand("queue", "add", mission("first"))
    errand("queue", "add", mission("second"))
    result = errand("queue", "run", "--quiet", "--json")
    assert result.exit_code == 1
    assert [each["achieved"] for each in json.loads(result.stdout.splitlines()[-1])["missions"]] == [False, True]
    assert states() == ["failure", "success"]


def test_a_cancelled_one_ends_the_run_of_the_queue(errand, mission, plant, states):
    plant.outcomes = ["cancelled"]
    errand("queue", "add", mission("first"))
    errand("queue", "add", mission("second"))
    assert errand("queue", "run", "--quiet").exit_code == 1
    assert states() == ["cancelled", "queued"]


def test_the_list_tells_states_and_numbers(errand, mission, plant):
    errand("queue", "add", mission("first"))
    errand("queue", "add", mission("second"))
    assert errand("queue", "remove", "1").exit_code == 0
    told = json.loads(errand("queue", "list", "--json").stdout.splitlines()[-1])
    assert [(each["mission"], each["state"], each["name"]) for each in told["missions"]] == [(2, "queued", "second")]


def test_the_list_shows_commands_with_their_brackets(errand, mission, plant):
    errand("queue", "add", mission("first"))
    assert "[kitchen]" in errand("queue", "list").output


def test_a_bad_mission_is_not_queued(errand, mission, states):
    result = errand("queue", "add", mission("bad", place="kitschen"))
    assert result.exit_code == 2
    assert "did you mean 'kitchen'" in result.output


def test_resume_goes_on_with_the_mission_that_a_correction_put_in_the_place(errand, mission, plant, monkeypatch):
    def corrected(prepared, *, durable, **_):
        prepared.request.out.mkdir(parents=True, exist_ok=True)
        durable.journals["Alice"].note(corrected_to("bathroom", prepared))
        raise GoneError

    with monkeypatch.context() as patch, pytest.raises(GoneError):
        patch.setattr(RUN_REQUEST, corrected)
        errand("run", mission("first"), "--quiet")
    result = errand("resume", "--quiet")
    assert result.exit_code == 0, result.output
    assert [run[0] for run in plant.runs] == ["go bathroom 2"]


PARTS = """name: two
robots: {alice: spot, bob: fetch}
parts:
  alice: {steps: [{to: kitchen}]}
  bob: {after: alice, steps: [{to: bedroom}]}
"""
GO = "Take [Nothing] to [%s] and do [Nothing] to [Nothing]"


@pytest.fixture
def two(tmp_path):
    (tmp_path / "two.yaml").write_text(PARTS, encoding="utf-8")
    return str(tmp_path / "two.yaml")


def test_a_killed_run_of_two_robots_is_resumed_with_each_where_it_was(errand, two, plant, states):
    plant.outcomes = ["killed"]
    with pytest.raises(GoneError):
        errand("run", two, "--quiet", "--no-record")
    result = errand("resume", "--quiet")
    assert (result.exit_code, states()) == (0, ["success"]), result.output
    durable = plant.runs[1][3]
    assert (durable.take_up, durable.log) == (True, "log-2.mcap")
    assert durable.poses == {"Alice": Pose2D(0.0, 0.5, 0.0), "Bob": Pose2D(1.0, 0.5, 0.0)}
    assert plant.commands == [[[GO % "kitchen"], [GO % "bedroom"]]] * 2


def test_a_correction_of_one_robots_part_is_resumed_beside_the_others(errand, two, plant, monkeypatch):
    def corrected(prepared, *, durable, **_):
        prepared.request.out.mkdir(parents=True, exist_ok=True)
        durable.journals["Bob"].note(corrected_to("office", prepared, "Bob"))
        raise GoneError

    with monkeypatch.context() as patch, pytest.raises(GoneError):
        patch.setattr(RUN_REQUEST, corrected)
        errand("run", two, "--quiet")
    result = errand("resume", "--quiet")
    assert result.exit_code == 0, result.output
    assert plant.commands == [[[GO % "kitchen"], [GO % "office"]]]


def test_queued_missions_of_the_same_robots_share_a_world_also_with_one_that_stands_by(errand, two, plant, mission):
    robots = "alice=spot,bob=fetch"
    errand("queue", "add", mission("go"), "--robots", robots)
    errand("queue", "add", two, "--robots", robots)
    errand("queue", "add", mission("go"), "--robots", "alice=spot,carl=spot")
    errand("queue", "add", mission("alone"))
    result = errand("queue", "run", "--quiet")
    assert [run[3].take_up for run in plant.runs] == [False, True, False, False], result.output
    assert list(plant.runs[1][3].poses) == ["Alice", "Bob"]


def test_resume_goes_on_with_what_was_killed_and_then_with_the_queue(errand, mission, plant, states):
    plant.outcomes = ["killed"]
    errand("queue", "add", mission("first"))
    errand("queue", "add", mission("second"))
    with pytest.raises(GoneError):
        errand("queue", "run", "--quiet")
    assert states() == ["running", "queued"]
    result = errand("queue", "run", "--quiet")
    assert (result.exit_code, "`errand resume` goes on with it" in result.output) == (2, True)
    result = errand("resume", "--quiet", "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout.splitlines()[-1])
    assert (told["mission"], [each["mission"] for each in told["then"]]) == (1, [2])
    assert [(run[0], run[3].log, run[3].take_up_label) for run in plant.runs[1:]] == [
        ("first", "log-2.mcap", "1"),
        ("second", "log.mcap", None),
    ]
    assert states() == ["success", "success"]


def test_a_bar_counts_the_missions_of_run_and_resume(errand, mission, plant, monkeypatch):
    terminal = Console(file=io.StringIO(), force_terminal=True, width=200)
    monkeypatch.setattr("executive.cli.queue_command.console_for", lambda as_json: terminal)
    for name in ("first", "second", "third"):
        errand("queue", "add", mission(name))
    plant.outcomes = ["success", "cancelled"]
    errand("queue", "run", "--quiet")
    assert "missions" in terminal.file.getvalue() and "2/3" in terminal.file.getvalue()
    terminal.file.truncate(0)
    assert errand("resume", "--quiet").exit_code == 0
    assert "2/2" in terminal.file.getvalue()


def test_a_resumed_mission_that_is_cancelled_again_ends_the_run_of_the_queue(errand, mission, plant, states):
    plant.outcomes = ["cancelled", "cancelled"]
    errand("queue", "add", mission("first"))
    errand("queue", "add", mission("second"))
    errand("queue", "run", "--quiet")
    assert errand("resume", "--quiet").exit_code == 1
    assert states() == ["cancelled", "queued"]


def test_a_killed_run_is_resumed_with_its_own_seed_and_folder(errand, mission, plant, states):
    plant.outcomes = ["killed"]
    with pytest.raises(GoneError):
        errand("run", mission("alone"), "--seed", "9", "--quiet", "--no-record")
    assert states() == ["running"]
    assert errand("resume", "--quiet").exit_code == 0
    assert [run[:3] for run in plant.runs] == [("alone", 9, "out")] * 2


@pytest.mark.parametrize("ended", ["cancelled", "error"])
def test_resume_continues_the_newest_mission_if_it_was_cancelled(errand, mission, plant, states, ended):
    plant.outcomes = [ended]
    errand("run", mission("alone"), "--quiet", "--no-record")
    assert states() == [ended]
    assert errand("resume", "--quiet").exit_code == 0
    assert states() == ["success"]


def test_a_cancelled_mission_does_not_go_on_by_itself_once_another_ran(errand, mission, plant, states):
    plant.outcomes = ["cancelled"]
    errand("run", mission("alone"), "--quiet", "--no-record")
    errand("run", mission("other"), "--quiet", "--no-record")
    result = errand("resume", "--quiet")
    assert (result.exit_code, states()) == (2, ["cancelled", "success"])


def test_a_mission_file_that_was_changed_is_taken_as_it_was(errand, mission, plant, tmp_path):
    plant.outcomes = ["killed"]
    with pytest.raises(GoneError):
        errand("run", mission("alone"), "--quiet")
    mission("alone", place="sideboard")
    assert errand("resume", "--quiet").exit_code == 0
    assert plant.commands[0] == plant.commands[1]
    assert "[kitchen]" in plant.commands[1][0][0]


def test_another_run_gives_up_an_interrupted_mission(errand, mission, plant, states):
    plant.outcomes = ["killed"]
    with pytest.raises(GoneError):
        errand("run", mission("alone"), "--quiet")
    result = errand("run", mission("other"), "--quiet")
    assert "Mission 1 (alone) had been interrupted; it is given up." in result.output
    assert states() == ["cancelled", "success"]


def test_nothing_to_resume_is_refused_with_a_hint(errand, mission, plant):
    result = errand("resume")
    assert (result.exit_code, "there is no store; run or queue a mission first" in result.output) == (2, True)
    errand("queue", "add", mission("first"))
    result = errand("resume")
    assert (result.exit_code, "no mission was interrupted; `errand queue run`" in result.output) == (2, True)
    errand("queue", "run", "--quiet")
    result = errand("resume", "--mission", "1")
    assert (result.exit_code, "mission 1 is success; name a mission that is" in result.output) == (2, True)
    result = errand("resume", "--mission", "8")
    assert (result.exit_code, "there is no mission 8; known are 1" in result.output) == (2, True)


def test_a_tree_that_is_no_longer_the_same_is_refused(errand, mission, plant, tmp_path):
    plant.outcomes = ["killed"]
    with pytest.raises(GoneError):
        errand("run", mission("alone"), "--quiet")
    with MissionStore(tmp_path / "out" / ".errand" / "missions.sqlite") as store:
        change(store, fingerprint="other")
    result = errand("resume")
    assert (result.exit_code, "begun with another version" in result.output) == (2, True)


def test_a_run_that_cannot_begin_leaves_no_mission_behind(errand, mission, monkeypatch, states):
    def refuse(*_, **__):
        raise InputError("the world is full")

    monkeypatch.setattr(RUN_REQUEST, refuse)
    assert errand("run", mission("alone"), "--quiet").exit_code == 2
    assert states() == []


def test_only_one_process_runs_missions_of_a_store(errand, mission, plant, tmp_path):
    with MissionStore(tmp_path / "out" / ".errand" / "missions.sqlite") as store, store.claim():
        result = errand("run", mission("alone"), "--quiet")
    assert (result.exit_code, "runs a mission of this store" in result.output) == (2, True)


def listed(errand):
    return json.loads(errand("queue", "list", "--json").stdout.splitlines()[-1])["missions"]


@pytest.mark.parametrize(
    ("options", "trigger", "missed"),
    [
        (("--at", "every weekday 09:00"), "every weekday 09:00", "skip"),
        (("--every", "30m", "--missed", "once"), "every 30m", "once"),
        (("--on", "battery full"), "battery full", "skip"),
        (("--on", "call first"), "call first", None),
    ],
)
def test_a_mission_with_a_trigger_stands_until_it_is_removed(errand, mission, plant, options, trigger, missed):
    result = errand("queue", "add", mission("first"), *options)
    assert (result.exit_code, f"({trigger}): first" in result.output) == (0, True), result.output
    (told,) = listed(errand)
    assert (told["state"], told["trigger"], told.get("missed")) == ("standing", trigger, missed)
    assert (told["next"] is not None) == trigger.startswith("every")
    assert trigger in errand("queue", "list").output
    assert errand("queue", "run", "--quiet").exit_code == 0
    assert errand("queue", "remove", "1").exit_code == 0
    assert (plant.runs, listed(errand)) == ([], [])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--at", "every wekday 09:00"), "did you mean 'weekday'"),
        (("--at", "every day 09:00", "--every", "30m"), "give one of --at, --every and --on"),
        (("--at", "2020-01-01 09:00"), "has passed"),
        (("--every", "soon"), "is no period"),
        (("--on", "noon"), "is no trigger"),
        (("--on", "topic mqtt:door"), "registers 'mqtt' in the entry-point group 'errand.triggers'"),
        (("--missed", "once"), "--missed has no meaning without a trigger"),
        (("--on", "call x", "--missed", "once"), "--missed has no meaning for 'call x'"),
    ],
)
def test_a_trigger_that_cannot_be_is_refused_and_nothing_is_kept(errand, mission, plant, options, words):
    result = errand("queue", "add", mission("first"), *options)
    assert (result.exit_code, words in result.output) == (2, True), result.output
    assert errand("queue", "list").exit_code == 2 or listed(errand) == []


def test_a_trigger_in_the_past_is_listed_as_over(errand, mission, plant, tmp_path):
    errand("queue", "add", mission("first"), "--at", "2999-01-01 09:00")
    with MissionStore(tmp_path / "out" / ".errand" / "missions.sqlite") as store:
        store._connection.execute("UPDATE mission SET trigger = '2020-01-01 09:00'")
    assert "2020-01-01 09:00, over" in errand("queue", "list").output


def test_serve_runs_what_is_due_and_the_list_says_where_it_came_from(errand, mission, plant, tmp_path):
    errand("queue", "add", mission("first"), "--every", "1d", "--missed", "once", "--seed", "4")
    with MissionStore(tmp_path / "out" / ".errand" / "missions.sqlite") as store:
        day_before = (store.now() - timedelta(days=1.5)).isoformat()
        store._connection.execute("UPDATE mission SET since = ?, anchor = ?", (day_before, day_before))
    result = errand("queue", "serve", "--until-idle", "--quiet", "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout.splitlines()[-1])
    assert told == {"missions": [{"mission": 2, "outcome": "success", "achieved": True}]}
    assert [run[:3] for run in plant.runs] == [("first", 4, "002-first")]
    standing, fired = listed(errand)
    assert (standing["state"], fired["state"], fired["standing"]) == ("standing", "success", 1)
    assert fired["why"].startswith("every 1d, due 2") and fired["why"].endswith(", missed")
    assert f"1: {fired['why']}" in errand("queue", "list").output


def test_serve_ends_well_although_a_mission_was_not_achieved(errand, mission, plant, states):
    plant.outcomes = ["failure"]
    errand("queue", "add", mission("first"))
    errand("queue", "add", mission("second"))
    result = errand("queue", "serve", "--until-idle", "--quiet")
    assert (result.exit_code, "1 of 2 missions achieved" in result.output) == (0, True)
    assert states() == ["failure", "success"]


def test_serve_goes_on_with_what_was_killed(errand, mission, plant, states):
    plant.outcomes = ["killed"]
    errand("queue", "add", mission("first"))
    errand("queue", "add", mission("second"))
    with pytest.raises(GoneError):
        errand("queue", "serve", "--until-idle", "--quiet")
    assert states() == ["running", "queued"]
    assert errand("queue", "serve", "--until-idle", "--quiet").exit_code == 0
    assert [(run[0], run[2], run[3].log) for run in plant.runs[1:]] == [
        ("first", "001-first", "log-2.mcap"),
        ("second", "002-second", "log.mcap"),
    ]
    assert states() == ["success", "success"]


def test_only_one_process_serves_a_store(errand, mission, plant, tmp_path):
    errand("queue", "add", mission("first"), "--every", "1h")
    with MissionStore(tmp_path / "out" / ".errand" / "missions.sqlite") as store, store.claim():
        result = errand("queue", "serve", "--until-idle")
        assert (result.exit_code, "runs a mission of this store" in result.output) == (2, True)
        assert errand("queue", "remove", "1").exit_code == 0


def test_serve_ends_when_its_time_is_over(errand, mission, plant):
    errand("queue", "add", mission("first"), "--every", "1h")
    assert errand("queue", "serve", "--for", "0.05").exit_code == 0
    assert plant.runs == []


@pytest.mark.parametrize("seconds", ["1e9", "300 days"])
def test_serve_may_have_all_the_time_there_is(errand, mission, plant, seconds):
    errand("queue", "add", mission("first"))
    assert errand("queue", "serve", "--for", seconds, "--until-idle", "--quiet").exit_code == 0
    assert len(plant.runs) == 1


def test_serve_without_a_store_is_refused(errand):
    result = errand("queue", "serve", "--until-idle")
    assert (result.exit_code, "there is no store" in result.output) == (2, True)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_server_that_waits(errand, mission, plant, monkeypatch, number):
    wait = WakeupPipe.wait

    def signalled(self, until):
        signal.raise_signal(number)
        wait(self, until)

    monkeypatch.setattr(WakeupPipe, "wait", signalled)
    errand("queue", "add", mission("first"), "--every", "1h")
    begun = time.monotonic()
    assert errand("queue", "serve", "--for", "50").exit_code == 0
    assert time.monotonic() - begun < 30


def test_a_signal_during_a_mission_ends_the_server_and_keeps_the_queue(errand, mission, plant, states):
    def signalled(prepared, *, control, **options):
        signal.raise_signal(signal.SIGTERM)
        plant.outcomes = ["cancelled" if control.poll().cancel == "cancelled by SIGTERM" else "error"]
        return Plant.__call__(plant, prepared, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RUN_REQUEST, signalled)
        errand("queue", "add", mission("first"))
        errand("queue", "add", mission("second"))
        result = errand("queue", "serve", "--quiet")
    assert (result.exit_code, states()) == (0, ["cancelled", "queued"])
    assert "goes on with it" in " ".join(result.output.split())
    assert errand("resume", "--quiet").exit_code == 0
    assert states() == ["success", "success"]


PLUG_IN = """
class Bell:
    def start(self, topics, fire):
        for topic in topics:
            fire(topic, b"")

    def stop(self):
        pass
"""


def test_serve_runs_what_a_plug_in_hears(errand, mission, plant, tmp_path, monkeypatch):
    (tmp_path / "bell_source.py").write_text(PLUG_IN)
    info = tmp_path / "bell_source-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: bell-source\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[errand.triggers]\nbell = bell_source:Bell\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert errand("queue", "add", mission("first"), "--on", "topic bell:front door").exit_code == 0
    result = errand("queue", "serve", "--until-idle", "--quiet")
    assert (result.exit_code, [run[0] for run in plant.runs]) == (0, ["first"]), result.output
    assert "(topic bell:front door)" in result.output


def test_serve_names_a_plug_in_that_is_gone_and_runs_what_is_queued(errand, mission, plant, tmp_path):
    errand("queue", "add", mission("first"), "--every", "1h")
    with MissionStore(tmp_path / "out" / ".errand" / "missions.sqlite") as store:
        store._connection.execute("UPDATE mission SET trigger = 'topic gone:x'")
    errand("queue", "add", mission("second"))
    result = errand("queue", "serve", "--until-idle", "--quiet")
    assert (result.exit_code, [run[0] for run in plant.runs]) == (0, ["second"])
    assert "missions that wait for topics of gone are not heard of" in result.output
    assert "entry-point group 'errand.triggers'" in result.output


def ended(errand):
    """The state of each mission and the message in the list."""
    told = json.loads(errand("queue", "list", "--json").stdout.splitlines()[-1])["missions"]
    return [(each["state"], each["message"]) for each in told]


SERVE = ("queue", "serve", "--until-idle", "--quiet")
RUN = ("queue", "run", "--quiet")


@pytest.mark.parametrize("command", [RUN, SERVE])
def test_a_name_of_300_letters_is_run_in_a_folder_with_a_short_name(errand, plant, tmp_path, command):
    for number in range(2):
        (tmp_path / f"{number}.yaml").write_text(f"name: {'go there ' * 34}{number}\nsteps: [{{to: kitchen}}]\n")
        assert errand("queue", "add", str(tmp_path / f"{number}.yaml")).exit_code == 0
    assert errand(*command).exit_code == 0
    folders = [run[2] for run in plant.runs]
    assert [len(folder) <= 100 for folder in folders] == [True, True]
    assert folders[0].removeprefix("001-") != folders[1].removeprefix("002-")


@pytest.mark.parametrize("command", [RUN, SERVE])
@pytest.mark.parametrize(
    ("column", "value", "cause"),
    [
        ("world", "nowhere", "unknown world 'nowhere'"),
        ("text", "name: [", "alone"),
        ("text", "name: alone\nsteps: [{skill: dance}]\n", "there is no skill 'dance'"),
    ],
)
def test_a_mission_that_cannot_begin_is_set_aside_and_the_next_one_runs(
    errand, mission, plant, states, tmp_path, command, column, value, cause
):
    errand("queue", "add", mission("alone"))
    errand("queue", "add", mission("second"))
    with MissionStore(tmp_path / "out" / ".errand" / "missions.sqlite") as store:
        change(store, **{column: value})
    result = errand(*command)
    assert (states(), [run[0] for run in plant.runs]) == (["error", "success"], ["second"])
    assert cause in ended(errand)[0][1]
    assert "Mission 1 (alone) is set aside: " in result.output


def test_a_defect_in_a_run_sets_its_mission_aside_and_keeps_the_traceback(errand, mission, plant, states, tmp_path):
    def broken(prepared, **options):
        if prepared.mission.name == "first":
            raise ZeroDivisionError("by a plug-in")
        return Plant.__call__(plant, prepared, **options)

    errand("queue", "add", mission("first"))
    errand("queue", "add", mission("second"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RUN_REQUEST, broken)
        result = errand("queue", "run", "--quiet")
    assert (result.exit_code, states()) == (1, ["error", "success"])
    assert "(ZeroDivisionError: by a plug-in)" in ended(errand)[0][1]
    assert "raise ZeroDivisionError" in (tmp_path / "out" / "mission-1-traceback.txt").read_text()


def test_a_mission_set_aside_is_resumed_by_its_number(errand, mission, plant, states, tmp_path):
    errand("queue", "add", mission("first"))
    with MissionStore(tmp_path / "out" / ".errand" / "missions.sqlite") as store:
        change(store, world="nowhere")
    assert errand("queue", "run", "--quiet").exit_code == 1
    with MissionStore(tmp_path / "out" / ".errand" / "missions.sqlite") as store:
        change(store, world=None)
    assert errand("resume", "--mission", "1", "--quiet").exit_code == 0
    assert states() == ["success"]


def test_a_queued_mission_that_cannot_go_on_is_set_aside_and_the_queue_goes_on(
    errand, mission, plant, states, tmp_path
):
    plant.outcomes = ["killed"]
    errand("queue", "add", mission("first"))
    errand("queue", "add", mission("second"))
    with pytest.raises(GoneError):
        errand("queue", "run", "--quiet")
    with MissionStore(tmp_path / "out" / ".errand" / "missions.sqlite") as store:
        change(store, fingerprint="other")
    assert errand("queue", "serve", "--until-idle", "--quiet").exit_code == 0
    assert states() == ["error", "success"]


def test_a_mission_that_could_not_begin_does_not_give_the_next_one_a_fresh_world(errand, mission, plant):
    def refuse_second(prepared, **options):
        if prepared.mission.name == "second":
            raise InputError("the world is full")
        return Plant.__call__(plant, prepared, **options)

    for name in ("first", "second", "third"):
        errand("queue", "add", mission(name))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RUN_REQUEST, refuse_second)
        errand("queue", "run", "--quiet")
    assert [run[3].take_up for run in plant.runs] == [False, True]


def test_after_a_cancelled_run_the_queue_says_how_to_go_on_also_when_nothing_is_queued(errand, mission, plant):
    plant.outcomes = ["cancelled"]
    errand("queue", "add", mission("first"))
    for said in (errand("queue", "run", "--quiet").output, errand("queue", "run", "--quiet").output):
        assert "Mission 1 (first) was cancelled; `errand resume --store" in " ".join(said.split())
    assert "No mission is queued" in said
