"""Control of a run: pause, step, breakpoints, preemption, stop button, lost lease, questions, cancel."""

import threading
import time
from dataclasses import replace

import pytest
from py_trees.common import Status

from executive.run.control import Control
from executive.run.control_state import Mode
from executive.run.guarded_robot import GuardedRobot
from executive.run.outcome import Outcome
from executive.run.visitor import RunVisitor
from executive.run.watchdog import Watchdog
from skills.api import Cause, Failed, Question, Running, Succeeded, nobody_speaks, nobody_to_ask
from skills.robot import Lease, Pose2D

GRASP = "alice/fetch-drink/1-kitchen/grasp"
GO = "Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]"


@pytest.fixture
def control():
    return Control(pace=None)


@pytest.fixture
def notes(published):
    return lambda: [(m["what"], m["message"]) for topic, m in published if topic == "control"]


@pytest.fixture
def fetch(compiled, run_tree, make, control):
    """Runs the fetch mission, which succeeds; `observe` is called after each tick, or `actions` are done at ticks."""

    def run(observe=None, actions=None, **options):
        observe = observe or at_ticks(actions or {})
        result = run_tree(compiled(*make.FETCH), control=control, observer=observe, **options)
        assert result.outcome is Outcome.SUCCESS, result.worst.message
        return result

    return run


@pytest.fixture
def answers(script):
    """The answers to a question that the skill that navigates asks, until it is answered."""
    said = []

    def ask(skill):
        skill.asked = getattr(skill, "asked", None) or skill.context.ask(QUESTION)
        if not skill.asked.done():
            return Running("waiting for an answer")
        said.append(skill.asked.result())
        return Succeeded("asked")

    script.ends["navigate"] = ask
    return said


@pytest.fixture
def goals(script, robot):
    """Where the robot has gone; it then stands there."""
    gone = []

    def go(skill):
        gone.append((skill.inputs.goal.x_m, skill.inputs.goal.y_m))
        robot.standing = Pose2D(*gone[-1], 0.0)
        return Succeeded("there")

    script.ends["navigate"] = go
    return gone


def at_ticks(actions):
    """An observer that does something after given ticks."""
    left = dict(actions)

    def observe(progress):
        if progress.ticks in left:
            left.pop(progress.ticks)()

    return observe


def test_a_paused_robot_stands_still_and_everything_keeps_its_place(fetch, control, robot, script):
    seen = []

    def observe(progress):
        if progress.ticks == 8:
            control.pause("somebody walks by")
        if 9 <= progress.ticks < 30:
            seen.append((robot.driving, progress.states["Alice"], control.state.mode, control.state.reason))
        if progress.ticks == 30:
            control.resume()

    fetch(observe)
    assert {(driving, mode, reason) for driving, _, mode, reason in seen} == {(False, Mode.PAUSED, "somebody walks by")}
    assert all(states == seen[0][1] for _, states, _, _ in seen)
    assert script.begun == ["navigate", "detect", "approach", "grasp", "grasp", "stow", "navigate", "hand_over"]


def test_a_pause_before_the_run_begins_lets_nothing_move(fetch, control, robot):
    control.pause()
    fetch(actions={5: lambda: robot.calls.append("5 ticks"), 6: control.resume})
    assert robot.calls[: robot.calls.index("5 ticks")] == ["stop"]


def test_a_step_goes_to_the_next_change_and_holds_again(fetch, control):
    changes = []

    def observe(progress):
        if control.state.mode is Mode.PAUSED and progress.ticks > 1 and len(changes) < 3:
            changes.append([k for k, s in progress.states["Alice"].items() if s.status is Status.SUCCESS])
            control.step()
        elif len(changes) == 3:
            control.resume()

    control.pause()
    fetch(observe)
    counts = [len(done) for done in changes]
    assert counts == sorted(counts)
    assert counts[-1] > counts[0]


def test_a_step_of_ticks_is_as_long(compiled, run_tree, control, script):
    script.steps = 5
    begun = []
    control.pause()
    actions = {2: lambda: control.step(3), 10: lambda: begun.extend(script.begun), 11: control.resume}
    result = run_tree(compiled(GO), control=control, observer=at_ticks(actions))
    assert (result.outcome, begun, script.begun) == (Outcome.SUCCESS, ["navigate"], ["navigate", "navigate"])
    with pytest.raises(ValueError, match="at least 1"):
        control.step(0)


