"""`errand fleet`: what is left to do in a store, and whose faults are whose."""

from dataclasses import replace
from unittest.mock import Mock

import pytest

from executive.app.fleet import fleet_run
from executive.app.fleet.dispatch import Dispatch
from executive.app.report.run_report import Verdict
from executive.cli.fleet_command import _faults, _to_do
from executive.mission.request import Request
from executive.store.missions import GivenMissions, MissionState, MissionStore
from skills.inputs.errors import InputError
from tests.executive.cli.calls import done, errand, json_of, refusal

GO = "Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"
REQUEST = Request(commands=("Take ...",), name="work", world_name="flat")


@pytest.fixture
def store(tmp_path):
    with MissionStore(tmp_path / "missions.sqlite") as opened:
        yield opened


def test_a_killed_run_continues_without_finished_and_half_done_missions(store):
    over, begun, stuck, waiting = (store.add(REQUEST, queued=True).id for _ in range(4))
    given = GivenMissions(store)
    for number in (over, begun, stuck):
        given.give(number, "Alice")
        store.begin(number)
    store.finish(over, MissionState.SUCCESS, "done")
    given.progress(begun, 2, None)
    given.progress(stuck, 0, "it was begun")
    assert [each.id for each in _to_do(store)] == [begun, waiting]
    assert (given.all()[begun].done, given.all()[begun].reassigned) == (2, 0)
    assert store.mission(stuck).message == "the run was interrupted, and Alice had begun it"


def test_an_interrupted_mission_of_another_command_is_not_changed(store):
    store.begin(store.add(REQUEST, queued=True).id)
    with pytest.raises(InputError, match="was interrupted"):
        _to_do(store)


def test_a_fault_is_for_the_robot_named_before_it_else_for_all():
    faults = _faults(["bob: robot dies at 20 s", "lidar: dropout 1 s at 2 s"], ("Alice", "Bob"))
    assert faults == {
        "Alice": ["lidar: dropout 1 s at 2 s"],
        "Bob": ["robot dies at 20 s", "lidar: dropout 1 s at 2 s"],
    }


def test_a_fault_for_an_absent_robot_names_the_robots():
    with pytest.raises(InputError, match=r"there is no robot 'carol'; known are Alice and Bob"):
        _faults(["carol: camera fails"], ("Alice", "Bob"))


def split_in_two(store):
    whole, first, second = (store.add(REQUEST, queued=True).id for _ in range(3))
    given = GivenMissions(store)
    given.split(whole, [first, second])
    store.begin(whole)
    given.give(first, "Alice")
    store.begin(first)
    return whole, first, second


def test_a_chain_whose_run_was_killed_goes_on_with_its_parts(store):
    whole, first, second = split_in_two(store)
    assert [each.id for each in _to_do(store)] == [first, second]
    assert store.mission(whole).state is MissionState.RUNNING


def test_a_split_mission_fails_if_its_interrupted_first_part_cannot_continue(store):
    whole, first, second = split_in_two(store)
    GivenMissions(store).progress(first, 0, "it was begun")
    with pytest.raises(InputError, match="no mission is queued"):
        _to_do(store)
    assert [store.mission(each).state for each in (whole, first, second)] == [MissionState.FAILURE] * 3


def test_a_file_with_parts_for_several_robots_is_refused_and_stays_in_the_queue(store, tmp_path):
    file = tmp_path / "both.yaml"
    part = "{steps: [{to: kitchen}]}"
    file.write_text(f"name: both\nrobots: {{alice: spot, bob: spot}}\nparts: {{alice: {part}, bob: {part}}}\n")
    store.add(Request(file=file, name="both", world_name="flat"), queued=True)
    shown = errand("fleet", "run", str(store.path), "--robots", "alice=spot,bob=spot")
    assert shown.exit_code == 2
    assert f"{file.name}:3: mission 1 (both): its parts are for several robots" in shown.stderr
    assert "run the file by `errand run`" in shown.stderr
    assert store.mission(1).state is MissionState.QUEUED


def test_a_mission_that_cannot_be_prepared_is_left_out_with_its_cause_and_the_others_run(store, monkeypatch):
    for world in ("nowhere", "flat", "shop"):
        go = replace(REQUEST, commands=(GO,), world_name=world)
        store.add(go if world == "flat" else replace(go, commands=(), sentence="go to the kitchen"), queued=True)
    ran = []

    def run(dispatch, **_):
        ran.extend(dispatch.missions)
        return Verdict("The fleet", False, "0 of 3 missions achieved", "")

    monkeypatch.setattr(fleet_run, "run_fleet", run)
    command = ["fleet", "run", str(store.path), "--robots", "alice=spot", "--no-record"]
    shown = errand(*command)
    assert (shown.exit_code, ran) == (1, [2]), shown.output
    messages = [each.message for each in store.missions()]
    assert ["it is for the world" in message for message in messages] == [True, False, True]
    assert "2 missions are left in the queue" not in shown.output


# the referee's verdicts on the missions, None: it did not judge; the verdict that `errand runs` shows
@pytest.mark.parametrize(
    ("verdicts", "shown"),
    [
        ([True, True], "fulfilled"),
        ([True, False, None], "not fulfilled"),
        ([None, True], "fulfilled"),
        ([None], "not judged"),
    ],
)
def test_runs_show_the_verdict_on_a_fleet(store, monkeypatch, verdicts, shown):
    rows = [{"referee": None if verdict is None else {"success": verdict}} for verdict in verdicts]
    monkeypatch.setattr(Dispatch, "rows", rows)
    monkeypatch.setattr(fleet_run, "run_fleet", lambda *_, **__: Verdict("The fleet", True, "done", ""))
    monkeypatch.setattr(fleet_run, "SimulatedBackend", Mock())
    store.add(replace(REQUEST, commands=(GO,)), queued=True)
    done("fleet", "run", store.path, "--robots", "alice=spot", "--no-record")
    (kept,) = json_of(done("runs", "--out", store.path.parent, "--json"))["runs"]
    assert kept["verdict"] == shown


def test_a_page_that_cannot_be_served_is_refused_before_a_fleet_begins(store, tmp_path):
    store.add(replace(REQUEST, commands=(GO,)), queued=True)
    command = ("fleet", "run", store.path, "--robots", "alice=spot", "--view", "1", "--view-host", "nohost.example")
    assert "cannot serve the page at nohost.example" in refusal(*command)
    assert list(tmp_path.rglob("run.json")) == []


@pytest.mark.parametrize(("named", "folder"), [("out/.errand/missions.sqlite", "out"), ("out", "out"), ("own.db", "")])
def test_the_folder_of_a_run_is_never_hidden(tmp_path, monkeypatch, named, folder):
    outs = []

    def run(dispatch, out, **_):
        outs.append(out)
        return Verdict("The fleet", True, "1 of 1 missions achieved", "")

    monkeypatch.setattr(fleet_run, "run_fleet", run)
    monkeypatch.setattr(fleet_run, "SimulatedBackend", Mock())
    path = tmp_path / ("out/.errand/missions.sqlite" if named == "out" else named)
    with MissionStore(path) as store:
        store.add(replace(REQUEST, commands=(GO,), world_name="flat"), queued=True)
    shown = errand("fleet", "run", str(tmp_path / named), "--robots", "alice=spot", "--no-record")
    assert (shown.exit_code, [out.parent for out in outs]) == (0, [tmp_path / folder]), shown.output
