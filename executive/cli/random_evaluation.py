"""`errand evaluate --random-missions`: runs sentences that the seeds draw from what is known of the worlds."""

from __future__ import annotations

from pathlib import Path

from executive.app.evaluate.random_missions import KnownWorld, random_evaluation
from executive.app.evaluate.runs import Evaluation
from executive.app.evaluate.scenario import MOST_RUNS
from executive.app.evaluate.seeds import first_seeds
from executive.app.feasibility import abilities_in
from executive.app.worlds import knowledge_of, open_world
from executive.cli.evaluate_scenario import Handling, evaluate_runs
from executive.words.steps import DEFAULT_WORLD
from skills.files.errors import InputError
from skills.files.outside import is_file

__all__ = ["evaluate_random_missions", "random_missions"]


def evaluate_random_missions(count: int, worlds: str | None, seeds: str | None, how: Handling) -> int:
    """Run what is still missing of so many random missions; the exit status. Raises InputError; results are kept.

    A mission that `errand check` would refuse counts as refused, unless it is to run anyway.
    """
    evaluation = random_missions(count, worlds or DEFAULT_WORLD, seeds or "1-")
    how.console.print(f"errand evaluate {evaluation.name}", markup=False)
    return evaluate_runs(evaluation, how, checked=not how.anyway)


def random_missions(count: int, worlds: str, seeds: str) -> Evaluation:
    """The runs of the first `count` seeds, in worlds by name or folder ("flat,shop").

    Raises:
        InputError: a world cannot be used, it is named twice, or there are too few seeds or too many missions.
    """
    names = [name.strip() for name in worlds.split(",")]
    if len(set(names)) < len(names):
        raise InputError(f"--worlds {worlds} names a world twice", hint="name each once")
    if count > MOST_RUNS:
        raise InputError(f"these are {count} runs, more than {MOST_RUNS}", hint="give several ranges of seeds in turn")
    chosen = first_seeds(seeds, count)
    if len(set(chosen)) < count:
        raise InputError(f"--seeds {seeds} names a seed twice", hint="name each once")
    named = f"--random-missions {count} --worlds {worlds} --seeds {seeds}"
    return random_evaluation([_known_world(name) for name in names], chosen, name=named)


def _known_world(name: str) -> KnownWorld:
    """What is known of a world, and what the robot of most missions can carry there. Raises InputError."""
    world = open_world(name)
    knowledge, abilities = knowledge_of(world), abilities_in(world)
    carried = frozenset(
        name
        for name in knowledge.things
        if name in abilities.masses_kg
        and abilities.masses_kg[name] <= abilities.lift_kg
        and abilities.widths_m.get(name, 0.0) <= abilities.opens_m
    )
    own = str(Path(name).resolve()) if is_file(Path(name) / "world.dmd.yaml") else name
    return KnownWorld(own, knowledge, carried)
