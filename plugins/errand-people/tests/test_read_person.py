"""The read_person skill: what it tells, when it goes to another side, and when it fails."""

from types import SimpleNamespace

import pytest
from planar_people import person_at
from planar_robot import TWO_ROOMS, Bench

from errand_people.looks import Appearance, Colour, Gesture, LookedAt, Pose, Trait
from errand_people.read_person import ReadPerson, ReadPersonInputs
from skills.api import Cause, Failed, Succeeded
from skills.robot import Pose2D

START, KIM_W = Pose2D(3.2, 5.4, 0.0), (5.6, 5.4)
POSES, WAVES = Appearance(Pose.SITTING), Appearance(Pose.SITTING, Gesture.WAVING)


class ScriptedLooks(ReadPerson):
    """Skill whose looks show appearances in turn (None: nobody); notes from where it looks."""

    def __init__(self, context, shown):
        super().__init__(context)
        self.shown, self.from_W = list(shown), []

    def _look_from_here(self, place_W, who):
        yield from self.pause(0.1, f"looking at {who}")
        self.from_W.append(self.context.pose())
        shown = self.shown.pop(0)
        return None if shown is None else LookedAt(shown, place_W, self.context.clock.now())


def read(shown, traits=(Trait.POSE, Trait.GESTURE), place_W=KIM_W):
    """Runs the skill before a person; returns its last step, and the skill."""
    bench = Bench(START, unmapped=(person_at(*KIM_W),), surveyed=TWO_ROOMS, cameras=False)
    bench.tick(10)
    skill = ScriptedLooks(bench.context(), shown)
    step = bench.run(skill, ReadPersonInputs("Kim", place_W, "corridor", traits))
    return SimpleNamespace(step=step, skill=skill)


def test_robot_tells_what_one_look_shows_without_driving():
    done = read([WAVES])
    assert isinstance(done.step, Succeeded), done.step
    assert done.step.message == "Kim is sitting, waving"
    assert {"pose": "sitting", "gesture": "waving", "clothes_colour": ""}.items() <= done.step.outputs.items()
    assert done.step.outputs["person"].surface == "corridor"
    assert len(done.skill.from_W) == 1


def test_an_unsure_trait_leads_to_a_look_from_another_side():
    done = read([POSES, WAVES])
    assert isinstance(done.step, Succeeded), done.step
    first, second = done.skill.from_W
    assert abs(first.y_m - second.y_m) > 0.5 or abs(first.x_m - second.x_m) > 1.0


def test_looks_that_do_not_agree_are_an_honest_failure():
    done = read([Appearance(Pose.STANDING), POSES, Appearance()], traits=(Trait.POSE, Trait.GESTURE))
    assert (type(done.step), done.step.cause) == (Failed, Cause.POSTCONDITION)
    assert done.step.message.startswith("the pose and gesture of Kim is not sure")


def test_an_answer_tells_what_is_known_beside_what_is_not_sure():
    done = read([POSES, POSES, POSES])
    assert done.step.message == "the gesture of Kim is not sure; Kim is sitting"
    assert done.step.outputs["pose"] == "sitting"


def test_the_answer_on_clothes_says_that_their_kind_is_not_told_apart():
    done = read([Appearance(Pose.STANDING, None, Colour.RED)], traits=(Trait.CLOTHES_COLOUR,))
    assert done.step.message == "Kim is dressed in red; the kind of clothing is not told apart"


def test_nobody_there_is_a_failure():
    done = read([None, None, None])
    assert done.step == Failed(Cause.POSTCONDITION, "nobody is seen at (5.60, 5.40)")


@pytest.mark.parametrize("shown", [[WAVES]])
def test_without_a_place_the_robot_meets_the_nearest_person_ahead(shown):
    done = read([*shown, *shown], place_W=None)
    assert isinstance(done.step, Succeeded), done.step
