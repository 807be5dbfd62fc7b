"""A request's variation, put into its world and plant."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.cli.requests import prepare
from executive.cli.variations import plant_variation
from executive.mission.request import Request
from executive.words.variation import Variation
from plant.worlds.lights import LIGHTS
from plant.worlds.placement import place_people
from skills.files.errors import InputError

BEER = "Hey Alice, bring me a beer"


def asked(folder: Path, variation: Variation) -> Request:
    return Request(sentence=BEER, world="flat", seed=2, out=folder / "out", variation=variation)


def test_light_clutter_and_friction_reach_the_plant_and_clutter_spares_what_is_asked_for(tmp_path: Path) -> None:
    varied = plant_variation(prepare(asked(tmp_path, Variation("dim", 5, 0, 0.7)), ask=None))
    assert (varied.light, varied.clutter, varied.friction) == (LIGHTS["dim"], 5, 0.7)
    assert "beer" in varied.spared


def test_people_of_a_variation_walk_in_the_world(tmp_path: Path) -> None:
    prepared = prepare(asked(tmp_path, Variation(people=2)), ask=None)
    walking = {each.name for each in place_people(prepared.world, 2) if each.route is not None}
    assert {"passer-by 1", "passer-by 2"} <= walking


def test_a_light_that_is_none_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"unknown light 'dimm'.*"):
        prepare(asked(tmp_path, Variation("dimm")), ask=None)


@pytest.mark.parametrize("values", [{"clutter": -1}, {"clutter": 41}, {"people": 9}, {"friction": 0.0}])
def test_a_value_out_of_range_is_refused_with_the_range(values: dict[str, float]) -> None:
    with pytest.raises(InputError, match="should be from"):
        Variation(**values)  # type: ignore[arg-type]


def test_a_variation_is_repeated_by_its_options_and_its_text() -> None:
    varied = Variation("evening", 3, 1, 1.5)
    assert varied.arguments() == ["--light=evening", "--clutter=3", "--people=1", "--friction=1.5"]
    assert Variation.of_text(varied.to_text()) == varied
