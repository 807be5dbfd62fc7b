"""Errand as a library: understands sentences, checks missions, and runs them in the simulated world.

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
    """Loads a world by the name of a shipped world or by its folder. Raises InputError if there is none."""
    from executive.app.worlds import open_world

    return open_world(name)


def parse(
    sentence: str, *, knowledge: Knowledge | None = None, require_wake: bool = False, open_words: bool = False
) -> Understanding:
    """Returns the commands that a sentence means, or a refusal that names the words.

    `knowledge` describes the world, by default `flat`; with `open_words` every name is accepted instead. With
    `require_wake` the sentence must call the robot by its name.
    """
    from executive.app.worlds import knowledge_of
    from executive.language.parser import load_parser
    from executive.language.understand import understand

    known = knowledge_of(load_world()) if knowledge is None and not open_words else knowledge
    return understand(sentence, parser=load_parser(), knowledge=known, require_wake=require_wake)


def check(request: Request) -> Checked:
    """Checks a request without running it: errors, warnings, and an estimate of its duration (s). Never raises."""
    from executive.app.checker import Checker

    return Checker().check(request)


def run_mission(request: Request, *, control: Control | None = None) -> RunReport:
    """Runs a request in the simulated world and returns its report; writes log and pictures into its folder `out`.

    `control` pauses or cancels the run from another thread.

    Raises:
        InputError: the request is not understood, or `check` finds an error in it.
    """
    from executive.app.checker import prepare_checked
    from executive.app.mission_run import run_request

    return run_request(prepare_checked(request), control=control).report


def evaluate(scenario: Path, *, out: Path, jobs: int = 2) -> Sequence[Case]:
    """Runs an evaluation file in `jobs` processes and returns its runs with their results.

    Writes results to `results.sqlite` in the folder `out`; the same call continues an interrupted evaluation.

    Raises:
        InputError: the file or a mission in it cannot be used, or the folder holds other results.
    """
    from executive.app.evaluate.evaluation import evaluate_runs, refuse_impossible_runs
    from executive.app.evaluate.evaluation_file import load_evaluation
    from executive.app.evaluate.workers import Pool

    results, before = out / "results.sqlite", refuse_impossible_runs
    return evaluate_runs(load_evaluation(scenario), Pool(jobs), results, out=out, before=before).cases
