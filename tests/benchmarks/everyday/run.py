"""Everyday sentences, each run once in the plant: what becomes of them, and what the referee says.

    python -m tests.benchmarks.everyday.run [--world flat] [--only 1-10] [--jobs 2] [--out FOLDER]

Prints a line for each, and how many ended alike: the claim, the verdict with its reason, or why it was refused.
`WORLD.yaml` beside this file holds the sentences. Whether a verdict is right is for a person to judge from these lines
and the log in the folder.
"""

from collections import Counter

from executive.app.evaluate.evaluation_file import seed_range
from tests.benchmarks.errand_process import report_of, run_errand
from tests.benchmarks.harness import benchmark
from tests.tables import yaml_beside

VERDICTS = {True: "fulfilled", False: "not fulfilled", None: "not judged"}


def cases(world: str = "flat", only: str = ""):
    rows = yaml_beside(__file__, f"{world}.yaml")
    chosen = seed_range(only) if only else range(1, len(rows) + 1)
    return [(number, rows[number - 1]["say"], rows[number - 1]["seed"], world) for number in chosen]


def run_case(number, said, seed, world, folder):
    quiet = ["--no-wake", "--quiet", "--no-record", "--json", "--questions", "first"]
    done = run_errand("run", "--say", said, "--world", world, "--seed", seed, "--out", folder, *quiet)
    if not (report := report_of(done.stdout)):
        kind = "refused" if done.returncode == 2 else "crashed"
        words = "".join(done.stderr.strip().splitlines()[-1:])
        return {"number": number, "said": said, "claim": kind, "verdict": "", "words": words}
    seen, words = report["referee"], f"{report['message']} / {report['referee']['why']}"
    ended = {"claim": report["outcome"], "verdict": VERDICTS[seen["success"]], "words": words}
    return {"number": number, "said": said, **ended}


def summary(ends):
    counts = Counter(f"{each.claim} {each.verdict}".strip() for each in ends)
    return {
        "runs": [" | ".join(map(str, vars(each).values())) for each in ends],
        "counts": dict(sorted(counts.items())),
    }


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
