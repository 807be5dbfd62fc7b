"""What nodes share, and the part of it that skills may touch."""

from dataclasses import replace

import pytest

from executive.tree.context import leaf_seed
from skills.detection import NoDetector, NoDetectorError


class Scripted:
    class_names = ("person",)

    def detect(self, pictures):
        return [() for _ in pictures]


def test_the_detector_reaches_the_skill(context):
    detector = Scripted()
    assert replace(context, detector=detector).for_skill("alice/navigate").detector is detector


def test_without_a_detector_nothing_is_known_and_use_is_an_error(context):
    detector = context.for_skill("alice/navigate").detector
    assert detector == NoDetector()
    assert detector.class_names == ()
    with pytest.raises(NoDetectorError, match="field 'detector'"):
        detector.detect([])


def test_leaf_seeds_differ_by_path_and_run_and_stay():
    assert leaf_seed(1, "alice/a") == leaf_seed(1, "alice/a") == 885863618
    assert len({leaf_seed(1, "alice/a"), leaf_seed(2, "alice/a"), leaf_seed(1, "alice/b")}) == 3
