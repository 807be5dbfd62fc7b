"""Memory that was freed goes back to the system."""

import ctypes
import sys
from pathlib import Path

import pytest

from executive.app.mission_run import return_memory

MB = 1_000_000


def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / MB


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_trim") or sys.platform != "linux", reason="needs glibc")
def test_memory_that_was_freed_in_pieces_is_returned():
    blocks = [bytearray(b"x") * 60_000 for _ in range(3_000)]
    some = blocks[::50]
    del blocks
    before_mb = resident_mb()
    return_memory()
    assert before_mb - resident_mb() > 100
    assert len(some) == 60
