"""People whom the robot follows and guides through the flat; prints JSON.

    python -m tests.benchmarks.people_trials [--what follow,crossed,guide] [--first 0] [--count 40] [--jobs 1]

`follow`: the robot is told to follow Robin to a room. Robin walks some 30 m there through three doors or more, by the
seed, turns round in one room at most, changes the pace and is distracted once. `crossed`: two other people walk the
same route the other way. `guide`: the robot guides Robin to a room beyond the hall; Robin stops and turns back once.
The referee judges each run; a run is `wrong_person` when the robot ended near somebody else and did not say that it
lost Robin.
"""

import math
from itertools import product

import numpy as np

from errand_people.judges import lost_s
from executive.words.knowledge import load_knowledge
from executive.words.mission import Distraction, Route
from executive.words.schemas import SPEECH
from plant.referee.object_history import TimedPath
from plant.worlds.world import load_world
from tests.benchmarks.harness import benchmark, for_each, totals
from tests.benchmarks.plant_mission import PlantMission
from tests.visitors import OnMessage

LENGTH_M, LEAST_DOORS = (28.0, 34.0), 3
START_ROOM, BESIDE_M = "living room", 1.6
LIMIT_S = 300.0


def cases(what: tuple[str, ...] = ("follow", "crossed", "guide"), first: int = 0, count: int = 40):
    return product(what, range(first, first + count))


def walk_through(world, rng):
    """Rooms, waypoints and length (m) of a walk of the wanted length; its last room is not passed before."""
    knowledge = load_knowledge(world.knowledge_path)
    while True:
        rooms, points, length_m, doors, turned = [START_ROOM], [world.standing[START_ROOM]], 0.0, 0, False
        while length_m < LENGTH_M[0] and len(rooms) < 12:
            here = [door for door in knowledge.doors if rooms[-1] in door.between]
            ways = [door for door in here if len(rooms) == 1 or rooms[-2] not in door.between]
            if not ways and turned:
                break
            turned, ways = turned or not ways, ways or here
            door = ways[int(rng.integers(len(ways)))]
            (room,) = set(door.between) - {rooms[-1]}
            stand = tuple(np.array(world.standing[room]) + rng.uniform(-0.3, 0.3, size=2))
            length_m += math.dist(points[-1], door.at) + math.dist(door.at, stand)
            rooms, points, doors = [*rooms, room], [*points, stand], doors + 1
        if LENGTH_M[0] <= length_m <= LENGTH_M[1] and doors >= LEAST_DOORS and rooms[-1] not in rooms[:-1]:
            return rooms, points, length_m


def draw_trial(what, seed, world):
    """Sentence for the robot, and the people who walk."""
    rng = np.random.default_rng([seed, len(what)])
    start, beside = world.start, np.array([math.cos(world.start.yaw_rad), math.sin(world.start.yaw_rad)]) * BESIDE_M
    ahead = (float(start.x_m + beside[0]), float(start.y_m + beside[1]))
    if what == "guide":
        room = str(rng.choice([each for each in sorted(world.rooms) if each not in (START_ROOM, "hall")]))
        lapse = Distraction(after=rng.uniform(2.0, 5.0), stop=rng.uniform(2.0, 4.0), back=rng.uniform(1.5, 3.0))
        robin = Route(waypoints=(ahead,), follows="robot", speed=rng.uniform(0.7, 1.1), distractions=(lapse,))
        return f"guide Robin to the {room}", {"Robin": robin}
    rooms, points, length_m = walk_through(world, rng)
    robin = Route(
        waypoints=(ahead, *points[1:]),
        speed=rng.uniform(0.55, 0.8),
        start=86_400.0,
        pace=0.2,
        distractions=(Distraction(after=rng.uniform(5.0, length_m - 8.0), stop=rng.uniform(2.0, 5.0)),),
        apart=True,
    )
    others = {}
    for number, name in enumerate(("Kim", "Lee") if what == "crossed" else ()):
        back = [*points[-1 - number : 0 : -1], points[number]]
        others[name] = Route(waypoints=tuple(back), speed=rng.uniform(0.6, 1.0), start=rng.uniform(5, 30), apart=True)
    return f"follow Robin to the {rooms[-1]}", {"Robin": robin, **others}


def run_case(what, seed, folder):
    """Runs the trial of a seed; Robin sets off when the robot says that it follows."""
    sentence, people = draw_trial(what, seed, load_world("flat"))
    walking = load_world("flat").without_people().with_routes(people)
    mission = PlantMission(folder, seed, change=lambda _: walking, sentence=sentence, time_limit_s=LIMIT_S)

    def set_off(topic, message):
        if topic == SPEECH and "follow you" in message["text"]:
            mission.simulation.engine.walkers["Robin"].set_off()

    ended = mission.end(sentence, *([] if what == "guide" else [OnMessage(set_off)]))
    referee = mission.backend.referee
    robot = TimedPath(np.array(referee.points(mission.robot_name)))
    paths = {each: TimedPath(np.array(points)) for each, points in referee._person_paths.items()}
    away_m = {each: math.dist(path.points[-1, :2], robot.points[-1, :2]) for each, path in paths.items()}
    wrong = away_m["Robin"] > 3.0 and min(away_m.values()) < 3.0 and "lost" not in ended.message
    lost = round(lost_s(robot, paths["Robin"], 0.0, ended.sim_time_s), 1)
    return vars(ended) | {"what": what, "lost_s": lost, "wrong_person": wrong}


def figures(ends):
    return {
        "runs": len(ends),
        "arrived": sum(bool(each.fulfilled) for each in ends),
        "false_claims": sum(each.false_claim for each in ends),
        "contacts": sum(each.people_hit for each in ends),
        "walked_into": sum(each.hit_by_people for each in ends),
        "lost_over_10_s": sum(each.lost_s > 10.0 for each in ends),
        **totals(ends, "wrong_person"),
        "failed": [each.seed for each in ends if not each.fulfilled],
    }


if __name__ == "__main__":
    benchmark(cases, run_case, for_each("what", figures))
