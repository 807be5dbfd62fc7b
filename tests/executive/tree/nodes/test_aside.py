"""What stands in the way is moved aside where the mission allows it, with scripted skills."""

import itertools
from dataclasses import dataclass, replace
from typing import Any

import pytest

from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
from executive.words.step import Policy
from skills.api import Cause, Failed, ObjectKind, ObjectObservation, Succeeded, Surface
from skills.quantities import Coordinate, Length
from skills.robot import Pose2D
from tests.executive.tree.scripted import told

GRASP = parse_command("Take [Nothing] to [kitchen] and do [grasp] to [beer]")
BEER = ObjectObservation(0.0, ObjectKind("beer"), (1.0, 2.0, 0.9), (0.06, 0.06, 0.2), 0.0, 0.9, "counter")
COKE = replace(BEER, kind=ObjectKind("coke"), position_W=(0.9, 2.0, 0.9))
ROUND, TAKEN, MOVED = "detect approach grasp", "approach grasp", "approach grasp stow place navigate"


@dataclass(frozen=True)
class PlaceInputs:
    surface: Surface
    clear_of: tuple[tuple[Coordinate, Coordinate, Length], ...] = ()


@dataclass
class Table:
    """The beer stands behind others; each grasp of one of them may fail with a cause, each put-down with another."""

    blocking: list[ObjectObservation]
    no_grasp: list[Cause | None]
    no_room: list[Cause | None]
    placed: list[Any]

    def grasp(self, skill):
        seen, nothing = skill.inputs.observation, {"tried": (), "in_the_way": ()}
        if seen.kind.name != "beer":
            cause = self.no_grasp.pop(0) if self.no_grasp else None
            if cause is not None:
                return Failed(cause, f"the {seen.kind} is too wide", nothing)
        elif self.blocking:
            why = f"the beer is behind the {self.blocking[0].kind}"
            return Failed(Cause.PLANNING, why, {**nothing, "in_the_way": tuple(self.blocking)})
        skill.context.robot._robot.holding = True
        return Succeeded("held", nothing)

    def place(self, skill):
        self.placed.append(skill.inputs)
        cause = self.no_room.pop(0) if self.no_room else None
        if cause is not None:
            return Failed(cause, "the counter has no spot out of the way")
        skill.context.robot._robot.let_go()
        if skill.inputs.clear_of:
            self.blocking.pop(0)
        return Succeeded("put down")


@pytest.fixture
def table(script):
    made = Table([COKE], [], [], [])
    script.ends |= {"grasp": made.grasp, "place": made.place, "back_off": lambda skill: Succeeded("backed off")}
    script.ends["approach"] = lambda skill: Succeeded("near", {"observation": skill.inputs.observation})
    script.ends["detect"] = lambda skill: Succeeded(
        "seen", {"observation": BEER, "observations": (BEER,), "unexplained": ()}
    )
    return made


@pytest.fixture
def compile_step(knowledge, make, script):
    """Compile a step under a mission's policy, with skills that tell what is in the way."""
    ports = {**make.PORTS, "place": (PlaceInputs, {})}
    grasp_inputs, grasp_outputs = ports["grasp"]
    ports["grasp"] = (grasp_inputs, {**grasp_outputs, "in_the_way": tuple[ObjectObservation, ...]})
    registry = {name: make.scripted_skill(script, name, *each) for name, each in ports.items()}

    def compile_it(own=None, mission=None, registry=registry):
        steps = (Do.from_command(GRASP).with_policy(Policy(move_aside=own)),)
        policy = Policy(move_aside=mission)
        return compile_mission(
            Mission(name="m", robot="Alice", steps=steps).with_policy(policy), knowledge=knowledge, registry=registry
        )

    return compile_it


@pytest.fixture
def play(compile_step, run_tree):
    return lambda own=None, **options: run_tree(compile_step(own), **options).worst


def test_a_blocking_object_is_moved_on_its_surface_and_picking_up_starts_again(play, table, script, published):
    result = play(1)
    assert result.outcome is Outcome.SUCCESS, result.message
    assert " ".join(script.begun) == f"navigate {ROUND} {MOVED} {ROUND} stow"
    assert table.placed[0].surface.name == "counter"
    assert "the coke is in the way of the beer; it is moved aside" in told(published)


def test_it_is_put_clear_of_the_object_and_of_the_way_from_the_robot_to_it(play, table):
    play(1)
    circles = table.placed[0].clear_of
    assert (circles[0], circles[-1]) == ((1.0, 2.0, 0.25), (0.0, 0.0, 0.25))
    steps = [abs(complex(a[0] - b[0], a[1] - b[1])) for a, b in itertools.pairwise(circles)]
    assert max(steps) < 0.25


def test_the_robot_goes_back_to_where_it_stood_since_a_grasp_was_found_from_there(play, script, table, robot):
    goals, usual = [], script.ends["approach"]

    def approaches(skill):
        robot.standing = Pose2D(0.3 if skill.inputs.observation.kind.name == "beer" else 0.5, 0.0, 0.0)
        return usual(skill)

    def goes(skill):
        goals.append(skill.inputs.goal)
        return Succeeded("gone")

    script.ends |= {"approach": approaches, "navigate": goes}
    assert play(1).outcome is Outcome.SUCCESS
    assert goals[1:] == [Pose2D(0.3, 0.0, 0.0)]


