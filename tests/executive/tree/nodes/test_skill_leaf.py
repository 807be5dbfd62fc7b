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


@dataclass(frozen=True)
class Inputs:
    number: int = 0


def leaf_of(
    context: Any, steps: list[Any], *, limit_s: float = 10.0, inputs: Any = None, outputs: Any = None, **more: Any
):
    """A leaf whose skill gives these steps in turn (an exception is raised); `log` tells what was called."""
    log: list[str] = []

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


def tick(leaf: SkillLeaf, clock: Any, times: int = 1) -> list[Status]:
    statuses = []
    for _ in range(times):
        clock.advance(1.0)
        leaf.tick_once()
        statuses.append(leaf.status)
    return statuses


def test_status_follows_the_steps(context, clock):
    # tick:    1        2        3
    # step:    Running  Running  Succeeded
    # status:  RUNNING  RUNNING  SUCCESS
    leaf, log = leaf_of(context, [Running("a", 0.5), Running("b"), Succeeded("done")])
    assert tick(leaf, clock) == [Status.RUNNING]
    assert (leaf.message, leaf.progress, leaf.active) == ("a", 0.5, True)
    assert tick(leaf, clock, 2) == [Status.RUNNING, Status.SUCCESS]
    assert (leaf.message, leaf.cause, leaf.active) == ("done", None, False)
    assert log == ["begin 0", "step", "step", "step", "end"]


def test_failure_keeps_the_skills_cause_and_sentence(context, clock):
    leaf, log = leaf_of(context, [Failed(Cause.PLANNING, "no way through")])
    assert tick(leaf, clock) == [Status.FAILURE]
    assert (leaf.cause, leaf.message) == (Cause.PLANNING, "no way through")
    assert log[-1] == "end"


@pytest.mark.parametrize("late", [Running("still"), Succeeded("too late")])
def test_time_over_is_a_timeout_even_for_a_late_success(context, clock, late):
    # time:    1 s      2 s      3 s      (limit 1.5 s after the start at 1 s)
    # status:  RUNNING  RUNNING  FAILURE
    leaf, log = leaf_of(context, [Running("a"), Running("b"), late], limit_s=1.5)
    assert tick(leaf, clock, 3) == [Status.RUNNING, Status.RUNNING, Status.FAILURE]
    assert leaf.cause is Cause.TIMEOUT
    assert "1.5 s" in leaf.message
    assert log[-1] == "end"


def test_speed_limits_lengthen_the_time_of_a_drive(context, clock, robot, monkeypatch):
    monkeypatch.setattr(robot, "capabilities", spot_capabilities, raising=False)
    corners = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
    hall = Zone("hall", ZoneKind.SPEED_LIMIT, corners, share=0.5)
    leaf, _ = leaf_of(
        dataclasses.replace(context, zones=(hall,)), [Running("a"), Running("b"), Succeeded("there")], limit_s=1.5
    )
    assert tick(leaf, clock, 3)[-1] is Status.SUCCESS


def test_a_late_failure_keeps_its_own_cause(context, clock):
    leaf, _ = leaf_of(context, [Running("a"), Failed(Cause.EXECUTION, "slipped")], limit_s=0.5)
    assert tick(leaf, clock, 2) == [Status.RUNNING, Status.FAILURE]
    assert leaf.cause is Cause.EXECUTION


def test_exception_in_step_is_an_error_with_its_traceback_in_the_log(context, clock, published):
    leaf, log = leaf_of(context, [ValueError("bad sum")])
    assert tick(leaf, clock) == [Status.FAILURE]
    assert (leaf.cause, leaf.message) == (Cause.ERROR, "listed raised ValueError: bad sum")
    assert log[-1] == "end"
    topic, message = published[-1]
    assert topic == "errors"
    assert "ValueError: bad sum" in message["traceback"]


def test_exception_in_begin_is_an_error_and_the_skill_is_ended(context, clock):
    leaf, log = leaf_of(context, [], begin_raises=True)
    assert tick(leaf, clock) == [Status.FAILURE]
    assert leaf.cause is Cause.ERROR
    assert log == ["begin 0", "end"]


def test_exception_in_end_turns_success_into_an_error(context, clock):
    leaf, _ = leaf_of(context, [Succeeded("done")], end_raises=True)
    assert tick(leaf, clock) == [Status.FAILURE]
    assert (leaf.cause, leaf.message) == (Cause.ERROR, "listed raised RuntimeError: no end")


@pytest.mark.parametrize("garbage", [None, True, Status.SUCCESS, "done"])
def test_a_step_that_is_no_step_is_refused(context, clock, garbage):
    leaf, log = leaf_of(context, [garbage])
    assert tick(leaf, clock) == [Status.FAILURE]
    assert leaf.cause is Cause.ERROR
    assert log[-1] == "end"


def test_interruption_ends_the_skill_once_and_says_what_it_was_doing(context, clock):
    leaf, log = leaf_of(context, [Running("driving")] * 5)
    tick(leaf, clock)
    leaf.stop(Status.INVALID)
    assert (leaf.status, leaf.cause, leaf.message) == (Status.INVALID, Cause.CANCELLED, "stopped while: driving")
    leaf.stop(Status.INVALID)
    assert log.count("end") == 1


