"""An inspection round of six points with random faults: how many of the pictures show the right thing, by the truth.

    python -m tests.benchmarks.inspection [--count 10] [--faults 2] [--jobs 2] [--out FOLDER]

Each seed draws its own faults of sensors and motors, and the time at which each begins.
"""

import re
from collections.abc import Iterable
from pathlib import Path

from executive.mission.scenario import Scenario
from tests.benchmarks.harness import benchmark, quantile, totals
from tests.benchmarks.plant_mission import PlantMission

ROUND = Path(__file__).parents[2] / "missions" / "inspection_round.yaml"
POINTS = 6


def cases(first: int = 1, count: int = 10, faults: int = 2) -> Iterable[tuple[int, int]]:
    return ((seed, faults) for seed in range(first, first + count))


def run_case(seed, faults, folder):
    mission = PlantMission(folder, seed, file=ROUND, scenario=Scenario(random=faults))
    end = mission.end("round")
    return {
        **vars(end),
        "points": POINTS,
        "right": pictures_right(end.why),
        "faults": mission.prepared.request.scenario.lines(),
    }


def pictures_right(why):
    """How many pictures of a verdict show what they are of."""
    return len(re.findall(r"\bthe picture shows\b", why, re.IGNORECASE))


def summary(results):
    counts = totals(results, "right", "points", "fulfilled", "false_claim", "collisions")
    return {"runs": len(results), **counts, "sim_time_s": quantile([each.sim_time_s for each in results])}


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
