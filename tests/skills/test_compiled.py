"""Loops compiled to machine code, cached on disk."""

import importlib
import pickle
import sys

import numba

LOOPS = """
from skills.compiled import compiled

@compiled
def doubled(value):
    return 2.0 * value
"""
GONE = b"cmodule_that_is_gone\nPoint\n."
"""A pickle of a name in a module that does not exist."""


def test_a_cached_function_whose_types_have_moved_is_compiled_again(tmp_path, monkeypatch):
    (tmp_path / "some_loops.py").write_text(LOOPS)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    assert importlib.import_module("some_loops").doubled(2.0) == 4.0
    (index,) = (tmp_path / "cache").rglob("*.nbi")
    index.write_bytes(pickle.dumps(numba.__version__) + GONE)
    del sys.modules["some_loops"]
    again = importlib.import_module("some_loops")
    assert again.doubled(3.0) == 6.0
    assert sum(again.doubled.machine_code.stats.cache_misses.values()) == 1
    del sys.modules["some_loops"]
