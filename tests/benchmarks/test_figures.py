"""A benchmark writes its figures with their command, revision, day, machine and seeds."""

import json
import sys

from tests.benchmarks.figures import write_figures


def test_a_file_of_figures_says_where_they_come_from(tmp_path, monkeypatch):
    words = ["tests/benchmarks/fleet.py", "--seed", "3", "--figures", "fleet"]
    monkeypatch.setattr(sys, "argv", words)
    file = write_figures("fleet", {"done": 0.9}, {"seed": 3, "jobs": 1}, folder=tmp_path)
    data = json.loads(file.read_text())
    assert (data["command"], data["seeds"]) == ("python -m tests.benchmarks.fleet --seed 3", "seed 3")
    assert data["values"] == {"done": 0.9}
    assert data.keys() == {"command", "commit", "date", "machine", "seeds", "values"}


def test_a_benchmark_of_a_plug_in_is_named_by_its_file(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["/any/plugins/errand-home/tests/home_gpsr.py", "--seed", "3"])
    data = json.loads(write_figures("gpsr", {}, {"seed": 3}, folder=tmp_path).read_text())
    assert data["command"] == "python plugins/errand-home/tests/home_gpsr.py --seed 3"
