"""SkillLeaf: statuses, time, defects, ports, and that the skill is ended on every way out."""

import dataclasses
from dataclasses import dataclass
from typing import Any, ClassVar

import pytest
from py_trees.common import Status

from executive.tree.board import Constant, FromBoard
from executive.tree.nodes.skill_leaf import SkillLeaf
from plant.robots.spot.kind import spot_capabilities
from skills.api import Cause, Failed, Part, Running, Skill, Succeeded, Zone, ZoneKind
from tests.executive.tree.scripted import N, tick


@dataclass(frozen=True)
class Inputs:
    number: int = 0


def leaf_of(context, steps, *, limit_s=10.0, inputs=None, outputs=None, **more):
    """A leaf whose skill gives these steps in turn (an exception is raised); `log` tells what was called."""
    log = []

    class Listed(Skill[Inputs]):
        name = "listed"
        Inputs: ClassVar[type] = Inputs
        outputs = more.get("declared", {})

        def begin(self, inputs: Inputs) -> None:
            log.append(f"begin {inputs.number}")
            self.steps = list(steps)
            if more.get("begin_raises"):
                raise ValueError("no begin")

        def step(self) -> Any:
            log.append("step")
            step = self.steps.pop(0)
            if isinstance(step, BaseException):
                raise step
            return step

        def end(self) -> None:
            log.append("end")
            if more.get("end_raises"):
                raise RuntimeError("no end")

    leaf = SkillLeaf(
        path_id="alice/test/listed",
        name="listed",
        skill=Listed,
        inputs=inputs or {},
        outputs=outputs or {},
        limit_s=limit_s,
        context=context,
        first=more.get("first", ()),
    )
    return leaf, log


def play(leaf, clock, ticks):
    """First letters of the leaf's statuses, at each second."""
    return "".join(status.value[0] for status in tick(leaf, ticks, clock))


A, B, DONE = Running("a"), Running("b"), Succeeded("done")
NO_WAY, SLIPPED = Failed(Cause.PLANNING, "no way through"), Failed(Cause.EXECUTION, "slipped")
THREE, COUNTED = Succeeded("", {"count": "three"}), {"outputs": {"count": "alice/c"}, "declared": {"count": int}}
ABSENT = {"inputs": {"number": FromBoard("alice/test/absent")}}
NOT_WRITTEN = "listed raised KeyError: nothing was written to the blackboard under 'alice/test/absent' yet"
NO_STEPS = (None, True, Status.SUCCESS, "done")
Ends = type("Ends", (KeyboardInterrupt,), {})
DEFECTS = (ValueError("bad sum"), SystemExit(3), BaseException("gone"), Ends("now"))
LIMIT, ERROR = {"limit_s": 1.5}, Cause.ERROR


# steps of the skill, what else there is; status at each second, cause, sentence, calls (begin, step, end)
@pytest.mark.parametrize(
    ("steps", "more", "expected", "cause", "message", "calls"),
    [
        ([A, B, DONE], {}, "RRS", None, "done", "bssse"),
        ([NO_WAY], {}, "F", Cause.PLANNING, "no way through", "bse"),
        ([SLIPPED], {}, "FF", Cause.EXECUTION, "slipped", "bsebse"),
        ([A, B, A], LIMIT, "RRF", Cause.TIMEOUT, "listed took longer than 1.5 s (a)", "bssse"),
        ([A, B, DONE], LIMIT, "RRF", Cause.TIMEOUT, "listed took longer than 1.5 s (done)", "bssse"),
        ([A, B, SLIPPED], LIMIT, "RRF", Cause.EXECUTION, "slipped", "bssse"),
        ([], {"begin_raises": True}, "F", ERROR, "listed raised ValueError: no begin", "be"),
        ([DONE], {"end_raises": True}, "F", ERROR, "listed raised RuntimeError: no end", "bse"),
        ([], ABSENT, "F", ERROR, NOT_WRITTEN, ""),
        ([DONE], COUNTED, "F", ERROR, "listed gave nothing on port 'count', not whole number", "bse"),
        ([THREE], COUNTED, "F", ERROR, "listed gave str on port 'count', not whole number", "bse"),
        *[([each], {}, "F", ERROR, f"listed gave back {each!r} instead of a step", "bse") for each in NO_STEPS],
        *[([each], {}, "F", ERROR, f"listed raised {type(each).__name__}: {each}", "bse") for each in DEFECTS],
    ],
)
def test_a_leaf_ends_as_its_skill_and_ends_the_skill(context, clock, steps, more, expected, cause, message, calls):
    leaf, log = leaf_of(context, steps, **more)
    assert play(leaf, clock, len(expected)) == expected
    assert (leaf.cause, leaf.message, "".join(each[0] for each in log)) == (cause, message, calls)
    assert (leaf.active, "alice/c" in context.board) == (False, False)


