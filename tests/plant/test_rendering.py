"""Light of a world, as it is drawn, and the threads that draw."""

import os
import subprocess
import sys

import numpy as np
import pytest

from executive.words.variation import DAY_LIGHT, LIGHTS
from plant.rendering import MESA_THREADS, lights, render_parameters

RENDERS = """
from pathlib import Path
from pydrake.math import RigidTransform
from plant.diagram import DiagramConfig, build_diagram
from plant.scene_pictures import render_view

built = build_diagram(DiagramConfig())
render_view(built.scene.query_at(built.plant.GetPositions(built.plant.CreateDefaultContext())), RigidTransform())
print(sum(each.read_text().startswith("llvmpipe") for each in Path("/proc/self/task").glob("*/comm")))
"""


def test_a_dim_light_dims_each_beam_and_the_sky():
    day, dim = lights(DAY_LIGHT), lights(LIGHTS["dim"])
    assert [each.intensity for each in dim] == pytest.approx([0.4 * each.intensity for each in day])
    assert np.max(render_parameters(LIGHTS["dim"]).default_clear_color) < 0.5


def test_a_low_sun_is_one_beam_more():
    assert len(lights(LIGHTS["low sun"])) == len(lights()) + 1


def test_software_renderer_draws_without_threads_of_its_own():
    usual = {name: value for name, value in os.environ.items() if name != MESA_THREADS}
    ended = subprocess.run([sys.executable, "-c", RENDERS], env=usual, capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["0"]
