"""CPU time of a run by subsystem."""

import time

import pytest

from executive.app.runs.profile import OTHER, START, Profile, by_subsystem, lines
from skills.geometry import wrap

DRIVES, TICKS = ("/x/skills/navigate/skill.py", 7, "step"), ("/x/executive/run/runner.py", 3, "tick")
TREE, SORT, BUILT_IN = ("/lib/py_trees/trees.py", 1, "tick"), ("/lib/sort.py", 1, "sort"), ("~", 0, "<built-in>")


# function: calls, own time, whole time, and for each caller the whole time of the calls from it
def test_a_librarys_function_shares_its_time_out_among_its_callers():
    stats = {
        TICKS: (1, 1, 0.5, 6.0, {}),
        TREE: (1, 1, 0.5, 5.0, {TICKS: (1, 1, 0.5, 5.0)}),
        DRIVES: (1, 1, 1.0, 4.0, {TREE: (1, 1, 1.0, 4.0)}),
        SORT: (4, 4, 2.0, 4.0, {DRIVES: (3, 3, 1.5, 3.0), TICKS: (1, 1, 0.5, 1.0)}),
        BUILT_IN: (4, 4, 2.0, 2.0, {SORT: (4, 4, 2.0, 2.0)}),
    }
    assert by_subsystem(stats) == pytest.approx({"executive.run": 0.5 + 0.5 + 1.0, "skills.navigate": 1.0 + 3.0})


def test_functions_that_only_call_each_other_count_as_other():
    stats = {SORT: (1, 1, 1.0, 1.0, {BUILT_IN: (1, 1, 1.0, 1.0)}), BUILT_IN: (1, 1, 1.0, 1.0, {SORT: (1, 1, 1.0, 1.0)})}
    assert by_subsystem(stats) == pytest.approx({OTHER: 2.0})


def test_a_profile_sees_the_time_between_the_beginning_and_the_end_of_a_run():
    profile, begun_s = Profile(), time.thread_time()
    profile.begin(None, None)
    while time.thread_time() < begun_s + 0.05:
        wrap(4.0)
    profile.end(None)
    spent = profile.table()
    assert list(spent)[-2:] == [OTHER, START]
    assert 0.0 < spent["skills.geometry"] < 0.06
    assert any(each.startswith("skills.geometry") for each in lines(spent))
