"""The command line: what scripts rely on, and bad input."""

import json
import shutil

import pytest

from executive.app.report.run_report import RunReport
from executive.app.runs.backend import LiveLog
from executive.app.runs.one_run import FinishedRun
from executive.tree.node_view import node_view
from executive.words.goal import RefereeReport
from plant.worlds.world import WORLDS_FOLDER
from tests.executive.cli.calls import done, errand, json_of

FETCH = "Hey Alice, can you fetch me a drink from the kitchen"


RIGHT = RefereeReport(True, "it is so", 0, 0)


def report(outcome="success", cause=None, referee=RIGHT):
    commands = ("Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]",)
    return RunReport(outcome, cause, "done", referee, commands, "flat", 1, 12.5, 2.5, 5.0, 250, "out/log.mcap")


@pytest.fixture
def no_plant(monkeypatch):
    """Runs end at once as the test says; no plant is built."""
    ended = {"report": report()}

    def run_request(prepared, **_):
        prepared.request.out.mkdir(parents=True, exist_ok=True)
        return FinishedRun(ended["report"], node_view(prepared.tree.root))

    monkeypatch.setattr("executive.app.runs.queue.run_request", run_request)
    return ended


def test_parse_prints_the_text_form_with_and_without_the_name():
    for sentence in (FETCH, "fetch me a drink from the kitchen"):
        result = errand("parse", sentence)
        assert result.exit_code == 0
        assert result.stdout.splitlines() == [
            "Take [Nothing] to [kitchen] and do [grasp] to [drink]",
            "Take [drink] to [start] and do [Nothing] to [Nothing]",
        ]


def test_parse_json_is_the_last_line_and_alone_on_standard_output():
    result = errand("parse", FETCH, "--json")
    (line,) = result.stdout.splitlines()
    assert [command["goal"] for command in json.loads(line)["commands"]] == ["kitchen", "start"]


def test_parse_jsonl_answers_line_by_line_in_order(tmp_path):
    (tmp_path / "s.txt").write_text("go to the balcony\n\nwhat time is it\n")
    result = errand("parse", "--open", "--jsonl", "--file", str(tmp_path / "s.txt"))
    answers = [json.loads(line) for line in result.stdout.splitlines()]
    assert (result.exit_code, [answer["status"] for answer in answers]) == (0, ["ok", "refused", "refused"])
    assert answers[0]["commands"][0]["goal"] == "balcony"


def test_tree_formats(tmp_path):
    sentence = "is there a hammer in the workshop"
    text = errand("tree", sentence)
    assert (text.exit_code, text.stdout.splitlines()[0][0]) == (0, "○")
    root = json_of(errand("tree", sentence, "--format", "json"))
    assert set(root) == {"id", "type", "name", "status", "cause", "source", "children"}
    assert root["id"].startswith("alice/")
    written = tmp_path / "tree.svg"
    done("tree", sentence, "--format", "svg", "--out", str(written))
    assert written.read_text().startswith("<svg")


