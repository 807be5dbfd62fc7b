"""Stack files: found by name, and read with file and line."""

from pathlib import Path

import pytest

from executive.mission.load import load_stack
from skills.inputs.errors import InputError
from skills.stack import default_stack, stack_file


def test_no_file_is_the_default():
    assert load_stack(None) is default_stack()


def test_a_file_sets_options_and_an_unknown_one_is_refused_with_its_line(tmp_path):
    file = tmp_path / "stack.yaml"
    file.write_text("planner:\n  use: lattice\n  margin_m: 0.15\n")
    assert load_stack(file).planner.margin_m == 0.15
    file.write_text("planner:\n  use: lattice\n  margin: 0.15\n")
    with pytest.raises(InputError, match="unknown key 'margin'") as error:
        load_stack(file)
    assert (error.value.file, error.value.line) == (file, 3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("", "detector.file: is missing; write 'file: ...'"),
        (", file: a.onnx, threshold: 50", "detector.threshold: should be from 0 to 1; it reads 50 now"),
        (", file: a.onnx, std: [1, 0, 1]", "detector.std.1: should be above 0"),
        (", file: a.onnx, names: 5", "detector.names: should be a mapping"),
    ],
)
def test_an_error_in_a_stack_file_names_the_option(tmp_path, options, message):
    (tmp_path / "stack.yaml").write_text(f"detector: {{use: onnx{options}}}\n")
    with pytest.raises(InputError) as error:
        load_stack(tmp_path / "stack.yaml")
    assert str(error.value).startswith(f"{tmp_path / 'stack.yaml'}:1: {message}")


@pytest.mark.parametrize("text", ["[]", "0", "false", "''", "- a"])
def test_a_stack_that_is_no_mapping_is_refused_and_an_empty_file_is_the_default(tmp_path, text):
    (tmp_path / "stack.yaml").write_text(text)
    with pytest.raises(InputError, match="should be a mapping of keys to values"):
        load_stack(tmp_path / "stack.yaml")
    (tmp_path / "stack.yaml").write_text("# nothing\n")
    assert load_stack(tmp_path / "stack.yaml").names == default_stack().names


def test_shipped_stack_is_found_by_its_name():
    assert load_stack(stack_file(Path("no_map"))).names["localiser"] == "dead_reckoning"


def test_a_file_is_taken_as_it_is(tmp_path):
    own = tmp_path / "own.yaml"
    own.write_text("planner: {use: lattice, greed: 1.5}\n")
    assert stack_file(own) == own


def test_an_unknown_name_of_a_stack_is_refused_with_the_known_ones(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="there is no stack 'no_mapp'; did you mean 'no_map'"):
        stack_file(Path("no_mapp"))
    assert stack_file(Path("mine.yaml")) == Path("mine.yaml")


def test_a_folder_does_not_hide_the_stack_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "no_map").mkdir()
    assert stack_file(Path("no_map")).name == "no_map_stack.yaml"
