"""Scenes: objects rest stably where they are, nothing overlaps, training and validation share nothing."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import shapely
from pydrake.geometry import Box
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial import ConvexHull

from errand_train.dataset.compose import compose
from errand_train.dataset.degrade import Degradation, degrade
from errand_train.dataset.objects import instance
from errand_train.dataset.render import is_validation
from errand_train.dataset.resting import choose_pose, resting_poses
from errand_train.dataset.room import random_room
from errand_train.dataset.textures import ROLES, numbers, texture
from errand_train.dataset.views import any_view, camera_specs


@pytest.fixture(autouse=True, scope="module")
def cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ERRAND_MODEL_CACHE", str(tmp_path_factory.mktemp("models")))
        yield


@pytest.mark.parametrize("category", ["hammer", "screwdriver", "wrench", "beer", "cube", "extinguisher", "kettle"])
def test_an_object_rests_on_three_points_under_its_centre_of_mass(category):
    model = instance(category, 1)
    for pose in resting_poses(model):
        points = model.surface.points @ pose.R.T
        np.testing.assert_allclose(pose.R @ pose.R.T, np.eye(3), atol=1e-9)
        assert points[:, 2].min() + pose.height_m == pytest.approx(0.0, abs=1e-6)
        low = points[points[:, 2] < points[:, 2].min() + 6e-4][:, :2]
        com = (pose.R @ np.array(model.com_m))[:2]
        assert len(low) >= 3
        assert np.all(low.min(axis=0) <= com)
        assert np.all(com <= low.max(axis=0))


def test_a_bottle_stands_or_lies_and_a_person_only_stands():
    bottle, rng = instance("beer", 0), np.random.default_rng(1)
    upright = [choose_pose(rng, bottle, resting_poses(bottle)).upright for _ in range(60)]
    assert 0.5 < np.mean(upright) < 0.9


def test_things_to_learn_from_lie_more_often_than_is_usual_and_people_do_not():
    # Of 400 by chance: an extinguisher stands 0.9 of the time, toppled 0.675.
    thing, person, rng = instance("extinguisher", 0), instance("person", 48), np.random.default_rng(1)
    standing = [choose_pose(rng, thing, resting_poses(thing), toppled=True).upright for _ in range(400)]
    assert np.mean(standing) == pytest.approx(0.675, abs=0.06)
    assert all(choose_pose(rng, person, resting_poses(person), toppled=True).upright for _ in range(60))


@pytest.mark.parametrize("category", ["cube", "cylinder", "coke"])
def test_an_object_in_a_stable_pose_stays_there_in_drake(category):
    model = instance(category, 1)
    pose = resting_poses(model)[0]
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(time_step=0.004, discrete_contact_approximation="sap")
    plant, _ = AddMultibodyPlant(config, builder)
    plant.RegisterCollisionGeometry(
        plant.world_body(), RigidTransform([0, 0, -0.5]), Box(4, 4, 1), "floor", CoulombFriction(0.8, 0.8)
    )
    Parser(plant).AddModels(str(model.path))
    body = plant.GetBodyByName(category)
    X_WO = RigidTransform([0, 0, pose.height_m + 0.0005])
    plant.SetDefaultFloatingBaseBodyPose(body, X_WO)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.8)
    X_WE = body.EvalPoseInWorld(plant.GetMyContextFromRoot(simulator.get_context()))
    assert float(X_WE.rotation().matrix()[2, 2]) > 0.99
    np.testing.assert_allclose(X_WE.translation(), X_WO.translation(), atol=0.006)


def test_rooms_for_validation_share_no_texture_with_those_for_training():
    assert not set(numbers(for_training=True)) & set(numbers(for_training=False))
    for seed in range(3):
        for training in (True, False):
            room = random_room(np.random.default_rng(seed), for_training=training)
            assert {number for _, number in room.textures} <= set(numbers(for_training=training))


def test_a_sixth_of_the_scenes_is_for_validation():
    assert sum(is_validation(index) for index in range(60)) == 10


@pytest.mark.parametrize("role", ROLES)
def test_a_texture_is_the_same_for_its_number_and_another_for_another(role):
    assert np.array_equal(texture(role, 3), texture(role, 3))
    assert not np.array_equal(texture(role, 3), texture(role, 4))
    assert texture(role, 3).std() >= 0.0


def test_supports_lie_inside_the_room_and_obstacles_do_not_overlap():
    for seed in range(4):
        room = random_room(np.random.default_rng(seed), for_training=True)
        width, depth, _ = room.size_m
        for support in room.supports:
            assert -0.01 <= support.centre[0] <= width + 0.01
            assert -0.01 <= support.centre[1] <= depth + 0.01
            assert 0.0 <= support.height_m < 2.2


def test_cameras_are_in_the_room_and_out_of_furniture():
    rng = np.random.default_rng(5)
    room = random_room(rng, for_training=True)
    for _ in range(20):
        eye = any_view(rng, room, camera_specs()).X_WC.translation()
        assert np.all(eye[:2] > 0)
        assert np.all(eye[:2] < room.size_m[:2])


def test_a_degraded_picture_keeps_its_size_and_grey_has_one_channel(tmp_path):
    clean = np.full((48, 64, 3), 90, dtype=np.uint8)
    how = Degradation.draw(np.random.default_rng(2))
    assert degrade(clean, how, np.random.default_rng(0), grey=False).shape == (48, 64, 3)
    assert degrade(clean, how, np.random.default_rng(0), grey=True).shape == (48, 64)


def test_degrading_is_the_same_for_the_same_seed():
    clean = np.random.default_rng(1).integers(0, 255, (48, 64, 3)).astype(np.uint8)
    how = Degradation.draw(np.random.default_rng(2))
    first, second = (degrade(clean, how, np.random.default_rng(0), grey=False) for _ in range(2))
    assert np.array_equal(first, second)


def test_a_validation_scene_has_only_held_out_instances_without_overlap(few_models):
    scene = compose(np.random.default_rng(3), 5, for_training=False)
    assert any(thing.model.class_id for thing in scene.objects)
    assert all(thing.model.held_out for thing in scene.objects)
    outlines = [(*thing_outline(thing), thing.model.name) for thing in scene.objects]
    for k, (low, points, name) in enumerate(outlines):
        for other_low, other_points, other in outlines[:k]:
            if abs(low - other_low) < 0.2:
                assert shapely.Polygon(points).distance(shapely.Polygon(other_points)) > 0.0, (name, other)


def thing_outline(thing):
    """Lowest height, and the outline from above."""
    points = np.asarray(thing.X_WO @ thing.model.surface.points.T).T
    return float(points[:, 2].min()), points[ConvexHull(points[:, :2]).vertices, :2]


def test_every_tenth_scene_holds_distractors_only(few_models):
    scene = compose(np.random.default_rng(3), 9, for_training=True)
    assert scene.objects
    assert all(thing.model.class_id == 0 for thing in scene.objects)
    assert scene.held is None or scene.held.model.class_id == 0


# scene            mugs of others among its distractors
# for training     some
# for validation   none
@pytest.mark.parametrize("for_training", [True, False])
def test_models_of_others_lie_about_in_scenes_to_train_on_alone(few_models, for_training):
    other = replace(instance("mug", 3), kind="of others")
    scene = compose(np.random.default_rng(3), 4, for_training=for_training, others=[other])
    assert any(thing.model == other for thing in scene.objects) is for_training


def test_a_crowded_scene_holds_more_than_the_same_one_without(monkeypatch):
    monkeypatch.setattr("errand_train.dataset.compose.DISTRACTORS", ("mug",))
    monkeypatch.setattr(
        "errand_train.dataset.compose._any_instance", lambda _rng, name, _for_training: instance(name, 0)
    )
    held = dict[bool, Counter[str]]()
    for share in (0.0, 1.0):
        monkeypatch.setattr("errand_train.dataset.compose.CROWDED_SHARE", share)
        scene = compose(np.random.default_rng(3), 0, for_training=True)
        held[scene.crowded] = Counter(thing.model.category for thing in scene.objects)
    assert sum(held[True].values()) > 1.5 * sum(held[False].values())
    assert set(held[True]) >= {"beer", "coke", "hammer", "screwdriver", "wrench", "cylinder", "cube", "mug"}
    assert held[True]["person"] <= 1
