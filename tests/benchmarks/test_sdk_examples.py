"""Examples of Spot's SDK that move nothing, or that the server refuses, end and say what the tables list."""

import os
import shutil
from pathlib import Path

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")

from tests.benchmarks.sdk_examples import EXAMPLES, run
from tests.benchmarks.sdk_promises import REFUSED, SERVED, Program

FOLDER, PYTHON = os.environ.get(EXAMPLES, ""), os.environ.get("ERRAND_SDK_PYTHON", "python3")
LISTED = {**SERVED, **{folder: refusal.program for folder, refusal in REFUSED.items()}}


# what a program does -> whether it is as listed: exit code 1, and `seen` in its output
@pytest.mark.parametrize(
    ("text", "listed"),
    [("raise SystemExit('seen')", True), ("print('seen')", False), ("raise SystemExit('hidden')", False)],
    ids=["as listed", "another exit code", "another output"],
)
def test_a_program_is_as_listed_by_its_exit_code_and_its_output(text, listed, tmp_path):
    (tmp_path / "program.py").write_text(text)
    figures = run(Program("program.py HOST", exit_code=1, says="seen"), tmp_path)
    assert figures["as_listed"] is listed, figures


@pytest.mark.nightly
@pytest.mark.skipif(not FOLDER, reason=f"{EXAMPLES} does not name the folder of the SDK's examples")
@pytest.mark.parametrize("folder", LISTED)
def test_an_example_ends_and_says_what_the_table_lists(folder):
    figures = run(LISTED[folder], Path(FOLDER) / folder, shutil.which(PYTHON))
    assert figures["as_listed"], figures
