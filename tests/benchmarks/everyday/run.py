"""Everyday sentences, each run once in the plant: what becomes of them, and what the referee says.

    python tests/benchmarks/everyday/run.py [--world flat] [--out FOLDER] [--only 1-10] [--jobs 2]

Prints one line for each: the claim, the verdict with its reason, or why it was refused. `WORLD.yaml` beside this file
holds the sentences. Whether a verdict is right is for a person to judge from these lines and the log in the folder.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import yaml

from executive.app.evaluate.evaluation_file import seed_range

VERDICTS = {True: "fulfilled", False: "not fulfilled", None: "not judged"}


def run_one(number, row, world, out):
    """The claim, the verdict and what is to be read of one sentence."""
    common = ["--world", world, "--seed", str(row["seed"]), "--out", str(out / f"{number:02d}")]
    quiet = ["--no-wake", "--quiet", "--no-record", "--json", "--questions", "first"]
    command = [sys.executable, "-m", "executive.cli", "run", "--say", row["say"], *common, *quiet]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    try:
        report = json.loads(done.stdout.splitlines()[-1])
    except (IndexError, ValueError):
        kind = "refused" if done.returncode == 2 else "crashed"
        return kind, "", done.stderr.strip().splitlines()[-1] if done.stderr.strip() else ""
    referee = report["referee"]
    return report["outcome"], VERDICTS[referee["success"]], f"{report['message']} / {referee['why']}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--world", default="flat")
    parser.add_argument("--out", type=Path, default=None)
    parser.add_argument("--only", default=None, help="such as 1-10 or 3,7")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    rows = yaml.safe_load(Path(__file__).with_name(f"{options.world}.yaml").read_text(encoding="utf-8"))
    chosen = seed_range(options.only) if options.only else range(1, len(rows) + 1)
    out = options.out or Path(tempfile.mkdtemp())
    counts = Counter()
    with ThreadPoolExecutor(options.jobs) as pool:
        runs = {n: pool.submit(run_one, n, rows[n - 1], options.world, out) for n in chosen}
        for n, future in runs.items():
            claim, verdict, words = future.result()
            counts[claim, verdict] += 1
            print(f"{n:2d} | {rows[n - 1]['say']} | {claim} | {verdict} | {words}", flush=True)
    for (claim, verdict), count in sorted(counts.items()):
        print(f"{count:3d} {claim} {verdict}")


if __name__ == "__main__":
    main()
