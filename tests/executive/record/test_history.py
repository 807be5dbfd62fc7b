"""A log read back: the tree at any time, and the transitions that scripts rely on."""

import json

import pytest
from py_trees.common import Status

from executive.record.history import Event, read_history, timeline
from executive.tree.node_view import node_view, to_json
from executive.view.text import style_of
from skills.api import Cause, Failed
from skills.inputs.errors import InputError


@pytest.fixture
def failed_run(compiled, make, script, log_run):
    """A mission that fails at `approach`: its log, its tree, and its result."""
    script.ends["approach"] = lambda skill: Failed(Cause.TIMEOUT, "no room to stand")
    tree = compiled(*make.FETCH)
    path, result = log_run(tree)
    return path, tree, result


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


@pytest.fixture
def telling_run(compiled, make, script, log_run):
    """The log of a mission whose skills say in each step what they do: "turning", then "going, 2 m to go" and 1 m."""
    script.steps, script.says = 4, lambda name, left: "turning" if left == 3 else f"going, {left} m to go"
    path, _ = log_run(compiled(*make.FETCH))
    return read_history(path)


def test_new_sentences_of_running_skills_are_logged_once(telling_run):
    # navigate begins "turning" (a transition), then goes on "going, 2 m to go"; that 1 m is left is nothing new
    told = [event.data for event in telling_run.events if event.topic == "activity"]
    first = told[0]["node"]
    assert first.endswith("navigate")
    assert [each["message"] for each in told if each["node"] == first] == ["going, 2 m to go"]


def test_the_state_at_a_time_has_the_message_of_that_time(telling_run):
    told = next(event.data for event in telling_run.events if event.topic == "activity")
    messages = []
    for time_s in (told["t"] - 0.01, told["t"]):
        (tree,) = telling_run.trees(time_s)
        messages.append(next(node.state.message for _, node in tree.walk() if node.path_id == told["node"]))
    assert messages == ["turning", "going, 2 m to go"]


def test_the_timeline_lists_messages_of_running_skills(telling_run):
    told = next(event.data for event in telling_run.events if event.topic == "activity")
    entries = [entry for entry in timeline(telling_run.events, leaves_only=True) if entry.about == told["node"]]
    assert [entry.text for entry in entries][:2] == ["turning", "going, 2 m to go"]
    assert entries[1].state is not None and entries[1].state.status is Status.RUNNING


def test_the_timeline_lists_skills_failures_and_the_outcome(failed_run):
    entries = list(timeline(read_history(failed_run[0]).events, leaves_only=True))
    texts = [entry.text for entry in entries]
    assert "TIMEOUT: no room to stand" in texts
    assert any(entry.about == "outcome" and "TIMEOUT" in entry.text for entry in entries)
    assert not [entry for entry in entries if entry.about == "alice/fetch-drink" and entry.state.cause is None]


@pytest.mark.parametrize(("found", "marks"), [(True, "––✓"), (False, "–––✗")])
def test_looks_that_another_one_follows_are_expected_to_find_nothing(compiled, make, script, found, marks, log_run):
    def detect(skill):
        third = script.begun.count("detect") == 3
        script.seen_on = tuple(surface.name for surface in skill.inputs.surfaces) if found and third else ()
        return make.default_end(script, "detect")(skill)

    script.ends["detect"] = detect
    path, _ = log_run(compiled(*make.FETCH))
    entries = list(timeline(read_history(path).events, leaves_only=True))
    over = [entry for entry in entries if entry.state and entry.state.status in (Status.SUCCESS, Status.FAILURE)]
    looks = [entry for entry in over if entry.about.endswith("/detect")]
    assert "".join(style_of(entry.state).symbol for entry in looks) == marks
    assert {entry.text for entry in looks[:2]} == {"not seen"}
    assert all(entry in looks for entry in over if style_of(entry.state).symbol == "–")


NO_TREE = [
    ("no tree", "run", {"world": "flat", "seed": 1}),
    ("broken", "tree", {"robot": "Alice", "root": {"id": "a"}}),
]


@pytest.mark.parametrize(("says", "topic", "message"), NO_TREE)
def test_a_log_without_a_tree_or_with_a_broken_one_is_refused(write_log, says, topic, message):
    with pytest.raises(InputError, match=says):
        read_history(write_log((topic, message))).trees()


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


def test_the_timeline_lists_speech():
    events = [Event("speech", 2.0, {"t": 2.0, "robot": "Alice", "text": "Hello"})]
    (entry,) = timeline(events)
    assert (entry.t, entry.about, entry.text) == (2.0, "speech", 'Alice says: "Hello"')


def test_the_timeline_lists_speech_behind_the_changes_of_its_tick():
    said = Event("speech", 2.0, {"t": 2.0, "robot": "Alice", "text": "Hello"})
    seen = Event("battery", 2.0, {})
    ended = Event("outcome", 2.0, {"robot": "Alice", "outcome": "success", "message": "done"})
    later = Event("outcome", 2.05, {"robot": "Bob", "outcome": "success", "message": "done"})
    order = [entry.text.split()[0] for entry in timeline([said, seen, ended, later])]
    assert order == ["Alice:", "Alice", "Bob:"]
