"""What two runs are compared by."""

from executive.record.history import Event
from tests.benchmarks.equal_logs import differences, lines, steady

RUN = {"exit": 0, "result": {"outcome": "success"}, "logs": [["0.050 state abc", "0.100 state def"]]}


def test_equal_runs_have_no_differences():
    assert list(differences(RUN, RUN)) == []


# what is changed                      told
# exit                                 exit
# result                               result
# an event                             event 2
# an event is missing                  event 2
# a log is missing                     1 logs
def test_each_difference_is_told_with_its_place():
    changed = {
        "exit": {**RUN, "exit": 1},
        "result": {**RUN, "result": {"outcome": "failure"}},
        "log 0, event 2": {**RUN, "logs": [["0.050 state abc", "0.100 state xyz"]]},
        "log 0, event 2 of 2 and 1": {**RUN, "logs": [["0.050 state abc"]]},
        "1 logs": {**RUN, "logs": []},
    }
    for told, run in changed.items():
        (found,) = differences(RUN, run)
        assert found.startswith(told), found


def test_differences_between_equal_runs_are_left_out():
    result = {"outcome": "success", "wall_time_s": 9.1, "robots": [{"real_time_factor": 4.0, "ticks": 3}]}
    assert steady(result) == {"outcome": "success", "robots": [{"ticks": 3}]}


# topic         what it tells            line
# transitions   a node                   whole
# pose          a position               a digest of twelve digits
# wall          processor time           none
# detections    with a picture           none
def test_a_line_tells_the_moment_and_what_happened():
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