def test_a_running_leaf_shows_sentence_and_progress_of_its_skill(context, clock):
    leaf, _ = leaf_of(context, [Running("a", 0.5)])
    assert play(leaf, clock, 1) == "R"
    assert (leaf.message, leaf.progress, leaf.active) == ("a", 0.5, True)


def test_speed_limits_lengthen_the_time_of_a_drive(context, clock, robot, monkeypatch):
    monkeypatch.setattr(robot, "capabilities", spot_capabilities, raising=False)
    hall = Zone("hall", ZoneKind.SPEED_LIMIT, ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)), share=0.5)
    leaf, _ = leaf_of(dataclasses.replace(context, zones=(hall,)), [A, B, DONE], limit_s=1.5)
    assert play(leaf, clock, 3) == "RRS"


def test_the_log_has_the_traceback_of_an_exception(context, clock, published):
    play(leaf_of(context, [ValueError("bad sum")])[0], clock, 1)
    topic, message = published[-1]
    assert (topic, "ValueError: bad sum" in message["traceback"]) == ("errors", True)


def test_interruption_ends_the_skill_once_and_says_what_it_was_doing(context, clock):
    leaf, log = leaf_of(context, [Running("driving")] * 5)
    play(leaf, clock, 1)
    leaf.stop(N)
    assert (leaf.status, leaf.cause, leaf.message) == (N, Cause.CANCELLED, "stopped while: driving")
    leaf.stop(N)
    assert log.count("end") == 1


def test_reset_of_a_finished_leaf_forgets_without_ending_again(context, clock):
    leaf, log = leaf_of(context, [Failed(Cause.PLANNING, "no")])
    play(leaf, clock, 1)
    leaf.stop(N)
    assert (leaf.cause, leaf.message, log.count("end")) == (None, "", 1)


def test_inputs_come_from_constants_and_the_board(context, clock):
    context.board.put("alice/test/n", 42)
    for binding, expected in ((Constant(7), "begin 7"), (FromBoard("alice/test/n"), "begin 42")):
        leaf, log = leaf_of(context, [Succeeded("")], inputs={"number": binding})
        play(leaf, clock, 1)
        assert log[0] == expected


def test_outputs_go_to_the_board(context, clock):
    step = Succeeded("done", {"count": 3})
    leaf, _ = leaf_of(context, [step], outputs={"count": "alice/test/count"}, declared={"count": int})
    play(leaf, clock, 1)
    assert context.board.get("alice/test/count") == 3


def test_keyboard_interrupt_is_not_swallowed(context, clock):
    leaf, _ = leaf_of(context, [KeyboardInterrupt()])
    with pytest.raises(KeyboardInterrupt):
        play(leaf, clock, 1)
    assert leaf.active
    leaf.abandon()
    assert not leaf.active


