"""People: who it is, where they are, greeting each once, and what is said when nobody confirms it."""

import math
from dataclasses import replace

import pytest

from errand_people.nodes import PlaceOf
from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.tree.board import Board, Constant
from executive.tree.compiler import compile_mission
from executive.tree.registry import installed_skills
from executive.words.command import parse_command
from executive.words.goal import GoalKind
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
from skills.api import Cause, Failed, ObjectKind, ObjectObservation, Succeeded
from skills.robot import Pose2D
from tests.visitors import OnTick

TO_ROBIN = "Take [Nothing] to [Robin] and do [Nothing] to [Nothing]"
GREET = "Take [Nothing] to [hall] and do [greet] to [some person]"
TAKEN = "somebody at (1.00, 0.00) in the hall, taken for Robin"
POST = Cause.POSTCONDITION
ROOMS = {"hall": (0.0, 0.0), "kitchen": (4.0, 0.0), "bedroom": (-4.0, 0.0), "bathroom": (0.5, 4.0)}


def person_at(x, y, room):
    return ObjectObservation(0.0, ObjectKind("person"), (x, y, 0.8), (0.5, 0.5, 1.7), 0.0, 0.9, room)


@pytest.fixture
def control():
    return Control(pace=None)


@pytest.fixture
def there(script, robot):
    """People by name, at the places where a scripted look finds them; the robot is where it last drove."""
    people = {}

    def look(skill):
        inputs = skill.inputs
        avoided = [each.position_W[:2] for each in inputs.avoid]
        seen = [
            person_at(x, y, inputs.place)
            for x, y, room in people.values()
            if room == inputs.place and all(math.dist((x, y), each) > 0.9 for each in avoided)
        ]
        if not seen:
            return Failed(Cause.POSTCONDITION, f"nobody is seen in the {inputs.place} from here")
        return Succeeded("saw somebody", {"observation": seen[0], "observations": tuple(seen), "unexplained": ()})

    def meet(skill):
        x, y = skill.inputs.place_W
        near = [(px, py, room) for px, py, room in people.values() if math.dist((px, py), (x, y)) < 1.0]
        if not near:
            return Failed(Cause.POSTCONDITION, "nobody is there any more")
        px, py, room = near[0]
        robot.standing = Pose2D(px - 1.0, py, 0.0)
        return Succeeded("beside them", {"person": person_at(px, py, room)})

    def drive(skill):
        robot.standing = skill.inputs.goal
        return Succeeded("there")

    script.ends |= {"find_people": look, "meet_person": meet, "navigate": drive}
    return people


@pytest.fixture
def asked(control, there, robot):
    """Lets the person beside the robot answer "Are you ...?"; returns the list of the questions."""
    questions = []

    def answer(*_):
        for each in control.state.questions:
            questions.append(each.question.text)
            here = (robot.standing.x_m + 1.0, robot.standing.y_m)
            name = next(name for name, (x, y, _) in there.items() if math.dist((x, y), here) < 0.5)
            if name != "mute":
                control.answer(each.question.id, "yes" if each.question.text == f"Are you {name}?" else "no")

    return questions, OnTick(answer)


@pytest.fixture
def result_of(compiled, run_tree, control, asked):
    def run(*texts):
        _, answers = asked
        long = {"time_limit_s": 1e4}
        return run_tree(compiled(*texts), control=control, visitors=[answers], settings=long).robots[0]

    return run


TO_BEDROOM = "Take [Nothing] to [Robin at bedroom] and do [Nothing] to [Nothing]"
ELSEWHERE, HERE = {"Maya": (4.0, 1.0, "kitchen")}, {"Sam": (1.0, 0.0, "hall")}


# who is where; outcome, cause, sentence (its beginning), questions
@pytest.mark.parametrize(
    ("people", "cause", "says", "count"),
    [
        ({**HERE, "Robin": (-1.0, 1.0, "hall")}, None, "somebody at (-1.00, 1.00) in the hall is Robin", 2),
        ({"Robin": (4.0, 1.0, "kitchen")}, None, "somebody at (4.00, 1.00) in the kitchen is Robin", 1),
        ({**HERE, **ELSEWHERE}, POST, "Robin is not found: somebody at (1.00, 0.00) in the hall is not Robin", 2),
        ({"mute": (1.0, 0.0, "hall")}, None, f"{TAKEN}, which nobody confirmed", None),
        ({"mute": (4.0, 1.0, "kitchen")}, POST, "", None),  # not taken for Robin elsewhere
    ],
)
def test_robot_asks_each_person_until_one_is_meant_and_says_who_it_is(
    result_of, there, asked, people, cause, says, count
):
    there |= people
    result = result_of(TO_ROBIN)
    assert (result.outcome is Outcome.SUCCESS, result.cause) == (cause is None, cause)
    assert result.message.startswith(says)
    assert set(asked[0]) == {"Are you Robin?"}
    assert count is None or len(asked[0]) == count


