"""The measures of the server of Spot's API run their smallest cases to their ends."""

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install 'spot-errand[spot]'")

from tests.benchmarks.test_smoke import result_of


@pytest.mark.nightly
def test_two_clients_are_killed_and_the_robot_stands_still():
    result = result_of("spot_kills", "--scripted", "--trials", 2)
    assert (result["trials"], result["still"], result["free"], result["wrong"]) == (2, 2, 2, [])
    assert (result["with_policy"], result["off_by_policy"]) == (1, 1)


@pytest.mark.nightly
def test_answers_and_pace_are_timed():
    result = result_of("spot_latency", "--scripted", "--seconds", 4)
    assert result["alone"]["state"]["count"] > 30, result
    assert 0.9 < result["with_sensors"]["pace"] < 1.1, result
    assert result["with_sensors"]["set_point"]["count"] > 10, result


@pytest.mark.nightly
def test_hard_inputs_are_counted():
    result = result_of("spot_fuzz", "--messages", 200, "--clients", 20)
    assert (result["messages"], result["idle_clients"], result["inside"], result["logged"]) == (200, 20, [], [])
