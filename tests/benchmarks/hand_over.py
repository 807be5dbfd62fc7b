"""How surely the robot hands over single objects: it takes one from a table and gives it to a person. Prints JSON.

    python -m tests.benchmarks.hand_over [--classes a,b] [--trials N] [--seed S] [--jobs 1] [--out FOLDER] [--json]

Each trial is a room of `tests.benchmarks.manipulation` with one object of the class on a table of random height, and a
person who takes what is offered. The plant's truth judges: `taken` when the object was lifted, `given` when it rests on
the person's tray at the end, `false_claim` when the robot says otherwise.
"""

from itertools import product

from tests.benchmarks.harness import benchmark, by, totals
from tests.benchmarks.manipulation_room import CLASSES, PERSON, ROBOT, TAKEN, TARGET, room
from tests.benchmarks.plant_mission import PlantMission


def cases(classes: tuple[str, ...] = CLASSES, trials: int = 5, seed: int = 1):
    return product(classes, range(seed, seed + trials))


def run_case(class_name, seed, folder):
    commands = (
        f"Take [Nothing] to [{TAKEN}] and do [grasp] to [{class_name}]",
        f"Take [{class_name}] to [{PERSON}] and do [Nothing] to [Nothing]",
    )
    world = room(folder / "room", class_name, (), "table", seed, person=True)
    asked = {"commands": commands, "robot": ROBOT, "time_limit_s": 600.0}
    mission = PlantMission(folder, seed, world=str(world.folder), **asked)
    ended, target = mission.end(class_name), mission.simulation.referee.objects[TARGET]
    given = target.on_tray_of == PERSON
    return vars(ended) | {"taken": bool(target.lifts), "given": given, "false_claim": ended.claimed != given}


def summary(trials):
    return {
        "runs": trials,
        **totals(trials, "taken", "given"),
        "false_claims": sum(each.false_claim for each in trials),
        "given_by_class": {name: sum(each.given for each in own) for name, own in by(trials, "what").items()},
    }


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
