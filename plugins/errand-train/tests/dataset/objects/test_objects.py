"""Object generators: the same number gives the same files, a quarter is held out, masses and inertias are real."""

from functools import cache as cached

import numpy as np
import pytest
from pydantic import ValidationError
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from errand_train.dataset.objects import CLASSES, DISTRACTORS, held_out, instance, is_repainted, is_untextured, numbers
from errand_train.dataset.objects import make as make_object
from errand_train.dataset.objects.draft import Draft
from errand_train.dataset.objects.lettering import crest_label, script_label
from errand_train.dataset.objects.recipes import Part, Recipe, build, load_recipes
from plant.models.catalogue import load_catalogue

make = cached(make_object)
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
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("ERRAND_MODEL_CACHE", str(tmp_path))
    return tmp_path


def files(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.suffix != ".npz"}


@pytest.mark.parametrize("category", ["hammer", "coke", "mug"])
def test_the_same_number_gives_the_same_files(category, tmp_path, monkeypatch):
    first = files(instance(category, 5).folder)
    monkeypatch.setenv("ERRAND_MODEL_CACHE", str(tmp_path / "other"))
    again = instance(category, 5)
    assert again.folder.is_relative_to(tmp_path / "other")
    assert files(again.folder) == first


def test_another_number_gives_another_instance():
    forms = {tuple(np.round(make("wrench", seed)[0].size_m, 4)) for seed in range(8)}
    assert len(forms) == 8


def test_a_made_model_is_read_from_the_cache():
    first = instance("cube", 0)
    stamp = first.obj_path.stat().st_mtime_ns
    assert instance("cube", 0) == first
    assert first.obj_path.stat().st_mtime_ns == stamp


def test_a_quarter_of_the_instances_is_held_out_and_training_never_sees_it():
    for category in (*CLASSES, *DISTRACTORS):
        training, kept = numbers(category, for_training=True), numbers(category, for_training=False)
        everything = range(max(training) + 2)
        assert len(training) * 4 == len(everything) * 3
        assert not any(held_out(number) for number in training)
        assert all(held_out(number) for number in kept)


def test_validation_sees_the_same_instances_however_many_there_are():
    # category: held-out numbers
    expected = {"hammer": list(range(3, 48, 4)), "person": list(range(3, 48, 4)), "mug": [3, 7]}
    assert {category: numbers(category, for_training=False) for category in expected} == expected


def test_validation_has_no_untextured_or_repainted_instances():
    assert not any(
        is_untextured(category, n) or is_repainted(category, n)
        for category in (*CLASSES, *DISTRACTORS)
        for n in numbers(category, for_training=False)
    )


def test_two_fifths_of_the_later_instances_are_untextured_and_so_are_all_later_people():
    later = [number for number in numbers("hammer", for_training=True) if number >= 48]
    assert sum(is_untextured("hammer", number) for number in later) / len(later) == pytest.approx(0.4, abs=0.01)
    assert all(is_untextured("person", number) for number in numbers("person", for_training=True) if number >= 48)