def test_a_person_who_is_not_in_the_usual_room_is_looked_for_in_the_nearest_others_first(result_of, there, script):
    there["Robin"] = (-4.5, 0.0, "bedroom")
    drives = []
    drive = script.ends["navigate"]
    script.ends["navigate"] = lambda skill: (
        drives.append((skill.inputs.goal.x_m, skill.inputs.goal.y_m)) or drive(skill)
    )
    assert result_of(TO_ROBIN).outcome is Outcome.SUCCESS
    assert drives[0] == ROOMS["hall"]
    assert drives[-1] == ROOMS["bedroom"]
    assert len(drives) == len(set(drives))


def test_robot_looks_from_the_door_where_somebody_stands_at_the_rooms_pose(result_of, there, script, robot):
    there["Robin"] = (4.0, 1.0, "kitchen")
    drive = script.ends["navigate"]

    def blocked(skill):
        if (skill.inputs.goal.x_m, skill.inputs.goal.y_m) != ROOMS["kitchen"]:
            return drive(skill)
        robot.standing = Pose2D(3.4, 0.0, 0.0)
        return Failed(Cause.PLANNING, "the goal is blocked")

    script.ends["navigate"] = blocked
    assert result_of(TO_ROBIN).outcome is Outcome.SUCCESS
    assert script.begun.count("clear_costmap") == 0


def test_a_room_that_cannot_be_reached_is_the_cause(result_of, there, script):
    script.ends["navigate"] = lambda skill: Failed(Cause.PLANNING, "the door is closed")
    result = result_of("Take [Nothing] to [kitchen] and do [greet] to [some person]")
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.PLANNING)


@pytest.mark.parametrize(("guests", "questions"), [({}, []), ({"guest": (-0.5, 0.0, "hall")}, ["Are you Robin?"])])
def test_the_only_known_person_is_asked_only_where_several_people_are_seen(
    result_of, there, asked, knowledge, guests, questions
):
    del knowledge.people["Sam"]
    there |= {**guests, "Robin": (1.0, 0.0, "hall")}
    assert result_of(TO_ROBIN).outcome is Outcome.SUCCESS
    assert asked[0][:1] == questions


def test_a_person_who_was_met_is_followed_without_a_second_search(result_of, there, script, asked):
    there["Robin"] = (4.0, 1.0, "kitchen")
    assert result_of(TO_ROBIN, "Take [Nothing] to [Nothing] and do [follow] to [Robin]").outcome is Outcome.SUCCESS
    assert (script.begun.count("follow_person"), len(asked[0])) == (1, 1)


@pytest.mark.parametrize(
    ("texts", "says"),
    [
        ([TO_BEDROOM], "Robin is not in the bedroom: nobody"),
        (
            [TO_ROBIN, TO_BEDROOM],
            "Robin is not in the bedroom",
        ),
    ],
)
def test_a_person_at_a_place_is_met_there_alone_and_else_last_seen_elsewhere(result_of, there, texts, says):
    there["Robin"] = (4.0, 1.0, "kitchen")
    result = result_of(*texts)
    assert (result.outcome, result.cause) == (Outcome.FAILURE, POST)
    assert result.message.startswith(says)
    assert ("Robin was last seen at (4.00, 1.00) in the kitchen" in result.message) == (len(texts) == 2)


def test_robot_that_reached_no_room_does_not_deny_that_the_person_is_there(result_of, script):
    script.ends["navigate"] = lambda skill: Failed(Cause.PLANNING, "the way is blocked")
    result = result_of(TO_BEDROOM)
    assert result.message.startswith("could not look for Robin in the bedroom: ")
    assert "the way is blocked" in result.message


def test_a_person_who_left_is_looked_for_again(result_of, there, script):
    there["Robin"] = (4.0, 1.0, "kitchen")
    leave = lambda skill: there.update(Robin=(0.0, 0.0, "hall")) or Succeeded("said")  # noqa: E731
    script.ends["guide_person"] = leave
    guide = "Take [Nothing] to [kitchen] and do [guide] to [Robin]"
    assert result_of(guide, TO_ROBIN).outcome is Outcome.SUCCESS
    assert script.begun.count("find_people") == 3


def test_a_drink_is_brought_to_where_the_person_was_met(result_of, there, script, robot):
    there["Robin"] = (4.0, 1.0, "kitchen")
    given = []

    def give(skill):
        given.append((robot.standing.x_m, robot.standing.y_m))
        skill.context.robot._robot.holding = False
        return Succeeded("given", {"released_W": (0.0, 0.0, 0.9)})

    script.ends["hand_over"] = give
    get = "Take [Nothing] to [kitchen] and do [grasp] to [drink]"
    result = result_of(TO_ROBIN, get, "Take [drink] to [Robin] and do [Nothing] to [Nothing]")
    assert result.outcome is Outcome.SUCCESS, result.message
    assert given == [(3.0, 1.0)]


def test_each_person_in_the_room_is_greeted_once(result_of, there, script):
    there |= {"Sam": (1.0, 0.0, "hall"), "Robin": (-0.5, 1.0, "hall"), "Maya": (4.0, 0.0, "kitchen")}
    result = result_of(GREET)
    assert (result.outcome, result.message) == (Outcome.SUCCESS, "greeted 2 people in the hall")
    assert script.begun.count("speak") == 2


