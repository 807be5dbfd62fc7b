"""Thin tools taken from a table, held and turned with: is what the robot believes of its gripper true? Prints JSON.

    python -m tests.benchmarks.thin_tools [--tools a,b] [--trials 5] [--first 9500] [--jobs 1] [--out FOLDER]

Each trial puts a tool of `thin_tools.yaml` on a table of random height. The robot stands before it and is told where
the tool lies, within 5 mm. It grasps, at most three times, holds for ten seconds, and turns to and fro meanwhile; then
it feels once more, as before it puts something down. The referee knows the truth. `denied` are the trials in which
the robot says "nothing" of a tool in its gripper; `false` those in which it believes in one that is not there.
`equal_tries` are those with three equal grasps, `hits` the collisions with the table.
"""

from collections import Counter
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from executive.app.prepare.placed_robots import only_robot
from executive.app.runs.simulated import simulate
from executive.run.worker import LockStepWorker
from plant.worlds.seeding import place_objects
from skills.api import TOUCHES, Running, SkillContext, Succeeded
from skills.grid_map import load_grid_map, map_columns
from skills.manipulation.grasp.candidates import same_grasp
from skills.manipulation.grasp.skill import Grasp, GraspInputs
from skills.manipulation.posture import Stow, StowInputs
from skills.robot import Pose2D
from skills.testing.estimators import BlockCostmap, KnownPlace, PlainColours
from skills.world_model import ObjectKind, ObjectObservation
from tests.benchmarks.harness import benchmark, by, quantile
from tests.benchmarks.manipulation_room import ROBOT, TAKEN, TARGET, room
from tests.benchmarks.shapes import TOOLS, written_tool

OFF_M, BEFORE_M, ATTEMPTS, HELD_S, TICK_S, TURN_RAD_S, LIMIT_S = 0.005, (0.62, 0.74), 3, 10.0, 0.05, 0.5, 150.0
FELT_S = 0.5
"""Time that the robot has to notice."""


def cases(tools: tuple[str, ...] = tuple(TOOLS), trials: int = 5, first: int = 9500):
    return [(name, seed) for seed in range(first, first + trials) for name in tools]


