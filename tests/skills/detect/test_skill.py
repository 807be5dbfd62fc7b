"""The detect skill: results, failures and viewpoints."""

from dataclasses import replace

import numpy as np
import pytest
from scripted_robot import MODEL, Colours, ScriptedRobot, context_of, failed, outcome
from table_scene import BLUE, COKE, GREY, PINK, RED, TABLE, Can

from skills.api import Cause, ObjectKind, ObjectObservation, Succeeded, Surface
from skills.detect.skill import Detect, DetectInputs
from skills.manipulation.stow.skill import Stow, StowInputs

FAR = Surface("shelf", ((8.0, -0.6), (8.4, -0.6), (8.4, 0.6), (8.0, 0.6)), 0.75)
SECOND = Can(1.1, 0.25, 0.033, 0.115, RED)
BEER = Can(1.0, 0.1, 0.03, 0.23, BLUE)


def found(things, inputs, **options):
    """Result and log of a search on a table with objects."""
    log = []
    step = outcome(Detect(context_of(ScriptedRobot(things=things), log, **options)), inputs)
    assert isinstance(step, Succeeded), step
    return step, log


def test_an_unknown_class_is_named():
    skill = Detect(context_of(ScriptedRobot()))
    failed(skill, DetectInputs(("coke", "unicorn"), (TABLE,)), Cause.PRECONDITION, "what unicorn looks like")


def test_an_unknown_attribute_is_named():
    skill = Detect(context_of(ScriptedRobot()))
    failed(skill, DetectInputs(("coke",), (TABLE,), ("shiny",)), Cause.PRECONDITION, "what shiny looks like")


def test_no_surface_is_a_failed_precondition():
    failed(Detect(context_of(ScriptedRobot())), DetectInputs(("coke",), ()), Cause.PRECONDITION, "no surface")


def test_a_surface_out_of_sight_is_a_failed_precondition():
    skill = Detect(context_of(ScriptedRobot()))
    failed(skill, DetectInputs(("coke",), (FAR,)), Cause.PRECONDITION, "the shelf is out of sight")


def test_an_object_is_found_at_its_position_and_seen_from_two_viewpoints():
    step, log = found([COKE], DetectInputs(("coke", "hammer"), (TABLE,)))
    seen = step.outputs["observation"]
    assert (seen.kind.name, seen.surface) == ("coke", "table")
    assert seen.position_W == pytest.approx((COKE.x, COKE.y, 0.8075), abs=0.008)
    assert seen.size_m == pytest.approx((0.066, 0.066, 0.115), abs=0.01)
    topics = [topic for topic, _ in log]
    assert topics.count("detections") == 2
    assert [m["class_name"] for topic, m in log if topic == "object_destination"] == ["coke"]
    (track,) = [m for topic, m in log if topic == "tracks"][-1]["tracks"]
    assert (track["views"], track["class_name"]) == (2, "coke")


def test_an_object_seen_only_once_does_not_count():
    class Flickering(Colours):
        pictures = 0

        def detect(self, pictures):
            object.__setattr__(self, "pictures", self.pictures + 1)
            return super().detect(pictures) if self.pictures == 1 else [()]

    skill = Detect(context_of(ScriptedRobot(things=[COKE]), detector=Flickering()))
    failed(skill, DetectInputs(("coke",), (TABLE,)), Cause.POSTCONDITION, "no coke seen on the table")


def test_an_object_of_another_class_does_not_count():
    skill = Detect(context_of(ScriptedRobot(things=[COKE])))
    failed(skill, DetectInputs(("beer",), (TABLE,)), Cause.POSTCONDITION, "no beer seen")


def test_an_object_beside_the_surface_does_not_count():
    half = replace(TABLE, polygon_W=((0.8, 0.1), (1.4, 0.1), (1.4, 0.6), (0.8, 0.6)))
    skill = Detect(context_of(ScriptedRobot(things=[COKE])))
    failed(skill, DetectInputs(("coke",), (half,)), Cause.POSTCONDITION, "no coke seen")