def test_at_a_breakpoint_the_node_has_not_begun(fetch, control, robot, script, notes):
    begun, held = [], []

    def observe(progress):
        if control.state.at == GRASP:
            begun.append(list(script.begun))
            held.append((robot.driving, progress.states["Alice"][GRASP].message))
            if len(begun) == 4:
                control.resume()

    control.set_breakpoint(GRASP)
    fetch(observe)
    assert begun == [["navigate", "detect", "approach"]] * 4
    assert held[1:] == [(False, "waits at the breakpoint")] * 3
    assert script.begun == ["navigate", "detect", "approach", "grasp", "stow", "navigate", "hand_over"]
    assert ("breakpoint", f"at the breakpoint {GRASP}") in notes()


def test_a_breakpoint_holds_each_time_until_it_is_cleared(compiled, run_tree, make, control, script):
    script.ends["grasp"] = lambda skill: Failed(Cause.EXECUTION, "slipped")
    stops = []

    def observe(progress):
        if control.state.at is not None:
            stops.append(script.begun.count("grasp"))
            if len(stops) == 2:
                control.clear_breakpoint(GRASP)
            control.resume()

    control.set_breakpoint(GRASP)
    run_tree(compiled(*make.FETCH), control=control, observer=observe)
    assert (stops, script.begun.count("grasp")) == ([0, 1], 3)


def test_a_breakpoint_at_a_composite_and_cancel_there(compiled, run_tree, make, control, robot, script):
    path_id = "alice/fetch-drink/2-start"
    control.set_breakpoint(path_id)

    def observe(progress):
        if control.state.at == path_id:
            control.cancel("no further")

    result = run_tree(compiled(*make.FETCH), control=control, observer=observe)
    assert (result.outcome, script.begun[-1]) == (Outcome.CANCELLED, "stow")
    assert (robot.driving, robot.holder) == (False, None)


def test_a_breakpoint_nowhere_is_refused_with_what_was_meant(compiled, run_tree, make):
    early = Control()
    early.set_breakpoint("alice/fetch-drink/1-kitchen/grap")
    with pytest.raises(ValueError, match=f"did you mean '{GRASP}'"):
        run_tree(compiled(*make.FETCH), control=early)
    late = Control()
    late.begin({"Alice": compiled(*make.FETCH)})
    with pytest.raises(ValueError, match=f"did you mean '{GRASP}'"):
        late.set_breakpoint("alice/fetch-drink/1-kitchen/grap")


def test_a_preempting_mission_runs_first_and_the_old_one_continues(fetch, compiled, control, script, published, robot):
    other = compiled(GO, name="go aside")
    result = fetch(actions={5: lambda: control.preempt(other)})
    first, aside = ["navigate", "detect", "approach"], ["navigate"]
    assert script.begun == [*first, *aside, "approach", "grasp", "stow", "navigate", "hand_over"]
    outcomes = [(m.get("mission"), m["outcome"]) for topic, m in published if topic == "outcome"]
    assert outcomes == [("go aside", Outcome.SUCCESS), (None, Outcome.SUCCESS)]
    assert [done.tree.mission_name for done in result.worst.preempting] == ["go aside"]
    assert result.worst.preempting[0].states["alice/go-aside"].status is Status.SUCCESS
    assert (robot.driving, robot.holder) == (False, None)


def test_missions_under_way_are_shown_the_present_one_last(compiled, run_tree, make, control):
    seen = []

    def observe(progress):
        if progress.ticks == 4:
            control.preempt(compiled(GO, name="go aside"))
        stack = control.state.missions["Alice"]
        if not seen or seen[-1] != (stack, progress.trees["Alice"].mission_name):
            seen.append((stack, progress.trees["Alice"].mission_name))
        assert all(path_id in progress.states["Alice"] for path_id in progress.trees["Alice"].path_ids)

    run_tree(compiled(*make.FETCH), control=control, observer=observe)
    both = ("fetch drink", "go aside")
    assert seen == [(("fetch drink",), "fetch drink"), (both, "go aside"), (("fetch drink",), "fetch drink")]


def test_a_mission_for_nobody_or_under_way_already_is_refused(compiled, make, control):
    tree = compiled(*make.FETCH)
    control.begin({"Alice": tree})
    with pytest.raises(ValueError, match="under way already"):
        control.preempt(tree)
    with pytest.raises(ValueError, match=r"'Bob' is not in this run; there are: Alice"):
        control.preempt(replace(tree, robot_name="Bob"))