def test_tree_of_a_file_maps_nodes_to_lines(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text("name: rounds\nsteps:\n  - {to: kitchen}\n  - say: go to the bedroom\n")
    root = json_of(errand("tree", str(path), "--format", "json"))
    assert [child["source"]["line"] for child in root["children"][-1]["children"]] == [3, 4]


def test_profile_prints_a_table_by_subsystem(no_plant, tmp_path):
    asked = ("run", "--say", "Hey Alice, go to the bedroom", "--out", str(tmp_path), "--quiet")
    assert "CPU time by subsystem" in errand(*asked, "--profile").output
    assert "CPU time by subsystem" not in errand(*asked).output


def test_run_json_has_exactly_the_contract_on_the_last_line(no_plant, tmp_path):
    result = errand("run", "--say", "Hey Alice, go to the bedroom", "--json", "--out", str(tmp_path))
    values = json_of(result)
    assert list(values) == [
        "outcome", "cause", "message", "referee", "commands", "world", "seed", "sim_time_s", "wall_time_s",
        "real_time_factor", "ticks", "log", "work", "answers", "said", "seen_objects", "log_time_s",
    ]  # fmt: skip
    assert list(values["referee"]) == [
        "success", "why", "collisions", "drops", "people_hit", "hit_by_people", "robots_hit", "holds",
    ]  # fmt: skip
    assert (result.exit_code, len(result.stdout.splitlines())) == (0, 1)
    assert "The referee saw" in result.stderr


@pytest.mark.parametrize(
    "changes",
    [
        {"outcome": "failure", "cause": "PLANNING"},
        {"outcome": "cancelled", "cause": "CANCELLED"},
        {"outcome": "error", "cause": "ERROR"},
        {"referee": RefereeReport(False, "the coke is on the floor", 0, 1)},
    ],
)
def test_a_mission_that_is_not_achieved_exits_with_1(no_plant, tmp_path, changes):
    no_plant["report"] = report(**changes)
    assert errand("run", "--no-wake", "--say", "go to the bedroom", "--out", str(tmp_path)).exit_code == 1


def test_a_world_may_ask_for_the_wake_phrase(no_plant, tmp_path):
    world = tmp_path / "flat"
    shutil.copytree(WORLDS_FOLDER / "flat", world)
    facts = world / "knowledge.yaml"
    facts.write_text(facts.read_text().replace("{name: Alice}", "{name: Alice, require_wake: true}"))
    asked = ("run", "--world", str(world), "--out", str(tmp_path / "out"), "--say")
    assert errand(*asked, "go to the bedroom").exit_code == 2
    done(*asked, "go to the bedroom", "--no-wake")
    done(*asked, "Hey Alice, go to the bedroom")
    assert errand("parse", "--world", str(world), "go to the bedroom").exit_code == 2


def test_the_whole_tree_is_shown_on_demand(no_plant, tmp_path):
    asked = ("run", "--say", "go to the bedroom", "--out", str(tmp_path))
    short, long = (errand(*asked, *more).stdout.splitlines() for more in ((), ("--tree",)))
    assert len(short) <= 6 < len(long)


def test_run_shows_commands_and_both_verdicts(no_plant, tmp_path):
    result = errand("run", "--say", "go to the bedroom", "--out", str(tmp_path))
    lines = result.stdout.splitlines()
    assert lines[0] == "Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]"
    assert any(line.startswith("The tree claims: ✓ success: done") for line in lines)
    assert any(line.startswith("The referee saw: ✓") for line in lines)


def impossible_file(tmp_path):
    file = tmp_path / "mission.yaml"
    file.write_text(
        "name: put\nworld: flat\nsteps:\n  - {to: kitchen table, take: coke}\n  - {to: bedroom, take: beer}\n"
    )
    return str(file)


@pytest.mark.parametrize("command", [("run",), ("queue", "add"), ("evaluate", "--seeds", "1-2")])
def test_errors_of_check_refuse_a_run_before_anything_moves(no_plant, tmp_path, command):
    result = errand(*command, impossible_file(tmp_path), "--out", str(tmp_path / "out"))
    assert (result.exit_code, [line.split(":")[2] for line in result.stderr.splitlines()]) == (2, ["4", "5"])
    assert not (tmp_path / "out").exists()


def test_anyway_begins_what_check_refuses(no_plant, tmp_path):
    done("run", impossible_file(tmp_path), "--anyway", "--out", str(tmp_path / "out"))


def test_the_random_faults_of_a_run_are_printed(no_plant, tmp_path):
    lines = [
        errand("run", "--say", FETCH, "--random-faults", "2", "--seed", seed, "--out", str(tmp_path / name)).stdout
        for seed, name in (("3", "a"), ("3", "b"), ("4", "c"))
    ]
    drawn = [[line for line in text.splitlines() if line.startswith("Scenario: fault:")] for text in lines]
    assert (len(drawn[0]), drawn[0] == drawn[1], drawn[0] == drawn[2]) == (2, True, False)


def server_of(visitors):
    """The class of the server that gets the log."""
    return next(type(each.server) for each in visitors if isinstance(each, LiveLog))


def test_run_with_foxglove_serves_what_the_run_logs(no_plant, tmp_path, monkeypatch):
    served = []

    class Server:
        url = "ws://there"

        def __init__(self, address):
            served.append(address)

        def close(self):
            served.append("closed")

    monkeypatch.setattr("executive.view.foxglove.LiveServer", Server)
    ended = lambda prepared, visitors, **_: served.append(server_of(visitors)) or 1 / 0  # noqa: E731
    monkeypatch.setattr("executive.app.runs.queue.run_request", ended)
    errand("run", "--say", FETCH, "--foxglove", "127.0.0.1:0", "--out", str(tmp_path / "out"))
    assert served == ["127.0.0.1:0", Server, "closed"]
