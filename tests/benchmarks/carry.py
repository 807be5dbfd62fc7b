"""How surely the robot carries what it has picked up: over 20 m and through doors of the flat. Prints JSON at the end.

    python -m tests.benchmarks.carry [--classes coke,beer] [--trials N] [--seed S] [--jobs 2] [--json]

The robot takes an object in the room where its class usually is and goes with it to another room, back, and there
again. The plant's truth judges: `lost` when the object was taken and is not in the gripper at the end, or was not at
any time in between; `carried` when it was brought 20 m and through two doors at least without that.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, Final

import numpy as np
import shapely

from executive.app.placed_robots import only_robot
from executive.app.simulated import simulate
from executive.run.outcome import Outcome
from plant.simulation import Simulation
from plant.worlds.world import World, load_world
from tests.benchmarks.manipulation import LOOK_S, ROBOT, TARGET, attempts, run_texts

PLACES: Final = {
    "coke": "kitchen",
    "beer": "kitchen",
    "hammer": "workshop",
    "cube": "workshop",
    "wrench": "workshop",
    "screwdriver": "workshop",
    "cylinder": "workshop",
    "extinguisher": "workshop",
}
FAR: Final = {"kitchen": "bedroom", "workshop": "kitchen"}
OPENING: Final = {"hall", "living room"}
CARRIED_M, DOORS, FLICKER_S = 20.0, 2, 0.5


@dataclass
class Way:
    """What the truth shows of an object on its way: how far it was carried (m), the rooms, and when it was lost (s)."""

    simulation: Simulation
    way_m: float = 0.0
    rooms: list[str] = field(default_factory=list)
    lost_at_s: float | None = None
    _xy_W: tuple[float, float] | None = None
    _held_s: float | None = None
    _due_s: float = 0.0

    def __call__(self, now_s: float) -> None:
        """Look, ten times a second."""
        if now_s < self._due_s:
            return
        self._due_s = now_s + LOOK_S
        if self.simulation.referee.objects[TARGET].holder is None:
            if self._held_s is not None and now_s - self._held_s > FLICKER_S and self.rooms and self.lost_at_s is None:
                self.lost_at_s = round(self._held_s, 1)
            self._xy_W = None
            return
        self._held_s = now_s
        pose = self.simulation.true_pose(ROBOT)
        before, self._xy_W = self._xy_W, (pose.x_m, pose.y_m)
        if before is not None:
            self.way_m += float(np.hypot(pose.x_m - before[0], pose.y_m - before[1]))
        self.rooms = entered(self.rooms, room_at(self.simulation.world, self._xy_W))


def room_at(world: World, xy_W: tuple[float, float]) -> str | None:
    """The room about a point, None in a doorway."""
    point = shapely.Point(xy_W)
    return next((name for name, corners in world.rooms.items() if shapely.Polygon(corners).contains(point)), None)


def entered(rooms: Sequence[str], room: str | None) -> list[str]:
    """The rooms in the order in which they were entered, with the one that the robot is in now."""
    return [*rooms, room] if room is not None and room not in rooms[-1:] else list(rooms)


def flat_with(class_name: str) -> World:
    """The flat with nobody and nothing in it but one object of a class, called `target`, where the class usually is."""
    world = load_world("flat").without_people()
    (rule,) = (each for each in world.seed_rules.objects if each.model == class_name)
    only = (rule.model_copy(update={"name": TARGET}),)
    return replace(world, seed_rules=world.seed_rules.model_copy(update={"objects": only}))


def doors(rooms: Sequence[str]) -> int:
    """How many doors lie on a way through rooms; between two of them is an opening without one."""
    return sum({one, other} != OPENING for one, other in pairwise(rooms))


def attempt(chosen: tuple[str, int]) -> dict[str, Any]:
    """Take an object of a class, carry it there and back and there again; what the plant's truth says of it."""
    class_name, seed = chosen
    world = flat_with(class_name)
    simulation = simulate(world, {ROBOT: only_robot(ROBOT, world)}, seed=seed, record=False)
    way, near = Way(simulation), PLACES[class_name]
    simulation.engine.observe(way)
    legs = (FAR[near], near, FAR[near])
    texts = (
        f"Take [Nothing] to [{near}] and do [grasp] to [{class_name}]",
        *(f"Take [Nothing] to [{goal}] and do [Nothing] to [Nothing]" for goal in legs),
    )
    result = run_texts(simulation, world, texts, seed).result
    held = simulation.referee.objects[TARGET].holder is not None
    taken = bool(way.rooms)
    lost = taken and (way.lost_at_s is not None or not held)
    return {
        "class": class_name,
        "seed": seed,
        "taken": taken,
        "lost": lost,
        "lost_at_s": way.lost_at_s,
        "carried": taken and not lost and way.way_m >= CARRIED_M and doors(way.rooms) >= DOORS,
        "way_m": round(way.way_m, 1),
        "doors": doors(way.rooms),
        "collisions": len(simulation.referee.collisions),
        "cause": "" if result.outcome is Outcome.SUCCESS else f"{result.cause}: {result.message}",
        "sim_time_s": round(simulation.clock.now(), 1),
    }


def trial_line(run: Mapping[str, Any]) -> str:
    """One line of a trial."""
    ended = "carried" if run["carried"] else "lost" if run["lost"] else "not carried" if run["taken"] else "not taken"
    return (
        f"{run['class']:12} seed {run['seed']:3} {ended:11} {run['way_m']:5.1f} m, {run['doors']} doors, "
        f"bumps {run['collisions']} {run['sim_time_s']:5.0f} s  {run['cause']}"
    )


def summary(runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """How many were lost and how many carried."""
    return {"lost": sum(run["lost"] for run in runs), "carried": sum(run["carried"] for run in runs)}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--classes", default="coke,beer", help=f"of {', '.join(PLACES)}")
    parser.add_argument("--trials", type=int, default=2, help="of each class, one by each seed")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", action="store_true", help="one line of JSON at the end")
    options = parser.parse_args()
    classes = options.classes.split(",")
    if unknown := [name for name in classes if name not in PLACES]:
        parser.error(f"no class {', '.join(unknown)} is in the flat; there are {', '.join(PLACES)}")
    chosen = [(name, options.seed + number) for name in classes for number in range(options.trials)]
    runs = list(attempts(attempt, chosen, options.jobs, trial_line))
    print(json.dumps({"runs": runs, **summary(runs)}, indent=None if options.json else 1))


if __name__ == "__main__":
    main()
