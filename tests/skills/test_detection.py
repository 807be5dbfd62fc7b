"""Detectors of others: what they need not have, and wrappers."""

from types import MappingProxyType

import numpy as np
import pytest

from executive.testing.bench import SkillBench
from skills.detection import Detection, Detector, DetectorWrapper, with_defaults
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot

CUP, MUG = Detection("cup", 0.9, (0.0, 0.0, 4.0, 4.0)), Detection("mug", 0.8, (4.0, 0.0, 8.0, 8.0))
PICTURE = np.zeros((8, 8), np.uint8)


class Plain:
    """A detector as a package may bring it, with nothing but what it must have."""

    class_names = ("cup", "mug")

    def detect(self, pictures):
        return [(CUP, MUG) for _ in pictures]


class Own(Plain, Detector):
    """The same, which inherits the other methods."""


@pytest.mark.parametrize("detector", [Own(), with_defaults(Plain()), DetectorWrapper(Plain())])
def test_a_detector_needs_only_its_classes_and_detect(detector):
    assert detector.class_names == ("cup", "mug")
    assert detector.detect([PICTURE]) == [(CUP, MUG)]
    assert detector.detect_class([PICTURE, PICTURE], "mug") == [(MUG,), (MUG,)]
    assert detector.detect_in_views(PICTURE, 0.1) == (CUP, MUG)
    assert detector.detect_with_depth(None, (CUP,)) == (CUP,)
    assert detector.models == {}


def test_a_bench_takes_a_detector_that_has_only_detect():
    clock = VirtualClock()
    bench = SkillBench(ScriptedRobot(clock), clock, detector=Plain())
    assert bench.context().detector.detect_class([PICTURE], "mug") == [(MUG,)]


def test_a_detector_that_has_all_methods_stays_itself():
    own = Own()
    assert with_defaults(own) is own


class Careful(Own):
    """A detector with methods of its own throughout."""

    models = MappingProxyType({"tin": None})

    def detect_class(self, pictures, class_name):
        return [(class_name,) for _ in pictures]

    def detect_in_views(self, picture, least_score=None):
        return (least_score,)

    def detect_with_depth(self, image, found):
        return (image, *found)


def test_a_wrapper_uses_the_methods_of_its_detector():
    wrapped = DetectorWrapper(DetectorWrapper(Careful()))
    assert wrapped.detect_class([PICTURE], "cup") == [("cup",)]
    assert wrapped.detect_in_views(PICTURE, 0.2) == (0.2,)
    assert wrapped.detect_with_depth("image", (CUP,)) == ("image", CUP)
    assert wrapped.models == {"tin": None}


def test_a_wrapper_has_a_method_for_each_of_a_detectors():
    public = {name for name in vars(Detector) if not name.startswith("_")} - {"models", "about"}
    assert len(public) == 6
    assert public <= set(vars(DetectorWrapper))


def test_a_detector_without_detect_cannot_be_made():
    class Half(Detector):
        class_names = ("cup",)

    with pytest.raises(TypeError, match="detect"):
        Half()
