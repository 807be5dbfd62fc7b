"""The whole path: from a sentence to a drink brought back, as a user runs it."""

import pytest

from executive.record.history import read_history
from executive.words.schemas import WALL
from tests.missions.conftest import REPEATED_S
from tests.tables import yaml_beside

pytestmark = pytest.mark.mission

BUDGETS = yaml_beside(__file__, "test_fetch_drink.yaml")

ARTIFACTS = {"tree.svg", "log.mcap", "recording.html", "map.png", "detection.png", "grasp.png", "hand_over.png"}


def test_tree_and_referee_agree_that_the_drink_was_brought(recorded):
    _, report, _ = recorded
    assert report["outcome"] == "success"
    assert report["referee"] == {**report["referee"], "success": True, "collisions": 0, "drops": 0}


def test_the_run_is_told_in_a_line_for_each_skill(recorded):
    _, _, lines = recorded
    done = [line.split("  ", 1)[1].lstrip() for line in lines if line.startswith("✓")]
    kinds = ["go to the kitchen counter", "detect", "approach", "grasp", "stow", "go to the start"]
    kinds.append("hand over (somebody; ")
    assert [kind for kind in kinds if not any(kind in each for each in done)] == []
    assert len(lines) <= 24


def test_the_run_leaves_tree_log_recording_and_pictures(recorded):
    out, _, _ = recorded
    assert {path.name for path in (out / "last").iterdir()} >= ARTIFACTS
    assert all((out / "last" / name).stat().st_size > 1000 for name in ARTIFACTS)


def test_the_same_seed_gives_the_same_events(recorded, repeated):
    logs = (read_history(recorded[0] / "last").events, read_history(repeated / "last").events)
    first, second = ([event for event in log if event.topic != WALL and event.stamp_s < REPEATED_S] for log in logs)
    assert any(event.data.get("node", "").endswith("/grasp") for event in first)
    assert first == second


def test_it_computes_no_more_than_its_budgets_so_that_no_slower_path_comes_in_unseen(recorded):
    out, report, _ = recorded
    work = report["work"]
    logged = [event.data for event in read_history(out / "last").events if event.topic == "work"]
    assert logged == [work]
    assert {name: work.get(name) for name in BUDGETS if work.get(name, 0) > BUDGETS[name]} == {}
    assert set(work) == set(BUDGETS), "a counter has no budget, or a budget no counter"
