"""Docking over Spot's API from drawn poses on free floor before the dock. Prints JSON.

    python -m tests.benchmarks.spot_docking [--first 1] [--count 10]

A pose lies 1.3 to 3.5 m from the dock and within 50 degrees of its axis, with any heading, where the body fits and the
straight line to the place before the dock is free. `docked` counts the runs that the server reports as docked and the
plant's truth shows on the dock, within 0.12 m and 0.2 rad.
"""

import math

import numpy as np
from bosdyn.api.docking import docking_pb2

from errand_spot.server.docking import DOCK_ID
from executive.app.prepare.placed_robots import only_robot
from executive.app.prepare.worlds import open_world
from skills.geometry import compose, inverse
from skills.grid_map import load_grid_map
from skills.robot import Pose2D
from tests.benchmarks.harness import benchmark, quantile

FAR_M, ASIDE_RAD, ROOM_M, LINE_M, PREP_M = (1.3, 3.5), math.radians(50.0), 0.6, 0.4, 0.9
NEAR_M, NEAR_RAD = 0.12, 0.2
Progress = docking_pb2.DockingCommandFeedbackResponse


def cases(first: int = 1, count: int = 10):
    return [(number,) for number in range(first, first + count)]


def drawn(number):
    """The pose of a number."""
    world, draw = open_world("flat"), np.random.default_rng(number)
    dock = only_robot("Alice", world, seed=1).dock
    ground = load_grid_map(world.surveyed.keepout_map_path).with_unknown_blocked()
    prep = compose(dock, Pose2D(PREP_M, 0.0, 0.0))
    while True:
        far_m, aside, yaw = draw.uniform(*FAR_M), draw.uniform(-ASIDE_RAD, ASIDE_RAD), draw.uniform(-math.pi, math.pi)
        pose = compose(dock, Pose2D(far_m * math.cos(aside), far_m * math.sin(aside), yaw))
        line = np.linspace((pose.x_m, pose.y_m), (prep.x_m, prep.y_m), 30)
        if ground.distance_m(line[:1]).min() > ROOM_M and ground.distance_m(line).min() > LINE_M:
            return pose


def run_case(number, folder):
    from tests.benchmarks.spot_client import SpotClient

    start = drawn(number)
    client = SpotClient(start, number, folder)
    request = docking_pb2.DockingCommandRequest(
        lease=client.lease, docking_station_id=DOCK_ID, clock_identifier=client.clock, end_time=client.ends(90.0)
    )
    answer = client.call("docking", "DockingCommand", request)
    asked = docking_pb2.DockingCommandFeedbackRequest(docking_command_id=answer.docking_command_id)

    def status():
        return client.call("docking", "DockingCommandFeedback", asked).status

    began_s = client.truth.clock.now()
    client.until(lambda: status() != Progress.STATUS_IN_PROGRESS, 95.0)
    off = compose(inverse(client.dock_W), client.truth.true_pose("Alice"))
    off_m, off_rad = math.hypot(off.x_m, off.y_m), abs(off.yaw_rad)
    told = Progress.Status.Name(status())
    docked = told == "STATUS_DOCKED" and off_m < NEAR_M and off_rad < NEAR_RAD
    return {
        "start": [round(value, 2) for value in (start.x_m, start.y_m, start.yaw_rad)],
        "told": told,
        "off_m": round(off_m, 3),
        "off_rad": round(off_rad, 3),
        "took_s": round(client.truth.clock.now() - began_s, 1),
        "contacts": len(client.truth.referee.collisions),
        "docked": docked,
    }


def summary(results):
    return {
        "docked": sum(each.docked for each in results),
        "of": len(results),
        "contacts": sum(each.contacts for each in results),
        "median_s": quantile([each.took_s for each in results if each.docked], digits=1),
        "others": [each for each in results if not each.docked],
    }


if __name__ == "__main__":
    benchmark(cases, run_case, summary, alone=True)  # a renderer must end in the thread it began in
