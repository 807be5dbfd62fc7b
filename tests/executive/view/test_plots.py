"""Plots of a run: which curves a log has, and what is drawn."""

import re

import numpy as np
import pytest

from executive.record.history import Event
from executive.view.plots import Curve, curves_of, to_plot

STATES = [{"robot": "Alice", "speed_m_s": 0.5 * n, "charge": 1.0 - 0.1 * n, "grip_n": 0.0} for n in range(3)]


def events(topic, values):
    return [Event(topic, float(number), data) for number, data in enumerate(values)]


def test_a_log_has_a_curve_for_each_value_that_is_not_always_0_in_the_unit_of_its_plot():
    curves = {each.title: each for each in curves_of(events("state", STATES))}
    assert curves.keys() == {"Speed", "Battery"}  # the gripper held nothing
    np.testing.assert_allclose(curves["Battery"].lines["Alice"], [(0, 100), (1, 90), (2, 80)])


def test_the_real_time_factor_is_simulated_time_over_wall_time():
    (curve,) = curves_of(events("wall", [{"lasted_s": 0.0}, {"lasted_s": 0.25}, {"lasted_s": 0.75}]))
    np.testing.assert_allclose(curve.lines[""], [(1, 4), (2, 2)])


def test_each_robot_has_its_line():
    both = [{"robot": name, "speed_m_s": 1.0} for name in ("Alice", "Bob")]
    (curve,) = curves_of(events("state", both))
    assert curve.lines.keys() == {"Alice", "Bob"}
    assert to_plot(curve).count("<polyline") == 2


def position_events(errors_m):
    """A log in which a robot is so far from where it believes to be; without errors that of a real robot."""
    states = events("state", [{"robot": "Alice", "position_sigma_m": 0.02} for _ in range(3)])
    return states + events("truth", [{"robot": "Alice", "error_m": error_m} for error_m in errors_m])


def test_the_error_of_the_position_is_plotted_above_the_dashed_uncertainty_where_the_truth_is_known():
    (curve,) = curves_of(position_events([0.01, 0.04, 0.5]))
    assert (curve.title, curve.unit) == ("Position error (dashed: own estimate, 1σ)", "cm")
    np.testing.assert_allclose(curve.lines["Alice"], [(0, 1), (1, 4), (2, 50)])
    np.testing.assert_allclose(curve.dashed["Alice"], [(0, 2), (1, 2), (2, 2)])
    assert re.findall(r'stroke-dasharray="([^"]*)"', to_plot(curve)) == ["3 3", "none"]


def test_the_log_of_a_real_robot_shows_only_the_uncertainty():
    (curve,) = curves_of(position_events([]))
    assert curve.title == "Own estimate of the position (1σ)"
    assert re.findall(r'stroke-dasharray="([^"]*)"', to_plot(curve)) == ["none"]


# largest value, labels of the axis
@pytest.mark.parametrize(
    ("largest", "labels"),
    [(0.9, ["0", "0.5", "1"]), (1.0, ["0", "0.5", "1"]), (83.0, ["0", "50", "100"]), (1.1, ["0", "1", "2"])],
)
def test_the_axis_ends_at_a_round_value(largest, labels):
    svg = to_plot(Curve("Speed", "m/s", {"a": np.array([(0.0, 0.0), (2.0, largest)])}))
    assert re.findall(r'text-anchor="end">([^<]*)</text>', svg)[:3] == labels
    assert ("Speed, m/s" in svg, "2 s" in svg) == (True, True)


def test_a_long_run_is_drawn_in_bounded_size_and_keeps_its_peak():
    line = np.column_stack([np.arange(100_000.0), np.ones(100_000)])
    line[51_234, 1] = 5.0
    svg = to_plot(Curve("Speed", "m/s", {"a": line}))
    assert len(svg) < 10_000
    assert min(float(point.split(",")[1]) for point in re.search(r'points="([^"]*)"', svg)[1].split()) == 32.0


def test_without_values_nothing_is_drawn():
    assert curves_of([]) == ()
