"""Zones: keep-out ground is an obstacle that may be left, limits slow the robot down, costs lead the planner."""

import dataclasses
import math

import cv2
import numpy as np
import pytest
from planar_robot import OUTLINE, TWO_ROOMS, Bench, grid_of

from skills.api import Cause, Failed, Succeeded
from skills.estimate.costmap import LayeredCostmap
from skills.footprint import Footprint, disc_centres, footprint_clearance_m, pose_array
from skills.navigate.planner import LatticePlanner, NoPathError
from skills.navigate.skill import Navigate, NavigateInputs
from skills.robot import Pose2D
from skills.world_model import FilterType, NoWorkCounter, Zone, ZoneKind, ZoneMask, zones_sentence
from skills.zone_map import KeepOut, zone_map

FOOTPRINT = Footprint.rectangle(OUTLINE)
FULL_M_S = 0.8


def box(x0, y0, x1, y1):
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def keep_out(name, *sides):
    return Zone(name, ZoneKind.KEEP_OUT, box(*sides))


CORRIDOR = box(0.0, 4.1, 10.0, 7.0)
START, OTHER_END = Pose2D(1.2, 5.5, 0.0), Pose2D(8.8, 5.5, 0.0)


class Counter(NoWorkCounter):
    total = 0

    def count(self, name, amount=1):
        self.total += amount


def plan(*zones, start=START, goal=OTHER_END):
    """The poses of a plan among zones, and its expansions."""
    found, work = zone_map(zones, FULL_M_S), Counter()
    costmap = KeepOut(found).space(LayeredCostmap(grid_of(TWO_ROOMS, (0.05, 1.0))), FOOTPRINT, start)
    given = {"zones": found} if found.has_costs(start) else {}
    path = LatticePlanner().problem(costmap, FOOTPRINT, start, goal, max_speed_m_s=FULL_M_S, work=work, **given)()
    return path.poses, work.total


def go(start, goal, *zones, limit_s=60.0):
    """Runs the skill; returns its last step, and the true poses and speeds of all ticks."""
    bench = Bench(start)
    poses, speeds = [bench.robot.pose], [0.0]

    def note():
        poses.append(bench.robot.pose)
        speeds.append(float(np.hypot(*bench.robot.velocity[:2])))

    skill = Navigate(dataclasses.replace(bench.context(), zones=zones))
    step = bench.run(skill, NavigateInputs(goal), limit_s=limit_s, each=note)
    return step, pose_array(poses), np.array(speeds)


def body_inside(zone, poses):
    """Whether a point of the body is in a rectangle at each pose."""
    (x0, y0), (x1, y1) = zone.corners_W[0], zone.corners_W[2]
    x, y = np.moveaxis(disc_centres(FOOTPRINT.discs, poses), -1, 0)
    return np.any((x > x0) & (x < x1) & (y > y0) & (y < y1), axis=1)


def test_robot_goes_round_a_keep_out_zone():
    zone = keep_out("rug", 4.5, 4.1, 5.5, 5.3)
    step, poses, _ = go(Pose2D(3.6, 4.9, 0.0), Pose2D(6.4, 4.9, 0.0), zone)
    assert isinstance(step, Succeeded), step.message
    assert not body_inside(zone, poses).any()


def test_a_goal_in_a_keep_out_zone_is_refused_with_its_name():
    step, poses, _ = go(START, OTHER_END, keep_out("lab", 8.0, 4.1, 10.0, 7.0))
    why = "The lab is a keep-out zone. The robot does not stand at (8.80, 5.50)."
    assert step == Failed(Cause.PLANNING, why, final=True)
    assert len(poses) < 10


def test_zones_that_leave_no_path_are_named():
    zones = keep_out("rug", 0.0, 0.0, 1.0, 0.4), keep_out("stairs", 4.0, 4.1, 6.0, 7.0)
    step, _, _ = go(START, OTHER_END, *zones, limit_s=20.0)
    assert step == Failed(Cause.PLANNING, "The stairs is a keep-out zone. No path leads to (8.80, 5.50).", final=True)


