"""Models of own objects in files."""

import numpy as np
import pytest
from own_models import can_model, photographed_can

from skills.inputs.errors import InputError
from skills.perception.object_model import RECOGNITION_FILE, read_model

MODEL = can_model("tin", 0.04, 0.12, (190, 15, 20))


def rewritten(folder, **changes):
    """Writes the model of a folder again with other arrays; None: without."""
    with np.load(folder / RECOGNITION_FILE) as data:
        arrays = {key: changes.get(key, lambda values: values)(data[key]) for key in data}
    np.savez(folder / RECOGNITION_FILE, **{key: values for key, values in arrays.items() if values is not None})


def test_a_model_is_read_as_it_was_written(tmp_path):
    MODEL.write(tmp_path)
    read = read_model(tmp_path)
    assert read.name == "tin"
    np.testing.assert_allclose(read.points, MODEL.points, atol=1e-6)
    np.testing.assert_array_equal(read.colours, MODEL.colours)


def test_views_of_photographs_are_read_as_they_were_written(tmp_path):
    model = photographed_can("tin", 0.04, 0.12, (190, 15, 20))
    model.write(tmp_path)
    np.testing.assert_array_equal(read_model(tmp_path).views, model.views)


def test_a_model_from_before_there_were_views_has_none(tmp_path):
    MODEL.write(tmp_path)
    rewritten(tmp_path, views=lambda views: None)
    assert len(read_model(tmp_path).views) == 0


@pytest.mark.parametrize("content", [None, b"", b"no archive"])
def test_a_folder_without_a_model_is_refused_in_one_sentence(tmp_path, content):
    if content is not None:
        (tmp_path / RECOGNITION_FILE).write_bytes(content)
    with pytest.raises(InputError, match="errand object import"):
        read_model(tmp_path)


@pytest.mark.parametrize(
    "changes", [{"colours": lambda rows: rows[:5]}, {"views": lambda views: views[:, :12]}], ids=" ".join
)
def test_a_model_with_too_few_colours_or_views_of_another_size_is_refused(tmp_path, changes):
    photographed_can("tin", 0.04, 0.12, (190, 15, 20)).write(tmp_path)
    rewritten(tmp_path, **changes)
    with pytest.raises(InputError, match="damaged"):
        read_model(tmp_path)
