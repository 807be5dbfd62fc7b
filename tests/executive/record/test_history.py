"""A log read back: the tree at any time, and the transitions that scripts rely on."""

import json

import pytest
from py_trees.common import Status

from executive.errors import InputError
from executive.record.event_log import EventLog
from executive.record.history import read_history
from executive.record.timeline import timeline
from executive.view.model import node_view, to_json
from skills.api import Cause, Failed


@pytest.fixture
def failed_run(tmp_path, compiled, run_tree, make, script, clock):
    """A mission that fails at `approach`: its log, its tree, and its result."""
    script.ends["approach"] = lambda skill: Failed(Cause.TIMEOUT, "no room to stand")
    tree = compiled(*make.FETCH)
    log = EventLog(tmp_path / "log.mcap", clock)
    result = run_tree(tree, publish=log)
    log.close()
    return log.path, tree, result


def test_the_last_state_is_that_of_the_run(failed_run):
    path, tree, result = failed_run
    (view,) = read_history(path).trees()
    assert to_json(view) == to_json(node_view(tree.root, result.worst.states))


def test_ports_and_sources_come_back(failed_run):
    path, tree, _ = failed_run
    (view,) = read_history(path).trees()
    assert view.structure() == node_view(tree.root).structure()


def test_the_state_at_a_time_is_the_one_then(failed_run):
    path, _, _ = failed_run
    history = read_history(path)
    begun = next(change for change in history.transitions() if change["to"] == "SUCCESS")
    (before,) = history.trees(begun["t"] - 0.01)
    (after,) = history.trees(begun["t"])
    states = [{node.path_id: node.state.status for _, node in view.walk()} for view in (before, after)]
    assert states[0][begun["node"]] is not Status.SUCCESS
    assert states[1][begun["node"]] is Status.SUCCESS


def test_transitions_have_the_keys_of_the_contract(failed_run):
    changes = list(read_history(failed_run[0]).transitions())
    assert all(set(change) == {"t", "node", "from", "to", "cause", "message"} for change in changes)
    assert [change["t"] for change in changes] == sorted(change["t"] for change in changes)
    failure = next(change for change in changes if change["cause"] == "TIMEOUT")
    assert (failure["to"], failure["message"]) == ("FAILURE", "no room to stand")
    json.dumps(changes)


def test_the_timeline_tells_skills_failures_and_the_outcome(failed_run):
    entries = list(timeline(read_history(failed_run[0]).events, leaves_only=True))
    texts = [entry.text for entry in entries]
    assert "TIMEOUT: no room to stand" in texts
    assert any(entry.about == "outcome" and "TIMEOUT" in entry.text for entry in entries)
    assert not [entry for entry in entries if entry.about == "alice/fetch-drink" and entry.state.cause is None]


def test_a_log_without_a_tree_is_refused(tmp_path, clock):
    log = EventLog(tmp_path / "log.mcap", clock)
    log("run", {"world": "flat", "seed": 1})
    log.close()
    with pytest.raises(InputError, match="no tree"):
        read_history(log.path).trees()


def test_a_broken_tree_is_refused(tmp_path, clock):
    log = EventLog(tmp_path / "log.mcap", clock)
    log("tree", {"robot": "Alice", "root": {"id": "a"}})
    log.close()
    with pytest.raises(InputError, match="broken"):
        read_history(log.path).trees()


def test_a_log_cut_anywhere_gives_the_tree_as_it_was(failed_run, tmp_path):
    whole = failed_run[0].read_bytes()
    all_changes = list(read_history(failed_run[0]).transitions())
    cut = tmp_path / "cut.mcap"
    readable = 0
    for end in range(len(whole) // 3, len(whole), max(1, len(whole) // 40)):
        cut.write_bytes(whole[:end])
        try:
            changes = list(read_history(cut).transitions())
        except InputError:
            continue
        readable += bool(changes)
        assert changes == all_changes[: len(changes)]
    assert readable > 10
