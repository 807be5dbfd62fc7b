"""Missions through Spot's API beside the same missions in process. Prints JSON at the end.

    python -m tests.benchmarks.spot_missions [--missions fetch_drink,patrol] [--seed 1] [--seeds 1] [--served-only]

Without `--missions`, all shipped missions of one robot run. `same` counts the pairs with equal outcome and equal
verdict; with `--served-only` the run in process is left out.
"""

from lock_step import LockStep

from errand_spot.perception import SpotPerception
from errand_spot.server.identity import credentials
from tests.benchmarks.harness import benchmark
from tests.benchmarks.served_missions import cases, run_pair, run_served, summary


def through_api(request, folder, options=lambda _: {}):
    """Runs a request through Spot's API; the server's credentials lie in the folder."""

    def lock_step(build):
        step = LockStep(build, credentials(folder), SpotPerception({}))
        step.stand_up()
        return step

    return run_served(request, lock_step, options)


def run_case(name, seed, served_only, folder):
    return run_pair(name, seed, served_only, folder, through_api)


if __name__ == "__main__":
    benchmark(cases, run_case, summary, alone=True)  # a renderer must end in the thread it began in
