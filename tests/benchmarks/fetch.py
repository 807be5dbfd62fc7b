"""Missions by Fetch in the flat: it takes something and brings it to a person or a surface; prints JSON.

    python -m tests.benchmarks.fetch [--first 0] [--count 5] [--out FOLDER] [--things a,b] [--goals a,b] [--jobs 1]

The number of a mission is the seed of its world and draws what is brought, and where to: half the missions end with a
person. Reported are how many missions were fulfilled by the referee with Wilson's interval of 95 %, false claims (the
robot says that it is done, the referee denies it), contacts with what was touched, and what the others failed of. The
wrench is left out unless it is named: from the height of the head it is seen too seldom.
"""

import re
from collections import Counter

import numpy as np

from executive.app.evaluate.summary import Rate
from executive.words.robot_config import RobotConfig
from tests.benchmarks.harness import benchmark, totals
from tests.benchmarks.plant_mission import PlantMission

TIME_LIMIT_S = 420.0
PERSON = "Robin"
THINGS = ("beer", "coke", "cube", "cylinder", "hammer", "screwdriver")
SURFACES = (
    *("kitchen counter", "kitchen table", "coffee table", "sideboard", "night stand", "dresser", "bathroom cabinet"),
    *("workbench", "tool trolley", "desk", "hall console"),
)


def cases(
    first: int = 0, count: int = 5, things: tuple[str, ...] = THINGS, goals: tuple[str, ...] = (PERSON, *SURFACES)
):
    """Sentences with their numbers; a person is the goal as often as all surfaces among `goals` together."""
    surfaces, drawn = [goal for goal in goals if goal != PERSON], []
    for number in range(first, first + count):
        rng = np.random.default_rng([number, 8])
        thing, to_person = things[int(rng.integers(len(things)))], bool(rng.random() < 0.5)
        if PERSON in goals and (to_person or not surfaces):
            drawn.append((f"bring me the {thing}", number))
        else:
            drawn.append((f"bring the {thing} to the {surfaces[int(rng.integers(len(surfaces)))]}", number))
    return drawn


def run_case(sentence, number, folder):
    robots = (RobotConfig("bob", "fetch"),)
    mission = PlantMission(folder, number, sentence=sentence, world="flat", time_limit_s=TIME_LIMIT_S, robots=robots)
    return mission.end(sentence)


def touched(events):
    return [found[1] for event in events if (found := re.search(r" hit (?:the )?(.+) at [\d.]+ s", event))]


def summary(results):
    fulfilled = Rate(sum(each.fulfilled is True for each in results), len(results))
    failed = [each for each in results if not each.fulfilled]
    return {
        "missions": fulfilled.total,
        "fulfilled": fulfilled.successes,
        "interval": [round(bound, 3) for bound in fulfilled.interval()],
        "false_claims": sum(each.false_claim for each in results),
        "contacts": sum(each.collisions for each in results),
        "touched": dict(Counter(what for each in results for what in touched(each.events)).most_common()),
        **totals(results, "drops"),
        "causes": dict(Counter(each.cause or "false claim" for each in failed).most_common()),
        "failed": [[each.seed, each.what, each.message, each.why] for each in failed],
    }


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
