"""The store: states, claims, and files that cannot be used."""

import sqlite3
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from py_trees.common import Status

from executive.mission.request import Request
from executive.mission.scenario import Scenario
from executive.run.visitor import TickNote
from executive.store.database import STORE_FILE
from executive.store.missions import MissionState, MissionStore
from executive.tree.node import Change, NodeState
from executive.words.robot_config import RobotConfig
from skills.api import Cause
from skills.inputs.errors import InputError
from skills.robot import Pose2D

REQUEST = Request(
    "fetch me a drink", seed=3, name="fetch drink", world_name="flat", robot="Alice", commands=("Take ...",),
    fingerprint="print", map=Path("own/map"),
)  # fmt: skip


@pytest.fixture
def path(tmp_path):
    return tmp_path / "deep" / "missions.sqlite"


def changed(path_id, status, cause=None, message=""):
    return Change(path_id, NodeState(), NodeState(status, cause, message))


def note(*changes, tree=None, now_s=1.0, board=None, pose=None, checkpoints=None, charge=None):
    return TickNote(tree, now_s, changes, board or {}, pose, checkpoints or {}, charge)


def test_a_simulated_world_is_stored_before_the_changes_of_a_tick_and_not_for_a_pose(path):
    with MissionStore(path) as store:
        mission, kept = store.add(REQUEST, queued=False).id, []
        journal = store.journal(mission)
        journal.keep_world = lambda: kept.append(store.has_steps(mission))
        journal.note(note(pose=Pose2D(1.0, 2.0, 0.5)))
        assert (kept, store.mission(mission).poses) == ([], {"Alice": Pose2D(1.0, 2.0, 0.5)})
        journal.note(note(changed("a/b", Status.RUNNING), now_s=1.1))
        assert (kept, store.has_steps(mission)) == ([False], True)


EVENTS = {"people": {"Robin": {"start": 3.0}}, "doors": ({"name": "door", "closes": 4.0},), "moves": ()}
BOB = RobotConfig("Bob", "fetch", Pose2D(1.0, 2.5, -0.25), "kitchen", Path("/stacks/own.yaml"))
KEPT = [
    {"robots": (BOB, RobotConfig("Alice", "spot"))},
    {"scenario": Scenario(("arm refuses at 3 s",), **EVENTS)},
    {"start": None},
    {"start": "unknown"},
    {"start": Pose2D(1.25, -3.0, 0.1)},
]


@pytest.mark.parametrize("facts", KEPT)
def test_a_mission_keeps_its_start_its_robots_and_its_faults_and_events(path, facts):
    request = replace(REQUEST, **facts)
    with MissionStore(path) as store:
        store.add(request, queued=True)
    with MissionStore(path, create=False) as store:
        assert store.missions()[0].request == request


def test_missions_keep_their_order_and_states(path):
    with MissionStore(path) as store:
        first, second = (store.add(REQUEST, queued=queued) for queued in (True, False))
        store.begin(first.id)
        store.finish(first.id, MissionState.FAILURE, "no drink")
    with MissionStore(path, create=False) as store:
        done, waiting = store.missions()
        assert (done.id, done.state, done.message, done.starts) == (first.id, MissionState.FAILURE, "no drink", 1)
        assert waiting == second
        assert store.missions(MissionState.QUEUED) == (second,)
        assert done.request == REQUEST


def test_a_mission_that_replaces_another_is_stored_in_its_place(path):
    other = replace(REQUEST, name="go hall", commands=("Go",), fingerprint="other", sentence=None)
    with MissionStore(path) as store:
        mission = store.add(REQUEST, queued=False)
        journal = store.journal(mission.id).allow_replacement("first", lambda tree: other)
        journal.note(note(changed("a/b", Status.SUCCESS), tree="first", board={"alice/x": Pose2D(1.0, 2.0, 0.5)}))
        journal.note(note(tree="second"))
        assert (store.mission(mission.id).request, store.has_steps(mission.id)) == (other, False)
        assert store.memory(mission.id).board == {}
        journal.note(note(changed("a/c", Status.RUNNING), tree="second"))
        assert list(store.memory(mission.id).steps) == ["a/c"]


