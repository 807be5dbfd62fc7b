"""A run: its memory is freed and goes back to the system, and clutter spares what the mission names."""

import ctypes
import resource
import subprocess
import sys
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from executive.app.prepare.from_request import prepare
from executive.app.runs.one_run import FilesOfRun, mentioned_classes, return_memory
from executive.mission.request import Request
from executive.words.variation import Variation
from skills.inputs.errors import SpareFiles, shortage_of_files

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


FROZEN = """
import gc, weakref
from executive.app.runs.one_run import return_memory
class Plant: pass
plant = Plant()
plant.itself, freed = plant, weakref.ref(plant)
gc.freeze()
del plant
return_memory()
assert freed() is None
"""


def test_objects_that_an_ended_run_has_frozen_are_freed():
    """In a process of its own, because the tests must not thaw what they hold."""
    subprocess.run([sys.executable, "-c", FROZEN], check=True)


def use_up_files(stack):
    while not shortage_of_files(1):
        stack.enter_context(closing(SpareFiles(1)))


def test_a_run_has_files_for_itself_when_no_other_file_can_be_opened(tmp_path):
    _, hard = limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    with closing(FilesOfRun()) as files:
        files.tick(None)
        highest = max(int(each.name) for each in Path("/proc/self/fd").iterdir())
        resource.setrlimit(resource.RLIMIT_NOFILE, (highest, hard))
        try:
            with ExitStack() as rest:
                use_up_files(rest)
                with pytest.raises(OSError, match="Too many open files"):
                    (tmp_path / "late").touch()
                files.tick(None)
                (tmp_path / "late").touch()
                use_up_files(rest)
                files.close()
                (tmp_path / "report").touch()
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, limits)


def test_clutter_spares_the_classes_that_are_asked_for(tmp_path):
    request = Request("Hey Alice, bring me a beer", world="flat", seed=2, out=tmp_path, variation=Variation(clutter=5))
    assert "beer" in mentioned_classes(prepare(request, ask=None))
