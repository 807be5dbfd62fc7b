"""The notebooks run from top to bottom, and show what comes."""

import importlib.util
import json
import re

import pytest

from tests.docs.documents import DOCS

SPEC = importlib.util.spec_from_file_location("run_notebook", DOCS / "run_notebook.py")
assert SPEC is not None
run_notebook = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(run_notebook)
NIGHTLY = pytest.mark.nightly
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))


def printed(notebook):
    """What each code cell prints."""
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return ["".join(text for out in cell["outputs"] for text in out.get("text", ())) for cell in cells]


DECIMAL = re.compile(r"\d+\.\d+")


def words_and_times(texts):
    """The texts without their decimal numbers, and these: the last digit of a time depends on the machine."""
    text = "\0".join(texts)
    return re.sub(r" *\d+\.\d+", " #", text), [float(number) for number in DECIMAL.findall(text)]


def pictures(notebook):
    return sum(
        bool({"image/png", "text/html"} & out.get("data", {}).keys())
        for cell in notebook["cells"]
        for out in cell.get("outputs", ())
    )


def notebook_of(*sources):
    return {"cells": [{"cell_type": "code", "source": [source], "outputs": []} for source in sources]}


def test_there_is_a_notebook():
    assert NOTEBOOKS


def case(path):
    """A notebook as a case; the mission of `five_lines` in the plant runs nightly, by day that of `test_facade`."""
    return pytest.param(path, marks=[pytest.mark.mission, *[NIGHTLY] * (path.stem == "five_lines")], id=path.stem)


@pytest.mark.parametrize("path", [case(path) for path in NOTEBOOKS])
def test_a_notebook_runs_and_shows_what_comes(path):
    """Run `python docs/run_notebook.py` when this fails although all is well."""
    stored = json.loads(path.read_text(encoding="utf-8"))
    come = run_notebook.executed(stored)
    (words, times), (stored_words, stored_times) = words_and_times(printed(come)), words_and_times(printed(stored))
    assert words == stored_words
    assert times == pytest.approx(stored_times, abs=0.3)
    assert pictures(come) == pictures(stored) > 0


def test_cells_share_their_names_and_keep_what_they_print():
    assert printed(run_notebook.executed(notebook_of("a = 1\nprint('one')", "print(a + 1)"))) == ["one\n", "2\n"]


def test_the_last_value_of_a_cell_shows_itself():
    source = "class Shown:\n    def _repr_html_(self):\n        return '<b>here</b>'\nShown()"
    (cell,) = run_notebook.executed(notebook_of(source))["cells"]
    assert [out["data"]["text/html"] for out in cell["outputs"]] == [["<b>here</b>"]]


def test_a_cell_that_raises_is_noticed():
    with pytest.raises(ZeroDivisionError):
        run_notebook.executed(notebook_of("1 / 0"))