@pytest.mark.parametrize(("attribute", "colour"), [("red", RED), ("pink", PINK)])
def test_the_object_with_the_attribute_is_chosen(attribute, colour):
    colours = Colours({"coke": RED, "beer": PINK} if colour == RED else {"coke": PINK, "beer": RED})
    things = [COKE, replace(SECOND, colour=PINK)]
    step, _ = found(things, DetectInputs(("coke",), (TABLE,), (attribute,)), detector=colours)
    assert step.outputs["observation"].kind.attributes == (attribute,)


def test_an_object_without_the_attribute_does_not_count():
    skill = Detect(context_of(ScriptedRobot(things=[COKE])))
    failed(skill, DetectInputs(("coke",), (TABLE,), ("blue",)), Cause.POSTCONDITION, "no blue coke seen")


def test_all_objects_are_counted_with_a_count_of_0():
    step, log = found([COKE, SECOND, BEER], DetectInputs(("coke",), (TABLE,), count=0))
    assert step.message == "there are two cokes on the table"
    assert len(step.outputs["observations"]) == 2
    assert sum(topic == "object_destination" for topic, _ in log) == 2


def test_a_result_rests_on_a_fresh_picture():
    robot = ScriptedRobot(things=[COKE])
    step = outcome(Detect(context_of(robot)), DetectInputs(("coke",), (TABLE,), count=0))
    assert isinstance(step, Succeeded), step
    assert robot.now() - step.outputs["observation"].stamp_s < 2.0


class SeenAtAllPicturesBut(Colours):
    """Detector that finds nothing in one of its pictures; counts them."""

    def __init__(self, missed):
        super().__init__()
        object.__setattr__(self, "missed", missed)
        object.__setattr__(self, "pictures", 0)

    def detect(self, pictures):
        object.__setattr__(self, "pictures", self.pictures + 1)
        return [()] if self.pictures == self.missed else super().detect(pictures)


# picture of the run that is not missed    blind at it              looks once more
# the last: a fresh one of what was found  nothing is seen there    from where it was seen before
def test_object_hidden_in_the_fresh_picture_is_viewed_from_its_old_viewpoint():
    asked, seeing = DetectInputs(("coke",), (TABLE,), count=0), SeenAtAllPicturesBut(None)
    found([COKE], asked, detector=seeing)
    missing, robot = SeenAtAllPicturesBut(seeing.pictures), ScriptedRobot(things=[COKE])
    step = outcome(Detect(context_of(robot, detector=missing)), asked)
    assert isinstance(step, Succeeded), step
    assert missing.pictures == seeing.pictures + 1
    assert robot.now() - step.outputs["observation"].stamp_s < 2.0


def test_search_ends_with_the_wanted_number_of_objects():
    step, _ = found([COKE, SECOND], DetectInputs(("coke",), (TABLE,), count=2))
    assert step.message == "there are two cokes on the table"


def test_too_few_objects_fail_with_their_number():
    skill = Detect(context_of(ScriptedRobot(things=[COKE])))
    failed(
        skill,
        DetectInputs(("coke",), (TABLE,), count=3),
        Cause.POSTCONDITION,
        "there is one coke on the table, fewer than 3",
    )


def test_search_without_objects_fails_with_the_shares_seen_and_stows_the_arm():
    robot, log = ScriptedRobot(things=[]), []
    skill = Detect(context_of(robot, log))
    failed(skill, DetectInputs(("coke", "beer"), (TABLE,)), Cause.POSTCONDITION, "no coke or beer seen on the table")
    assert np.allclose(robot.q, MODEL.stowed_rad, atol=1e-6)
    assert next(topic for topic, _ in log) == "object_to_detect"
    assert {topic for topic, _ in log} == {"object_to_detect", "detections", "tracks", "surfaces_seen"}
    (shares,) = [m["surfaces"]["table"] for topic, m in log if topic == "surfaces_seen"]
    assert shares["seen"] > 0.8
    assert sum(shares.values()) == pytest.approx(1.0, abs=0.01)


