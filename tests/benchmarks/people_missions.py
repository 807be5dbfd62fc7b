"""Missions to meet, tell, ask and greet people who stand at random places of the flat; prints JSON.

    python -m tests.benchmarks.people_missions [--first 9760] [--count 30] [--jobs 1] [--out FOLDER] [--json]

Robin, Maya and Sam stand in their usual rooms, in other rooms, or are absent, by the seed. The robot knows nobody by
face and asks "Are you Robin?"; the nearest person within 3 m answers. Missions take turns: meet, tell,
ask, greet. A claim is right when the referee confirms a success, and a denial when the person is absent. A claim that
the referee does not confirm is a false one.
"""

import math
import shutil

import numpy as np
import yaml

from executive.words.mission import Route
from executive.words.outlines import inside
from plant.worlds.seeding import add_answers
from plant.worlds.world import load_world
from skills.grid_map import load_grid_map
from tests.benchmarks.harness import benchmark, quantile, totals
from tests.benchmarks.plant_mission import PlantMission

USUAL = {"Robin": "living room", "Maya": "kitchen", "Sam": "office"}
STEPS = {
    "meet": "- {{to: {whom}}}\n",
    "tell": "- {{to: {whom}}}\n- {{speak: Dinner is ready.}}\n",
    "ask": "- {{to: {whom}}}\n- {{ask: Do you want a drink?, choices: {{yes: null, no: null}}}}\n",
    "greet": "- {{to: {whom}, do: greet, object: some person}}\n",
}
GREETED = ("living room", "kitchen", "office", "hall")
CLEAR_M, APART_M, NEVER_S = 0.45, 1.3, 86400.0
ABSENT, ELSEWHERE = 0.15, 0.25


def cases(first: int = 9760, count: int = 30):
    """Kinds of missions in turn, with their seeds."""
    return [([*STEPS][seed % len(STEPS)], seed) for seed in range(first, first + count)]


def make_world(folder):
    """Writes the flat with three people in its knowledge."""
    shutil.copytree(load_world("flat").folder, folder)
    knowledge = yaml.safe_load((folder / "knowledge.yaml").read_text())
    knowledge["people"] = {name: {"at": room} for name, room in USUAL.items()}
    (folder / "knowledge.yaml").write_text(yaml.safe_dump(knowledge))
    return load_world(str(folder))


def draw_people(world, kind, seed):
    """Name of the person or room that a mission is about, and the places of all people."""
    rng = np.random.default_rng(seed)
    grid = load_grid_map(world.folder / "truth" / "keepout.yaml")
    rows, columns = np.nonzero(grid.distance > CLEAR_M)
    points = np.column_stack([columns + 0.5, rows + 0.5]) * grid.resolution_m + np.array(grid.origin_m)
    people = {}
    whom = str(rng.choice(list(USUAL))) if kind != "greet" else str(rng.choice(GREETED))
    for name, usual in USUAL.items():
        drawn = rng.random()
        if drawn < ABSENT:
            continue
        room = usual if drawn > ABSENT + ELSEWHERE else str(rng.choice(list(world.rooms)))
        if kind == "greet" and rng.random() < 0.6:
            room = whom
        taken = [(world.start.x_m, world.start.y_m), *people.values()]
        there = [p for p in points[rng.permutation(len(points))] if inside(world.rooms[room], p)]
        spot = next((p for p in there if all(math.dist(p, other) > APART_M for other in taken)), None)
        if spot is not None:
            people[name] = (float(spot[0]), float(spot[1]))
    return whom, people


def run_case(kind, seed, folder):
    world = make_world(folder / "flat")
    whom, people = draw_people(world, kind, seed)
    routes = {name: Route(waypoints=(at, at), start=NEVER_S) for name, at in people.items()}
    peopled = add_answers(world.without_people().with_routes(routes), {name: {"drink": "yes"} for name in routes})
    steps = STEPS[kind].format(whom=whom)
    mission = PlantMission(folder, seed, steps=steps, world=str(world.folder), change=lambda _: peopled)
    room = world.rooms.get(whom)
    present = whom in people if room is None else any(inside(room, at) for at in people.values())
    ended = mission.end(f"{kind} {whom}")
    right = bool(ended.fulfilled) if ended.claimed else not present
    return vars(ended) | {"right": right, "present": present}


def summary(ends):
    return {
        "missions": len(ends),
        **totals(ends, "right"),
        "fulfilled": sum(each.claimed and bool(each.fulfilled) for each in ends),
        "false_claims": [each.seed for each in ends if each.false_claim],
        "wrong_denials": [each.seed for each in ends if each.present and not each.claimed],
        **totals(ends, "people_hit"),
        "time_s_median": quantile([each.sim_time_s for each in ends], digits=1),
    }


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
