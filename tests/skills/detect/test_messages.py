import json

import numpy as np
from made_detections import detected_3d
from pydrake.math import RigidTransform
from table_robot import TableRobot, context_of
from table_scene import COKE, TABLE, scene, seen_as

from skills.api import Detection, LocalisationEstimate
from skills.detect.messages import coverage_message, detections_message, tracks_message
from skills.perception.detection_3d import detections_3d
from skills.perception.point_cloud import SurfaceShares
from skills.perception.tracker import Tracker

PLACE = LocalisationEstimate(0.0, RigidTransform(), np.diag([0.02**2, 0.02**2, 0.0]), True)


def test_message_has_all_detections_and_their_positions_if_known():
    image = scene([COKE])
    found = (seen_as("coke", image), Detection("beer", 0.6, (1.0, 1.0, 9.0, 9.0)))
    message = detections_message(image, found, detections_3d(image, PLACE, found[:1], [TABLE]))
    coke, beer = message["detections"]
    assert (coke["class_id"], coke["surface"], len(coke["position_W"])) == (2, "table", 3)
    assert coke["sigma_m"][0] > 0.02
    assert (beer["class_id"], beer["surface"], "position_W" in beer) == (1, "", False)
    assert message["image"] is image.colour


def test_messages_are_json_but_for_the_picture():
    context = context_of(TableRobot())
    tracks = tracks_message(context, Tracker(("coke",)).update([detected_3d()], lambda track: True))
    coverage = coverage_message(context, {"table": SurfaceShares(0.5, 0.25)})
    assert json.loads(json.dumps(tracks))["tracks"][0]["class_name"] == "coke"
    assert json.loads(json.dumps(coverage))["surfaces"]["table"] == {"seen": 0.5, "hidden": 0.25, "out_of_view": 0.25}