def test_a_start_in_a_keep_out_zone_leaves_it_by_the_door_and_does_not_come_back():
    room = keep_out("study", 0.0, 0.0, 4.95, 4.05)
    step, poses, _ = go(Pose2D(2.2, 2.6, math.pi), Pose2D(3.6, 5.5, 0.0), room)
    assert isinstance(step, Succeeded), step.message
    inside = body_inside(room, poses)
    left = int(np.argmin(inside))
    assert inside[:left].all() and not inside[left:].any()


def test_a_start_in_a_keep_out_zone_does_not_cross_it():
    step, poses, _ = go(Pose2D(2.2, 5.5, 0.0), OTHER_END, keep_out("hall", 2.0, 4.1, 8.0, 7.0), limit_s=30.0)
    assert isinstance(step, Failed) and "The hall is a keep-out zone." in step.message
    assert poses[:, 0].max() < 2.6


def test_ground_deeper_than_the_body_stays_an_obstacle():
    zone, here = keep_out("hall", 2.0, 4.1, 8.0, 7.0), Pose2D(2.2, 5.5, 0.0)
    space = KeepOut(zone_map((zone,), FULL_M_S)).space(LayeredCostmap(grid_of(TWO_ROOMS, (0.05, 1.0))), FOOTPRINT, here)
    ahead = pose_array([Pose2D(x, 5.5, 0.0) for x in (2.2, 2.0, 2.6)])
    now_m, back_m, deeper_m = footprint_clearance_m(space, FOOTPRINT, ahead)
    assert now_m > 0.0 and back_m > now_m and deeper_m < -0.2


def test_robot_is_slow_when_it_enters_a_speed_limit_and_fast_again_behind_it():
    zone = Zone("hall", ZoneKind.SPEED_LIMIT, box(4.4, 4.1, 5.4, 7.0), speed_m_s=0.2)
    step, poses, speeds = go(Pose2D(2.2, 5.5, 0.0), Pose2D(7.6, 5.5, 0.0), zone)
    assert isinstance(step, Succeeded), step.message
    inside = body_inside(zone, poses)
    assert inside.sum() > 60
    assert speeds[inside].max() <= 0.25
    assert speeds[poses[:, 0] < 4.0].max() > 0.4 and speeds[poses[:, 0] > 6.0].max() > 0.4


def test_a_share_is_one_of_the_speed_at_which_the_robot_drives():
    zone = Zone("hall", ZoneKind.SPEED_LIMIT, CORRIDOR, share=0.5)
    context = dataclasses.replace(Bench(START).context(), zones=(zone,))
    assert context.zone_map().speed_m_s(FOOTPRINT, pose_array([START]), np.zeros(1)) == pytest.approx(0.4)


def test_a_path_prefers_a_lane():
    poses, _ = plan(Zone("lane", ZoneKind.PREFERRED, box(2.5, 4.4, 7.5, 5.1)))
    between = poses[(poses[:, 0] > 3.2) & (poses[:, 0] < 6.8)]
    assert ((between[:, 1] > 4.4) & (between[:, 1] < 5.1)).all()
    assert (plan()[0][:, 1] > 5.1).all()


def test_a_path_does_not_go_against_a_one_way_zone():
    lane = Zone("lane", ZoneKind.ONE_WAY, box(3.0, 5.1, 7.0, 6.0), direction_rad=math.pi)
    poses, _ = plan(lane)
    steps, middle = np.diff(poses, axis=0), 0.5 * (poses[1:] + poses[:-1])
    inside = (middle[:, 0] > 3.05) & (middle[:, 0] < 6.95) & (middle[:, 1] > 5.15) & (middle[:, 1] < 5.95)
    assert (steps[inside, 0] < 0.005).all()
    assert np.array_equal(plan(lane, start=OTHER_END, goal=START)[0], plan(start=OTHER_END, goal=START)[0])


def test_a_one_way_zone_that_leaves_no_path_is_named():
    with pytest.raises(NoPathError, match="The hall is a one-way zone"):
        plan(Zone("hall", ZoneKind.ONE_WAY, box(3.0, 4.1, 7.0, 7.0), direction_rad=math.pi))


def test_a_start_in_a_one_way_zone_may_leave_it_against_the_direction():
    poses, _ = plan(Zone("hall", ZoneKind.ONE_WAY, box(0.0, 4.1, 4.0, 7.0), direction_rad=math.pi))
    assert poses[-1, 0] == OTHER_END.x_m