def test_nothing_moves_while_the_stop_button_is_pressed(fetch, compiled, control, robot):
    driven = []

    def observe(progress):
        if progress.ticks == 3:
            control.stop_button("a hand in the way")
        if progress.ticks == 6:
            control.resume()
            control.step()
            control.preempt(compiled(GO, name="go aside"))
        if 3 < progress.ticks < 20:
            driven.append(robot.driving)
            assert (control.state.mode, control.state.reason) == (Mode.STOPPED, "a hand in the way")
        if progress.ticks == 20:
            control.release_stop_button()
        if progress.ticks == 25:
            control.resume()

    fetch(observe)
    assert not any(driven)


def test_a_lost_lease_suspends_until_it_is_free_again(fetch, control, robot, notes):
    modes = []

    def observe(progress):
        if progress.ticks in (4, 30):
            robot.holder = "tablet" if progress.ticks == 4 else None
        if 4 < progress.ticks <= 30:
            modes.append((control.state.mode, robot.driving))

    fetch(observe)
    assert set(modes) == {(Mode.LEASE_LOST, False)}
    assert notes() == [("lease lost", "tablet holds the lease of Alice"), ("lease back", "Alice has its lease again")]
    assert robot.holder is None


def test_skills_use_one_token_for_whatever_lease_the_run_has(compiled, run_tree, make, control, robot):
    shown = []
    drive = robot.drive
    robot.drive = lambda *v, until_s, lease: (
        shown.append((lease, robot.lease)),
        drive(*v, until_s=until_s, lease=lease),
    )[1]
    actions = {4: lambda: setattr(robot, "holder", "tablet"), 9: lambda: setattr(robot, "lease", None)}
    assert run_tree(compiled(*make.FETCH), control=control, observer=at_ticks(actions)).outcome is Outcome.SUCCESS
    assert all(lease == counts for lease, counts in shown)
    assert len({lease.number for lease, _ in shown}) == 2


QUESTION = Question("alice/fetch/ask", "Go on?", ("retry", "skip"), "skip", 2.0)


def test_a_question_waits_for_its_answer(control, clock):
    asked = control.ask(QUESTION, clock)
    assert not asked.done()
    assert [(q.id, q.options, q.until_s) for q in control.state.questions] == [(QUESTION.id, QUESTION.options, 2.0)]
    with pytest.raises(RuntimeError):
        asked.result()
    control.answer(QUESTION.id, "retry")
    assert (asked.done(), asked.result(), control.state.questions) == (True, "retry", ())


def test_nobody_answers_and_the_default_counts(control, clock):
    asked = control.ask(QUESTION, clock)
    clock.advance(2.0)
    assert (asked.done(), asked.result(), control.state.questions) == (True, "skip", ())
    events = control.poll().events
    assert [event.what for event in events] == ["question", "question closed"]


def test_words_spoken_to_the_robot_reach_it_even_if_they_are_none_of_the_choices(control, clock):
    asked = control.ask(QUESTION, clock)
    control.answer(QUESTION.id, "maybe", spoken=True)
    assert asked.result() == "maybe"


def test_wrong_answers_and_late_ones_are_refused(control, clock):
    asked = control.ask(QUESTION, clock)
    with pytest.raises(ValueError, match="choose one of: retry, skip"):
        control.answer(QUESTION.id, "maybe")
    with pytest.raises(ValueError, match="open already"):
        control.ask(QUESTION, clock)
    asked.withdraw()
    asked.withdraw()
    closed = control.poll().events[-1]
    assert f"{closed.what}: {closed.message}" == f"question closed: {QUESTION.id}: the robot no longer asks it"
    with pytest.raises(ValueError, match="not open"):
        control.answer(QUESTION.id, "retry")
    with pytest.raises(ValueError, match="none of"):
        Question("q", "?", ("a",), "b", 1.0)
    assert nobody_to_ask(QUESTION).result() == "skip"


# What is done at which tick: a pause does not count against the time of a question.
ANSWERED = [
    lambda control: {20: lambda: control.answer(QUESTION.id, "retry")},
    lambda control: {10: control.pause, 200: control.resume, 215: lambda: control.answer(QUESTION.id, "retry")},
]


