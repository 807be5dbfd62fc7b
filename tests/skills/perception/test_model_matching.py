"""Recognition of own objects in analytic scenes, and the detector that has their models."""

from dataclasses import replace

import numpy as np
import pytest
from own_models import can_model, photographed_can
from pydrake.math import RigidTransform
from table_scene import BLUE, RED, TABLE, Can, scene

from executive.run.work import CountedDetector, Work
from skills.api import LocalisationEstimate
from skills.class_forms import ANY_OBJECT
from skills.perception.model_matching import ModelDetector, identified, likeness, with_models
from skills.perception.object_model import view_of
from skills.perception.surface_segmentation import labelled_clusters, segment_surface
from skills.testing.estimators import PlainColours

PLACE = LocalisationEstimate(0.0, RigidTransform(), np.zeros((3, 3)), True)
TIN = Can(1.0, -0.1, 0.04, 0.12, RED)
MODEL = can_model("tin", 0.04, 0.12, RED)
PHOTOGRAPHED = photographed_can("tin", 0.04, 0.12, RED)
RED_PLATE, BLUE_PLATE, WHITE = (190, 40, 35), (40, 60, 190), (230, 230, 230)
by_mesh_and_by_photographs = pytest.mark.parametrize("model", [MODEL, PHOTOGRAPHED], ids=["mesh", "photographs"])


def seen(things, models):
    image = scene(things)
    pairs = labelled_clusters(image, PLACE, [segment_surface(image, RigidTransform(), TABLE)], [], [TABLE])
    clusters = [cluster for cluster, _ in pairs]
    return identified(clusters, image, PLACE, {model.name: model for model in models})


@by_mesh_and_by_photographs
def test_an_object_like_its_model_gets_its_name_place_and_size(model):
    (found,) = seen([TIN], [model])
    assert (found.class_name, found.surface) == ("tin", "table")
    assert found.detection.score > 0.8
    assert found.position_W == pytest.approx([1.0, -0.1, 0.81], abs=0.006 if model is MODEL else 0.02)
    assert found.size_m == pytest.approx((0.08, 0.08, 0.12), abs=0.006)


@by_mesh_and_by_photographs
@pytest.mark.parametrize(
    "other",
    [
        Can(1.0, -0.1, 0.04, 0.12, BLUE),
        Can(1.0, -0.1, 0.04, 0.17, RED),
        Can(1.0, -0.1, 0.028, 0.12, RED),
        Can(1.0, -0.1, 0.055, 0.12, RED),
    ],
    ids=["colour", "higher", "narrower", "wider"],
)
def test_an_object_that_differs_stays_a_thing(other, model):
    (found,) = seen([other], [model])
    assert found.class_name == ANY_OBJECT
    assert found.detection.alternatives == ()


def test_each_object_gets_the_name_of_its_own_model():
    models = [MODEL, can_model("pot", 0.05, 0.09, BLUE)]
    found = seen([TIN, Can(1.1, 0.2, 0.05, 0.09, BLUE), Can(1.1, 0.0, 0.02, 0.05, RED)], models)
    assert sorted(each.class_name for each in found) == ["pot", ANY_OBJECT, "tin"]


def test_an_object_behind_another_is_claimed_only_while_half_of_it_shows():
    behind = Can(1.15, -0.02, 0.04, 0.12, RED)
    wall = Can(1.0, 0.0, 0.045, 0.2, BLUE)
    names = [each.class_name for each in seen([behind, wall], [MODEL])]
    assert "tin" not in names


@by_mesh_and_by_photographs
def test_models_that_nothing_tells_apart_are_alternatives_without_a_claim(model):
    (found,) = seen([TIN], [model, replace(model, name="twin")])
    assert found.class_name == ANY_OBJECT
    assert {name for name, _ in found.detection.alternatives} == {"tin", "twin"}


def test_no_model_is_aligned_with_segments_of_another_size(monkeypatch):
    monkeypatch.setattr("skills.perception.model_matching._refined", None)
    (found,) = seen([Can(1.0, -0.1, 0.04, 0.25, RED)], [MODEL])
    assert found.class_name == ANY_OBJECT


def drawn(colour=RED_PLATE, size=(60, 90), label=None, label_rows=(30, 60)):
    """View of a plate of one colour with a label across it."""
    width, height = size
    rgba = np.full((height, width, 4), 255, np.uint8)
    rgba[..., :3] = colour
    if label is not None:
        rgba[label_rows[0] : label_rows[1], :, :3] = label
    return view_of(rgba)


def test_a_view_is_like_itself_among_others():
    views = np.array([drawn(BLUE_PLATE), drawn(label=WHITE), drawn(size=(90, 60))])
    assert likeness(drawn(label=WHITE), views) == pytest.approx(1.0)


def test_a_darker_picture_is_still_alike():
    darker = drawn(tuple(round(0.75 * each) for each in RED_PLATE), label=tuple(round(0.75 * each) for each in WHITE))
    assert likeness(darker, drawn(label=WHITE)[None]) > 0.7


def test_a_view_keeps_the_proportions_and_the_middle():
    rows, columns = np.nonzero(drawn(size=(40, 80))[..., 3] > 127)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (0, 23, 6, 17)


@pytest.mark.parametrize(
    "other", [drawn(BLUE_PLATE), drawn(size=(90, 45)), drawn(label=WHITE)], ids=["colour", "outline", "edges"]
)
def test_one_difference_is_enough_to_be_unlike(other):
    assert likeness(other, drawn()[None]) < 0.35


def test_detector_with_models_detects_as_its_networks_do():
    networks = PlainColours()
    detector = CountedDetector(ModelDetector(networks, [MODEL]), Work())
    assert list(detector.models) == ["tin"]
    assert detector.class_names == networks.class_names
    picture = np.zeros((40, 60, 3), np.uint8)
    assert detector.detect([picture]) == networks.detect([picture])
    assert networks.models == {}


def test_models_of_two_makers_add_up(tmp_path):
    can_model("pot", 0.05, 0.08, (20, 160, 30)).write(tmp_path)
    assert list(with_models(ModelDetector(PlainColours(), [MODEL]), [tmp_path]).models) == ["tin", "pot"]
    networks = PlainColours()
    assert with_models(networks, []) is networks
