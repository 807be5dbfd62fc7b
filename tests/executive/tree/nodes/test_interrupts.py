"""Watches by priority above a mission: status tables."""

import pytest

from executive.tree.nodes.composites import MemorySequence
from executive.tree.nodes.guard import Waiting
from executive.tree.nodes.interrupts import Interrupt, Interrupts, Monitor
from executive.tree.nodes.skill_leaf import SkillLeaf
from skills.api import Cause, Failed
from tests.executive.tree.scripted import Leaf, N, S, Switch, table

LOW = Failed(Cause.PRECONDITION, "the battery is at 10%")


def work(name, script="RS"):
    return Leaf(script, name, restarts=True)


class Bench:
    """stop > battery > lost > mission; each of them set by hand."""

    def __init__(self, context, *, mission=None, spares=(), uses=3, charge=None):
        self.stop, self.battery, self.urgent, self.lost = Switch(), Switch(), Switch(), Switch()
        self.charge, self.find_out = charge or work("charge"), work("find-out")
        self.mission = mission or work("mission", "RRRRS")
        watches = [
            Monitor(path_id="alice/stop", name="stop", condition=self.stop, context=context),
            self._interrupt("battery", self.charge, (self.battery, self.urgent), spares, uses, context),
            self._interrupt("lost", self.find_out, (self.lost, None), spares, uses, context),
        ]
        self.root = Interrupts(path_id="alice/watch", name="watch", children=[*watches, self.mission])

    def _interrupt(self, name, child, call, spares, uses, context):
        return Interrupt(
            path_id=f"alice/{name}-call", name=name, child=child, condition=call[0], urgent=call[1],
            spares=frozenset(spares), uses=uses, context=context,
        )  # fmt: skip

    def tick(self, ticks=1):
        return table(self.root, ticks)


@pytest.fixture
def bench(context):
    return Bench(context)


def test_without_any_call_the_mission_runs_and_the_interrupts_stay_idle(bench):
    #                       root stop batt lost mission
    assert bench.tick(5) == ["RSIIR"] * 4 + ["SSIIS"]
    assert (bench.root.cause, bench.root.message) == (None, "mission S")


def test_a_call_suspends_the_mission_which_goes_on_afterwards(bench):
    bench.tick(2)
    bench.battery.verdict = LOW
    assert bench.tick() == ["RSRIR"]
    assert bench.root.message == "the battery is at 10%: charge R"
    bench.battery.verdict = None
    assert bench.tick(3) == ["RSSIR", "RSSIR", "SSSIS"]
    assert (bench.mission.begun, "~mission" in bench.mission.log, bench.charge.begun) == (1, True, 1)


def test_an_interrupt_under_way_comes_to_its_end_though_the_call_is_over(context):
    bench = Bench(context, charge=work("charge", "RRRS"))
    bench.battery.verdict = LOW
    bench.tick()
    bench.battery.verdict = None
    assert [row[2] for row in bench.tick(4)] == ["R", "R", "S", "S"]


def test_a_more_important_call_suspends_a_less_important_one(bench):
    bench.tick()
    bench.lost.verdict = Failed(Cause.PRECONDITION, "lost")
    assert bench.tick() == ["RSIRR"]
    bench.battery.verdict = LOW
    assert bench.tick() == ["RSRRR"]
    assert (bench.find_out.log, bench.find_out.place) == (["+find-out", "~find-out"], 1)
    bench.battery.verdict = bench.lost.verdict = None
    assert bench.tick() == ["RSSSR"]  # both come to their end, and the mission goes on


def test_a_failed_interrupt_ends_the_mission_with_its_cause(context):
    bench = Bench(context, charge=work("charge", "F"))
    bench.tick()
    bench.battery.verdict = LOW
    assert bench.tick() == ["FSFII"]
    assert (bench.root.cause, bench.root.message) == (Cause.EXECUTION, "the battery is at 10%: charge F")


def test_an_interrupt_is_done_so_often_and_no_more(context):
    bench = Bench(context, uses=2, charge=work("charge", "S"))
    bench.battery.verdict = LOW
    assert [row[0] for row in bench.tick(3)] == ["R", "R", "F"]
    assert bench.root.message == "the battery is at 10%, again after 2 times battery"
    assert bench.charge.begun == 2


def test_a_violated_monitor_ends_the_mission(bench):
    bench.tick(2)
    bench.stop.verdict = Failed(Cause.CANCELLED, "stopped")
    assert bench.tick() == ["FFIII"]
    assert (bench.root.cause, bench.root.message) == (Cause.CANCELLED, "stopped")


def test_a_waiting_monitor_holds_all_below(bench):
    bench.lost.verdict = Failed(Cause.PRECONDITION, "lost")
    bench.tick()
    bench.stop.verdict = Waiting("the stop button is pressed")
    assert bench.tick(2) == ["RRIRI"] * 2
    assert (bench.root.message, bench.find_out.place) == ("the stop button is pressed", 1)
    bench.stop.verdict = bench.lost.verdict = None
    assert bench.tick(2) == ["RSISR", "RSISR"]


def test_a_call_that_cannot_tell_yet_holds_the_mission(bench):
    bench.lost.verdict = Waiting("no scan yet")
    assert bench.tick() == ["RSIII"]
    assert bench.root.message == "no scan yet"


def test_a_new_start_begins_all_conditions_and_counts_from_zero(context):
    bench = Bench(context, uses=1, mission=work("mission", "S"))
    for times in (1, 2):
        bench.battery.verdict = LOW
        assert [row[0] for row in bench.tick()] == ["R"]
        bench.battery.verdict = None
        assert [row[0] for row in bench.tick()] == ["S"]
        assert (bench.stop.begun, bench.battery.begun, bench.urgent.begun) == (times, times, times)


def skill_mission(context, make, script, name):
    inputs, outputs = make.PORTS[name]
    leaf = SkillLeaf(
        path_id=f"alice/{name}", name=name, skill=make.scripted_skill(script, name, inputs, outputs), inputs={},
        outputs={}, limit_s=30.0, context=context,
    )  # fmt: skip
    return MemorySequence(path_id="alice/m", name="m", children=[leaf])


def test_a_call_waits_for_the_handling_of_an_object_unless_it_is_urgent(context, make, script):
    script.steps = 100
    bench = Bench(context, mission=skill_mission(context, make, script, "stow"), spares={"stow"})
    bench.tick()
    bench.battery.verdict = LOW
    assert bench.tick() == ["RSIIR"]
    bench.urgent.verdict = LOW
    assert bench.tick() == ["RSRIR"]


def test_the_suspended_leaf_begins_again(context, make, script, robot):
    script.steps = 3
    bench = Bench(context, mission=skill_mission(context, make, script, "stow"))
    bench.tick(2)
    bench.battery.verdict = LOW
    bench.tick()
    assert (script.begun, script.ended, robot.driving) == (["stow"], ["stow"], False)
    bench.battery.verdict = None
    assert [row[0] for row in bench.tick(3)] == ["R", "R", "S"]
    assert script.begun == ["stow", "stow"]


def test_stopped_from_outside_all_that_runs_is_stopped(bench):
    bench.tick()
    bench.battery.verdict = LOW
    bench.tick()
    bench.root.stop(N)
    assert [child.status for child in bench.root.children] == [S, N, N, N]
    assert bench.root.cause is Cause.CANCELLED
