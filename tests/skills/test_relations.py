"""Geometry of each relation, and which of several objects is meant."""

import math
from dataclasses import replace

import pytest

from executive.words.command import split_relations
from skills.relations import Landmark, Relation, RelationKind, Scene, Standing, choose, margin_m, ordinal
from skills.robot import Pose2D
from tests.tables import table

OUTLINES_W = {
    "door": ((2.0, 5.0),),
    "stove": ((3.1, -1.0), (4.0, -1.0), (4.0, 1.0), (3.1, 1.0)),
    "Robin": ((6.0, 0.0),),
}
CLASSES = {name: (name,) for name in ("beer", "wrench", "coke")}


def grounded(text):
    """The relations in a text, with classes and outlines as a world would give them."""
    _, relations = split_relations(f"thing {text}")
    known = {
        each: tuple(
            replace(one, classes=CLASSES.get(one.name, ()), outline_W=OUTLINES_W.get(one.name, ()))
            for one in each.landmarks
        )
        for each in relations
    }
    return [replace(each, landmarks=landmarks) for each, landmarks in known.items()]


BEER = Landmark("beer", classes=("beer",))
WRENCH = Landmark("wrench", classes=("wrench",))
SCENE = Scene(
    ((1.0, -1.0), (3.0, -1.0), (3.0, 1.0), (1.0, 1.0)),
    Pose2D(0.0, 0.0, 0.0),
    {BEER: [Standing((2.0, 0.0), (0.1, 0.1, 0.2))], WRENCH: [Standing((2.0, 0.6))]},
)


@pytest.mark.parametrize(*table(__file__, "margins"))
def test_an_object_has_a_relation_where_its_margin_is_positive(relation, at, sign):
    (one,) = grounded(relation)
    assert math.copysign(1, margin_m(one, Standing(tuple(at)), SCENE)) == sign


@pytest.mark.parametrize(*table(__file__, "choices"))
def test_relations_choose_among_candidates(relations, candidates, meant):
    standing = [Standing((x, y), (size, 0.05, 0.05)) for x, y, size in candidates]
    assert choose(grounded(", ".join(relations)), standing, SCENE) == meant


def test_all_that_fit_are_chosen_where_several_are_wanted():
    candidates = [Standing((2.0, 0.2)), Standing((2.0, 0.7))]
    assert choose(grounded("left of the beer"), candidates, SCENE) == [0]
    assert choose(grounded("left of the beer"), candidates, SCENE, every=True) == [0, 1]


def test_slack_accepts_relations_that_are_missed_by_less():
    relations, one = grounded("left of the beer"), Standing((2.35, 0.3))
    assert choose(relations, [one], SCENE, slack_m=0.02) == []
    assert choose(relations, [one], SCENE, slack_m=0.05) == [0]


def test_an_object_is_no_landmark_of_itself():
    own, other = Standing((2.0, 0.0)), Standing((2.0, 0.3))
    coke = Landmark("coke", classes=("coke",))
    relation = Relation(RelationKind.NEXT_TO, (coke,))
    assert margin_m(relation, own, replace(SCENE, objects={coke: [own]})) == -math.inf
    assert margin_m(relation, own, replace(SCENE, objects={coke: [own, other]})) < 0.0


def test_two_objects_of_one_kind_have_a_space_between_them():
    beers = replace(SCENE, objects={BEER: [Standing((2.0, 0.0)), Standing((2.0, 0.4))]})
    relation = Relation(RelationKind.BETWEEN, (BEER, BEER))
    assert margin_m(relation, Standing((2.0, 0.2)), beers) == pytest.approx(0.1)


@pytest.mark.parametrize(*table(__file__, "wrong"))
def test_a_relation_refuses_wrong_landmarks_and_numbers(kind, landmarks, nth, says):
    with pytest.raises(ValueError, match=says):
        Relation(RelationKind[kind], (BEER,) * landmarks, nth)


@pytest.mark.parametrize(*table(__file__, "ordinals"))
def test_ordinals_are_written_as_in_english(number, text):
    assert ordinal(number) == text