@pytest.mark.parametrize("actions", ANSWERED)
def test_a_skill_asks_the_operator_while_running(compiled, run_tree, control, answers, actions):
    result = run_tree(compiled(GO), control=control, observer=at_ticks(actions(control)))
    assert (result.outcome, answers) == (Outcome.SUCCESS, ["retry"])


def test_a_remark_ends_a_skill_that_waits_for_one(compiled, run_tree, control, script):
    said = []

    def follow(skill):
        skill.heard = getattr(skill, "heard", None) or skill.context.listen()
        if not skill.heard.done():
            return Running("following")
        said.append(skill.heard.result())
        return Succeeded("told to end")

    told = {5: lambda: control.tell("thank you", robot="Bob"), 20: lambda: control.tell("stop", robot="Alice")}
    script.ends["navigate"] = follow
    result = run_tree(compiled(GO), control=control, observer=at_ticks(told))
    assert (result.outcome, said, control.tell("stop")) == (Outcome.SUCCESS, ["stop"], False)


def test_a_remark_is_heard_once_and_not_by_a_skill_that_has_ended(control):
    ended, first = control.listen("Alice"), control.listen("Alice")
    ended.withdraw()
    assert (control.tell("that's it"), control.tell("stop")) == (True, False)
    assert (ended.done(), first.result()) == (False, "that's it")
    with pytest.raises(RuntimeError):
        ended.result()


def test_nobody_speaks_where_a_skill_runs_without_a_control():
    remark = nobody_speaks()
    remark.withdraw()
    assert not remark.done()


def test_another_thread_pauses_waits_and_goes_on(compiled, run_tree, script):
    control = Control(pace=20.0)
    script.steps = 40
    modes = []

    def operator():
        control.pause()
        state = control.wait(control.state.version, timeout_s=5.0) if not control.state.missions else control.state
        modes.append(state.mode)
        control.resume()

    thread = threading.Thread(target=operator)
    thread.start()
    result = run_tree(compiled(GO), control=control)
    thread.join()
    assert result.outcome is Outcome.SUCCESS
    assert modes == [Mode.PAUSED]


def test_waiting_ends_with_a_change_or_with_its_time(control):
    version = control.state.version
    assert control.wait(version, timeout_s=0.01).version == version
    control.pause()
    assert control.wait(version, timeout_s=5.0).version > version


def test_simulated_time_does_not_run_ahead_of_the_people_while_held(compiled, run_tree):
    control = Control(pace=2.0)
    control.pause()
    walls = []

    def observe(progress):
        walls.append(time.perf_counter())
        if progress.ticks == 5:
            control.resume()

    run_tree(compiled(GO), control=control, observer=observe)
    assert walls[4] - walls[0] >= 4 * 0.05 / 2.0 * 0.9


def test_a_control_controls_one_run_only(compiled, run_tree, control):
    run_tree(compiled(GO), control=control)
    with pytest.raises(ValueError, match="one run only"):
        run_tree(compiled(GO), control=control)


def test_an_untouched_control_changes_no_log(compiled, run_tree, make, robot, clock, published):
    logs = []
    for hands in (None, Control()):
        clock._now_s, robot.lease, robot.holding = 0.0, None, False
        published.clear()
        run_tree(compiled(*make.FETCH), control=hands)
        logs.append([(topic, repr(data)) for topic, data in published if topic != "wall"])
    assert logs[0] == logs[1]


def test_a_lease_of_another_program_is_passed_on_unchanged(robot):
    guarded = GuardedRobot(robot, Watchdog())
    token, foreign, shown = guarded.claim("errand"), Lease("Alice", "tablet", 99), []
    robot.stop = lambda *, lease, only: shown.append(lease) or 1
    guarded.stop(lease=foreign)
    robot.lease = None
    guarded.regain_lease()
    guarded.stop(lease=token)
    assert shown == [foreign, robot.lease]
    assert token != robot.lease


def test_a_mission_can_take_the_place_of_the_one_under_way(compiled, run_tree, make, control, script, notes):
    other = compiled(GO, name="go to the bedroom")
    result = run_tree(compiled(*make.FETCH), control=control, observer=at_ticks({4: lambda: control.replace(other)}))
    assert (result.outcome, result.worst.tree.mission_name) == (Outcome.SUCCESS, "go to the bedroom")
    assert (result.trees, script.begun) == ({"Alice": other}, ["navigate", "detect", "navigate"])
    assert script.ended == script.begun
    (given_up,) = result.worst.preempting
    assert (given_up.tree.mission_name, given_up.outcome) == ("fetch drink", Outcome.CANCELLED)
    assert "given up" in given_up.message
    assert ("replace", "instead 'go to the bedroom'") in notes()
    assert control.state.missions == {"Alice": ()}


