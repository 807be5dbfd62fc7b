"""All hostile texts for every option and argument of every command, or so many drawn for each.

    python -m tests.benchmarks.hostile_options [--texts 20] [--seed 1] [--commands run,check]

Reports each call that ends in a traceback, hangs, or is refused without plain words.
"""

import contextlib
import random
import shutil
import tempfile
import time
from pathlib import Path

from tests.benchmarks.harness import command
from tests.executive.cli import hostile_calls

SLOW_S = 5.0


def measure(texts: int = 1000, seed: int = 1, commands: tuple[str, ...] = ()):
    """Tries so many texts in each place of some commands, or of all; returns 1 when a call has a defect."""
    drawn, every, bad, calls = random.Random(seed), hostile_calls.hostile_texts(), 0, 0
    with tempfile.TemporaryDirectory() as name:
        good, here = Path(name) / "good", Path(name) / "here"
        good.mkdir()
        hostile_calls.prepare(good)
        for place in (each for each in hostile_calls.places() if not commands or each.command in commands):
            for text in drawn.sample(every, min(texts, len(every))):
                shutil.copytree(good, here)
                begun = time.perf_counter()
                with contextlib.chdir(here):
                    wrong = hostile_calls.defect(hostile_calls.arguments(place, text))
                spent_s = time.perf_counter() - begun
                shutil.rmtree(here)
                calls += 1
                if wrong or spent_s > SLOW_S:
                    bad += 1
                    what = wrong or f"{spent_s:.1f} s"
                    print(f"{place.title} {text[:60]!r} ({len(text)} letters): {what}", flush=True)
    print(f"{calls} calls: {bad} with a defect")
    return int(bad > 0)


if __name__ == "__main__":
    command(measure)
