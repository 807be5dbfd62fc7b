"""Class probabilities of one object from the scores and the shapes of its views."""

import pytest

from skills.api import Detection
from skills.perception.class_evidence import ClassEvidence

NAMES = ("beer", "coke", "cube")
BOX = (0.0, 0.0, 10.0, 10.0)
BOTTLE = {"beer": 6.0, "coke": 3.0, "cube": 0.1, "thing": 0.3}


def evidence(*views, shape=None):
    """Evidence of views, each a class with its score, or nothing."""
    found = ClassEvidence.none(NAMES)
    for name, score, *alternatives in views:
        found = found.add(Detection(name, score, BOX, tuple(alternatives)), shape)
    return found


UNKNOWN = ("thing", 0.7)


def test_views_of_one_class_add_up():
    beliefs = [evidence(*[("beer", 0.6)] * count).probabilities["beer"] for count in (1, 2, 3)]
    assert beliefs == sorted(beliefs)
    assert beliefs[0] < 0.8 < beliefs[1]


def test_a_view_without_a_label_is_evidence_against_the_class():
    assert evidence(("beer", 0.9), UNKNOWN).probabilities["beer"] < evidence(("beer", 0.9)).probabilities["beer"]


def test_the_order_of_the_views_does_not_matter():
    one, other = evidence(("beer", 0.9), UNKNOWN, ("coke", 0.5)), evidence(("coke", 0.5), ("beer", 0.9), UNKNOWN)
    assert one.probabilities == pytest.approx(other.probabilities)


def test_a_class_that_no_view_supports_does_not_compete():
    found = evidence(UNKNOWN, shape=BOTTLE)
    assert max(found.probabilities, key=found.probabilities.get) == "thing"
    assert max(found.possible, key=found.possible.get) == "beer"


@pytest.mark.parametrize(
    ("shape", "is_likely"), [(BOTTLE, True), (None, False), ({"cube": 6.0, "thing": 1.0, "beer": 0.1}, False)]
)
def test_the_shape_is_a_second_witness(shape, is_likely):
    assert (evidence(("beer", 0.5), UNKNOWN, shape=shape).probabilities["beer"] > 0.8) is is_likely


def test_the_shape_counts_once_however_many_views_show_it():
    once, often = (evidence(*[UNKNOWN] * count, shape=BOTTLE) for count in (1, 5))
    assert often.possible["beer"] < once.possible["beer"]


def test_an_alternative_competes_by_its_score():
    found = evidence(("beer", 0.5, ("coke", 0.45))).probabilities
    assert found["beer"] > found["coke"] > 0.3 > found["cube"]


def test_a_class_is_sure_by_one_sure_score():
    assert evidence(UNKNOWN, ("beer", 0.5)).is_sure("beer")
    assert not evidence(("beer", 0.45), ("beer", 0.45)).is_sure("beer")
