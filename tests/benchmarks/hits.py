"""Random missions that carry tools and cubes: what the gripper hits, and what the robot does then. Prints JSON.

    python -m tests.benchmarks.hits [--first 9700] [--count 20] [--world flat] [--jobs 1] [--out FOLDER]

The seed draws the object and its goal, and places the objects. `hits` are the collisions, `by` these by the part of the
robot, what it hit, and what the robot said that it did.
"""

import re
from collections import Counter

import numpy as np

from executive.run.visitor import RunVisitor
from tests.benchmarks.harness import benchmark
from tests.benchmarks.plant_mission import PlantMission

THINGS = ("hammer", "screwdriver", "wrench", "cube")
GOALS = {
    "flat": ("kitchen table", "kitchen counter", "coffee table", "desk", "sideboard", "Robin"),
    "lab": ("kitchen counter", "desk", "lab bench"),
    "shop": ("display table", "checkout counter"),
}
SAID = re.compile(r"the (hammer|screwdriver|wrench|cube|object)")


def cases(first: int = 9700, count: int = 20, world: str = "flat"):
    return [(world, seed) for seed in range(first, first + count)]


def drawn(world, seed):
    """The sentence of a seed."""
    rng = np.random.default_rng([seed, 23])
    thing, goal = THINGS[int(rng.integers(len(THINGS)))], GOALS[world][int(rng.integers(len(GOALS[world])))]
    return f"bring Robin the {thing}" if goal == "Robin" else f"take the {thing} to the {goal}"


class Watch(RunVisitor):
    """Visitor that notes what the robot says that it does when a collision is counted."""

    def __init__(self, mission):
        self.referee, self.doing, self.hits = mission.simulation.referee, "", []
        mission.simulation.engine.observe(self, every=4)

    def __call__(self, now_s):
        for each in self.referee.collisions[len(self.hits) :]:
            self.hits.append(f"{SAID.sub('it', self.doing)}: {each.sentence.rsplit(' at ', 1)[0]}")

    def message(self, topic, message):
        if topic in ("transitions", "activity") and message.get("message"):
            self.doing = message["message"]
        return message


def run_case(world, seed, folder):
    mission = PlantMission(folder, seed, sentence=drawn(world, seed), world=world, require_wake=False)
    watch = Watch(mission)
    return {**vars(mission.end(drawn(world, seed), watch)), "hits": watch.hits}


def summary(results):
    return {
        "missions": len(results),
        "fulfilled": sum(bool(each.fulfilled) for each in results),
        "false": sum(each.false_claim for each in results),
        "drops": sum(each.drops for each in results),
        "hits": sum(each.collisions for each in results),
        "with_hits": sum(each.collisions > 0 for each in results),
        "by": dict(Counter(hit for each in results for hit in each.hits).most_common()),
        "failed": [f"{each.seed} {each.what}: {each.message} / {each.why}" for each in results if not each.fulfilled],
    }


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
