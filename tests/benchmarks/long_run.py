"""What a long run writes and remembers: a robot that waits, drives and looks for simulated hours; prints JSON lines.

    python -m tests.benchmarks.long_run [--minutes 120] [--every 10] [--wait 60] [--no-record] [--world flat] [--top 10]

One line for each ten minutes of the robot's clock: what the process has written since the last one, its memory, and how
much faster than real time it was. The last line has the slope of the memory over the second half, the bytes written per
minute at the beginning and at the end, and the size of the recording. `--wait` is how long it waits at each place (s).
`--top` adds the lines of code that hold what was allocated since the first report (tracemalloc; slow).
"""

import tempfile
import time
import tracemalloc
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from executive.app.prepare.from_request import prepare
from executive.app.runs.one_run import run_request
from executive.app.runs.queue import durable_run
from executive.mission.request import Request
from executive.run.visitor import RunVisitor
from executive.store.missions import STORE, MissionStore
from tests.benchmarks.harness import command, show

MISSION = """name: long round
world: {world}
steps:
  - repeat: {{while: elapsed < {seconds}}}
    steps:
      - to: kitchen
      - wait: {{seconds: {wait}}}
      - to: living room
      - if: {{object: coke, at: coffee table}}
        then: [{{speak: There it is.}}]
        else: [{{speak: It is not here.}}]
      - wait: {{seconds: {wait}}}
"""
PAGE_BYTES, MB = 4096, 1e6


class Watch(RunVisitor):
    """Reporter of the process, every so many seconds of the robot's clock."""

    def __init__(self, period_s, *, top=0):
        self.reports = []
        self._period_s, self._top = period_s, top
        self._at_s, self._wall_s, self._written = 0.0, time.monotonic(), written_bytes()
        self._first = None

    def tick(self, progress):
        took_s, now_s = progress.now_s - self._at_s, progress.now_s
        if took_s < self._period_s:
            return
        per_minute = (written_bytes() - self._written) / 1e3 / (took_s / 60.0)
        speed = took_s / (time.monotonic() - self._wall_s)
        own = {"until_min": now_s / 60.0, "memory_mb": memory_mb(), "written_kb_per_min": per_minute}
        self.reports.append(SimpleNamespace(**own, real_time_factor=speed))
        show({key: round(value, 2) for key, value in vars(self.reports[-1]).items()})
        if self._top:
            self._show_growth()
        self._at_s, self._wall_s, self._written = now_s, time.monotonic(), written_bytes()

    def _show_growth(self):
        now = tracemalloc.take_snapshot()
        self._first = self._first or now
        for each in now.compare_to(self._first, "lineno")[: self._top]:
            at = f"{each.traceback[0].filename}:{each.traceback[0].lineno}"
            show({"grown_kb": round(each.size_diff / 1e3), "count": each.count_diff, "at": at})


def written_bytes():
    """Bytes that this process has written to files so far."""
    told = dict(line.split(": ") for line in Path("/proc/self/io").read_text().splitlines())
    return int(told["wchar"])


def memory_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE_BYTES / MB


def measure(
    minutes: float = 120.0,
    every: float = 10.0,
    wait: float = 60.0,
    record: bool = True,
    world: str = "flat",
    top: int = 0,
):
    if top:
        tracemalloc.start()
    with tempfile.TemporaryDirectory(prefix="errand-long-") as made:
        out, watch = Path(made), Watch(60.0 * every, top=top)
        (out / "long.yaml").write_text(MISSION.format(world=world, seconds=60.0 * minutes, wait=wait))
        asked = Request(file=out / "long.yaml", out=out, record=record, time_limit_s=120.0 * minutes + 600.0)
        prepared = prepare(asked)
        with MissionStore(out / STORE) as store:
            mission = store.add(prepared.request.from_anywhere(), queued=False)
            store.begin(mission.id)
            finished = run_request(prepared, visitors=[watch], durable=durable_run(store, mission, prepared))
        show(summary(watch.reports, finished.report.outcome, out))


def summary(reports, outcome, out):
    later = reports[len(reports) // 2 :]
    times = [each.until_min for each in later]
    slope = float(np.polyfit(times, [each.memory_mb for each in later], 1)[0]) if len(later) > 1 else 0.0
    recording, log = out / "recording.html", out / "log.mcap"
    return {
        "outcome": outcome,
        "minutes": round(reports[-1].until_min, 1),
        "memory_mb_per_hour": round(60.0 * slope, 2),
        "written_kb_per_min_first": round(reports[0].written_kb_per_min),
        "written_kb_per_min_last": round(reports[-1].written_kb_per_min),
        "log_mb": round(log.stat().st_size / MB, 1),
        "recording_mb": round(recording.stat().st_size / MB, 1) if recording.exists() else None,
    }


if __name__ == "__main__":
    command(measure)