def test_notes_are_there_for_another_process_after_each_tick(path):
    with MissionStore(path) as store:
        journal = store.journal(store.add(REQUEST, queued=False).id)
        pose = Pose2D(1.0, 2.0, 0.5)
        journal.note(note(changed("a/b", Status.RUNNING), board={"alice/x": pose}, pose=pose))
        journal.note(note(now_s=2.0, checkpoints={"a/b": {"spot": [1.0, 2.0]}}))
        with MissionStore(path) as other:
            memory = other.memory(1)
            assert memory.steps["a/b"].checkpoint == {"spot": [1.0, 2.0]}
            assert (memory.board, memory.pose) == ({"alice/x": pose}, pose)
        journal.note(note(changed("a/b", Status.FAILURE, Cause.PLANNING, "no way"), now_s=3.0))
        step = store.memory(1).steps["a/b"]
        assert (step.status, step.cause, step.message, step.clock_s) == (Status.FAILURE, Cause.PLANNING, "no way", 3.0)
        assert step.checkpoint == {}


def test_a_store_that_is_locked_for_a_while_loses_no_note(path):
    with MissionStore(path) as store:
        journal = store.journal(store.add(REQUEST, queued=False).id)
        store._connection.execute("PRAGMA busy_timeout = 10")
        other = sqlite3.connect(path, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        journal.note(note(changed("a", Status.SUCCESS)))
        assert "locked" in journal.troubles[0]
        other.execute("COMMIT")
        other.close()
        journal.note(note(changed("b", Status.RUNNING)))
        assert set(store.memory(1).steps) == {"a", "b"}


def test_values_that_cannot_be_stored_are_reported_and_left_out(path):
    with MissionStore(path) as store:
        journal = store.journal(store.add(REQUEST, queued=False).id)
        journal.note(note(changed("a", Status.SUCCESS), board={"alice/f": print}))
        assert store.memory(1).board == {}
        assert "alice/f" in journal.troubles[0]


def test_an_unknown_mission_is_refused_with_those_known(path):
    with MissionStore(path) as store:
        with pytest.raises(InputError, match="no mission 7; the store is empty"):
            store.mission(7)
        store.add(REQUEST, queued=True)
        with pytest.raises(InputError, match="no mission 7; known are 1"):
            store.remove(7)


def test_removing_a_mission_forgets_its_steps(path):
    with MissionStore(path) as store:
        store.journal(store.add(REQUEST, queued=True).id).note(note(changed("a", Status.SUCCESS)))
        store.remove(1)
        assert store._connection.execute("SELECT count(*) FROM step").fetchone() == (0,)


def other_program(path):
    with closing(sqlite3.connect(path)) as other, other:
        other.execute("CREATE TABLE recipes (name)")


def older_version(path):
    MissionStore(path).close()
    with closing(sqlite3.connect(path)) as other, other:
        other.execute(f"PRAGMA user_version = {STORE_FILE.version - 1}")


def cut_off(path):
    with MissionStore(path) as store:
        for _ in range(200):
            store.add(REQUEST, queued=True)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2] + b"\0" * 100)


OLDER = f"version {STORE_FILE.version - 1}, and this errand reads {STORE_FILE.version}; finish its missions"
# What lies in place of the store, whether one is made where none is, and what the refusal says.
UNUSABLE = [
    (lambda path: None, False, "there is no store; run or queue a mission first"),
    (lambda path: path.mkdir(), True, "cannot use the store"),
    (lambda path: path.write_bytes(b"no database at all" * 100), True, r"the store is damaged .* move it away"),
    (cut_off, False, "damaged"),
    (older_version, True, OLDER),
    (other_program, True, "no store; name another file"),
]


@pytest.mark.parametrize(("put", "create", "says"), UNUSABLE)
def test_a_store_that_cannot_be_used_is_refused(path, put, create, says):
    path.parent.mkdir()
    put(path)
    with pytest.raises(InputError, match=says), MissionStore(path, create=create) as store:
        store.missions()


@pytest.mark.parametrize(("text", "named"), [(b"hammer", "mission"), (b"no way", "step"), (b"blue", "value")])
def test_a_flipped_bit_in_a_text_is_found_and_its_mission_named(path, text, named):
    with MissionStore(path) as store:
        store.add(REQUEST, queued=True)
        number = store.add(replace(REQUEST, name="the hammer"), queued=True).id
        board = {"alice/colour": "blue"}
        store.journal(number).note(note(changed("a", Status.FAILURE, Cause.PLANNING, "no way"), board=board))
    MissionStore(path, create=False).close()
    content = path.read_bytes()
    assert text in content
    path.write_bytes(content.replace(text, bytes([text[0] ^ 1]) + text[1:]))
    with pytest.raises(
        InputError, match=rf"the store is damaged \(in its table {named}, mission {number} has changed by itself"
    ):
        MissionStore(path, create=False)


