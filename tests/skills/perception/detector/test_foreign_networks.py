"""Networks that other tools exported: used by a skill, and refused where their plug-in is missing."""

from importlib.metadata import EntryPoints

import pytest
from tiny_detector import write_model

from executive.app.report.pictures import open_detector
from executive.testing.skill_test import carry_out, load_skill_tests, scripted_maker
from plant.robots.spot.kind import spot_capabilities
from skills import stack
from skills.inputs.errors import InputError
from skills.perception.detector import Cascade
from skills.testing.blocks import TABLE_CAN
from tests.project import core_skills
from tests.skills.exported_networks import coloured_patch, mean_colour

SKILL_TESTS = """\
skill: detect
robot: {pose: {x: 0.45}, stack: own.yaml}
with: {classes: [coke], surfaces: table}
tests:
  - name: the network sees the can
    expect: {outcome: success, message: saw a coke on the table}
  - name: it sees none where there is none
    world: {can: false}
    expect: {outcome: failure, cause: POSTCONDITION}
"""


@pytest.mark.parametrize("index", [0, 1])
def test_a_skill_finds_an_object_with_an_own_network(tmp_path, index):
    coloured_patch(tmp_path / "own.onnx", TABLE_CAN.colour)
    (tmp_path / "own.yaml").write_text("detector: {use: onnx, file: own.onnx, classes: {can: coke}}\n")
    path = tmp_path / "own.skilltest.yaml"
    path.write_text(SKILL_TESTS)
    skills = core_skills()
    file = load_skill_tests(path, skills)
    trial = carry_out(file, index, skills["detect"], {"scripted": scripted_maker(spot_capabilities())})
    assert not trial.differences, trial.report()


MISSING = "'onnx' needs the plug-in errand-make, which is not installed"


@pytest.fixture
def no_plugin(monkeypatch):
    """Leaves the detector `onnx` out, as where the plug-in errand-make is not installed."""
    installed = stack.installed_plugins
    shipped = [each for each in installed("errand.detectors") if each.name != "onnx"]
    monkeypatch.setattr(
        stack,
        "installed_plugins",
        lambda group: EntryPoints(shipped) if group == "errand.detectors" else installed(group),
    )
    stack.components.cache_clear()
    yield
    stack.components.cache_clear()


def test_a_stack_file_with_a_network_names_the_plug_in_that_is_missing(no_plugin):
    with pytest.raises(stack.StackError) as error:
        stack.stack_of({"detector": {"use": "onnx", "file": "own.onnx"}})
    assert (error.value.path, error.value.message, error.value.hint) == (
        ("detector", "use"),
        MISSING,
        "pip install errand-make",
    )


@pytest.mark.parametrize("load", [lambda file: Cascade(file).build(), lambda file: open_detector(file, 0.5)])
def test_a_cascade_refuses_a_network_and_names_the_plug_in_that_is_missing(tmp_path, no_plugin, load):
    file = mean_colour(tmp_path / "own.onnx")
    with pytest.raises(InputError) as error:
        load(file)
    assert (
        str(error.value) == f"{file}: it is no cascade of Errand, and the detector {MISSING}; pip install errand-make"
    )


def test_a_cascade_in_a_file_needs_no_plug_in(tmp_path, no_plugin):
    assert open_detector(write_model(tmp_path / "tiny.onnx"), 0.5).class_names
