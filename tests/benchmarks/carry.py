"""How surely the robot carries what it has picked up: over 20 m and through doors of the flat. Prints JSON.

    python -m tests.benchmarks.carry [--classes coke,beer] [--trials N] [--seed S] [--jobs 1] [--out FOLDER] [--json]

The robot takes an object in the room where its class usually is and goes with it to another room, back, and there
again. The plant's truth judges: `lost` when the object was taken and is not in the gripper at the end, or was not at
any time in between; `carried` when it was brought 20 m and through two doors at least without that.
"""

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise, product

import shapely

from plant.simulation import Simulation
from plant.worlds.world import load_world
from tests.benchmarks.harness import benchmark, totals
from tests.benchmarks.manipulation_room import LOOK_S, ROBOT, TARGET
from tests.benchmarks.plant_mission import PlantMission

PLACES = {"coke": "kitchen", "beer": "kitchen"} | dict.fromkeys(
    ("hammer", "cube", "wrench", "screwdriver", "cylinder", "extinguisher"), "workshop"
)
FAR = {"kitchen": "bedroom", "workshop": "kitchen"}
OPENING = {"hall", "living room"}
"""Rooms with an opening between them, which is no door."""
CARRIED_M, DOORS, FLICKER_S = 20.0, 2, 0.5


@dataclass
class Way:
    """Observer of an object on its way: how far it is carried (m), the rooms, and when it is lost (s)."""

    simulation: Simulation
    way_m: float = 0.0
    rooms: list[str] = field(default_factory=list)
    lost_at_s: float | None = None
    _xy_W: tuple[float, float] | None = None
    _held_s: float | None = None
    _due_s: float = 0.0

    def __call__(self, now_s):
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
        self.way_m += 0.0 if before is None else math.dist(self._xy_W, before)
        self.rooms = entered(self.rooms, room_at(self.simulation.world, self._xy_W))


def room_at(world, xy_W):
    point = shapely.Point(xy_W)
    return next((name for name, corners in world.rooms.items() if shapely.Polygon(corners).contains(point)), None)


def entered(rooms, room):
    """Rooms in the order in which they were entered, with the one that the robot is in now."""
    return [*rooms, room] if room is not None and room not in rooms[-1:] else list(rooms)


def doors(rooms):
    return sum({one, other} != OPENING for one, other in pairwise(rooms))


def flat_with(class_name):
    """The flat with nobody and nothing in it but one object of a class, called `target`, where the class usually is."""
    world = load_world("flat").without_people()
    (rule,) = (each for each in world.seed_rules.objects if each.model == class_name)
    only = (rule.model_copy(update={"name": TARGET}),)
    return replace(world, seed_rules=world.seed_rules.model_copy(update={"objects": only}))


def cases(classes: tuple[str, ...] = ("coke", "beer"), trials: int = 2, seed: int = 1):
    if unknown := [name for name in classes if name not in PLACES]:
        raise SystemExit(f"no class {', '.join(unknown)} is in the flat; there are {', '.join(PLACES)}")
    return product(classes, range(seed, seed + trials))


def run_case(class_name, seed, folder):
    near = PLACES[class_name]
    goals = (FAR[near], near, FAR[near])
    commands = (
        f"Take [Nothing] to [{near}] and do [grasp] to [{class_name}]",
        *(f"Take [Nothing] to [{goal}] and do [Nothing] to [Nothing]" for goal in goals),
    )
    world = flat_with(class_name)
    asked = {"commands": commands, "robot": ROBOT, "time_limit_s": 600.0}
    mission = PlantMission(folder, seed, change=lambda _: world, **asked)
    way = Way(mission.simulation)
    mission.simulation.engine.observe(way)
    ended, taken = mission.end(class_name), bool(way.rooms)
    held = mission.simulation.referee.objects[TARGET].holder is not None
    lost = taken and (way.lost_at_s is not None or not held)
    carried = taken and not lost and way.way_m >= CARRIED_M and doors(way.rooms) >= DOORS
    told = {"lost_at_s": way.lost_at_s, "way_m": round(way.way_m, 1), "doors": doors(way.rooms)}
    return vars(ended) | {"taken": taken, "lost": lost, "carried": carried, **told}


def summary(trials):
    return {"runs": trials, **totals(trials, "lost", "carried")}


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
