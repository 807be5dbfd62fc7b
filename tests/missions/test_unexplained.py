"""In the plant, a question stays open while something stands there that may be what is asked for."""

from dataclasses import replace

import pytest

from executive.app.runs import simulated
from skills.detection import DetectorWrapper
from tests.benchmarks.plant_mission import PlantMission
from tests.visitors import OnMessage

pytestmark = pytest.mark.mission


class BlindToBeer(DetectorWrapper):
    """Detector that gives no beer a score."""

    def detect_in_views(self, picture, least_score=None):
        found = (one for one in super().detect_in_views(picture, least_score) if one.class_name != "beer")
        return tuple(replace(one, alternatives=tuple(a for a in one.alternatives if a[0] != "beer")) for one in found)


class FaintBeers(DetectorWrapper):
    """Detector that is never sure of a beer."""

    def detect_in_views(self, picture, least_score=None):
        found = super().detect_in_views(picture, least_score)
        return tuple(replace(one, score=min(one.score, 0.45)) if one.class_name == "beer" else one for one in found)


def test_a_bottle_that_is_most_likely_a_beer_is_fetched(tmp_path, monkeypatch):
    usual = simulated.shared_detector
    monkeypatch.setattr(simulated, "shared_detector", lambda *given: FaintBeers(usual(*given)))
    end = PlantMission(tmp_path, 29, sentence="take a beer from the kitchen counter").end("fetched")
    assert (end.claimed, end.fulfilled) == (True, True), end.message


def test_a_bottle_that_nothing_recognises_is_not_denied(tmp_path, monkeypatch):
    usual, captions = simulated.shared_detector, []
    monkeypatch.setattr(simulated, "shared_detector", lambda *given: BlindToBeer(usual(*given)))
    shown = OnMessage(lambda topic, message: captions.append(message["caption"]) if topic == "pictures" else None)
    mission = PlantMission(tmp_path, 29, sentence="is there a beer on the kitchen counter")
    mission.prepared = replace(mission.prepared, request=replace(mission.prepared.request, record=True))
    end = mission.end("asked", shown)
    assert (end.claimed, end.cause) == (False, "EXECUTION"), end.message
    what = "something 24 cm tall stands on the kitchen counter"
    assert f"I cannot tell whether there is a beer: {what}" in end.message
    assert f"What is this? {what.capitalize()}" in captions
    assert len(list((tmp_path / "what_is_this_1").glob("view_*.png"))) >= 4
