"""The place that GraphNav gives a robot behind its API."""

import pytest
from bosdyn.api.graph_nav import graph_nav_pb2, map_pb2
from call_faults import Fault

from errand_spot.messages import pose
from skills.robot import Pose2D

STATE = "bosdyn.api.graph_nav.GraphNavService/GetLocalizationState"


def localise(step, *, anchored=True):
    """Uploads a map with one waypoint at (2, 1), and localises the robot there."""
    graph, X_SW = map_pb2.Graph(waypoints=[{"id": "a"}]), Pose2D(2.0, 1.0, 0.0).transform()
    if anchored:
        graph.anchoring.anchors.add(id="a", seed_tform_waypoint=pose(X_SW))
    step.connection.call("graph-nav-service", "UploadGraph", graph_nav_pb2.UploadGraphRequest(graph=graph))
    request = graph_nav_pb2.SetLocalizationRequest(fiducial_init=1)
    request.initial_guess.waypoint_id = "a"
    request.initial_guess.waypoint_tform_body.rotation.w = 1.0
    step.connection.call("graph-nav-service", "SetLocalization", request)


def place(step):
    step.robot.own_localisation()
    step.advance(0.1)
    return step.robot.own_localisation()


def test_the_place_is_that_of_the_seed_frame(step):
    assert place(step) is None
    localise(step)
    found = place(step)
    assert (found.X_SO.x_m, found.X_SO.y_m) == pytest.approx((2.0, 1.0), abs=0.01)
    assert found.stamp_s == pytest.approx(step.now(), abs=0.05)


def test_a_robot_that_is_lost_has_no_place(step):
    localise(step)
    with step.server.faults.fault(STATE, Fault(fields={"lost_detector_state.is_lost": True})):
        assert place(step) is None
    assert place(step) is not None


def test_a_map_without_anchors_gives_no_place(step):
    localise(step, anchored=False)
    assert place(step) is None
