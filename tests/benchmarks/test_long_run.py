"""Figures of the benchmark of long runs."""

from types import SimpleNamespace

from tests.benchmarks.long_run import memory_mb, summary, written_bytes


def test_the_slope_of_the_memory_is_that_of_the_second_half(tmp_path):
    (tmp_path / "log.mcap").write_bytes(b"x" * 200_000)
    memory = (500.0, 700.0, 800.0, 801.0, 802.0)
    rows = [{"until_min": 10.0 * n, "memory_mb": mb, "written_kb_per_min": 900.0} for n, mb in enumerate(memory, 1)]
    told = summary([SimpleNamespace(**row) for row in rows], "success", tmp_path)
    assert (told["memory_mb_per_hour"], told["log_mb"], told["recording_mb"]) == (6.0, 0.2, None)


def test_memory_and_written_bytes_of_this_process_are_measured(tmp_path):
    before = written_bytes()
    (tmp_path / "file").write_bytes(b"x" * 100_000)
    assert written_bytes() - before >= 100_000
    assert memory_mb() > 10.0
