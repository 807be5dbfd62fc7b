"""Recognisers of other distributions extend the detector where a world has objects of its own or tags."""

import pytest

from executive.app.prepare.placed_robots import shared_detector
from skills.detection import DetectorWrapper
from skills.inputs.errors import InputError
from skills.perception.fiducials import TagDetector
from skills.world_model import Tag
from tests.executive.distribution import module_of_a_plug_in

CODES = """
from skills.detection import DetectorWrapper

class CodeDetector(DetectorWrapper):
    pass

def with_codes(detector, folders, tags):
    return CodeDetector(detector)

def unlicensed(detector, folders, tags):
    raise RuntimeError("no licence")

def forgetful(detector, folders, tags):
    pass
"""
MUG = Tag(7, 0.06, on="mug")


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Makes a distribution that registers recognisers."""
    with module_of_a_plug_in(tmp_path, monkeypatch, "codes", "errand.recognisers", CODES) as register:
        yield register


def test_a_recogniser_wraps_the_detector_of_a_world_with_tags(install):
    install("codes = codes:with_codes")
    detector = shared_detector(tags=(MUG,))
    assert isinstance(detector, TagDetector)  # by the order of their names, ours is the last
    assert type(detector._detector).__name__ == "CodeDetector"
    assert isinstance(detector._detector, DetectorWrapper)


def test_a_world_without_tags_and_objects_of_its_own_uses_the_detector_alone(install):
    install("codes = codes:lost")
    assert shared_detector() is shared_detector()


# the function of an entry point -> why it cannot be used
@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("lost", "AttributeError"),
        ("unlicensed", "RuntimeError: no licence"),
        ("forgetful", "it returns no detector"),
        ("MUG", "AttributeError"),
    ],
)
def test_a_recogniser_that_cannot_be_used_is_refused_with_its_distribution(install, name, why):
    install(f"codes = codes:{name}")
    with pytest.raises(InputError, match=rf"cannot use recogniser 'codes' \(codes:{name}\) of codes: .*{why}"):
        shared_detector(tags=(MUG,))
