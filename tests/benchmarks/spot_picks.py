"""Picks over Spot's API: objects of the flat, from a drawn place before their surface. Prints JSON.

    python -m tests.benchmarks.spot_picks [--classes coke,hammer] [--first 1] [--count 5] [--jobs 1]

The seed places the objects. The robot stands 1.3 to 1.6 m before the front of the object's surface, up to 0.25 m aside
and turned by up to 0.15 rad. The client lets the hand look down at the object, and picks what lies on the ray from the
hand's camera to the object's true middle; the server finds, walks, plans and grasps. `picked` counts the objects that
the server reports as grasped and the referee saw lifted, in a gripper that holds them.
"""

import math

import numpy as np
from bosdyn.api import manipulation_api_pb2
from bosdyn.client.robot_command import RobotCommandBuilder as Build

from errand_spot.messages import vec3
from executive.app.prepare.worlds import open_world
from plant.worlds.seeding import place_objects
from skills.robot import Pose2D
from tests.benchmarks.harness import benchmark, by, quantile

CLASSES = ("coke", "beer", "hammer", "cube", "extinguisher", "wrench", "screwdriver", "cylinder")
BEFORE_M, ASIDE_M, TURNED_RAD, HAND_M = (1.3, 1.6), 0.25, 0.15, (0.6, 0.0, 0.55)
Api = manipulation_api_pb2
ENDED = (
    Api.MANIP_STATE_GRASP_SUCCEEDED,
    Api.MANIP_STATE_GRASP_FAILED,
    Api.MANIP_STATE_GRASP_PLANNING_NO_SOLUTION,
    Api.MANIP_STATE_GRASP_FAILED_TO_RAYCAST_INTO_MAP,
)


def cases(classes: tuple[str, ...] = CLASSES, first: int = 1, count: int = 5):
    return [(name, seed) for name in classes for seed in range(first, first + count)]


def drawn(world, p_W, draw):
    """Place of the robot before the front edge that is nearest to a point."""
    edges = [np.array(edge) for edges in world.seed_rules.fronts.values() for edge in edges]
    feet = [_nearest_on(edge, p_W[:2]) for edge in edges]
    edge, foot = min(zip(edges, feet, strict=True), key=lambda each: float(np.linalg.norm(each[1] - p_W[:2])))
    along = (edge[1] - edge[0]) / np.linalg.norm(edge[1] - edge[0])
    inward = np.array([-along[1], along[0]])
    inward *= np.sign(inward @ (p_W[:2] - foot))
    x, y = foot - draw.uniform(*BEFORE_M) * inward + draw.uniform(-ASIDE_M, ASIDE_M) * along
    return Pose2D(float(x), float(y), math.atan2(inward[1], inward[0]) + draw.uniform(-TURNED_RAD, TURNED_RAD))


def _nearest_on(edge, p):
    a, b = edge
    share = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return a + share * (b - a)


def run_case(name, seed, folder):
    from tests.benchmarks.spot_client import SpotClient

    world = open_world("flat")
    X_WO = next(each.X_WO for each in place_objects(world, seed) if each.name == name)
    start = drawn(world, X_WO.translation(), np.random.default_rng([seed, CLASSES.index(name)]))
    client = SpotClient(start, seed, folder)
    middle_W = client.truth.referee.objects[name].rests_W[0]
    point_O = start.transform().inverse() @ middle_W
    half = 0.5 * math.atan2(HAND_M[2] + 0.52 - point_O[2], math.hypot(*point_O[:2]) - HAND_M[0])
    turn = 0.5 * math.atan2(point_O[1], point_O[0])
    down = Build.arm_pose_command(
        *HAND_M, math.cos(half) * math.cos(turn), -math.sin(half) * math.sin(turn),
        math.sin(half) * math.cos(turn), math.cos(half) * math.sin(turn), "body", 2.0,
    )  # fmt: skip
    told = client.command(Build.build_synchro_command(down, Build.claw_gripper_open_command()))
    client.until(lambda: told().arm_command_feedback.arm_cartesian_feedback.status == 1, 8.0)
    client.until(lambda: False, 1.0)
    camera_O = client.computer.snapshot.X_AB("odom", "hand_color_image_sensor").translation()
    ray = {"ray_start_rt_frame": vec3(camera_O), "ray_end_rt_frame": vec3(point_O), "frame_name": "odom"}
    pick = Api.ManipulationApiRequest(lease=client.lease, pick_object_ray_in_world=Api.PickObjectRayInWorld(**ray))
    number = client.call("manipulation", "ManipulationApi", pick).manipulation_cmd_id
    asked, states = Api.ManipulationApiFeedbackRequest(manipulation_cmd_id=number), list[int]()

    def ended():
        states.append(client.call("manipulation", "ManipulationApiFeedback", asked).current_state)
        return states[-1] in ENDED

    began_s = client.truth.clock.now()
    client.until(ended, 120.0)
    lifted = [each for each, history in client.truth.referee.objects.items() if history.lifts]
    held = client.computer.snapshot.gripper.holding
    return {
        "class": name,
        "seed": seed,
        "told": Api.ManipulationFeedbackState.Name(states[-1]).removeprefix("MANIP_STATE_"),
        "lifted": lifted,
        "contacts": len(client.truth.referee.collisions),
        "took_s": round(client.truth.clock.now() - began_s, 1),
        "picked": states[-1] == Api.MANIP_STATE_GRASP_SUCCEEDED and name in lifted and held,
    }


def summary(results):
    return {
        "picked": sum(each.picked for each in results),
        "of": len(results),
        "by_class": {name: sum(each.picked for each in own) for name, own in by(results, "class").items()},
        "median_s": quantile([each.took_s for each in results if each.picked], digits=1),
        "others": [each for each in results if not each.picked],
    }


if __name__ == "__main__":
    benchmark(cases, run_case, summary, alone=True)  # a renderer must end in the thread it began in