def test_failure_says_how_much_of_the_surface_is_hidden():
    wall = Can(0.95, 0.0, 0.1, 0.4, GREY)
    log = []
    skill = Detect(context_of(ScriptedRobot(things=[wall]), log))
    failed(skill, DetectInputs(("coke",), (TABLE,)), Cause.POSTCONDITION, "% hidden")
    assert next(m["surfaces"]["table"]["hidden"] for topic, m in log if topic == "surfaces_seen") > 0.02


def test_hidden_areas_are_viewed_from_the_side():
    wall = Can(1.0, 0.0, 0.06, 0.30, GREY)
    hidden = Can(1.17, 0.0, 0.033, 0.115, RED)
    log = []
    step = outcome(Detect(context_of(ScriptedRobot(things=[wall, hidden]), log)), DetectInputs(("coke",), (TABLE,)))
    seen_in = [bool(m["detections"]) for topic, m in log if topic == "detections"]
    assert not any(seen_in[:2])
    assert isinstance(step, Succeeded), step
    assert step.outputs["observation"].position_W == pytest.approx((hidden.x, hidden.y, 0.8075), abs=0.03)


def test_object_visible_from_one_side_is_confirmed_from_a_viewpoint_beside_it():
    wall = [Can(1.0, y, 0.05, 0.32, GREY) for y in (-0.08, 0.0, 0.08)]
    hidden = Can(1.2, 0.05, 0.033, 0.115, RED)
    log = []
    step = outcome(Detect(context_of(ScriptedRobot(things=[*wall, hidden]), log)), DetectInputs(("coke",), (TABLE,)))
    assert isinstance(step, Succeeded), step
    assert step.outputs["observation"].position_W == pytest.approx((hidden.x, hidden.y, 0.8075), abs=0.03)
    # seen when looked at from the side, hidden from both places between, seen again beside the first one
    assert [bool(m["detections"]) for topic, m in log if topic == "detections"][-4:] == [True, False, False, True]


def test_search_in_the_dark_fails_as_unseen():
    robot = ScriptedRobot()
    failed(Detect(context_of(robot)), DetectInputs(("coke",), (TABLE,)), Cause.EXECUTION, "it is dark")
    assert np.allclose(robot.q, MODEL.stowed_rad, atol=1e-6)


def test_an_object_on_the_floor_counts_only_with_floor():
    bottle = Can(1.0, -0.85, 0.04, 0.25, BLUE, base=0.0)
    inputs = DetectInputs(("beer",), (TABLE,))
    failed(Detect(context_of(ScriptedRobot(things=[bottle]))), inputs, Cause.POSTCONDITION, "no beer seen")
    step, _ = found([bottle], replace(inputs, floor=True))
    assert step.outputs["observation"].surface == "floor"
    assert step.outputs["observation"].position_W == pytest.approx((1.0, -0.85, 0.125), abs=0.03)


def test_with_an_expected_position_only_objects_near_it_count():
    near = DetectInputs(("coke",), (TABLE,), expected_W=(SECOND.x, SECOND.y, 0.8))
    step, _ = found([COKE, SECOND], near)
    assert step.outputs["observation"].position_W[1] == pytest.approx(SECOND.y, abs=0.02)
    skill = Detect(context_of(ScriptedRobot(things=[COKE])))
    failed(skill, replace(near, expected_W=(1.2, 0.5, 0.8)), Cause.POSTCONDITION, "no coke seen")


SEEN_BEFORE = ObjectObservation(
    0.0, ObjectKind("coke"), (COKE.x, COKE.y, 0.8075), (0.066, 0.066, 0.115), 0.0, 0.55, "table"
)