class Bench:
    """The robot before the table, and what the referee sees in its gripper."""

    def __init__(self, name, seed, folder):
        world = room(folder / "room", "thing", [], "table", seed, written_tool(name, folder))
        self.rng = np.random.default_rng([seed, *name.encode()])
        self.surface, (placed, *_) = world.surfaces[TAKEN], place_objects(world, seed)
        start, named = self._start(placed.X_WO.translation()), only_robot(ROBOT, world)
        self.simulation = simulate(world, {ROBOT: replace(named, start=start)}, seed=seed, record=False)
        self.history = self.simulation.referee.objects[TARGET]
        self.clock, self.robot, self._told = self.simulation.clock, self.simulation.robots[ROBOT], []
        place = KnownPlace(start)
        self.context = SkillContext(
            robot=self.robot,
            lease=self.robot.take_lease("bench"),
            clock=self.clock,
            worker=LockStepWorker(self.clock),
            localiser=place,
            costmap=BlockCostmap(),
            solid_columns=map_columns([load_grid_map(path) for path in world.scan_map_paths], [self.surface]),
            publish=self._publish,
            seed=seed,
            detector=PlainColours(MappingProxyType({})),
        )
        self.mistaken_s = Counter()
        self.longest_s = Counter()

    def _publish(self, topic, message):
        if topic == TOUCHES:
            self.simulation.referee.expect_touch(ROBOT, message["until_s"])

    def _start(self, p_W):
        """Pose before the table's front, the tool ahead."""
        front_m = min(y for _, y in self.surface.polygon_W)
        return Pose2D(p_W[0] + self.rng.uniform(-0.15, 0.15), front_m - self.rng.uniform(*BEFORE_M), 0.5 * np.pi)

    @property
    def has_it(self):
        return bool(self.history._carried and self.history.holder is not None and not self.history._supported)

    def observation(self):
        """The tool as seen: its true pose, a little off."""
        plant, context = self.simulation.engine.world.plant, self.simulation.engine.context
        body = plant.get_body(plant.GetBodyIndices(plant.GetModelInstanceByName(TARGET))[0])
        X_WO, sides_m = plant.EvalBodyPoseInWorld(context, body), self.history.sides_m
        x, y, z = X_WO.translation() + np.array([*self.rng.uniform(-OFF_M, OFF_M, 2), 0.0])
        axis = X_WO.rotation().matrix()[:, 0]
        size_m = (float(sides_m[0]), float(sides_m[1]), float(sides_m[2]))
        yaw_rad = float(np.arctan2(axis[1], axis[0]))
        place_W = (float(x), float(y), float(z))
        return ObjectObservation(self.clock.now(), ObjectKind("thing"), place_W, size_m, yaw_rad, 0.9, TAKEN)

    def run(self, skill, inputs):
        """Runs a skill to its end; returns its last step."""
        until_s = self.clock.now() + LIMIT_S
        skill.begin(inputs)
        while isinstance(step := skill.step(), Running) and self.clock.now() < until_s:
            self.clock.advance(TICK_S)
        skill.end()
        return step

    def hold(self):
        """Holds still, then turns to and fro; counts the time in which the robot's belief is wrong, without a break."""
        robot, end_s = self.robot, self.clock.now() + HELD_S
        while (left_s := end_s - self.clock.now()) > 0.0:
            if left_s < 0.6 * HELD_S:
                turn = TURN_RAD_S if left_s > 0.3 * HELD_S else -TURN_RAD_S
                robot.drive(0.0, 0.0, turn, until_s=self.clock.now() + 0.3, lease=self.context.lease)
            self.clock.advance(TICK_S)
            self.note()

    def note(self):
        believes, has = self.robot.gripper().holding, self.has_it
        for what, wrong in (("denied", has and not believes), ("false", believes and not has)):
            self.mistaken_s[what] = self.mistaken_s[what] + TICK_S if wrong else 0.0
            self.longest_s[what] = max(self.longest_s[what], self.mistaken_s[what])


def run_case(name, seed, folder):
    bench, tried, told, denied, claims = Bench(name, seed, folder), (), [], 0, 0
    taken = False
    while not taken and len(told) < ATTEMPTS:
        step = bench.run(Grasp(bench.context), GraspInputs(bench.observation(), tried))
        taken, had = isinstance(step, Succeeded), bench.has_it
        told.append(step.message)
        outputs = getattr(step, "outputs", {})
        tried = outputs.get("tried", tried)
        denied += (not taken) and had
        claims += taken and not had
    held = bench.has_it
    if taken:
        bench.hold()
        bench.run(Stow(bench.context), StowInputs())
        bench.note()
        believes = bench.robot.gripper().holding
        denied += bench.has_it and (not believes or bench.longest_s["denied"] > FELT_S)
        claims += believes and not bench.has_it
    equal = [
        len(tried) > 2 and same_grasp(tried[k], tried[k + 1]) and same_grasp(tried[k], tried[k + 2])
        for k in range(len(tried) - 2)
    ]
    return {
        "name": name,
        "seed": seed,
        "lifted": bool(bench.history.lifts),
        "held": held,
        "kept": held and bench.has_it,
        "attempts": len(told),
        "denied": denied > 0,
        "false": claims > 0,
        "equal_tries": any(equal),
        "hits": [each.sentence for each in bench.simulation.referee.collisions],
        "opening": round(bench.robot.gripper().opening, 3),
        "told": told,
        "sim_time_s": round(bench.clock.now(), 1),
    }


def summary(results):
    return {
        "trials": len(results),
        **{
            key: sum(getattr(each, key) for each in results)
            for key in ("lifted", "held", "kept", "denied", "false", "equal_tries")
        },
        "hits": sum(len(each.hits) for each in results),
        "attempts": dict(sorted(Counter(each.attempts for each in results).items())),
        "by_tool": {name: f"{sum(e.held for e in own)}/{len(own)}" for name, own in by(results, "name").items()},
        "told": dict(Counter(text for each in results for text in each.told).most_common()),
        "simulated_s": quantile([each.sim_time_s for each in results], digits=1),
    }


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
