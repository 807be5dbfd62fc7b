"""Rooms behind closed doors: whether the failure names the doors, and how soon; prints JSON.

    python -m tests.benchmarks.closed_doors [--first 9840] [--count 20] [--detours 0] [--jobs 1] [--out FOLDER]

Each case is drawn from its number: a world, a room of it, and when each of its doors closes: before the drive, or
after up to ten seconds. The robot is to go to the room. `named`: the failure names all closed doors that it saw, at
least one, and no open door. `given_up_s`: the robot's time from when it had seen the last of them closed to its
failure. With `--detours`, that many more cases have one door of the room left open, and the robot arrives.
"""

import cv2
import numpy as np

from executive.record.history import read_history
from executive.words.knowledge import load_knowledge
from executive.words.schemas import DOORS
from plant.worlds.world import load_world
from skills.grid_map import load_grid_map
from tests.benchmarks.harness import benchmark, totals
from tests.benchmarks.plant_mission import PlantMission

WORLDS = ("flat", "shop", "lab")
MOST_DOORS = 2
LATEST_S, LIMIT_S = 10.0, 300.0
WITHIN_S = 15.0
BODY_M, JAMB_M = 0.2, 0.1


def cases(first: int = 9840, count: int = 20, detours: int = 0):
    return [*((first + n, False) for n in range(count)), *((first + n, True) for n in range(detours))]


def draw(number, *, detour):
    """World, room, and its doors with the times (s) at which they close; None for the one that a detour leaves open."""
    rng = np.random.default_rng([number, 51, detour])
    while True:
        world = str(rng.choice(WORLDS))
        knowledge = load_knowledge(load_world(world).knowledge_path)
        room = str(rng.choice(list(knowledge.rooms)))
        doors = [door.between for door in knowledge.doors if room in door.between]
        if not (2 if detour else 1) <= len(doors) <= MOST_DOORS or not is_cut_off(world, knowledge, room):
            continue
        times = [0.1 if rng.random() < 0.5 else round(float(rng.uniform(1.0, LATEST_S)), 1) for _ in doors]
        order = rng.permutation(len(doors))
        return world, room, [(doors[n], None if detour and k == 0 else times[n]) for k, n in enumerate(order)]


def is_cut_off(world, knowledge, room):
    """True if the doors of a room are its only ways in, from the robot's start, on the map."""
    grid = load_grid_map(load_world(world).keepout_map_path).with_unknown_blocked()
    free = grid.distance > BODY_M
    for door in knowledge.doors:
        if room in door.between:
            cells = np.argwhere(free)
            near = np.hypot(*(grid.centres(cells) - door.at).T) < 0.5 * door.width + JAMB_M
            free[tuple(cells[near].T)] = False
    labels, cells = cv2.connectedComponents(free.astype(np.uint8), connectivity=8)[1], np.argwhere(free)
    ends = (knowledge.start, knowledge.places[room].pose)
    nearest = [cells[np.argmin(np.hypot(*(grid.centres(cells) - [at.x, at.y]).T))] for at in ends]
    here, there = (labels[tuple(cell)] for cell in nearest)
    return bool(here != there)


def run_case(number, detour, folder):
    world, room, closings = draw(number, detour=detour)
    closes_s = {frozenset(door): at_s for door, at_s in closings if at_s is not None}
    events = "".join(f"  - {{door: {list(door)}, closes: {at_s}}}\n" for door, at_s in closings if at_s is not None)
    scenario = folder / "scenario.yaml"
    scenario.write_text(f"events:\n{events}".replace("'", '"'))
    asked = {"sentence": f"go to the {room}", "scenario_files": (scenario,), "time_limit_s": LIMIT_S}
    ended = PlantMission(folder, number, world=world, **asked).end(f"{room} in {world}")
    seen_s = {}
    for event in read_history(folder / "log.mcap").events:
        for door in event.data["doors"] if event.topic == DOORS else ():
            if door["state"] == "closed" and frozenset(door["between"]) in closes_s:
                seen_s.setdefault(frozenset(door["between"]), event.stamp_s)
    every = [door.between for door in load_knowledge(load_world(world).knowledge_path).doors]
    named = {frozenset(door) for door in every if f"between the {door[0]} and the {door[1]}" in ended.message}
    given_up_s = round(ended.sim_time_s - max(seen_s.values()), 1) if seen_s else None
    right = bool(named) and named == set(seen_s)
    return vars(ended) | {"detour": detour, "named": right, "given_up_s": given_up_s}


def summary(results):
    closed = [each for each in results if not each.detour]
    late = [each for each in closed if each.given_up_s is None or each.given_up_s > WITHIN_S]
    return {
        "closed": len(closed),
        **totals(closed, "named"),
        "given_up_s": sorted(each.given_up_s for each in closed if each.given_up_s is not None),
        "given_up_late": [each.seed for each in late],
        "not_named": [each.seed for each in closed if not each.named],
        "detours": len(results) - len(closed),
        "arrived": sum(each.detour and each.claimed for each in results),
        "collisions": sum(each.collisions for each in results),
    }


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
