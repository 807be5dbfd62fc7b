import math
from itertools import pairwise

import numpy as np
import pytest

from errand_make.maps.pose_graph import Edge, PoseGraph
from skills.geometry import compose, relative_pose
from skills.robot import Pose2D

pytest.importorskip("gtsam")

SURE = np.diag([0.02, 0.02, 0.01]) ** 2


def ring(count=40, radius_m=5.0):
    """Poses on a circle, the last beside the first."""
    turns = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)
    return [Pose2D(radius_m * math.cos(t), radius_m * math.sin(t), t + math.pi / 2) for t in turns.tolist()]


def drifting(true):
    """A chain whose every step turns by half a degree too much."""
    steps = [relative_pose(a, b) for a, b in pairwise(true)]
    wrong = [Pose2D(step.x_m, step.y_m, step.yaw_rad + math.radians(0.5)) for step in steps]
    poses = [true[0]]
    for step in wrong:
        poses.append(compose(poses[-1], step))
    return PoseGraph(poses, [Edge(n, n + 1, step, SURE) for n, step in enumerate(wrong)])


def worst_m(graph, true):
    return max(math.hypot(a.x_m - b.x_m, a.y_m - b.y_m) for a, b in zip(graph.poses, true, strict=True))


def closed(true):
    """The last edge back to the first pose."""
    return Edge(0, len(true) - 1, relative_pose(true[0], true[-1]), SURE, closure=True)


def test_a_loop_closure_takes_the_drift_out():
    true = ring()
    graph = drifting(true)
    before = worst_m(graph, true)
    graph.edges.append(closed(true))
    graph.optimise()
    assert before > 1.0 and worst_m(graph, true) < 0.4


def test_the_first_pose_stays():
    true = ring()
    graph = drifting(true)
    graph.edges.append(closed(true))
    graph.optimise()
    off = relative_pose(true[0], graph.poses[0])
    assert math.hypot(off.x_m, off.y_m) < 1e-3 and abs(off.yaw_rad) < 1e-3


def test_a_false_closure_is_dropped_and_the_true_ones_stay():
    true = ring()
    graph = drifting(true)
    right = [Edge(n, len(true) - 1 - n, relative_pose(true[n], true[-1 - n]), SURE, closure=True) for n in range(3)]
    wrong = Edge(0, 20, relative_pose(true[0], true[-1]), SURE, closure=True)
    graph.edges.extend([*right, wrong])
    graph.optimise()
    assert graph.drop_outliers(5.0) == [wrong]
    assert graph.closures == right
    assert worst_m(graph, true) < 0.4


def test_the_covariance_grows_along_the_chain():
    graph = drifting(ring())
    near, far = (np.trace(graph.covariance(index)[:2, :2]) for index in (2, 30))
    assert far > 4.0 * near > 0.0