def stow_of(log, *steps, called="stow", part=Part.ARM):
    """A skill for one part alone that gives these steps in turn."""

    class Stowing(Skill[Inputs]):
        name = called
        Inputs: ClassVar[type] = Inputs
        uses = frozenset({part})

        def begin(self, inputs: Inputs) -> None:
            log.append(f"begin {called}")
            self.steps = list(steps)

        def step(self) -> Any:
            return self.steps.pop(0)

        def end(self) -> None:
            log.append(f"end {called}")

    return Stowing


@pytest.fixture
def armed(context, robot, monkeypatch):
    """A robot with an arm that may be anywhere."""
    monkeypatch.setattr(robot, "capabilities", spot_capabilities)
    context.arm_order.anywhere = True
    return context


@pytest.mark.parametrize("last", [Succeeded("stowed"), NO_WAY])
def test_an_arm_that_may_be_anywhere_is_brought_in_before_the_skill_begins(armed, clock, last):
    calls = []
    leaf, log = leaf_of(armed, [Succeeded("gone")], first=(stow_of(calls, Running("stowing"), last),))
    assert play(leaf, clock, 2) == "RR"
    assert (calls, log) == (["begin stow", "end stow"], ["begin 0"])
    assert play(leaf, clock, 1) == "S"


@pytest.mark.parametrize(
    ("stow", "back", "begun"),
    [
        (NO_WAY, Succeeded("backed off"), ["stow", "back_off", "stow again"]),
        (NO_WAY, Failed(Cause.PLANNING, "no clearance"), ["stow", "back_off"]),
        (Failed(Cause.EXECUTION, "held fast"), Succeeded("backed off"), ["stow"]),
        (Succeeded("stowed"), Succeeded("backed off"), ["stow"]),
    ],
)
def test_robot_backs_off_where_the_arm_has_no_path_and_stows_again(armed, clock, stow, back, begun):
    calls = []
    first = (
        stow_of(calls, stow),
        stow_of(calls, back, called="back_off", part=Part.BASE),
        stow_of(calls, Succeeded("stowed"), called="stow again"),
    )
    leaf, log = leaf_of(armed, [Succeeded("gone")], first=first)
    assert play(leaf, clock, len(begun) + 1)[-1] == "S"
    assert calls == [f"{when} {each}" for each in begun for when in ("begin", "end")]
    assert log[0] == "begin 0"


def test_an_arm_that_is_where_it_is_to_be_stays_there(armed, clock):
    armed.arm_order.anywhere = False
    calls = []
    leaf, _ = leaf_of(armed, [Succeeded("gone")], first=(stow_of(calls),))
    assert play(leaf, clock, 1) == "S"
    assert calls == []


def test_a_halt_while_the_arm_is_brought_in_ends_that(armed, clock):
    calls = []
    leaf, log = leaf_of(armed, [], first=(stow_of(calls, *[Running("stowing")] * 9),))
    play(leaf, clock, 2)
    leaf.stop(N)
    assert (calls, log, leaf.active) == (["begin stow", "end stow"], [], False)
    assert armed.arm_order.anywhere


@pytest.mark.parametrize(
    ("uses", "step", "anywhere"),
    [
        ({Part.ARM}, Succeeded("posed"), False),  # it leaves the arm as it is to be
        ({Part.ARM}, Failed(Cause.EXECUTION, "stuck"), True),
        ({Part.ARM, Part.BASE}, Succeeded("seen"), True),
        ({Part.BASE}, Failed(Cause.EXECUTION, "blocked"), False),  # it does not use the arm
    ],
)
def test_a_leaf_notes_whether_the_arm_may_be_anywhere(context, clock, uses, step, anywhere):
    leaf, _ = leaf_of(context, [step])
    leaf.skill.uses = frozenset(uses)
    play(leaf, clock, 1)
    assert context.arm_order.anywhere is anywhere


def test_a_halted_skill_that_uses_the_arm_may_leave_it_anywhere(context, clock):
    leaf, _ = leaf_of(context, [Running("reaching")] * 3)
    play(leaf, clock, 1)
    leaf.stop(N)
    assert context.arm_order.anywhere
