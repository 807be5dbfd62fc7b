"""All hostile texts for every option and argument of every command, or so many drawn for each.

    python -m tests.benchmarks.hostile_options [--texts 20] [--seed 1] [--commands run,check]

Tells each call that ends in a traceback, hangs, or is refused without plain words.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Collection
from pathlib import Path

from tests.executive.cli import hostile_calls

SLOW_S = 5.0


def benchmark(texts: int, seed: int, chosen: Collection[str], tell: Callable[[str], None]) -> int:
    """Try so many texts in each place; the number of calls with something wrong."""
    drawn, every, bad, calls = random.Random(seed), hostile_calls.hostile_texts(), 0, 0
    with tempfile.TemporaryDirectory() as name:
        good, home = Path(name) / "good", Path.cwd()
        good.mkdir()
        hostile_calls.prepare(good)
        for place in hostile_calls.places():
            if chosen and place.command not in chosen:
                continue
            for text in drawn.sample(every, min(texts, len(every))):
                here = Path(name) / "here"
                shutil.copytree(good, here)
                os.chdir(here)
                begun = time.perf_counter()
                wrong = hostile_calls.defect(hostile_calls.arguments(place, text))
                spent_s = time.perf_counter() - begun
                os.chdir(home)
                shutil.rmtree(here)
                calls += 1
                if wrong or spent_s > SLOW_S:
                    bad += 1
                    tell(f"{place.title} {text[:60]!r} ({len(text)} letters): {wrong or f'{spent_s:.1f} s'}")
    tell(f"{calls} calls: {bad} with a defect")
    return bad


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--texts", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--commands", type=lambda text: text.split(","), default=[])
    options = parser.parse_args()
    return int(benchmark(options.texts, options.seed, options.commands, lambda text: print(text, flush=True)) > 0)


if __name__ == "__main__":
    sys.exit(main())