class Blind(Colours):
    """Knows its classes, and sees none."""

    def detect(self, pictures):
        return [() for _ in pictures]


# What stands where a coke was seen, which the network does not know from near; whether it is the coke.
@pytest.mark.parametrize(
    ("thing", "is_it"),
    [(COKE, True), (replace(COKE, y=COKE.y + 0.1), False), (replace(COKE, height=0.23), False), (None, False)],
    ids=["itself", "beside", "taller", "gone"],
)
def test_object_seen_before_is_known_from_near_by_its_place_and_size(thing, is_it):
    again = DetectInputs(("coke",), (TABLE,), expected_W=SEEN_BEFORE.position_W, seen_before=SEEN_BEFORE)
    things = [] if thing is None else [thing]
    step = outcome(Detect(context_of(ScriptedRobot(things=things), detector=Blind())), again)
    assert isinstance(step, Succeeded) == is_it


def test_object_of_another_class_is_not_the_one_seen_before():
    again = DetectInputs(("coke",), (TABLE,), expected_W=SEEN_BEFORE.position_W, seen_before=SEEN_BEFORE)
    blue = replace(COKE, colour=BLUE)
    failed(Detect(context_of(ScriptedRobot(things=[blue]))), again, Cause.POSTCONDITION, "no coke seen")


def test_unlabelled_cluster_is_viewed_from_near():
    class ShortSighted(Colours):
        def detect(self, pictures):
            large = [[d for d in found if d.box[3] - d.box[1] > 75.0] for found in super().detect(pictures)]
            return [tuple(found) for found in large]

    step, log = found([COKE], DetectInputs(("coke",), (TABLE,)), detector=ShortSighted())
    assert step.outputs["observation"].position_W == pytest.approx((COKE.x, COKE.y, 0.8075), abs=0.01)
    seen_in = [bool(m["detections"]) for topic, m in log if topic == "detections"]
    assert not seen_in[0]
    assert seen_in[-1]


def test_object_that_may_be_of_the_wanted_class_is_viewed_from_near():
    class ConfusedFromAfar(Colours):
        def detect(self, pictures):
            return [tuple(self.taken(d) for d in found) for found in super().detect(pictures)]

        def taken(self, one):
            small = one.box[3] - one.box[1] < 75.0
            return replace(one, class_name="beer", score=0.6, alternatives=(("coke", 0.4),)) if small else one

    step, _ = found([COKE], DetectInputs(("coke",), (TABLE,)), detector=ConfusedFromAfar())
    assert step.outputs["observation"].kind.name == "coke"


def test_the_gripper_opens_for_a_view_and_closes_afterwards():
    robot = ScriptedRobot(things=[])
    failed(Detect(context_of(robot)), DetectInputs(("coke",), (TABLE,)), Cause.POSTCONDITION, "no coke")
    assert robot.opening == 0.0


def test_the_same_scene_gives_the_same_log():
    logs = [found([COKE, BEER], DetectInputs(("coke",), (TABLE,)))[1] for _ in range(2)]
    plain = [[(topic, {k: v for k, v in m.items() if k != "image"}) for topic, m in log] for log in logs]
    assert plain[0] == plain[1]


class WithoutGripper(ScriptedRobot):
    """A robot with an arm that carries a camera and no gripper."""

    def capabilities(self):
        return replace(super().capabilities(), gripper=None)


def test_an_arm_without_a_gripper_looks_and_is_stowed():
    robot = WithoutGripper(things=[COKE])
    seen = outcome(Detect(context_of(robot)), DetectInputs(("coke",), (TABLE,)))
    assert isinstance(seen, Succeeded), seen
    assert seen.outputs["observation"].kind.name == "coke"
    assert isinstance(outcome(Stow(context_of(robot)), StowInputs()), Succeeded)
    assert np.allclose(robot.q, MODEL.stowed_rad, atol=0.02)
