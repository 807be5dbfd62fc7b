"""Tick durations and overruns, told under a topic of their own."""

import pytest

from executive.record.ticks import TickMeter


@pytest.fixture
def meter(published, clock) -> TickMeter:
    return TickMeter(lambda topic, message: published.append((topic, message)), clock, limit_s=0.05)


def test_every_duration_is_told_once_and_overruns_are_counted(meter, published, clock):
    durations = [0.001 * n for n in range(100)]
    for duration in durations:
        meter(duration)
        clock.advance(0.05)
    meter.close(12.5)
    assert {topic for topic, _ in published} == {"wall"}
    assert [tick for _, message in published for tick in message["tick_s"]] == pytest.approx(durations)
    assert (meter.overruns, published[-1][1]["overruns"], published[-1][1]["wall_time_s"]) == (49, 49, 12.5)


def test_it_speaks_once_a_second(meter, published, clock):
    for _ in range(200):
        meter(0.001)
        clock.advance(0.05)
    assert len(published) == 10


def test_a_run_that_overruns_says_so_in_its_log(compiled, run_tree, make, published, script):
    run_tree(compiled(*make.FETCH))
    walls = [message for topic, message in published if topic == "wall"]
    ticks = [tick for message in walls for tick in message["tick_s"]]
    assert len(ticks) > 10
    assert walls[-1]["overruns"] == sum(tick > walls[-1]["limit_s"] for tick in ticks)
