"""Sentences of a file, one a line: how many are understood, and with seeds, how they are carried out in `home`; JSON.

    python plugins/errand-home/tests/home_gpsr.py --file SENTENCES [--seed 7001] [--runs 3] [--figures NAME]

Without `--seed`, sentences are only read. With it, the first `--runs` sentences that are understood run, each in the
scene of the next seed, for at most five simulated minutes. As the referees of the league do before a command, the scene
is changed so that it can be carried out: what is to be taken, counted or compared stands at the place, and a person
whom the sentence names is in the room. Figures are by category: understood, claimed, fulfilled by the referee, false
claims, contacts, and the median time.
"""

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np
from home_cast import Cast

from executive import parse
from executive.app.prepare.worlds import knowledge_of, open_world
from plant.worlds.seeding import place_objects
from plant.worlds.world import WorldError
from tests.benchmarks.harness import benchmark, by
from tests.benchmarks.plant_mission import PlantMission

WORLD, TIME_LIMIT_S, TRIES, CROWDED, MOST_SHOWN = "home", 300.0, 40, 10, 3
CATEGORIES = {
    "count people": r"tell me how many (?:people|.*persons) ",
    "tell of a person": r"tell (?:me )?the (?:name|pose|gesture) of ",
    "talk": r"(?:tell|say) (?:something|the (?:time|day)|what day|your teams) ",
    "answer": r"answer ",
    "follow": r"follow ",
    "guide": r"(?:guide|escort|lead|take) (?:the person|the \w+ person|[A-Z])",
    "greet, then": r"(?:greet|salute|say hello to|introduce yourself to) ",
    "meet, then": r"meet ",
    "find a person": r"(?:find|locate|look for) a (?:person|\w+ person) ",
    "go, then a person": r"(?:go|navigate) to .* then (?:meet|(?:find|locate|look for) the (?:person|\w+ person))",
    "count objects": r"tell me how many .*there are",
    "compare objects": r"tell me what (?:is|are) the .*est ",
    "bring me": r"(?:bring|give) me ",
    "go, then": r"(?:go|navigate) to ",
    "find, then": r"(?:find|locate|look for) an? .* in ",
    "take, then": r"(?:take|get|grasp|fetch) an? .* from ",
}
"""Categories of sentences by how they begin."""


def category_of(sentence):
    return next((name for name, begins in CATEGORIES.items() if re.match(begins, sentence, re.IGNORECASE)), "other")


def cases(file: Path = Path("sentences.txt"), seed: int = 0, runs: int = 0):
    """Sentences with the seeds of their runs; 0 for one that is only read."""
    knowledge, next_seed = knowledge_of(open_world(WORLD)), seed
    for line in file.read_text("utf-8").splitlines():
        if sentence := line.strip():
            runs_it = bool(seed) and (not runs or next_seed < seed + runs) and is_understood(sentence, knowledge)
            yield sentence, next_seed if runs_it else 0
            next_seed += runs_it


def is_understood(sentence, knowledge):
    return parse(sentence, knowledge=knowledge).status.name == "OK"


def run_case(sentence, seed, folder):
    """Reads a sentence, and carries it out."""
    told = parse(sentence, knowledge=knowledge_of(open_world(WORLD)))
    read = {"category": category_of(sentence), "understood": told.status.name == "OK", "ran": bool(seed)}
    read |= {"sentence": sentence, "reason": told.reason or ""}
    if not seed:
        return read
    fields = {"sentence": sentence, "world": WORLD, "time_limit_s": TIME_LIMIT_S, "require_wake": False}
    return vars(PlantMission(folder, seed, change=feasible, **fields).end(sentence)) | read


def feasible(prepared):
    """World in which a sentence can be carried out at a seed: objects and people are where it needs them."""
    world, knowledge, seed = prepared.world, prepared.knowledge, prepared.request.seed
    for number in range(TRIES):
        rng = np.random.default_rng([seed, number, 90])
        moved = arranged(world, knowledge, prepared.mission.commands, rng, alone=number >= CROWDED)
        try:
            place_objects(moved, seed)
        except WorldError:
            continue
        return moved
    raise WorldError(f"no scene fits {prepared.request.sentence!r} at the seed {seed}")


def arranged(world, knowledge, commands, rng, *, alone):
    """World with what the commands take, count or compare at its place, and with their people in their rooms.

    `alone`: other objects are elsewhere.
    """
    rules, placed = {one.name: one for one in world.seed_rules.objects}, dict[str, str]()
    for command in commands:
        place = None if command.goal is None else knowledge.place(command.goal)
        if command.task is None or command.puts or place is None or command.object is None:
            continue
        kinds = [name for name in rng.permutation(knowledge.classes(command.object.name)) if name in rules]
        for name in kinds[: 1 if command.takes else int(rng.integers(1, MOST_SHOWN + 1))]:
            placed[name] = str(rng.choice(knowledge.surfaces_in(place)))
    taken = {*placed.values()} if alone else set()
    for name, rule in rules.items():
        free = [each for each in rule.surfaces if each not in taken] or [*rule.surfaces]
        free = tuple(map(str, rng.permutation(free)))  # another try draws other surfaces
        rules[name] = rule.model_copy(update={"surfaces": (placed[name],) if name in placed else free})
    people = Cast(world, knowledge, rng).play(commands)
    changed = {"objects": tuple(rules.values()), "people": people}
    return replace(world, seed_rules=world.seed_rules.model_copy(update=changed))


def summary(results):
    every = {"all": results, **dict(sorted(by(results, "category").items()))}
    refused = Counter(f"{each.category}: {re.split('[;:]', each.reason)[0]}" for each in results if not each.understood)
    rows = {name: figures(own) for name, own in every.items()}
    return {
        **rows["all"],
        "categories": [["sentences", *rows["all"]], *([name, *row.values()] for name, row in rows.items())],
        "refused": dict(refused.most_common()),
        "failed": [
            [each.seed, each.sentence, each.message, each.why] for each in results if each.ran and not each.fulfilled
        ],
    }


def figures(results):
    """Figures of some results: how many are understood, and if some ran, of their runs."""
    ran = [each for each in results if each.ran]
    understood = {"understood": f"{sum(each.understood for each in results)} of {len(results)}"}
    return (
        understood
        if not ran
        else understood
        | {
            "ran": len(ran),
            "claimed": sum(each.claimed for each in ran),
            "fulfilled": sum(each.fulfilled is True for each in ran),
            "false": sum(each.false_claim for each in ran),
            "contacts": sum(each.collisions for each in ran),
            "time_s": round(median([each.sim_time_s for each in ran]), 1),
        }
    )


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
