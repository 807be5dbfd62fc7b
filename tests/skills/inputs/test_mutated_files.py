"""Some changed files of every kind; `python -m tests.benchmarks.mutated_files` tries thousands."""

import math

import pytest

pytest.importorskip("trimesh")


def test_changed_files_of_every_kind_are_read_or_refused_in_their_line():
    from tests.benchmarks.mutated_files import benchmark

    told = list[str]()
    assert benchmark(75, 3, (), told.append, most_s=math.inf) == 0, "\n".join(told)
