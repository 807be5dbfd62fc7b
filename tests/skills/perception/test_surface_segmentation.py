"""Segmentation of surfaces in analytic scenes."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform
from table_scene import BLUE, CAMERA, COKE, GREEN, GREY, RED, TABLE, Can, box_of, scene, seen_as

from skills.api import Detection, LocalisationEstimate, Surface
from skills.perception.detection_3d import detections_3d
from skills.perception.point_cloud import may_rest
from skills.perception.surface_segmentation import (
    matching_cluster,
    segment_surface,
    split_detected,
    touching_parts,
)
from skills.robot import Image

PLACE = LocalisationEstimate(0.0, RigidTransform(), np.zeros((3, 3)), True)


def viewed(image, X_WO=None, surface=TABLE):
    view = segment_surface(image, X_WO or RigidTransform(), surface)
    assert view is not None
    return view


def detected_in(image, name="coke", colour=RED, detection=None):
    """The object of a colour in 3D."""
    (detected,) = detections_3d(image, PLACE, [detection or seen_as(name, image, colour)], [TABLE])
    return detected


def test_a_can_is_one_cluster_at_its_position():
    (cluster,) = viewed(scene([COKE])).clusters
    assert cluster.shape.round
    assert cluster.shape.centre == pytest.approx((0.95, -0.1), abs=0.008)
    assert cluster.shape.length_m == pytest.approx(0.066, abs=0.01)
    assert cluster.shape.height_m == pytest.approx(0.115, abs=0.008)
    assert cluster.base_m == pytest.approx(0.75, abs=0.004)


def test_a_localisation_error_shifts_the_can_as_a_whole():
    (cluster,) = viewed(scene([COKE]), X_WO=RigidTransform([0.02, -0.02, 0.02])).clusters
    assert cluster.shape.centre == pytest.approx((0.97, -0.12), abs=0.008)
    assert cluster.base_m == pytest.approx(0.77, abs=0.004)


def test_the_box_in_the_picture_holds_the_can():
    image = scene([COKE])
    (cluster,) = viewed(image).clusters
    u0, v0, u1, v1 = box_of(image, RED)
    assert cluster.box[:3] == pytest.approx((u0, v0, u1 - 1.0), abs=3)
    assert 0 <= v1 - 1.0 - cluster.box[3] <= 6


def test_the_camera_is_where_the_scene_has_it():
    assert scene([]).frames.pose("hand_camera").translation() == pytest.approx(CAMERA)


def test_two_cans_are_two_clusters():
    image = scene([COKE, Can(1.1, 0.2, 0.033, 0.115, RED)])
    assert sorted(round(cluster.shape.centre[1], 1) for cluster in viewed(image).clusters) == [-0.1, 0.2]


def test_a_gap_of_two_centimetres_divides_two_cans():
    assert len(viewed(scene([COKE, Can(COKE.x, COKE.y + 0.086, 0.033, 0.115, BLUE)])).clusters) == 2


def test_an_empty_table_has_no_clusters():
    assert viewed(scene([])).clusters == ()


def test_more_depth_noise_gives_no_ghosts():
    assert viewed(scene([], noise_m=0.006)).clusters == ()


def test_a_surface_out_of_the_picture_is_not_judged():
    away = Surface("shelf", ((-3.0, -0.5), (-2.0, -0.5), (-2.0, 0.5), (-3.0, 0.5)), 0.75)
    assert segment_surface(scene([COKE]), RigidTransform(), away) is None


def test_a_grey_picture_has_clusters_without_colour():
    (cluster,) = viewed(Image(**{**scene([COKE]).__dict__, "colour": None})).clusters
    assert np.ptp(cluster.points.colours, axis=1).max() == 0


def test_the_cluster_of_a_detection_is_the_one_in_its_box():
    image = scene([COKE, Can(0.95, 0.12, 0.033, 0.115, BLUE)])
    detected, clusters = detected_in(image, colour=BLUE), viewed(image).clusters
    assert matching_cluster(clusters, detected).shape.centre == pytest.approx((0.95, 0.12), abs=0.008)


def test_a_detection_beside_all_clusters_has_none():
    image = scene([COKE, Can(0.95, 0.12, 0.033, 0.115, BLUE)])
    detected, clusters = detected_in(image, colour=BLUE), viewed(image).clusters
    assert matching_cluster(tuple(c for c in clusters if c.shape.centre[1] < 0.0), detected) is None


def test_a_detected_object_is_split_from_the_object_that_it_touches():
    image = scene([COKE, Can(COKE.x, COKE.y + 0.068, 0.033, 0.115, BLUE)])
    view, detected = viewed(image), detected_in(image)
    assert len(view.clusters) == 1
    alone = split_detected(view, detected)
    assert len(alone.clusters) == 2
    assert matching_cluster(alone.clusters, detected).shape.centre == pytest.approx((COKE.x, COKE.y), abs=0.012)


@pytest.mark.parametrize(("height_m", "cut"), [(0.115, 0.0), (0.24, 0.4)], ids=["whole", "box without the top"])
def test_a_single_object_stays_whole(height_m, cut):
    image = scene([Can(0.95, -0.1, 0.033, height_m, RED)])
    u0, v0, u1, v1 = seen_as("beer", image).box
    low = Detection("beer", 0.8, (u0, v0 + cut * (v1 - v0), u1, v1))
    view = viewed(image)
    assert split_detected(view, detected_in(image, detection=low)) is view


# heights over the surface (m) of points in one column -> which of them may rest on it
@pytest.mark.parametrize(
    ("heights_m", "rest"),
    [
        ((0.02, 0.06, 0.11), (True, True, True)),
        ((0.39, 0.395), (False, False)),
        ((0.03, 0.39, 0.395), (True, False, False)),
        ((0.2, 0.25), (True, True)),
    ],
    ids=["what stands", "a board above", "a thing below a board", "a thing whose foot is hidden"],
)
def test_points_above_a_gap_do_not_rest_on_the_surface(heights_m, rest):
    assert tuple(may_rest(np.tile([0.51, 0.31], (len(heights_m), 1)), np.array(heights_m))) == rest


def test_neighbouring_columns_are_judged_alone():
    xy = np.array([[0.5, 0.3], [0.9, 0.3], [0.5, 0.3], [0.9, 0.3]])
    assert may_rest(xy, np.array([0.39, 0.02, 0.4, 0.06])).tolist() == [False, True, False, True]


def columns(*pieces):
    """Points of pieces of columns at (x, y), from a height to another, every centimetre."""
    points = [(x, y, z) for x, y, low, high in pieces for z in np.arange(low, high, 0.01)]
    return np.array(points)[:, :2], np.array(points)[:, 2]


TANK = [(0.5, 0.3, 0.0, 0.35)]
LEVER = [(0.5 - d, 0.3, 0.31, 0.34) for d in (0.04, 0.08, 0.12)]
BOARD = [(0.5 - d, 0.3, 0.31, 0.34) for d in np.arange(0.04, 0.4, 0.04)]
HIGHER = [(0.46, 0.3, 0.38, 0.39)]


# What hangs beside a tank of 35 cm, and whether it belongs to what rests:
# a lever of 12 cm: yes; a board of 36 cm: no; a lamp 3 cm above the tank: no.
@pytest.mark.parametrize(("hanging", "rests"), [(LEVER, True), (BOARD, False), (HIGHER, False)])
def test_a_small_part_that_sticks_out_of_an_object_rests_with_it(hanging, rests):
    xy, height_m = columns(*TANK, *hanging)
    found = may_rest(xy, height_m)
    assert np.all(found[xy[:, 0] == 0.5])
    assert np.all(found[xy[:, 0] != 0.5] == rests)


RNG_SEED = 4


def box(x, y, length, width, height=0.03):
    points = np.random.default_rng(RNG_SEED).uniform(-0.5, 0.5, (6000, 2))
    return np.column_stack([points * [length, width] + [x, y], np.full(len(points), height)])


def disc(x, y, radius, height=0.03):
    rng = np.random.default_rng(RNG_SEED)
    turn, off = rng.uniform(0.0, 2.0 * np.pi, 6000), radius * np.sqrt(rng.uniform(0.0, 1.0, 6000))
    return np.column_stack([x + off * np.cos(turn), y + off * np.sin(turn), np.full(6000, height)])


HAMMER = (box(0.0, 0.0, 0.26, 0.026), box(0.13, 0.0, 0.03, 0.12))


def parts_of(objects, colours=None):
    """Labels and number of the objects that touch; each is grey unless its colour is given."""
    colours = colours or [GREY] * len(objects)
    painted = [np.tile(np.uint8(colour), (len(points), 1)) for points, colour in zip(objects, colours, strict=True)]
    return touching_parts(np.concatenate(objects), np.concatenate(painted))


@pytest.mark.parametrize(
    ("objects", "count"),
    [
        ((disc(0.0, 0.0, 0.033),), 1),
        ((disc(0.0, 0.0, 0.033), disc(0.066, 0.0, 0.033)), 2),
        ((disc(0.0, 0.0, 0.033), disc(0.066, 0.0, 0.033), disc(0.132, 0.0, 0.033)), 3),
        ((box(0.0, 0.0, 0.05, 0.05), box(0.03, 0.05, 0.05, 0.05)), 2),
        ((*HAMMER, disc(0.17, 0.095, 0.04, height=0.12)), 2),
    ],
)
def test_objects_that_touch_are_counted(objects, count):
    labels, found = parts_of(objects)
    assert found == count
    assert sorted(np.unique(labels)) == list(range(count))


def test_another_colour_divides_a_hammer_from_a_low_object_that_it_touches():
    objects = (*HAMMER, disc(0.17, 0.095, 0.04))
    assert parts_of(objects)[1] == 1
    assert parts_of(objects, [GREY, GREY, RED])[1] == 2


def test_each_point_gets_the_label_of_its_object():
    labels, _ = parts_of([disc(0.0, 0.0, 0.033), disc(0.066, 0.0, 0.033)])
    halves = labels.reshape(2, -1)
    assert all(np.mean(half == np.bincount(half).argmax()) > 0.95 for half in halves)


@pytest.mark.parametrize(
    ("parts", "colours"),
    [
        (HAMMER, (RED, GREY)),
        ((box(0.0, 0.0, 0.2, 0.02), box(0.1, 0.0, 0.05, 0.05), box(-0.1, 0.0, 0.05, 0.05)), None),  # a wrench
        ((box(0.0, 0.0, 0.1, 0.036), box(0.1, 0.0, 0.12, 0.007)), (RED, GREY)),  # a screwdriver
        ((box(0.0, 0.0, 0.05, 0.05), box(0.05, 0.0, 0.05, 0.05)), (RED, BLUE)),  # flush boxes, as was said
    ],
)
def test_one_object_of_several_parts_stays_one(parts, colours):
    assert parts_of(parts, colours)[1] == 1


def test_a_low_bar_stays_whole_where_the_noise_of_the_surface_hides_a_part_of_it():
    halves = [Can(1.0, y, 0.012, 0.014, GREEN) for y in np.arange(-0.1, 0.1, 0.012) if abs(y) > 0.01]
    assert len(viewed(scene(halves)).clusters) == 1


def test_the_pieces_of_a_detected_object_are_joined():
    pieces = [Can(1.0, y, 0.012, 0.014, GREEN) for y in (-0.09, -0.08, -0.07, 0.07, 0.08, 0.09)]
    image = scene([*pieces, Can(1.2, 0.2, 0.033, 0.115, BLUE)])
    view, detected = viewed(image), detected_in(image, "wrench", GREEN)
    assert len(view.clusters) == 3
    joined = split_detected(view, detected)
    assert len(joined.clusters) == 2
    assert matching_cluster(joined.clusters, detected).shape.length_m == pytest.approx(0.2, abs=0.02)


def test_a_handle_lower_than_the_noise_of_single_points_belongs_to_a_detected_wrench():
    head = [Can(1.0, y, 0.012, 0.014, GREEN) for y in (-0.09, -0.08, -0.07)]
    image = scene([*head, *(Can(1.0, y, 0.012, 0.006, GREEN) for y in np.arange(-0.06, 0.1, 0.01))])
    (alone,) = viewed(image).clusters
    (whole,) = split_detected(viewed(image), detected_in(image, "wrench", GREEN)).clusters
    assert alone.shape.length_m < 0.07
    assert whole.shape.length_m == pytest.approx(0.2, abs=0.02)


def test_a_neighbour_within_the_box_of_a_large_detected_object_stays_one_of_its_own():
    image = scene([Can(0.95, 0.0, 0.05, 0.25, RED), Can(1.12, 0.13, 0.033, 0.115, RED)])
    pixels = np.argwhere(np.all(image.colour == RED, axis=-1))[:, ::-1]
    whole = replace(detected_in(image, "extinguisher"), pixels=pixels)
    assert len(split_detected(viewed(image), whole).clusters) == 2
