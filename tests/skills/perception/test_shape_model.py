"""Features of shapes in depth, and the classes that they suggest."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from table_scene import CAMERA, GREY, TABLE, Can, scene

from skills.perception.shape_model import shape_model
from skills.perception.surface_segmentation import segment_surface

CAN = [Can(1.1, 0.1, 0.033, 0.115, GREY)]
BOTTLE = [Can(1.1, 0.1, 0.031, 0.15, GREY), Can(1.1, 0.1, 0.013, 0.09, GREY, base=TABLE.height_m + 0.15)]
LOW = [Can(1.1, 0.1, 0.08, 0.02, GREY)]


def cluster_of(things):
    (cluster,) = segment_surface(scene(things), RigidTransform(), TABLE).clusters
    return cluster


def test_the_features_are_metric():
    features = cluster_of(CAN).features(CAMERA)
    height_m, length_m, width_m, widest_m, off_m = np.exp(features[:5])
    assert height_m == pytest.approx(0.115, abs=0.006)
    assert (length_m, width_m, widest_m) == pytest.approx((0.066,) * 3, abs=0.012)
    assert off_m == pytest.approx(0.72, abs=0.05)


def test_a_neck_is_narrower_than_the_body():
    levels = cluster_of(BOTTLE).features(CAMERA)[7:17]
    assert levels[:5].min() > 0.8
    assert levels[-3:].max() < 0.6


# shape, classes that it suggests, and a class that it speaks against
@pytest.mark.parametrize(
    ("things", "likely", "unlikely"),
    [(BOTTLE, {"beer", "coke"}, "cube"), (CAN, {"coke", "cylinder", "beer"}, "hammer")],
    ids=["bottle", "can"],
)
def test_the_model_suggests_the_classes_of_a_shape(things, likely, unlikely):
    found = shape_model().likelihoods(cluster_of(things).features(CAMERA))
    assert max(found, key=found.get) in likely
    assert found[unlikely] < 0.5


def test_a_likelihood_is_never_zero():
    assert min(shape_model().likelihoods(cluster_of(LOW).features(CAMERA)).values()) > 0.0
