"""Shipped missions: each compiles for its world and runs to its end with scripted skills."""

import pytest

from executive.mission.load import load_mission, mission_of_robot
from executive.mission.resolve import mission_from_file
from executive.run.outcome import Outcome
from executive.tree.compiler import compile_mission
from skills.api import Cause, Failed, Succeeded

NAMES = (
    "beer_else_coke", "charge_then_go", "check_hammer", "clear_table", "count_drinks", "deliver", "fetch_drink",
    "find_hammer", "go_living_room", "go_to_pose", "greet_and_ask", "guarded_delivery", "guarded_round",
    "guide_robin", "hammer_to_kitchen", "inspection_round", "look_and_approach", "patrol", "patrol_and_report",
    "retry_elsewhere", "speak_while_driving", "take_beer_to_bedroom", "tea_or_coffee", "tidy_cube", "tidy_table",
    "timed_visit", "two_drinks", "two_robots", "visit_room", "wait_for_button", "watch_the_door", "welcome",
)  # fmt: skip
SURFACES_WITH_THINGS = ("kitchen counter", "kitchen table", "workbench", "tool trolley")


def test_all_missions_are_named_here(missions):
    assert tuple(path.stem for path in missions) == NAMES


@pytest.fixture
def run_mission(parser, knowledge_in, skills, run_tree, script, missions, make):
    """Runs a mission file with scripted skills that have the real skills' ports."""

    def put_down(skill):
        skill.context.robot._robot.holding = False
        return Succeeded("put down", {"released_W": (0.0, 0.0, 0.9)})

    def hold(skill):
        skill.context.robot._robot.holding = True
        return Succeeded("held", dict.fromkeys(skills["grasp"].outputs, ()))

    def look(skill):
        if skill.inputs.classes == ("thing",) and script.begun.count("place") == 2:
            return Failed(Cause.POSTCONDITION, "nothing is left")
        return make.default_end(script, "detect")(skill)

    def charge(skill):
        skill.context.robot._robot.charge = skill.inputs.level
        return Succeeded("charged")

    def somebody(skill):
        found = skill.inputs.avoid == ()
        seen = {"observation": make.COKE, "observations": (make.COKE,), "unexplained": ()}
        return Succeeded("seen", seen) if found else Failed(Cause.POSTCONDITION, "nobody else is there")

    def scripted(name, skill):
        made = make.scripted_skill(script, name, skill.Inputs, skill.outputs)
        made.uses = skill.uses
        return made

    script.seen_on = SURFACES_WITH_THINGS
    script.ends |= {"place": put_down, "grasp": hold, "detect": look, "charge": charge, "find_people": somebody}
    script.ends["meet_person"] = lambda skill: Succeeded("beside them", {"person": make.COKE})
    script.ends["check_door"] = lambda skill: Succeeded("open", {"open": True, "free_m": 0.9})
    registry = {name: scripted(name, skill) for name, skill in skills.items()}

    def run_file(name, part=None):
        loaded = load_mission(next(path for path in missions if path.stem == name))
        loaded = loaded if part is None else mission_of_robot(loaded, "Alice", part)
        knowledge = knowledge_in(loaded)
        mission = mission_from_file(loaded, parser=parser, knowledge=knowledge)
        tree = compile_mission(mission, knowledge=knowledge, registry=registry)
        return run_tree(tree, settings={"tick_period_s": 0.5}).robots[0]

    return run_file


FOR_SEVERAL = ("two_robots",)
FOR_ONE = tuple(name for name in NAMES if name not in FOR_SEVERAL)


@pytest.mark.parametrize("name", FOR_ONE)
def test_it_compiles_with_the_real_skills(compile_file, missions, name):
    tree = compile_file(next(path for path in missions if path.stem == name))
    assert tree.parts


@pytest.mark.parametrize("name", FOR_ONE)
def test_it_runs_to_success_with_scripted_skills(run_mission, name):
    result = run_mission(name)
    assert result.outcome is Outcome.SUCCESS, result.message


@pytest.mark.parametrize("part", ["alice", "bob"])
def test_a_part_for_one_of_two_robots_runs_to_success(run_mission, part):
    assert run_mission("two_robots", part).outcome is Outcome.SUCCESS


def test_a_look_comes_to_its_end_before_what_it_decides_is_done(run_mission, script):
    run_mission("beer_else_coke")
    assert script.begun.count("grasp") == 1
    assert script.ended == script.begun


def test_a_raw_pose_is_driven_to(run_mission, script):
    assert run_mission("go_to_pose").outcome is Outcome.SUCCESS
    assert script.begun == ["navigate"]


def test_two_drinks_are_fetched_and_put_down_one_after_the_other(run_mission, script):
    run_mission("two_drinks")
    assert [name for name in script.begun if name in ("grasp", "place")] == ["grasp", "place"] * 2


def test_a_table_is_cleared_object_by_object_until_nothing_is_left(run_mission, script):
    run_mission("clear_table")
    assert [name for name in script.begun if name in ("detect", "grasp", "place")] == [
        *(["detect", "grasp", "place"] * 2),
        "detect",
    ]


def test_tidying_a_tidy_table_succeeds(run_mission, script):
    script.ends["detect"] = lambda skill: Failed(Cause.POSTCONDITION, "not seen")
    result = run_mission("tidy_table")
    assert (result.outcome, result.message.count("grasp")) == (Outcome.SUCCESS, 2)


def test_a_mission_of_100_steps_compiles(tmp_path, parser, flat, skills):
    steps = [
        "  - {to: kitchen, do: grasp, object: drink, retries: 1, timeout: 300}",
        "  - {take: drink, to: coffee table, on_failure: skip}",
        "  - say: is there a hammer in the workshop",
        "  - {skill: navigate, with: {x: 5.2, y: 4.5, yaw: 0.0}}",
    ]
    path = tmp_path / "m.yaml"
    path.write_text("name: long\nsteps:\n" + "\n".join(steps * 25) + "\n")
    mission = mission_from_file(path, parser=parser, knowledge=flat)
    tree = compile_mission(mission, knowledge=flat, registry=skills)
    assert len(tree.commands) == 75
