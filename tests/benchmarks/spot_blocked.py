"""Blocked walks over Spot's API: towards walls, furniture and a person that bar the straight way. Prints JSON.

    python -m tests.benchmarks.spot_blocked [--first 1] [--count 10]

Every fifth walk leads from the flat's start into the person there; the others begin at drawn poses with something of
the flat 0.3 to 1.5 m ahead of the body. Each walk has its goal 3 m ahead. `blocked` counts those that the server
reports as STOPPED and BLOCKED at most 3 s after the body has come to rest; `contacts` those with what was in the way.
"""

import math

import numpy as np
from bosdyn.api import basic_command_pb2
from bosdyn.client.robot_command import RobotCommandBuilder as Build

from errand_spot.messages import frame_tree
from executive.app.prepare.worlds import open_world
from skills.grid_map import load_grid_map
from skills.robot import Pose2D
from tests.benchmarks.harness import benchmark, quantile

FREE_M, ROOM_M, GOAL_M, HALF_LENGTH_M, HALF_WIDTH_M = (0.3, 1.5), 0.62, 3.0, 0.55, 0.2
STILL_M_S, MOST_S, PERSON_EVERY = 0.02, 3.0, 5
Walk = basic_command_pb2.SE2TrajectoryCommand.Feedback


def cases(first: int = 1, count: int = 10):
    return [(number,) for number in range(first, first + count)]


def drawn(number):
    """The start of a walk."""
    world, draw = open_world("flat"), np.random.default_rng(number)
    if number % PERSON_EVERY == 0:
        return world.start
    ground = load_grid_map(world.surveyed.keepout_map_path).with_unknown_blocked()
    places = ground.centres(np.argwhere(ground.distance > ROOM_M))
    while True:
        (x, y), yaw_rad = places[draw.integers(len(places))], draw.uniform(-math.pi, math.pi)
        ahead_m = np.arange(HALF_LENGTH_M, HALF_LENGTH_M + FREE_M[1], 0.05)
        line = [x, y] + np.outer(ahead_m, [math.cos(yaw_rad), math.sin(yaw_rad)])
        barred = ground.distance_m(line) < HALF_WIDTH_M
        if barred.any() and ahead_m[barred.argmax()] > HALF_LENGTH_M + FREE_M[0]:
            return Pose2D(float(x), float(y), yaw_rad)


def run_case(number, folder):
    from tests.benchmarks.spot_client import SpotClient

    client = SpotClient(start := drawn(number), number, folder)
    tree = frame_tree(client.computer.snapshot.frames)
    told = client.command(Build.synchro_trajectory_command_in_body_frame(GOAL_M, 0.0, 0.0, tree))
    rest_s, reported_s = math.inf, math.inf

    def over():
        nonlocal rest_s, reported_s
        now_s, before = client.truth.clock.now(), poses[-1]
        poses.append(pose := client.truth.true_pose("Alice"))
        rests = math.hypot(pose.x_m - before.x_m, pose.y_m - before.y_m) / 0.025 < STILL_M_S
        rest_s = min(rest_s, now_s) if rests and len(poses) > 40 else math.inf
        part = told().mobility_command_feedback.se2_trajectory_feedback
        if part.status == Walk.STATUS_STOPPED:
            reported_s = now_s
        return part.status == Walk.STATUS_STOPPED

    poses = [start]
    client.until(over, 25.0)
    part, pose = told().mobility_command_feedback.se2_trajectory_feedback, poses[-1]
    goal = Walk.FinalGoalStatus.Name(part.final_goal_status)
    after_s = reported_s - rest_s if math.isfinite(reported_s) else math.inf
    return {
        "start": [round(value, 2) for value in (start.x_m, start.y_m, start.yaw_rad)],
        "walked_m": round(math.hypot(pose.x_m - start.x_m, pose.y_m - start.y_m), 2),
        "after_s": round(after_s, 2) if math.isfinite(after_s) else None,
        "told": f"{Walk.Status.Name(part.status)} {goal}",
        "contacts": len(client.truth.referee.collisions),
        "blocked": goal == "FINAL_GOAL_STATUS_BLOCKED" and after_s <= MOST_S,
    }


def summary(results):
    return {
        "blocked": sum(each.blocked for each in results),
        "of": len(results),
        "contacts": sum(each.contacts for each in results),
        "median_after_s": quantile([each.after_s for each in results if each.blocked]),
        "others": [each for each in results if not each.blocked],
    }


if __name__ == "__main__":
    benchmark(cases, run_case, summary, alone=True)  # a renderer must end in the thread it began in