class Notebook(RunVisitor):
    """Keeps what each tick brought of the robot's mission."""

    def __init__(self):
        self.notes = []

    def tick(self, progress):
        self.notes += progress.notes.values()

    @property
    def missions(self):
        return [note.tree.mission_name for note in self.notes]


def test_notes_describe_the_mission_that_took_the_place_of_another(compiled, run_tree, make, control):
    other, notebook = compiled(GO, name="go to the bedroom"), Notebook()
    actions = {4: lambda: control.replace(other)}
    run_tree(compiled(*make.FETCH), control=control, observer=at_ticks(actions), visitors=[notebook])
    assert notebook.missions == ["fetch drink"] * 4 + ["go to the bedroom"] * (len(notebook.notes) - 4)
    assert len(notebook.notes) > 4


def test_notes_have_the_charge_with_each_change_and_once_a_second(compiled, run_tree, make, robot):
    notebook, robot.charge = Notebook(), 0.5
    run_tree(compiled(*make.FETCH), visitors=[notebook])
    assert all(note.charge is not None for note in notebook.notes if note.changes)
    charges = [note.charge for note in notebook.notes if note.charge is not None]
    assert 0 < len(charges) < len(notebook.notes)
    assert all(0.4 < charge <= 0.5 for charge in charges)


def test_notes_leave_out_missions_that_come_in_between(compiled, run_tree, make, control):
    between, other, notebook = compiled(GO, name="between"), compiled(GO, name="other"), Notebook()
    actions = {2: lambda: control.preempt(between), 4: lambda: control.replace(other)}
    run_tree(compiled(*make.FETCH), control=control, observer=at_ticks(actions), visitors=[notebook])
    assert set(notebook.missions) == {"fetch drink"}
    assert {change.path_id.split("/")[1] for note in notebook.notes for change in note.changes} == {"fetch-drink"}


def test_missions_for_later_come_in_their_order(compiled, run_tree, control):
    first, second = compiled(GO, name="first"), compiled(GO, name="second")
    control.then(first)
    control.then(second)
    result = run_tree(compiled(GO), control=control)
    assert [each.tree.mission_name for each in result.worst.preempting] == ["first", "second"]


def test_a_mission_for_later_is_refused_when_it_waits_already(compiled, control):
    control.then(compiled(GO, name="first"))
    with pytest.raises(ValueError, match="under way already"):
        control.then(compiled(GO, name="first"))


def test_a_robot_that_is_not_in_the_run_gets_no_mission(compiled, control):
    control.begin({"Bob": compiled(GO)})
    for give in (control.replace, control.then, control.preempt):
        with pytest.raises(ValueError, match="not in this run"):
            give(compiled(GO, name="other"))


def test_an_observer_sees_where_the_robot_is_and_what_it_holds(compiled, run_tree, make, control):
    robots = []
    run_tree(compiled(*make.FETCH), control=control, observer=lambda progress: robots.append(progress.robots["Alice"]))
    assert (robots[0].pose.x_m, robots[0].pose.y_m, robots[0].holding) == (0.0, 0.0, False)
    assert robots[-1].holding


COME_BACK = "Take [Nothing] to [start] and do [Nothing] to [Nothing]"


@pytest.mark.parametrize("give", ["replace", "then"])
def test_a_mission_in_place_of_another_or_after_it_comes_back_to_the_same_start(
    compiled, run_tree, make, control, goals, give
):
    other = compiled(COME_BACK, name="come back")
    run_tree(compiled(*make.FETCH), control=control, observer=at_ticks({12: lambda: getattr(control, give)(other)}))
    assert (goals[0] != (0.0, 0.0), goals[-1]) == (True, (0.0, 0.0))


def test_a_mission_that_comes_first_begins_where_the_robot_stands(compiled, run_tree, make, control, goals):
    other = compiled(COME_BACK, name="come back")
    run_tree(compiled(*make.FETCH), control=control, observer=at_ticks({8: lambda: control.preempt(other)}))
    assert goals[1] == goals[0] != (0.0, 0.0)
