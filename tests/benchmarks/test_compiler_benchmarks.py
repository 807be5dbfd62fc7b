"""What compiling a long mission costs, against a short one: steps must not make each other dearer."""

import time
from pathlib import Path

import pytest

from executive.language.parser import load_parser
from executive.mission.resolve import mission_from_file
from executive.tree.compiler import compile_mission
from executive.tree.registry import installed_skills
from executive.words.knowledge import load_knowledge

STEPS = (
    "  - {to: kitchen, do: grasp, object: drink, retries: 1, timeout: 300}",
    "  - {take: drink, to: coffee table, on_failure: skip}",
    "  - say: is there a hammer in the workshop",
    "  - {skill: navigate, with: {x: 5.2, y: 4.5, yaw: 0.0}}",
)
SHORT, LONG = 2, 25
FLAT = Path(__file__).parents[2] / "plant" / "worlds" / "flat" / "knowledge.yaml"


@pytest.mark.benchmark(group="compiler")
def test_compiling_a_mission_of_a_hundred_steps(benchmark, tmp_path):
    flat, skills, parser = load_knowledge(FLAT), installed_skills(), load_parser()

    def compiled(times):
        path = tmp_path / f"{times}.yaml"
        path.write_text("name: long\nsteps:\n" + "\n".join(STEPS * times) + "\n")
        mission = mission_from_file(path, parser=parser, knowledge=flat)
        return lambda: compile_mission(mission, knowledge=flat, registry=skills)

    short, long = compiled(SHORT), compiled(LONG)
    short()
    begun = time.process_time()
    for _ in range(10):
        short()
    short_s = (time.process_time() - begun) / 10
    benchmark.pedantic(long, rounds=10, warmup_rounds=1)
    benchmark.extra_info["step_of_100_times_step_of_8"] = round(
        benchmark.stats.stats.median / LONG / (short_s / SHORT), 2
    )