def test_an_empty_store_is_damaged(path):
    path.parent.mkdir()
    path.touch()
    for create in (True, False):
        with pytest.raises(InputError, match=r"the store is damaged .*move it away"):
            MissionStore(path, create=create)
    assert path.stat().st_size == 0


def test_an_error_while_a_store_is_claimed_is_no_store_error(path):
    with MissionStore(path) as store, pytest.raises(OSError, match="elsewhere"), store.claim():
        raise OSError("elsewhere")
    with MissionStore(path) as store, store.claim():
        pass


def test_a_store_that_another_program_has_locked_says_so(path):
    with MissionStore(path) as store, MissionStore(path) as other:
        store._connection.execute("PRAGMA busy_timeout = 10")
        other._connection.execute("BEGIN EXCLUSIVE")
        with pytest.raises(InputError, match="another program has locked the store; end the program"):
            store.add(REQUEST, queued=True)
        other._connection.rollback()


def test_a_full_disk_names_how_to_continue(path):
    with MissionStore(path) as store:
        number = store.add(REQUEST, queued=True).id
        (pages,) = store._connection.execute("PRAGMA page_count").fetchone()
        store._connection.execute(f"PRAGMA max_page_count = {pages}")
        with pytest.raises(InputError, match=r"the disk is full.*errand resume"):
            store.finish(number, MissionState.SUCCESS, "long " * 10_000)
        assert store.mission(number).state is MissionState.QUEUED


def test_each_of_several_robots_has_its_own_steps_values_and_pose(path):
    with MissionStore(path) as store:
        mission = store.add(replace(REQUEST, robot="Alice"), queued=False).id
        store.place(mission, {"Alice": Pose2D(9.0, 9.0, 0.0), "Carl": Pose2D(5.0, 5.0, 0.0)})
        for name, x_m, charge in (("Alice", 1.0, 0.5), ("Bob", 2.0, 0.1)):
            slug, pose = name.lower(), Pose2D(x_m, 0.0, 0.0)
            done = changed(f"{slug}/a", Status.SUCCESS)
            journal = store.journal(mission, name)
            journal.note(note(done, board={f"{slug}/x": x_m}, pose=pose, charge=charge))
        alice, bob = store.memory(mission, "Alice"), store.memory(mission, "Bob")
        assert ([*alice.steps], alice.board, alice.pose) == (["alice/a"], {"alice/x": 1.0}, Pose2D(1.0, 0.0, 0.0))
        assert ([*bob.steps], bob.board, bob.pose) == (["bob/a"], {"bob/x": 2.0}, Pose2D(2.0, 0.0, 0.0))
        assert store.mission(mission).poses["Carl"] == Pose2D(5.0, 5.0, 0.0)
        assert [tuple(row) for row in store.rows("SELECT lowest_charge, last_charge FROM mission")] == [(0.5, 0.5)]


def test_the_lowest_charge_of_a_mission_is_kept_over_a_restart_and_the_last(path):
    with MissionStore(path) as store:
        mission = store.add(REQUEST, queued=False).id
        journal = store.journal(mission)
        for tick, charge in enumerate((0.8, None, 0.3, 0.6)):
            journal.note(note(*([changed(f"a/{tick}", Status.SUCCESS)] if tick != 2 else []), charge=charge))
        store.journal(mission).note(note(changed("b", Status.SUCCESS), charge=0.9))
        (row,) = store.rows("SELECT lowest_charge, last_charge, ended FROM mission")
        assert tuple(row) == (0.3, 0.9, None)


def test_a_value_that_cannot_be_read_names_the_fix(path):
    with MissionStore(path) as store:
        store.add(REQUEST, queued=True)
        store._connection.execute("INSERT INTO value (mission, key, text) VALUES (1, 'alice/x', '{')")
        with pytest.raises(InputError, match=r"mission 1 cannot be taken up.*queue remove 1"):
            store.memory(1)


HOLD = """
import sys
from pathlib import Path
from executive.store.missions import MissionStore

with MissionStore(Path(sys.argv[1])) as store, store.claim():
    sys.stdout.write("held\\n")
    sys.stdout.flush()
    sys.stdin.read()
"""


def test_two_processes_do_not_run_missions_of_one_store(path):
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert holder.stdout.readline() == "held\n"
        with (
            MissionStore(path) as store,
            pytest.raises(InputError, match=f"process {holder.pid} runs a mission"),
            store.claim(),
        ):
            pass
    finally:
        holder.kill()
        holder.communicate()
    with MissionStore(path) as store, store.claim():
        pass
