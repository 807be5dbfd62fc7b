"""Tests of charging: it ends at the level and fails where the charge does not rise."""

from types import SimpleNamespace

import pytest

from skills.api import Cause, Failed, Running, Succeeded
from skills.robot import Battery
from skills.small.charge import Charge, ChargeInputs
from skills.stack import default_stack


class Dock:
    """Clock and battery in one; the charge rises by so much a second."""

    def __init__(self, charge, rate):
        self.now_s, self.charge, self.rate = 0.0, charge, rate

    def now(self):
        return self.now_s

    def battery(self):
        return Battery(self.now_s, self.charge)

    def advance(self, dt_s):
        self.now_s += dt_s
        self.charge += self.rate * dt_s


def outcome(dock, level):
    skill, progress = Charge(SimpleNamespace(robot=dock, clock=dock, stack=default_stack())), []
    skill.begin(ChargeInputs(level))
    while isinstance(step := skill.step(), Running):
        progress.append(step.progress)
        dock.advance(0.5)
        assert dock.now_s < 1000.0
    skill.end()
    return step, progress


def test_it_waits_until_the_level_is_reached():
    dock = Dock(0.2, 0.01)
    step, progress = outcome(dock, 0.5)
    assert isinstance(step, Succeeded)
    assert dock.now_s == pytest.approx(30.0, abs=1.0)
    assert progress == sorted(progress)


def test_a_full_battery_needs_no_waiting():
    dock = Dock(0.9, 0.0)
    assert isinstance(outcome(dock, 0.8)[0], Succeeded)
    assert dock.now_s == 0.0


@pytest.mark.parametrize("rate", [0.0, -0.0002])
def test_charging_gives_up_when_the_charge_does_not_rise(rate):
    dock = Dock(0.2, rate)
    step, _ = outcome(dock, 0.8)
    assert step.cause is Cause.POSTCONDITION
    assert "does not charge here" in step.message
    assert dock.now_s < 32.0


def test_a_level_beyond_full_is_refused():
    assert outcome(Dock(0.2, 0.1), 80.0)[0] == Failed(Cause.PRECONDITION, "a charge is from 0 to 1, not 80")
