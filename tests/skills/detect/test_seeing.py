"""One picture looked through."""

from dataclasses import replace

import numpy as np
import pytest
from table_scene import COKE, scene

from skills.detect.seeing import is_dark


@pytest.mark.parametrize(("counts", "dark"), [(0, True), (4, True), (12, False), (255, False)])
def test_a_picture_that_is_black_all_over_is_dark(counts, dark):
    image = scene([COKE])
    assert is_dark(replace(image, grey=np.full_like(image.grey, counts))) is dark


def test_a_dim_picture_with_something_in_it_is_not_dark():
    image = scene([COKE])
    grey = np.zeros_like(image.grey)
    grey[100:140, 100:160] = 60
    assert not is_dark(replace(image, grey=grey))
