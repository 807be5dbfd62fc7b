"""Search for own objects, which the detector knows by their models."""

import base64
from dataclasses import replace

import cv2
import numpy as np
from own_models import can_model, viewed_model
from table_robot import Colours, TableRobot, context_of, failed, outcome
from table_scene import BLUE, COKE, GREEN, RED, TABLE, Can

from skills.api import Cause, Succeeded
from skills.detect.skill import Detect, DetectInputs
from skills.perception.model_matching import ModelDetector
from skills.perception.object_model import view_of

COKES = DetectInputs(("coke",), (TABLE,))
TIN = Can(1.1, 0.2, 0.04, 0.12, GREEN)
MODELS = [can_model("tin", 0.04, 0.12, GREEN), can_model("pot", 0.05, 0.08, RED)]


class Counting(Colours):
    """A detector that counts its pictures."""

    pictures = 0

    def detect(self, pictures):
        self.pictures += len(pictures)
        return super().detect(pictures)


def search(things, name, networks=None):
    detector = ModelDetector(networks or Colours({"coke": RED}), MODELS)
    return Detect(context_of(TableRobot(things=things), detector=detector)), DetectInputs((name,), (TABLE,))


def test_own_object_is_found_by_its_model_from_two_sides():
    step = outcome(*search([COKE, TIN], "tin"))
    assert isinstance(step, Succeeded), step
    seen = step.outputs["observation"]
    assert (seen.kind.name, seen.surface) == ("tin", "table")
    assert abs(seen.position_W[1] - TIN.y) < 0.01
    assert "saw the tin" in step.message or "saw a tin" in step.message


def test_own_object_that_is_absent_is_not_claimed():
    failed(*search([COKE, TIN], "pot"), Cause.POSTCONDITION, "no pot seen on the table")
    failed(*search([Can(1.1, 0.2, 0.04, 0.12, BLUE)], "tin"), Cause.POSTCONDITION, "no tin seen")


def test_search_for_an_own_object_runs_no_network():
    networks = Counting({"coke": RED})
    outcome(*search([TIN], "tin", networks))
    assert networks.pictures == 0


def test_search_for_a_class_aligns_no_model(monkeypatch):
    monkeypatch.setattr("skills.perception.model_matching.fits", None)
    step = outcome(*search([COKE, TIN], "coke"))
    assert isinstance(step, Succeeded), step


def test_own_object_has_a_box_in_the_published_picture():
    skill, inputs = search([COKE, TIN], "tin")
    shown = []
    skill.context = replace(
        skill.context, publish=lambda topic, message: shown.append(message) if topic == "detections" else None
    )
    assert isinstance(outcome(skill, inputs), Succeeded)
    names = [{each["class_name"] for each in message["detections"]} for message in shown]
    assert {"tin"} in names
    assert not any("thing" in each for each in names)
    u0, v0, u1, v1 = next(each["box"] for message in shown for each in message["detections"])
    assert u1 > u0 and v1 > v0


def pictures_of(png):
    """The object in a view of the log, RGB with alpha."""
    return cv2.cvtColor(cv2.imdecode(np.frombuffer(base64.b64decode(png), np.uint8), -1), cv2.COLOR_BGRA2RGBA)


def unexplained(things):
    """The message about what stays unexplained in a search for a coke."""
    log = []
    detector = Colours({"coke": RED})
    failed(Detect(context_of(TableRobot(things=things), log, detector=detector)), COKES, Cause.EXECUTION, "cannot tell")
    (message,) = [message for topic, message in log if topic == "pictures"]
    return message


def test_an_unexplained_object_has_clear_views_from_several_sides_and_its_size():
    message = unexplained([TIN])
    views = [pictures_of(each) for each in message["views"]]
    assert 4 <= len(views) <= 6
    assert sum(map(len, message["views"])) < 20_000
    for view in views:
        opaque = view[..., 3] > 127
        assert 20 < max(view.shape[:2]) <= 132
        assert not view[[0, -1]].any()
        assert not view[:, [0, -1]].any()
        assert np.abs(np.median(view[opaque][:, :3], axis=0) - GREEN).max() < 6
        assert not view[~opaque].any()
    assert np.allclose(message["size_m"], (0.08, 0.08, 0.12), atol=0.01)
    assert np.allclose(message["position_W"][:2], (TIN.x, TIN.y), atol=0.01)


def test_an_unexplained_object_is_recognised_by_the_views_of_it():
    message = unexplained([TIN])
    views = [view_of(pictures_of(each)[2:-2, 2:-2]) for each in message["views"]]
    detector = ModelDetector(Colours({"coke": RED}), [viewed_model("jar", message["size_m"], views)])
    step = outcome(Detect(context_of(TableRobot(things=[TIN]), detector=detector)), DetectInputs(("jar",), (TABLE,)))
    assert isinstance(step, Succeeded), step
    coke = Detect(context_of(TableRobot(things=[TIN]), detector=detector))
    failed(coke, COKES, Cause.POSTCONDITION, "no coke seen")
    blue = Detect(context_of(TableRobot(things=[replace(TIN, colour=BLUE)]), detector=detector))
    failed(blue, DetectInputs(("jar",), (TABLE,)), Cause.POSTCONDITION, "no jar seen")
