"""Arms of people who receive objects: they hang, and hold the tray when it is out."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from plant.diagram import X_PT_HOME, DiagramConfig, LooseModel, build_diagram
from plant.models.catalogue import load_catalogue
from plant.models.person_arms import LOWER_M, SIDES, UPPER_M, arm_poses
from plant.worlds.seeding import Receiving

PERSON = load_catalogue()["person"].forms["standing"]
HELD = RigidTransform([0.45, 0.0, 0.95])


def hand(side, X_PT=None):
    _, lower = arm_poses(side, X_PT)
    return lower @ np.array([0.0, 0.0, -LOWER_M])


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("X_PT", [None, X_PT_HOME], ids=["no tray", "tray in the torso"])
def test_arm_hangs_while_the_tray_is_not_in_use(side, X_PT):
    assert hand(side, X_PT) == pytest.approx([0.062, SIDES[side] * 0.25, 0.805])


# side   hand in the frame of the tray
@pytest.mark.parametrize(("side", "at"), [("left", [-0.13, 0.165, -0.01]), ("right", [-0.13, -0.165, -0.01])])
@pytest.mark.parametrize("turn_rad", [-0.6, 0.0, 0.6])
def test_hand_holds_the_side_of_a_tray_that_is_out(side, at, turn_rad):
    X_PT = RigidTransform(RotationMatrix.MakeZRotation(turn_rad)) @ HELD
    assert X_PT.inverse() @ hand(side, X_PT) == pytest.approx(at, abs=0.02)


@pytest.mark.parametrize("x_m", [0.1, 0.2, 0.45, 0.8])
def test_upper_and_lower_arm_meet_at_the_elbow(x_m):
    upper, lower = arm_poses("left", RigidTransform([x_m, 0.0, 0.9]))
    assert upper @ np.array([0.0, 0.0, -UPPER_M]) == pytest.approx(lower.translation())


def test_hand_points_at_a_tray_out_of_reach():
    shoulder, far = np.array([0.0, 0.205, 1.40]), RigidTransform([1.2, 0.0, 0.7])
    along, wanted = hand("left", far) - shoulder, far @ np.array([-0.13, 0.165, -0.01]) - shoulder
    assert np.cross(along, wanted) == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    assert np.linalg.norm(along) == pytest.approx(UPPER_M + LOWER_M, rel=2e-3)


def seen_arms(*, receiving):
    """Returns the lower arms that the scene of one person shows, as height (m) by name, with the tray out."""
    built = build_diagram(
        DiagramConfig(models=[LooseModel("Kim", PERSON.path(), RigidTransform(), True, None, receiving)])
    )
    root_context = built.diagram.CreateDefaultContext()
    for tray in built.trays.values():
        built.plant.SetFreeBodyPose(built.plant.GetMyMutableContextFromRoot(root_context), tray, HELD)
    built.arms.pose(root_context)
    query = built.scene_graph.get_query_output_port().Eval(built.scene_graph.GetMyContextFromRoot(root_context))
    inspector = query.inspector()
    shown = [each for each in inspector.GetAllGeometryIds() if inspector.GetPerceptionProperties(each) is not None]
    return {
        inspector.GetName(each): float((query.GetPoseInWorld(each) @ np.array([0.0, 0.0, -LOWER_M]))[2])
        for each in shown
        if inspector.GetName(each).endswith("lower_arm")
    }


def test_scene_shows_each_arm_of_a_receiver_once_at_the_tray():
    assert list(seen_arms(receiving=Receiving()).values()) == pytest.approx([0.94, 0.94], abs=0.03)


def test_arms_of_a_person_without_a_tray_hang():
    assert list(seen_arms(receiving=None).values()) == pytest.approx([0.805, 0.805], abs=0.01)