def test_reset_of_a_finished_leaf_forgets_without_ending_again(context, clock):
    leaf, log = leaf_of(context, [Failed(Cause.PLANNING, "no")])
    tick(leaf, clock)
    leaf.stop(Status.INVALID)
    assert (leaf.cause, leaf.message, log.count("end")) == (None, "", 1)


def test_each_attempt_gets_a_new_skill(context, clock):
    leaf, log = leaf_of(context, [Failed(Cause.EXECUTION, "first step again")])
    assert tick(leaf, clock, 2) == [Status.FAILURE, Status.FAILURE]
    assert log == ["begin 0", "step", "end"] * 2


def test_inputs_come_from_constants_and_the_board(context, clock):
    context.board.put("alice/test/n", 42)
    for binding, expected in ((Constant(7), "begin 7"), (FromBoard("alice/test/n"), "begin 42")):
        leaf, log = leaf_of(context, [Succeeded("")], inputs={"number": binding})
        tick(leaf, clock)
        assert log[0] == expected


def test_an_input_that_nobody_wrote_is_an_error(context, clock):
    leaf, log = leaf_of(context, [], inputs={"number": FromBoard("alice/test/absent")})
    assert tick(leaf, clock) == [Status.FAILURE]
    assert "alice/test/absent" in leaf.message
    assert log == []


def test_outputs_go_to_the_board(context, clock):
    step = Succeeded("done", {"count": 3})
    leaf, _ = leaf_of(context, [step], outputs={"count": "alice/test/count"}, declared={"count": int})
    tick(leaf, clock)
    assert context.board.get("alice/test/count") == 3


@pytest.mark.parametrize("given", [{}, {"count": "three"}])
def test_missing_or_wrongly_typed_outputs_are_an_error(context, clock, given):
    leaf, _ = leaf_of(context, [Succeeded("done", given)], outputs={"count": "alice/c"}, declared={"count": int})
    assert tick(leaf, clock) == [Status.FAILURE]
    assert leaf.cause is Cause.ERROR
    assert "alice/c" not in context.board


def test_keyboard_interrupt_is_not_swallowed(context, clock):
    leaf, _ = leaf_of(context, [KeyboardInterrupt()])
    with pytest.raises(KeyboardInterrupt):
        tick(leaf, clock)
    assert leaf.active
    leaf.abandon()
    assert not leaf.active


@pytest.mark.parametrize(
    "defect", [SystemExit(3), BaseException("gone"), type("Ends", (KeyboardInterrupt,), {})("now")]
)
def test_a_skill_that_raises_what_is_no_exception_fails_with_its_name(context, clock, defect):
    leaf, _ = leaf_of(context, [defect])
    assert tick(leaf, clock) == [Status.FAILURE]
    assert (leaf.cause, leaf.message) == (Cause.ERROR, f"listed raised {type(defect).__name__}: {defect}")


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


@pytest.mark.parametrize("last", [Succeeded("stowed"), Failed(Cause.PLANNING, "no way")])
def test_an_arm_that_may_be_anywhere_is_brought_in_before_the_skill_begins(armed, clock, last):
    calls: list[str] = []
    leaf, log = leaf_of(armed, [Succeeded("gone")], first=(stow_of(calls, Running("stowing"), last),))
    assert tick(leaf, clock, 2) == [Status.RUNNING] * 2
    assert (calls, log) == (["begin stow", "end stow"], ["begin 0"])
    assert tick(leaf, clock) == [Status.SUCCESS]


NO_WAY = Failed(Cause.PLANNING, "no way")


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
    calls: list[str] = []
    first = (
        stow_of(calls, stow),
        stow_of(calls, back, called="back_off", part=Part.BASE),
        stow_of(calls, Succeeded("stowed"), called="stow again"),
    )
    leaf, log = leaf_of(armed, [Succeeded("gone")], first=first)
    assert tick(leaf, clock, len(begun) + 1)[-1] == Status.SUCCESS
    assert calls == [f"{when} {each}" for each in begun for when in ("begin", "end")]
    assert log[0] == "begin 0"


def test_an_arm_that_is_where_it_is_to_be_stays_there(armed, clock):
    armed.arm_order.anywhere = False
    calls: list[str] = []
    leaf, _ = leaf_of(armed, [Succeeded("gone")], first=(stow_of(calls),))
    assert tick(leaf, clock) == [Status.SUCCESS]
    assert calls == []


def test_a_halt_while_the_arm_is_brought_in_ends_that(armed, clock):
    calls: list[str] = []
    leaf, log = leaf_of(armed, [], first=(stow_of(calls, *[Running("stowing")] * 9),))
    tick(leaf, clock, 2)
    leaf.stop(Status.INVALID)
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
    tick(leaf, clock)
    assert context.arm_order.anywhere is anywhere


def test_a_halted_skill_that_uses_the_arm_may_leave_it_anywhere(context, clock):
    leaf, _ = leaf_of(context, [Running("reaching")] * 3)
    tick(leaf, clock)
    leaf.stop(Status.INVALID)
    assert context.arm_order.anywhere
