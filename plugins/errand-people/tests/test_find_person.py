"""The find_person skill: who fits, who does not, who is not seen well enough, and what it says."""

import math

from planar_people import person_at
from planar_robot import TWO_ROOMS, Bench

from errand_people.find_person import FindPerson, FindPersonInputs
from errand_people.looks import Appearance, Colour, Gesture, LookedAt, Pose
from skills.api import Cause, Failed, Succeeded
from skills.robot import Pose2D

START = Pose2D(3.2, 5.4, 0.0)
AREA_W = ((1.0, 4.3), (9.5, 4.3), (9.5, 6.5), (1.0, 6.5))
KIM_W, LEE_W = (5.6, 5.4), (7.4, 5.2)
STANDS, SITS = Appearance(Pose.STANDING, Gesture.NONE), Appearance(Pose.SITTING, Gesture.WAVING)


class ScriptedSearch(FindPerson):
    """Skill that finds the people who are given by their places, and sees their appearances (None: nobody)."""

    def __init__(self, context, people):
        super().__init__(context)
        self.people, self.looked_W = people, []

    def _look_round(self, inputs):
        yield from self.pause(0.1, "looking round")
        return list(self.people)

    def _look_from_here(self, place_W, who):
        yield from self.pause(0.1, f"looking at {who}")
        self.looked_W.append(place_W)
        shown = self.people[min(self.people, key=lambda each: math.dist(each, place_W))]
        return None if shown is None else LookedAt(shown, place_W, self.context.clock.now())


def search(people, **inputs):
    """Runs the skill among people; returns its last step, and the skill."""
    bench = Bench(START, unmapped=[person_at(*each) for each in people], surveyed=TWO_ROOMS, cameras=False)
    bench.tick(10)
    skill = ScriptedSearch(bench.context(), people)
    return bench.run(skill, FindPersonInputs(AREA_W, "corridor", **inputs), limit_s=200.0), skill


def test_the_person_who_fits_is_found_and_the_others_are_left():
    step, _ = search({KIM_W: STANDS, LEE_W: SITS}, pose=Pose.SITTING)
    assert isinstance(step, Succeeded), step
    assert step.message == "1 in the corridor is sitting"
    assert math.dist(step.outputs["person"].position_W[:2], LEE_W) < 0.1


def test_a_search_for_one_ends_with_the_first_who_fits():
    step, skill = search({KIM_W: SITS, LEE_W: SITS}, gesture=Gesture.WAVING)
    assert len(step.outputs["people"]) == len(skill.looked_W) == 1


def test_all_who_fit_are_counted():
    step, _ = search({KIM_W: STANDS, LEE_W: STANDS}, pose=Pose.STANDING, count=0)
    assert (step.message, len(step.outputs["people"])) == ("2 in the corridor is standing", 2)


def test_nobody_who_fits_is_a_failure_that_says_who_is_there():
    step, _ = search({KIM_W: STANDS}, clothes_colour=Colour.RED, pose=Pose.LYING)
    said = "nobody in the corridor is lying, dressed in red; the kind of clothing is not told apart"
    assert step == Failed(Cause.POSTCONDITION, f"{said}; others are standing, making no gesture")


def test_somebody_who_is_not_seen_well_enough_is_no_proof_that_nobody_fits():
    step, _ = search({KIM_W: Appearance(Pose.STANDING)}, gesture=Gesture.WAVING)
    assert step == Failed(Cause.EXECUTION, "nobody in the corridor is waving, but the gesture of somebody is not sure")


def test_people_who_do_not_count_are_not_looked_at():
    first, _ = search({KIM_W: SITS}, pose=Pose.SITTING)
    step, skill = search({KIM_W: SITS}, pose=Pose.SITTING, avoid=(first.outputs["person"],))
    assert (step.cause, skill.looked_W) == (Cause.POSTCONDITION, [])
