"""Errand as a library: what a sentence means, what speaks against a mission, and runs in the simulated world.

    import executive

    executive.parse("fetch me a drink").commands
    executive.check(executive.Request("fetch me a drink")).errors
    executive.run_mission(executive.Request("fetch me a drink", seed=3)).achieved

Each name is loaded when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from executive.app.checker import Checked
    from executive.app.evaluate.results import Case
    from executive.app.report import RunReport
    from executive.language.understand import Understanding
    from executive.mission.request import Request
    from executive.run.control import Control
    from executive.words.knowledge import Knowledge
    from plant.worlds.world import World

__all__ = ["Request", "check", "evaluate", "load_world", "parse", "run_mission"]


def __getattr__(name: str) -> Any:
    if name == "Request":
        from executive.mission.request import Request

        return Request
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def load_world(name: str = "flat") -> World:
    """The world of a name that comes with Errand, or of a folder. Raises InputError: there is none."""
    from executive.app.worlds import open_world

    return open_world(name)


def parse(
    sentence: str, *, knowledge: Knowledge | None = None, require_wake: bool = False, open_words: bool = False
) -> Understanding:
    """What a sentence means: commands, or a refusal that names the words.

    `knowledge` is what the robot knows of its world, by default of `flat`; with `open_words` every name is accepted
    instead. With `require_wake` the sentence must call the robot by its name.
    """
    from executive.app.worlds import knowledge_of
    from executive.language.parser import load_parser
    from executive.language.understand import understand

    known = knowledge_of(load_world()) if knowledge is None and not open_words else knowledge
    return understand(sentence, parser=load_parser(), knowledge=known, require_wake=require_wake)


def check(request: Request) -> Checked:
    """What speaks against a request, and how long it takes (s), without running it. It raises nothing for bad input."""
    from executive.app.checker import Checker

    return Checker().check(request)


def run_mission(request: Request, *, control: Control | None = None) -> RunReport:
    """The report of a request, run to its end in the simulated world; log, pictures and report lie in its folder `out`.

    `control` pauses it, cancels it and so on, from another thread.

    Raises:
        InputError: it is not understood, or what `check` finds speaks against it.
    """
    from executive.app.feasibility import refuse_impossible
    from executive.app.mission_run import run_request
    from executive.app.prepare import prepare

    prepared = prepare(request)
    refuse_impossible(prepared)
    return run_request(prepared, control=control).report


def evaluate(scenario: Path, *, out: Path, jobs: int = 2) -> Sequence[Case]:
    """The runs of a scenario file with what came of each, done by `jobs` processes.

    Results land in `results.sqlite` of the folder `out`; the same call goes on where it stopped.

    Raises:
        InputError: the file, or a mission in it, cannot be used, or the folder holds other results.
    """
    from executive.app.evaluate.evaluation import evaluate_runs, refuse_impossible_runs
    from executive.app.evaluate.evaluation_file import load_evaluation
    from executive.app.evaluate.workers import Pool

    results, before = out / "results.sqlite", refuse_impossible_runs
    return evaluate_runs(load_evaluation(scenario), Pool(jobs), results, out=out, before=before).cases
