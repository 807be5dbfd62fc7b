"""Placement of objects in the flat for the seeds 0 to 50."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from pydrake.math import RollPitchYaw

from executive.words.mission import Route
from plant.models.catalogue import load_catalogue
from plant.models.person_figure import Spot
from plant.worlds.seeding import outline_W, place_objects, place_people, polygon_distance, standing_W
from plant.worlds.world import PersonRule, WorldError, load_world
from skills.robot import Pose2D

SEEDS = range(51)
TOOLS = ("hammer", "cube", "extinguisher", "wrench", "screwdriver", "cylinder")
HOME = {"coke": "kitchen", "beer": "kitchen", **dict.fromkeys(TOOLS, "workshop")}


@pytest.fixture(scope="module")
def world():
    return load_world("flat")


@pytest.fixture(scope="module")
def placed(world):
    return {seed: place_objects(world, seed) for seed in SEEDS}


def outline(placement):
    pose = Pose2D.from_transform(placement.X_WO)
    return outline_W(placement.form, (pose.x_m, pose.y_m), pose.yaw_rad)


@pytest.fixture
def things(placed):
    return [*itertools.chain(*placed.values())]


def test_each_thing_lies_in_its_room(world, placed):
    rooms = [{each.name: world.surface_places[each.surface or ""] for each in seeded} for seeded in placed.values()]
    assert rooms == [HOME] * len(SEEDS)


def test_each_thing_starts_a_millimetre_above_its_surface(world, things):
    for thing in things:
        rests_m = world.surfaces[thing.surface or ""].height_m + thing.form.rest_height_m
        assert thing.X_WO.translation()[2] - rests_m == pytest.approx(0.001)
        assert thing.X_WO.rotation().matrix()[2, 2] == pytest.approx(1.0)


def test_each_thing_lies_within_reach_of_a_front_edge(world, things):
    for thing in things:
        depths, centre = [], thing.X_WO.translation()[:2]
        for a, b in np.array(world.seed_rules.fronts[thing.surface or ""]):
            along = (b - a) / np.linalg.norm(b - a)
            if 0 <= (centre - a) @ along <= np.linalg.norm(b - a):
                depths.append(abs(along[0] * (centre - a)[1] - along[1] * (centre - a)[0]))
        assert 0.08 - 1e-9 <= min(depths) <= 0.25 + 1e-9


def test_outlines_stay_on_the_surface(world, things):
    for thing in things:
        corners = np.array(world.surfaces[thing.surface or ""].polygon_W)
        assert np.all((corners.min(axis=0) <= outline(thing)) & (outline(thing) <= corners.max(axis=0)))


def test_things_keep_clear_of_each_other_and_of_fixtures(world, placed):
    for things in placed.values():
        outlines = [outline(thing) for thing in things]
        pairs = list(itertools.combinations(outlines, 2))
        pairs += [(o, np.array(p)) for o in outlines for p in world.seed_rules.keep_clear]
        assert min(polygon_distance(a, b) for a, b in pairs) >= 0.12 - 1e-9


def test_every_allowed_surface_is_used(world, things):
    used = {(thing.name, thing.surface) for thing in things}
    assert used == {(rule.name, surface) for rule in world.seed_rules.objects for surface in rule.surfaces}


def test_every_form_of_a_class_is_used(things):
    used = {(thing.class_name, thing.form.file) for thing in things}
    forms = {(name, form.file) for name, entry in load_catalogue().items() for form in entry.forms.values()}
    assert used == {pair for pair in forms if pair[0] != "person"}


def test_poses_differ_between_seeds_and_not_within_one(world, placed):
    assert len({tuple(things[0].X_WO.translation()) for things in placed.values()}) == len(SEEDS)
    for first, second in zip(placed[7], place_objects(world, 7), strict=True):
        assert first.X_WO.IsExactlyEqualTo(second.X_WO)


def test_the_person_stands_before_the_robot_and_looks_at_it(world):
    for seed in SEEDS:
        (robin,) = place_people(world, seed)
        x, y, z = robin.X_WO.translation() - [world.start.x_m, world.start.y_m, 0.0]
        assert (0.9 <= math.hypot(x, y) <= 1.3, z) == (True, 0.0)
        assert robin.X_WO.rotation().matrix()[:2, 0] @ [x, y] / math.hypot(x, y) < -0.9


def test_a_person_with_a_pose_stands_and_faces_as_it_says_and_walks_from_there(world):
    kim = PersonRule(name="Kim", pose=Spot(x=4.0, y=4.4, yaw=1.0))
    walks = kim.model_copy(update={"name": "Noor", "route": Route(waypoints=("kitchen",))})
    moved = dataclasses.replace(world, seed_rules=world.seed_rules.model_copy(update={"people": (kim, walks)}))
    stands, sets_off = place_people(moved, 3)
    assert stands.X_WO.translation() == pytest.approx([4.0, 4.4, 0.0])
    assert RollPitchYaw(stands.X_WO.rotation()).yaw_angle() == pytest.approx(1.0)
    assert (stands.route, sets_off.route.stops[0].at_W) == (None, (4.0, 4.4))


def test_the_seed_chooses_one_of_a_persons_poses(world):
    kim = PersonRule(name="Kim", poses=(Spot(x=4.0, y=4.4, yaw=1.0), Spot(x=3.0, y=4.4, yaw=0.0)))
    moved = dataclasses.replace(world, seed_rules=world.seed_rules.model_copy(update={"people": (kim,)}))
    chosen = [float(place_people(moved, seed)[0].X_WO.translation()[0]) for seed in range(12)]
    assert {*chosen} == {3.0, 4.0}
    assert sorted(standing_W(moved, kim)) == [(3.0, 4.4), (4.0, 4.4)]


@pytest.mark.parametrize(
    ("count", "change", "message"),
    [(60, {}, "coke finds no free spot on kitchen"), (1, {"model": "sofa"}, "no model 'sofa'; there are beer, coke")],
)
def test_things_that_do_not_fit_or_have_no_model_are_refused(world, count, change, message):
    rule = world.seed_rules.objects[0].model_copy(update=change)
    wrong = world.seed_rules.model_copy(update={"objects": (rule,) * count})
    with pytest.raises(WorldError, match=message):
        place_objects(dataclasses.replace(world, seed_rules=wrong), 1)


def test_polygon_distance_is_zero_for_overlap_and_the_gap_otherwise():
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    others = [square + [0.5, 0.5], square * 0.2 + 0.4, square + [1.3, 0.2], square + [1.3, 1.4]]
    assert [polygon_distance(square, other) for other in others] == [0.0, 0.0, pytest.approx(0.3), pytest.approx(0.5)]
