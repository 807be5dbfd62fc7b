"""What two runs are compared by."""

import pytest

from executive.record.history import Event
from tests.benchmarks.equal_logs import differences, lines, steady

RUN = {"exit": 0, "result": {"outcome": "success"}, "logs": [["0.050 state abc", "0.100 state def"]]}


def test_equal_runs_have_no_differences():
    assert list(differences(RUN, RUN)) == []


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"exit": 1}, "exit"),
        ({"result": {"outcome": "failure"}}, "result"),
        ({"logs": [["0.050 state abc", "0.100 state xyz"]]}, "log 0, event 2"),
        ({"logs": [["0.050 state abc"]]}, "log 0, event 2 of 2 and 1"),
        ({"logs": []}, "1 logs"),
    ],
)
def test_a_difference_is_told_with_its_place(changed, told):
    (found,) = differences(RUN, RUN | changed)
    assert found.startswith(told)


def test_differences_between_equal_runs_are_left_out():
    result = {"outcome": "success", "wall_time_s": 9.1, "robots": [{"real_time_factor": 4.0, "ticks": 3}]}
    assert steady(result) == {"outcome": "success", "robots": [{"ticks": 3}]}


def test_a_line_tells_a_transition_whole_a_pose_as_a_digest_and_no_pictures_and_processor_times():
    events = [
        Event("transitions", 0.05, {"node": "alice/fetch", "file": "OUT"}),
        Event("pose", 0.1, {"x": 1.0}),
        Event("wall", 0.1, {"tick_s": [0.02]}),
        Event("detections", 0.2, {"format": "jpeg", "data": "..."}),
    ]
    first, second = lines(events, "/somewhere")
    assert first == '0.050 transitions {"file": "OUT", "node": "alice/fetch"}'
    assert second.startswith("0.100 pose ")
    assert len(second.split()[-1]) == 12
