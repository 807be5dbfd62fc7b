"""Programs of Spot's SDK move the robot as they ask, to 0.1 m; the plant's truth judges."""

import os
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")

from tests.benchmarks.sdk_motion import EXAMPLES, run
from tests.benchmarks.sdk_promises import (
    COLUMNS,
    NOT_RUN,
    OWN,
    PROGRAMS,
    REFUSED,
    SERVED,
    Promise,
    deviation,
)

FOLDER = os.environ.get(EXAMPLES, "")
needs_examples = pytest.mark.skipif(not FOLDER, reason=f"{EXAMPLES} does not name the folder of the SDK's examples")


def track(*xy):
    """Track of a body through points of the floor, ten samples for each line."""
    lines = [np.linspace(a, b, 11) for a, b in pairwise(xy)]
    made = np.zeros((11 * len(lines), len(COLUMNS)))
    made[:, :2] = np.concatenate(lines)
    return made


SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))


# path of the body -> error of the promise of a square
@pytest.mark.parametrize(
    ("path", "error"),
    [(SQUARE, 0.0), (((0, 0), (0, 0)), 1.414), (((0, 0), (1, 0), (1, 1), (0, 0)), 0.707), (SQUARE[::-1], 1.0)],
    ids=["square", "stays", "cuts a corner", "other way round"],
)
def test_a_square_is_judged_along_the_path_and_not_at_its_end(path, error):
    assert deviation(track(*path), Promise("x y", SQUARE, 0.1, along=True)) == pytest.approx(error, abs=0.05)


def test_a_robot_that_passes_a_place_does_not_rest_there():
    passing, resting = track((0, 0), (1, 0), (2, 0)), track((0, 0), (1, 0), (1, 0), (2, 0))
    promise = Promise("x", ((0,), (1,), (2,)), 0.1)
    assert deviation(passing, promise) < 0.01
    rests = Promise("x", ((1,),), 0.1, rests_s=1.0)
    assert deviation(resting, rests) < 0.01 < 0.2 < deviation(passing, rests)


@pytest.mark.nightly
def test_our_program_moves_base_and_hand_where_it_asks():
    figures = run(OWN, Path(__file__).parent)
    assert figures["true"] and figures["ended"], figures
    assert set(figures["worst"]) == {"base", "gaze", "hand", "height", "joints", "velocity"}
    assert not figures["cut"]


@needs_examples
def test_each_folder_of_the_sdks_examples_stands_in_one_table():
    tables = [{each.line.split("/")[0] for each in PROGRAMS}, set(REFUSED), set(SERVED), set(NOT_RUN)]
    folders = {path.name for path in Path(FOLDER).iterdir() if path.is_dir()}
    assert folders == set.union(*tables) and len(folders) == sum(map(len, tables))


@pytest.mark.nightly
@needs_examples
@pytest.mark.parametrize("program", PROGRAMS, ids=lambda each: each.line)
def test_examples_of_the_sdk_move_the_robot_where_they_ask(program):
    figures = run(program, FOLDER)
    assert figures["true"] and figures["ended"], figures
