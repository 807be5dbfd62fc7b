"""Errand as a library: understands sentences, checks missions, and runs them in the simulated world.

    import executive

    executive.parse("fetch me a drink").commands
    executive.check("fetch me a drink", world="shop").errors
    executive.run_mission("fetch me a drink", seed=3).achieved
    executive.evaluate("fetch_drink", seeds="1-5")

A mission is a sentence, a mission file, the name of a shipped mission, or a `Request`. Keyword arguments are fields of
`Request`. The results show themselves in a notebook. Each name is loaded when it is first used.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Unpack

    from executive.app.evaluate.results import Cases
    from executive.app.prepare.checker import Checked
    from executive.app.report.run_report import RunReport
    from executive.language.understand import Understanding
    from executive.mission.request import Request, RequestFields
    from executive.run.control import Control
    from executive.words.knowledge import Knowledge
    from plant.worlds.world import World

__all__ = ["Request", "check", "evaluate", "load_world", "parse", "run_mission"]

for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"):
    os.environ.setdefault(_variable, "1")  # the same results on any number of cores, which missions share
os.environ.setdefault("OPENCV_IPP", "disabled")  # its distance transform rounds one way or another from run to run
os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")  # else it warns of that
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", "64000000")  # a small file may decompress to more than the memory


def _load_own(name: str) -> None:
    """Loads a package of Errand where the user's project has a folder of its name; that folder extends the package.

    Raises ImportError if the user's program has imported the folder before.
    """
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120 - pathlib loads slowly
    own = os.path.join(root, name)  # noqa: PTH118
    named = [os.path.join(entry, name) for entry in sys.path]  # noqa: PTH118
    folders = sorted({os.path.abspath(each) for each in named if os.path.isdir(each)} - {own})  # noqa: PTH100, PTH112
    if not folders:
        return
    sys.path.insert(0, root)
    try:
        package = import_module(name)
    finally:
        sys.path.remove(root)
    if package.__path__[0] != own:
        found = package.__path__[0]
        raise ImportError(f"{found} stands for Errand's package '{name}': import executive first, or rename the folder")
    package.__path__ += folders


for _name in ("skills", "plant"):
    _load_own(_name)


def __getattr__(name: str) -> Any:
    if name == "Request":
        from executive.mission.request import Request

        return Request
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def load_world(name: str = "flat") -> World:
    """Loads a world by the name of a shipped world or by its folder. Raises InputError if there is none."""
    from executive.app.prepare.worlds import open_world

    return open_world(name)


def parse(
    sentence: str, *, knowledge: Knowledge | None = None, require_wake: bool = False, open_words: bool = False
) -> Understanding:
    """Returns the commands that a sentence means, or a refusal that names the words.

    `knowledge` describes the world, by default `flat`; with `open_words` every name is accepted instead. With
    `require_wake` the sentence must call the robot by its name.
    """
    from executive.app.prepare.worlds import knowledge_of
    from executive.language.parser import load_parser
    from executive.language.understand import understand

    known = knowledge_of(load_world()) if knowledge is None and not open_words else knowledge
    return understand(sentence, parser=load_parser(), knowledge=known, require_wake=require_wake)


def check(mission: Request | str | Path, **fields: Unpack[RequestFields]) -> Checked:
    """Checks a mission without running it: errors, warnings, and an estimate of its duration (s).

    Raises:
        InputError: a keyword argument cannot be used. Errors of the mission are in the result.
    """
    from executive.app.prepare.checker import Checker
    from executive.app.prepare.mission_files import request_of

    return Checker().check(request_of(mission, **fields))


def run_mission(
    mission: Request | str | Path, *, control: Control | None = None, **fields: Unpack[RequestFields]
) -> RunReport:
    """Runs a mission in the simulated world and returns its report; writes log and pictures into its folder `out`.

    `control` pauses or cancels the run from another thread.

    Raises:
        InputError: the mission is not understood, `check` finds an error in it, or a keyword argument cannot be used.
    """
    from executive.app.prepare.from_request import prepare_checked
    from executive.app.prepare.mission_files import request_of
    from executive.app.runs.one_run import run_request

    return run_request(prepare_checked(request_of(mission, **fields)), control=control).report


def evaluate(
    mission: Request | str | Path,
    *,
    seeds: str = "1-20",
    jobs: int = 2,
    **fields: Unpack[RequestFields],
) -> Cases:
    """Runs an evaluation file, or a mission at many seeds, in `jobs` processes; returns the runs with their results.

    An evaluation file takes no `seeds`, and no field but `out`. Writes results to `results.sqlite` in the folder `out`,
    by default `out/evaluate`; the same call continues an interrupted evaluation.

    Raises:
        InputError: the file or a mission in it cannot be used, or the folder holds other results.
    """
    from dataclasses import replace
    from pathlib import Path

    from executive.app.evaluate.evaluation import evaluate_runs, refuse_impossible_runs
    from executive.app.evaluate.evaluation_file import evaluation_at_seeds, is_evaluation, load_evaluation, seed_range
    from executive.app.evaluate.results import Cases
    from executive.app.evaluate.workers import Pool
    from executive.app.prepare.mission_files import mission_file, request_of

    asked, out = request_of(mission, **fields), Path(fields.get("out", "out/evaluate"))
    asked = asked if asked.file is None else replace(asked, file=mission_file(asked.file))
    if asked.file is not None and is_evaluation(asked.file):
        runs = load_evaluation(asked.file)
    else:
        runs = evaluation_at_seeds(asked, seed_range(seeds), each_fault=False)
    return Cases(evaluate_runs(runs, Pool(jobs), out / "results.sqlite", out=out, before=refuse_impossible_runs).cases)
