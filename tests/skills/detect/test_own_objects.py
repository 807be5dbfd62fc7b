"""Search for own objects, which the detector knows by their models."""

from dataclasses import replace

from own_models import can_model
from table_robot import Colours, TableRobot, context_of, failed, outcome
from table_scene import BLUE, COKE, GREEN, RED, TABLE, Can

from skills.api import Cause, Succeeded
from skills.detect.skill import Detect, DetectInputs
from skills.perception.model_matching import ModelDetector

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
