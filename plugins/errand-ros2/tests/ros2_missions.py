"""Missions through ROS 2 beside the same missions in process. Prints JSON at the end.

    python plugins/errand-ros2/tests/ros2_missions.py [--missions fetch_drink] [--seed 1] [--seeds 1] [--served-only]

Without `--missions`, all shipped missions of one robot run. `same` counts the pairs with equal outcome and equal
verdict; with `--served-only` the run in process is left out.
"""

from ros_client import free_port
from ros_lock_step import LockStep

from errand_ros2.wire.node import Place
from tests.benchmarks.harness import benchmark
from tests.benchmarks.served_missions import cases, run_pair, run_served, summary


def through_ros(request, options=lambda _: {}):
    """Runs a request through ROS 2."""
    return run_served(request, lambda build: LockStep(build, Place(port=free_port())), options)


def run_case(name, seed, served_only, folder):
    return run_pair(name, seed, served_only, folder, lambda request, _: through_ros(request))


if __name__ == "__main__":
    benchmark(cases, run_case, summary, alone=True)  # a renderer must end in the thread it began in
