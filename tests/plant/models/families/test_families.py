"""Families: the same number gives the same files, a quarter is held out, masses and inertias are real."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from plant.models.catalogue import load_catalogue
from plant.models.families import CLASSES, DISTRACTORS, ODDMENT, held_out, instance, make, numbers, repainted, sketched

SMALL = tuple(name for name in CLASSES if name != "person")

# Least and greatest mass (kg) and longest side (m) that an instance may have.
RANGES = {
    "beer": ((0.01, 1.4), (0.08, 0.32)),
    "coke": ((0.01, 2.2), (0.08, 0.36)),
    "extinguisher": ((1.0, 30.0), (0.25, 0.85)),
    "hammer": ((0.15, 9.0), (0.2, 1.0)),
    "screwdriver": ((0.01, 0.4), (0.07, 0.45)),
    "wrench": ((0.03, 4.0), (0.11, 0.45)),
    "cylinder": ((0.001, 20.0), (0.03, 0.41)),
    "cube": ((0.001, 30.0), (0.03, 0.23)),
    "person": ((40.0, 150.0), (1.2, 2.2)),
}


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ERRAND_MODEL_CACHE", str(tmp_path))
    return tmp_path


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.suffix != ".npz"}


@pytest.mark.parametrize("family", ["hammer", "coke", "mug"])
def test_the_same_number_gives_the_same_files(family: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = files(instance(family, 5).folder)
    monkeypatch.setenv("ERRAND_MODEL_CACHE", str(tmp_path / "other"))
    again = instance(family, 5)
    assert again.folder.is_relative_to(tmp_path / "other")
    assert files(again.folder) == first


def test_another_number_gives_another_thing() -> None:
    forms = {tuple(np.round(make("wrench", seed)[0].size_m, 4)) for seed in range(8)}
    assert len(forms) == 8


def test_a_made_model_is_read_from_the_cache() -> None:
    first = instance("cube", 0)
    stamp = first.obj_path.stat().st_mtime_ns
    assert instance("cube", 0) == first
    assert first.obj_path.stat().st_mtime_ns == stamp


def test_a_quarter_of_the_instances_is_held_out_and_training_never_sees_it() -> None:
    for family in (*CLASSES, *DISTRACTORS):
        training, kept = numbers(family, for_training=True), numbers(family, for_training=False)
        everything = range(max(training) + 2)
        assert len(training) * 4 == len(everything) * 3
        assert not any(held_out(number) for number in training)
        assert all(held_out(number) for number in kept)


def test_validation_sees_the_same_instances_however_many_there_are() -> None:
    # family: held-out numbers
    expected = {"hammer": list(range(3, 48, 4)), "person": list(range(3, 48, 4)), "mug": [3, 7]}
    assert {family: numbers(family, for_training=False) for family in expected} == expected


def test_validation_sees_no_sketches_and_nothing_repainted() -> None:
    assert not any(
        sketched(family, n) or repainted(family, n)
        for family in (*CLASSES, *DISTRACTORS)
        for n in numbers(family, for_training=False)
    )


def test_two_fifths_of_the_later_instances_are_sketches_and_so_are_all_later_people() -> None:
    later = [number for number in numbers("hammer", for_training=True) if number >= 48]
    assert sum(sketched("hammer", number) for number in later) / len(later) == pytest.approx(0.4, abs=0.01)
    assert all(sketched("person", number) for number in numbers("person", for_training=True) if number >= 48)


def test_oddments_are_for_training_alone() -> None:
    assert numbers(ODDMENT, for_training=False) == []
    assert len(numbers(ODDMENT, for_training=True)) == 480


def test_an_oddment_has_plain_colours_alone_and_the_size_of_what_lies_about() -> None:
    made = [make(ODDMENT, seed) for seed in range(120)]
    assert {kind for _, kind, _ in made} == {"turned", "handled", "box", "slab", "bent", "sprayer"}
    for seed, (each, _, _) in enumerate(made):
        assert each.pictures == {}
        assert 0.03 < max(each.size_m) < 0.45, (seed, each.size_m)
        assert 0.001 < each.mass.mass_kg < 12.0, (seed, each.mass.mass_kg)


def test_no_turned_oddment_is_a_plain_drum() -> None:
    turned = [each for each, kind, _ in (make(ODDMENT, seed) for seed in range(240)) if kind == "turned"]
    for made in turned:
        points = np.concatenate([points for _, points, _, _ in made.mesh.groups()])
        level, radius = np.round(points[:, 2], 6), np.linalg.norm(points[:, :2], axis=1)
        widths = [radius[level == height].max() for height in np.unique(level)]
        assert max(widths) > 1.3 * min(widths)


def test_no_oddment_of_a_box_is_a_cube() -> None:
    boxes = [each for each, kind, _ in (make(ODDMENT, seed) for seed in range(120)) if kind == "box"]
    assert min(max(each.size_m) / min(each.size_m) for each in boxes) > 1.2


@pytest.mark.parametrize("family", CLASSES)
def test_a_sketch_has_plain_colours_alone_and_the_size_of_the_real_thing(family: str) -> None:
    masses, sides = RANGES[family]
    for seed in [number for number in range(48, 120) if sketched(family, number)][:12]:
        made, kind, _ = make(family, seed)
        assert (kind, made.pictures) == ("sketch", {})
        assert masses[0] <= made.mass.mass_kg <= masses[1], (seed, made.mass.mass_kg)
        assert sides[0] <= max(made.size_m) <= sides[1], (seed, made.size_m)


def test_a_sketch_of_a_thing_of_no_class_keeps_its_form_and_loses_its_pictures() -> None:
    made, kind, _ = make("cereal_box", 10)
    assert sketched("cereal_box", 10)
    assert (kind, made.pictures) == ("cereal box", {})
    assert all(material.texture is None for material in made.mesh.materials.values())


@pytest.mark.parametrize("family", ["extinguisher", "hammer", "screwdriver", "wrench"])
def test_a_repainted_thing_keeps_its_form_and_loses_its_pictures(family: str) -> None:
    seeds = [number for number in range(48, 80) if repainted(family, number)][:4]
    for seed in seeds:
        made, kind, _ = make(family, seed)
        assert (kind != "sketch", made.pictures) == (True, {})
        assert {made.mesh.materials[name].texture for name, *_ in made.mesh.groups()} == {None}
    assert len(seeds) == 4


def test_some_repainted_tools_are_of_one_colour_and_no_extinguisher_is() -> None:
    def colours(family: str) -> list[int]:
        made = [make(family, number)[0] for number in range(48, 80) if repainted(family, number)]
        return [len({material.colour for material in each.mesh.materials.values()}) for each in made]

    assert 1 in colours("hammer")
    assert min(colours("extinguisher")) > 1


def test_what_would_pass_for_a_class_without_its_picture_keeps_it() -> None:
    assert not any(sketched(family, 10) for family in ("food_can", "wine_bottle", "tissue_box"))


def test_there_are_nine_classes_with_thirty_instances_and_forty_distractors() -> None:
    assert set(CLASSES) == set(load_catalogue())
    assert all(len(numbers(family, for_training=True)) >= 30 for family in CLASSES)
    assert len(DISTRACTORS) >= 40
    assert not set(CLASSES) & set(DISTRACTORS)


@pytest.mark.parametrize("family", SMALL)
def test_sizes_and_masses_are_those_of_real_things(family: str) -> None:
    masses, sides = RANGES[family]
    for seed in range(16):
        made, _, _ = make(family, seed)
        assert masses[0] <= made.mass.mass_kg <= masses[1], (seed, made.mass.mass_kg)
        assert sides[0] <= max(made.size_m) <= sides[1], (seed, made.size_m)


@pytest.mark.parametrize("family", [*SMALL, *DISTRACTORS, ODDMENT])
def test_inertias_are_those_of_a_body_that_fits_its_box(family: str) -> None:
    made, _, _ = make(family, 1)
    moments = np.linalg.eigvalsh(made.mass.inertia)
    assert moments[0] > 0
    assert moments[2] <= moments[0] + moments[1] + 1e-12
    half = np.array(made.size_m) / 2
    assert np.all(np.abs(made.mass.com) <= half)
    assert np.trace(made.mass.inertia) / 2 <= made.mass.mass_kg * float(half @ half) * 1.01


def test_a_cube_and_a_cylinder_have_the_inertia_of_the_book() -> None:
    made = next(made for made, _, _ in (make("cube", seed) for seed in range(20)) if len(made.mesh.materials) == 6)
    expected = made.mass.mass_kg * made.size_m[0] ** 2 / 6
    np.testing.assert_allclose(np.diag(made.mass.inertia), expected, rtol=0.06)
    made, _, _ = make("cylinder", 2)
    radius, height = made.size_m[0] / 2, made.size_m[2]
    assert made.mass.inertia[2, 2] == pytest.approx(made.mass.mass_kg * radius**2 / 2, rel=0.03)
    across = made.mass.mass_kg * (3 * radius**2 + height**2) / 12
    assert made.mass.inertia[0, 0] == pytest.approx(across, rel=0.03)


@pytest.mark.parametrize("family", ["beer", "wrench", "extinguisher", "pliers"])
def test_every_normal_has_unit_length_and_every_picture_is_there(family: str) -> None:
    model = instance(family, 2)
    normals = np.array([line.split()[1:] for line in model.obj_path.read_text().splitlines() if line[:3] == "vn "])
    np.testing.assert_allclose(np.linalg.norm(normals.astype(float), axis=1), 1.0, atol=0.01)
    for line in (model.folder / f"{family}.mtl").read_text().splitlines():
        if line.startswith("map_Kd"):
            assert (model.folder / line.split()[1]).is_file()


def test_a_person_stands_on_the_floor_with_a_person_s_size_and_mass() -> None:
    made, stance, _ = make("person", 1)
    low = min(points[:, 2].min() for _, points, _, _ in made.mesh.groups())
    masses, sides = RANGES["person"]
    assert stance
    assert low == pytest.approx(0.0, abs=1e-6)
    assert masses[0] <= made.mass.mass_kg <= masses[1]
    assert sides[0] <= made.size_m[2] <= sides[1]


@pytest.mark.parametrize("family", ["hammer", "screwdriver", "coke", "toaster"])
def test_drake_reads_the_model_and_agrees_on_its_mass(family: str) -> None:
    model = instance(family, 3)
    plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.005)
    Parser(plant).AddModels(str(model.path))
    plant.Finalize()
    body = plant.GetBodyByName(family)
    assert isinstance(plant, MultibodyPlant)
    assert body.default_mass() == pytest.approx(model.mass_kg, rel=1e-3)
    np.testing.assert_allclose(body.default_com(), model.com_m, atol=1e-5)
    assert plant.num_collision_geometries() >= 1


def test_an_unknown_family_is_told_the_known_ones() -> None:
    with pytest.raises(KeyError, match="no family 'hamer'; there are beer, coke"):
        instance("hamer", 1)


def test_a_negative_number_is_refused() -> None:
    with pytest.raises(ValueError, match="0 or more, not -1"):
        instance("hammer", -1)
