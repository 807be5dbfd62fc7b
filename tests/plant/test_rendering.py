"""Light of a world, as it is drawn."""

from __future__ import annotations

import numpy as np
import pytest

from executive.words.variation import DAY_LIGHT, LIGHTS
from plant.rendering import lights, render_parameters


def test_a_dim_light_dims_each_beam_and_the_sky() -> None:
    day, dim = lights(DAY_LIGHT), lights(LIGHTS["dim"])
    assert [each.intensity for each in dim] == pytest.approx([0.4 * each.intensity for each in day])
    sky = render_parameters(LIGHTS["dim"]).default_clear_color
    assert np.max(sky) < 0.5


def test_a_low_sun_is_one_beam_more() -> None:
    assert len(lights(LIGHTS["low sun"])) == len(lights()) + 1