def test_a_robot_whose_way_back_is_blocked_goes_on_from_where_it_stands(play, script, table):
    script.ends["navigate"] = lambda skill: (
        Failed(Cause.PLANNING, "blocked") if "place" in script.begun else Succeeded("gone")
    )
    assert play(1).outcome is Outcome.SUCCESS


@pytest.mark.parametrize(("own", "mission", "moved"), [(None, None, 0), (None, 1, 1), (0, 1, 0), (2, None, 1)])
def test_whether_it_is_allowed_is_the_steps_to_say_or_the_missions(
    compile_step, run_tree, table, script, own, mission, moved
):
    result = run_tree(compile_step(own, mission)).worst
    assert len(table.placed) == moved
    assert (result.outcome is Outcome.SUCCESS) == bool(moved)


def test_the_failure_stays_when_moving_objects_is_not_allowed(play, table, script):
    result = play()
    assert (result.cause, result.message) == (Cause.PLANNING, "the beer is behind the coke (after 3 attempts)")
    assert " ".join(script.begun) == f"navigate {ROUND} {ROUND} back_off {ROUND} stow"


# how many may be moved, of two -> how many are, and the sentence
@pytest.mark.parametrize(("own", "moved", "message"), [(1, 1, "the beer is behind the cube"), (2, 2, "")])
def test_as_many_are_moved_one_after_the_other_as_the_mission_allows(play, table, own, moved, message):
    table.blocking.append(replace(COKE, kind=ObjectKind("cube")))
    result = play(own)
    assert (result.outcome is Outcome.SUCCESS, len(table.placed)) == (own == 2, moved)
    assert result.message.startswith(message)


def test_an_object_that_cannot_be_moved_is_left_and_the_end_says_both(play, table, script):
    table.no_grasp = [Cause.PLANNING]
    result = play(1)
    assert result.cause is Cause.PLANNING
    assert result.message == "the beer is behind the coke; move it aside: the coke is too wide"
    assert " ".join(script.begun) == f"navigate {ROUND} {TAKEN} stow"


def test_an_object_that_slips_from_the_grasp_is_taken_once_more(play, table, script):
    table.no_grasp = [Cause.POSTCONDITION]
    assert play(1).outcome is Outcome.SUCCESS
    assert " ".join(script.begun) == f"navigate {ROUND} {TAKEN} {MOVED} {ROUND} stow"


def test_an_object_without_approach_is_taken_from_where_the_robot_stands(play, table, script):
    usual = script.ends["approach"]

    def not_the_coke(skill):
        coke = skill.inputs.observation.kind.name == "coke"
        return Failed(Cause.POSTCONDITION, "not seen again") if coke else usual(skill)

    script.ends["approach"] = not_the_coke
    assert play(1).outcome is Outcome.SUCCESS
    assert " ".join(script.begun) == f"navigate {ROUND} {MOVED} {ROUND} stow"


def test_an_object_without_a_free_spot_is_set_down_again_and_the_end_says_so(play, table, robot):
    table.no_room = [Cause.PLANNING]
    result = play(1)
    assert result.message.startswith("the beer is behind the coke; move it aside: the counter has")
    assert ([bool(each.clear_of) for each in table.placed], robot.holding) == ([True, False], False)


def test_on_the_floor_it_is_put_on_the_floor_about_it(play, table):
    table.blocking = [replace(COKE, surface="floor")]
    assert play(1).outcome is Outcome.SUCCESS
    surface = table.placed[0].surface
    assert (surface.name, surface.height_m) == ("floor", 0.0)
    assert sorted(corner[0] for corner in surface.polygon_W) == pytest.approx([-0.3, -0.3, 2.1, 2.1])


def test_an_object_on_no_known_surface_is_left(play, table):
    table.blocking = [replace(COKE, surface=None)]
    assert play(1).message.endswith("move it aside: it is not known what the coke stands on")
    assert not table.placed


def test_a_failure_to_plan_with_nothing_in_the_way_moves_nothing(play, table, script):
    script.ends["grasp"] = lambda skill: Failed(Cause.PLANNING, "out of reach", {"tried": (), "in_the_way": ()})
    assert play(1).message == "out of reach (after 3 attempts)"
    assert " ".join(script.begun) == f"navigate {ROUND} {ROUND} back_off {ROUND} stow"


def test_skills_that_do_not_tell_what_is_in_the_way_are_not_asked(compile_step, registry):
    tree = compile_step(1, registry=registry)
    assert not [node for node in tree.root.walk() if node.kind == "in the way"]


@pytest.mark.parametrize("index", range(5, 10))
def test_cancelled_at_any_step_of_it_the_skill_ends_and_nothing_more_begins(play, table, script, index):
    control = Control(pace=None)

    def observe(progress):
        if len(script.begun) == index:
            control.cancel()

    result = play(1, observer=observe, control=control)
    assert (result.outcome, result.cause) == (Outcome.CANCELLED, Cause.CANCELLED)
    assert " ".join(script.begun) == " ".join(f"navigate {ROUND} {MOVED}".split()[:index])
    assert script.ended == script.begun