def test_robot_moves_to_see_the_whole_room_before_it_claims_to_have_greeted_all(compiled):
    tree = compiled(GREET)
    looks = [node for node in tree.mission.walk() if node.name == "find_people"]
    assert [look.options["inputs"]["moves"] for look in looks] == [Constant(True)]


def test_a_robot_that_saw_too_little_of_the_room_does_not_claim_to_have_greeted_all(result_of, there, script):
    there["Sam"] = (1.0, 0.0, "hall")
    look, hidden = script.ends["find_people"], Failed(Cause.EXECUTION, "60% of it was never in view")
    script.ends["find_people"] = lambda skill: hidden if script.begun.count("speak") else look(skill)
    result = result_of(GREET)
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.EXECUTION)
    assert script.begun.count("speak") == 1


def test_greeting_an_empty_room_fails_and_says_so(result_of, there, script):
    result = result_of(GREET)
    assert (result.outcome, result.message) == (Outcome.FAILURE, "nobody is seen in the hall from here")
    assert "speak" not in script.begun


def test_a_person_who_cannot_be_reached_is_not_claimed_to_be_greeted(result_of, there, script):
    there |= {"Sam": (1.0, 0.0, "hall"), "Robin": (-1.0, 1.0, "hall")}
    meet = script.ends["meet_person"]
    blocked = Failed(Cause.PLANNING, "there is no free place to stand")
    script.ends["meet_person"] = lambda skill: blocked if skill.inputs.place_W == (1.0, 0.0) else meet(skill)
    result = result_of(GREET)
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.POSTCONDITION)
    assert "no free place" in result.message
    assert script.begun.count("speak") == 1


def test_a_port_may_be_the_place_of_a_person(make):
    board = Board("alice")
    board.put("alice/person", replace(make.COKE, position_W=(4.0, 5.0, 0.9)))
    assert PlaceOf("alice/person").read(board) == (4.0, 5.0)


def test_the_speaker_is_followed_and_guided_without_a_search(compiled):
    for task in ("follow", "guide"):
        tree = compiled(f"Take [Nothing] to [kitchen] and do [{task}] to [speaker]")
        (leaf,) = [node for node in tree.mission.walk() if node.kind == "skill"]
        assert leaf.name == f"{task}_person"
        assert "place_W" not in leaf.options["inputs"]


def test_following_ends_in_the_room_of_the_goal(compiled, knowledge):
    tree = compiled("Take [Nothing] to [counter] and do [follow] to [Robin]")
    (leaf,) = [node for node in tree.mission.walk() if node.name == "follow_person"]
    assert leaf.options["inputs"]["until_W"] == Constant(knowledge.rooms["kitchen"])


@pytest.mark.parametrize(
    ("text", "kind", "person", "regions"),
    [
        (TO_ROBIN, GoalKind.MET, "Robin", []),
        ("Take [Nothing] to [kitchen] and do [follow] to [Robin]", GoalKind.OWN, "Robin", ["kitchen"]),
        ("Take [Nothing] to [Nothing] and do [follow] to [speaker]", GoalKind.OWN, None, []),
        ("Take [Nothing] to [counter] and do [guide] to [Robin]", GoalKind.OWN, "Robin", ["kitchen"]),
        (GREET, GoalKind.OWN, None, ["hall"]),
    ],
)
def test_the_goal_condition_of_a_command_about_people(compiled, text, kind, person, regions):
    (part,) = compiled(text).parts
    assert (part.goal.kind, part.goal.person) == (kind, person)
    assert [region.name for region in part.goal.goal] == regions


GIVE = "Take [coke] to [Robin] and do [Nothing] to [Nothing]"


# steps before the hand-over -> what the skill is told of having met the person
@pytest.mark.parametrize(("before", "met"), [((), None), ((TO_ROBIN,), Constant(True))])
def test_a_hand_over_is_told_that_the_person_was_met_before(knowledge, before, met):
    steps = tuple(Do.from_command(parse_command(text)) for text in (*before, GIVE))
    mission = Mission(name="give", robot="Alice", steps=steps)
    tree = compile_mission(mission, knowledge=knowledge, registry=installed_skills())
    (give,) = (node for node in tree.root.walk() if node.name == "hand_over")
    assert give.options["inputs"].get("met") == met


# where Sam usually is -> what a hand-over to Robin in the hall is told of having met him
@pytest.mark.parametrize(("at", "met"), [("bedroom", None), ("hall", Constant(True))])
def test_a_hand_over_where_several_known_people_are_begins_with_a_question(knowledge, at, met):
    people = {**knowledge.people, "Sam": knowledge.people["Sam"].model_copy(update={"at": at})}
    knowledge = knowledge.model_copy(update={"people": people})
    mission = Mission(name="give", robot="Alice", steps=(Do.from_command(parse_command(GIVE)),))
    tree = compile_mission(mission, knowledge=knowledge, registry=installed_skills())
    (give,) = (node for node in tree.root.walk() if node.name == "hand_over")
    asks = any(node.kind == "who is it" for node in tree.root.walk())
    assert (give.options["inputs"].get("met"), asks) == (met, met is not None)
