"""Components give the stored answers to recorded input, each alone; `record.py` records both."""

from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from plant.robots.spot.kind import spot_capabilities
from skills.manipulation.arm.collision import ArmScene
from skills.manipulation.arm.kinematics import arm_model
from skills.perception.class_evidence import FAINT_SCORE
from skills.perception.detection_3d import detections_3d
from skills.perception.detector.camera_images import detect_in_image
from skills.perception.point_cloud import in_plain_view
from skills.perception.tracker import Tracker
from skills.robot import Pose2D
from skills.stack import default_stack
from tests.skills.replay.stored import load
from tests.tables import yaml_beside

INPUT, REFERENCE = (Path(__file__).with_name(name) for name in ("fetch.npz", "fetch.yaml"))
given = cache(lambda: load(INPUT))
detector = cache(lambda: default_stack().detector.build())


def localise():
    """Pose in the world (m, m, rad) at each scan."""
    localiser = default_stack().localiser.build(given()["grid"], given()["start"], surely=True)
    for scan, odometry in given()["scans"]:
        localiser.update(SimpleNamespace(scan=lambda scan=scan: scan, odometry=lambda odometry=odometry: odometry))
        pose = Pose2D.from_transform(localiser.estimate().X_WO @ scan.X_OB)
        yield f"{scan.stamp_s:.1f} s", *vars(pose).values()


def detect():
    """Picture and class, score and box (pixels) of each detection."""
    for k, (image, *_) in enumerate(given()["pictures"]):
        for one in sorted(detect_in_image(detector(), image, FAINT_SCORE), key=lambda one: one.box):
            yield f"{k} {one.class_name}", one.score, *one.box


def track():
    """Class and number of views, belief and position (m) of each track, from the recorded detections."""
    tracker = Tracker(given()["class_names"])
    for image, place, found, surfaces in given()["pictures"]:
        placed = detections_3d(image, place, found, surfaces)
        tracker.update(placed, lambda t, image=image, X_WO=place.X_WO: in_plain_view(image, X_WO, t.position_W))
    for one in sorted(tracker.snapshot(), key=lambda one: one.number):
        yield f"{one.class_name} {one.views}", one.belief, *one.position_W


def plan_grasp():
    """The candidate's hand pose and costs, the lift, and joints along the motions with their durations (s)."""
    stack, capabilities, grasp = default_stack(), spot_capabilities(), given()["grasp"]
    planner, rng = stack.grasp_planner, np.random.default_rng()
    rng.bit_generator.state = grasp["random_state"]
    found = planner.candidates(grasp["target"], grasp["shoulder"], capabilities.gripper)
    scene = ArmScene(capabilities, arm_model(capabilities), grasp["joints"])
    scene.set_opening(grasp["opening"])
    chosen, arm = [found[k] for k in grasp["numbers"]], stack.arm_planner
    plan = planner.plan(scene, grasp["start_rad"], chosen, grasp["around"], arm, rng)
    one = plan.candidate
    yield "grip", *one.X_BH.GetAsMatrix34().flat, one.width_m, one.cost, one.tilt_rad, one.lever_m
    yield "lift", *plan.lift_B
    for name in ("to_pregrasp", "to_grasp", "last_bit"):
        times_s, joints = vars(getattr(plan, name)).values()
        for share in (0.0, 0.3, 0.7, 1.0):
            yield name, share * times_s[-1], *(np.interp(share * times_s[-1], times_s, q) for q in joints.T)


@pytest.fixture(scope="module")
def expected():
    """The stored answers, once recording and networks are loaded."""
    return given() and detector().class_names and yaml_beside(__file__, REFERENCE.name)


COMPONENTS = {localise: (0.005, 0.005, 0.01), detect: (0.03, 2.0), track: (0.03, 0.005), plan_grasp: (0.001,)}
"""Largest differences of a row's numbers; the last one holds for all others."""


@pytest.mark.parametrize("component", COMPONENTS, ids=lambda component: component.__name__)
def test_a_component_answers_recorded_input_as_before(component, expected):
    most = COMPONENTS[component]
    for (word, *row), (known, *before) in zip(component(), expected[component.__name__], strict=True):
        limits = (*most, *most[-1:] * len(before))[: len(before)]
        assert word == known and np.allclose(row, before, rtol=0.0, atol=limits), (word, row, known, before)