@pytest.mark.parametrize("count", [2, pytest.param(12, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("category", CLASSES)
def test_an_untextured_model_has_only_plain_colours_and_a_real_size(category, count):
    masses, sides = RANGES[category]
    for seed in [number for number in range(48, 120) if is_untextured(category, number)][:count]:
        made, kind, _ = make(category, seed)
        assert (kind.partition(" ")[0], made.pictures) == ("untextured", {})
        assert masses[0] <= made.mass.mass_kg <= masses[1], (seed, made.mass.mass_kg)
        assert sides[0] <= max(made.size_m) <= sides[1], (seed, made.size_m)


def test_an_untextured_distractor_keeps_its_form_and_loses_its_pictures():
    made, kind, _ = make("cereal_box", 10)
    assert is_untextured("cereal_box", 10)
    assert (kind, made.pictures) == ("cereal box", {})
    assert all(material.texture is None for material in made.mesh.materials.values())


@pytest.mark.parametrize("category", ["extinguisher", "hammer", "screwdriver", "wrench"])
def test_a_repainted_object_keeps_its_form_and_loses_its_pictures(category):
    seeds = [number for number in range(48, 80) if is_repainted(category, number)][:2]
    for seed in seeds:
        made, kind, _ = make(category, seed)
        assert (kind != "untextured", made.pictures) == (True, {})
        assert {made.mesh.materials[name].texture for name, *_ in made.mesh.groups()} == {None}
    assert len(seeds) == 2


def test_some_repainted_tools_are_of_one_colour_and_no_extinguisher_is():
    def colours(category):
        made = [make(category, number)[0] for number in range(48, 80) if is_repainted(category, number)]
        return [len({material.colour for material in each.mesh.materials.values()}) for each in made]

    assert 1 in colours("hammer")
    assert min(colours("extinguisher")) > 1


def test_a_distractor_that_would_look_like_a_class_keeps_its_pictures():
    assert not any(is_untextured(category, 10) for category in ("food_can", "wine_bottle", "tissue_box"))


def test_there_are_nine_classes_with_thirty_instances_and_forty_distractors():
    assert set(CLASSES) == set(load_catalogue())
    assert all(len(numbers(category, for_training=True)) >= 30 for category in CLASSES)
    assert len(DISTRACTORS) >= 40
    assert not set(CLASSES) & set(DISTRACTORS)


@pytest.mark.parametrize("count", [2, pytest.param(16, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("category", SMALL)
def test_sizes_and_masses_are_those_of_real_objects(category, count):
    masses, sides = RANGES[category]
    for seed in range(count):
        made, _, _ = make(category, seed)
        assert masses[0] <= made.mass.mass_kg <= masses[1], (seed, made.mass.mass_kg)
        assert sides[0] <= max(made.size_m) <= sides[1], (seed, made.size_m)


BY_NIGHT = {name for number, name in enumerate(DISTRACTORS) if number % 4}
"""Three of four distractors, which are recipes of the same parts as the others."""


@pytest.mark.parametrize(
    "category",
    [pytest.param(name, marks=[pytest.mark.nightly] * (name in BY_NIGHT)) for name in (*SMALL, *DISTRACTORS)],
)
def test_inertias_are_those_of_a_body_that_fits_its_box(category):
    made, _, _ = make(category, 1)
    moments = np.linalg.eigvalsh(made.mass.inertia)
    assert moments[0] > 0
    assert moments[2] <= moments[0] + moments[1] + 1e-12
    half = np.array(made.size_m) / 2
    assert np.all(np.abs(made.mass.com) <= half)
    assert np.trace(made.mass.inertia) / 2 <= made.mass.mass_kg * float(half @ half) * 1.01


def sharp(made):
    """Whether a cube's edges are not rounded."""
    return all(len(np.unique(points.round(9))) == 2 for _, points, _, _ in made.mesh.groups())


def test_a_cube_and_a_cylinder_have_the_inertia_of_the_book():
    made = next(made for made, _, _ in (make("cube", seed) for seed in range(20)) if sharp(made))
    expected = made.mass.mass_kg * made.size_m[0] ** 2 / 6
    np.testing.assert_allclose(np.diag(made.mass.inertia), expected, rtol=0.06)
    made, _, _ = make("cylinder", 2)
    radius, height = made.size_m[0] / 2, made.size_m[2]
    assert made.mass.inertia[2, 2] == pytest.approx(made.mass.mass_kg * radius**2 / 2, rel=0.03)
    across = made.mass.mass_kg * (3 * radius**2 + height**2) / 12
    assert made.mass.inertia[0, 0] == pytest.approx(across, rel=0.03)


@pytest.mark.parametrize("category", ["beer", "wrench", "extinguisher", "pliers"])
def test_every_normal_has_unit_length_and_every_picture_is_there(category):
    model = instance(category, 2)
    normals = np.array([line.split()[1:] for line in model.obj_path.read_text().splitlines() if line[:3] == "vn "])
    np.testing.assert_allclose(np.linalg.norm(normals.astype(float), axis=1), 1.0, atol=0.01)
    for line in (model.folder / f"{category}.mtl").read_text().splitlines():
        if line.startswith("map_Kd"):
            assert (model.folder / line.split()[1]).is_file()


def test_a_person_stands_on_the_floor_with_a_person_s_size_and_mass():
    made, stance, _ = make("person", 1)
    low = min(points[:, 2].min() for _, points, _, _ in made.mesh.groups())
    masses, sides = RANGES["person"]
    assert stance
    assert low == pytest.approx(0.0, abs=1e-6)
    assert masses[0] <= made.mass.mass_kg <= masses[1]
    assert sides[0] <= made.size_m[2] <= sides[1]


@pytest.mark.parametrize("category", ["hammer", "screwdriver", "coke", "toaster"])
def test_drake_reads_the_model_and_agrees_on_its_mass(category):
    model = instance(category, 3)
    plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.005)
    Parser(plant).AddModels(str(model.path))
    plant.Finalize()
    body = plant.GetBodyByName(category)
    assert isinstance(plant, MultibodyPlant)
    assert body.default_mass() == pytest.approx(model.mass_kg, rel=1e-3)
    np.testing.assert_allclose(body.default_com(), model.com_m, atol=1e-5)
    assert plant.num_collision_geometries() >= 1


def test_an_unknown_category_is_refused_with_the_known_ones():
    with pytest.raises(KeyError, match="no category 'hamer'; there are beer, coke"):
        instance("hamer", 1)


def test_a_negative_number_is_refused():
    with pytest.raises(ValueError, match="0 or more, not -1"):
        instance("hammer", -1)


def test_a_recipe_with_an_unknown_key_is_refused():
    with pytest.raises(ValidationError, match="densty"):
        Part.model_validate({"box": "main", "densty": 500})


@pytest.mark.parametrize("value", ["l + depth", "__import__('os')", "l.real", "l +"])
def test_an_expression_over_anything_but_the_recipes_names_is_refused(value):
    part = {"box": "main", "low": (0, 0, 0), "high": (1, 1, value), "density": 500}
    recipe = Recipe.model_validate({"let": {"l": 1}, "materials": {"main": {}}, "parts": (part,)})
    with pytest.raises(ValueError, match=r"neither a number|no expression"):
        build("crate", recipe, Draft(np.random.default_rng(1)))


def test_a_recipe_repeats_turns_and_places_its_parts():
    box = {"box": "main", "low": (0, 0, 0), "high": ("l", 1, 1), "density": 1}
    group = {"each": {"k": 3}, "at": ("4*k", 0, 0), "turn": (("z", 90),), "parts": (box,)}
    recipe = Recipe.model_validate(
        {"let": {"l": (2, 2)}, "materials": {"main": {"texture": "plain"}}, "parts": (group,)}
    )
    made, _, _ = build("row", recipe, Draft(np.random.default_rng(1)))
    np.testing.assert_allclose(made.size_m, (9, 2, 1))
    assert made.mass.mass_kg == pytest.approx(6.0)


def test_half_of_the_beers_are_cans():
    kinds = load_recipes("classes")["beer"].kinds
    weights = {name: kind.weight for name, kind in kinds.items()}
    assert sum(weight for name, weight in weights.items() if "can" in name) == pytest.approx(sum(weights.values()) / 2)


@pytest.mark.parametrize("colour", [(0.05, 0.3, 0.13), (0.93, 0.93, 0.91), (0.82, 0.66, 0.24)])
def test_a_crest_shows_other_colours_than_its_ground(colour):
    rng = np.random.default_rng(5)
    for _ in range(5):
        label = crest_label(rng, np.array(colour), np.array([0.1, 0.25, 0.66]), words=["BEER"])
        assert (label.shape, label.min() >= 0.0, label.max() <= 1.0) == ((256, 512, 3), True, True)
        assert (np.abs(label - label[128, 0]).max(axis=2) > 0.2).mean() > 0.1


def test_a_script_repeats_its_name_on_both_sides():
    label = script_label(np.random.default_rng(2), np.array([0.8, 0.0, 0.0]), np.zeros(3), words=[], brands=["Cola"])
    light = (label.min(axis=2) > 0.5).mean(axis=0)
    assert min(light[:256].max(), light[256:].max()) > 0.1
