"""Maps of the forms that other programs write are read right, or refused by their reason."""

import re

import numpy as np
import pytest

from skills.grid_map import load_grid_map
from skills.inputs.errors import InputError
from tests.skills.estimate.map_forms import FORMS, FREE, OCCUPIED, UNKNOWN, room


@pytest.mark.parametrize("name", [name for name, form in FORMS.items() if form.refused is None])
def test_a_map_of_another_program_is_read_as_it_was_saved(tmp_path, name):
    form = FORMS[name]
    grid = load_grid_map(form.write(tmp_path))
    read = grid.grey(free=FREE, unknown=UNKNOWN, occupied=OCCUPIED)[::-1]
    saved = room()
    if form.note is not None and "free_thresh" in form.note:
        saved[saved == UNKNOWN] = FREE
    np.testing.assert_array_equal(read, saved)
    assert grid.resolution_m == pytest.approx(0.05)
    if form.note is not None:
        assert any(re.search(form.note, note) for note in grid.notes)


@pytest.mark.parametrize("name", [name for name, form in FORMS.items() if form.refused is not None])
def test_a_map_that_cannot_be_used_is_refused_by_its_reason(tmp_path, name):
    form = FORMS[name]
    with pytest.raises(InputError) as error:
        load_grid_map(form.write(tmp_path))
    assert re.search(str(form.refused), str(error.value))