def test_zones_without_costs_change_no_plan_and_expand_as_many_states():
    bare, among = plan(), plan(Zone("far", ZoneKind.ONE_WAY, box(0.2, 0.2, 0.5, 0.3)))
    assert np.array_equal(bare[0], among[0]) and bare[1] == among[1]
    assert not zone_map((Zone("hush", ZoneKind.SILENT, CORRIDOR),), FULL_M_S).has_costs(START)


def test_a_zone_of_square_kilometres_is_drawn_on_larger_cells():
    zones = zone_map((Zone("land", ZoneKind.KEEP_OUT, box(-9000.0, -9000.0, 9000.0, -100.0)),), FULL_M_S)
    assert zones.keep_out.size < 5_000_000
    assert zones.names_at(ZoneKind.KEEP_OUT, Pose2D(0.0, -200.0, 0.0)) == ("land",)


def mask_zone(folder, values, kind, info, mode="raw"):
    cv2.imwrite(str(folder / "mask.pgm"), np.flipud(values).astype(np.uint8))
    text = f"image: mask.pgm\nmode: {mode}\nresolution: 0.5\norigin: [1.0, 2.0, 0.0]\nnegate: 0\n"
    (folder / "mask.yaml").write_text(f"{text}occupied_thresh: 1.0\nfree_thresh: 0.0\n")
    return zone_map((Zone("mask", kind, mask=ZoneMask(str(folder / "mask.yaml"), *info)),), FULL_M_S)


def at(zones, grid, x, y):
    row, column, _ = zones.cells(np.array([[x, y]]))
    return grid[row[0], column[0]]


def test_a_keep_out_mask_blocks_full_cells_and_makes_others_dearer(tmp_path):
    values = np.array([[0, 100, 50], [255, 0, 0]])
    zones = mask_zone(tmp_path, values, ZoneKind.KEEP_OUT, (FilterType.KEEP_OUT, 0.0, 1.0))
    assert at(zones, zones.keep_out, 1.75, 2.25) and zones.keep_out.sum() == 100
    factor = zones.costs(np.array([1.25, 2.25]), np.array([2.25, 2.75]), FULL_M_S).factor
    assert factor.tolist() == [[1.0, 2.0], [1.0, 1.0]]


@pytest.mark.parametrize(
    ("info", "value", "mode", "limit_m_s"),
    [
        ((FilterType.SPEED_SHARE, 100.0, -1.0), 75, "raw", 0.2),
        ((FilterType.SPEED_SHARE, 100.0, -1.0), 0, "raw", 0.8),
        ((FilterType.SPEED_SHARE, 100.0, -1.0), 100, "raw", math.inf),
        ((FilterType.SPEED_SHARE, 100.0, -1.0), 255, "raw", math.inf),
        ((FilterType.SPEED_SHARE, 100.0, -1.0), 127, "scale", 0.4),  # a share of darkness
        ((FilterType.SPEED, 0.1, 0.01), 20, "raw", 0.3),
    ],
)
def test_a_speed_mask_limits_by_share_or_by_speed(tmp_path, info, value, mode, limit_m_s):
    zones = mask_zone(tmp_path, np.full((8, 8), value), ZoneKind.SPEED_LIMIT, info, mode)
    found = zones.speed_m_s(FOOTPRINT, pose_array([Pose2D(3.0, 4.0, 0.0)]), np.zeros(1))
    assert found == pytest.approx(limit_m_s)


def test_the_robot_knows_the_silent_zone_in_which_it_stands():
    hush = Zone("corridor", ZoneKind.SILENT, CORRIDOR)
    places = (START, Pose2D(1.5, 2.0, 0.0))
    contexts = [dataclasses.replace(Bench(place).context(), zones=(hush,)) for place in places]
    assert [context.silent_zone() for context in contexts] == ["corridor", None]


def test_the_sentence_names_all_zones():
    assert zones_sentence(["hall"], "keep-out zone") == "The hall is a keep-out zone."
    assert (
        zones_sentence(["hall", "lab", "bath"], "keep-out zone") == "The hall, the lab and the bath are keep-out zones."
    )
