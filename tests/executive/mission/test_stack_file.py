"""Stack files: read with file and line."""

import pytest

from executive.mission.stack_file import load_stack
from skills.files.errors import InputError
from skills.stack import default_stack


def test_no_file_is_the_default():
    assert load_stack(None) is default_stack()


def test_a_file_sets_options(tmp_path):
    file = tmp_path / "stack.yaml"
    file.write_text("planner:\n  use: lattice\n  margin_m: 0.15\n")
    assert load_stack(file).planner.margin_m == 0.15


def test_an_unknown_option_is_refused_with_its_line(tmp_path):
    file = tmp_path / "stack.yaml"
    file.write_text("planner:\n  use: lattice\n  margin: 0.15\n")
    with pytest.raises(InputError, match="unknown key 'margin'") as error:
        load_stack(file)
    assert (error.value.file, error.value.line) == (file, 3)
