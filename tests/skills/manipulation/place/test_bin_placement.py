"""Heights inside a bin, before and after an object fell into it."""

import numpy as np
import pytest

from skills.api import Surface
from skills.manipulation.place.verification import inside_heights, risen_cells

BIN = Surface("bin", ((0.0, 0.0), (0.46, 0.0), (0.46, 0.46), (0.0, 0.46)), 0.42, is_bin=True)
XY = np.stack(np.meshgrid(np.arange(0.0, 0.46, 0.01), np.arange(0.0, 0.46, 0.01)), axis=-1).reshape(-1, 2)


def view(*objects, seen=lambda x, y: True):
    """Heights of a bin with its floor at 0.06 m and boxes (x0, y0, x1, y1, top) in it."""
    z = np.full(len(XY), 0.06)
    for x0, y0, x1, y1, top in objects:
        z[([x0, y0] <= XY).all(axis=1) & ([x1, y1] >= XY).all(axis=1)] = top
    points = np.column_stack([XY, z])
    return inside_heights(points[[seen(x, y) for x, y in XY]], BIN)


WRENCH, CAN, RIM = (0.1, 0.2, 0.3, 0.23, 0.08), (0.2, 0.1, 0.27, 0.22, 0.13), (0.0, 0.0, 0.46, 0.02, 0.42)


@pytest.mark.parametrize(
    ("before", "after", "inside"),
    [
        pytest.param(view(), view(WRENCH), True, id="a thin tool"),
        pytest.param(view(CAN), view(CAN, WRENCH), True, id="a tool beside a can"),
        pytest.param(view(CAN), view(CAN), False, id="only the can of before"),
        pytest.param({}, view(CAN), True, id="nothing was seen before"),
        pytest.param({}, view(), False, id="an empty bin"),
        pytest.param({}, view(RIM), False, id="its walls"),
        pytest.param(view(seen=lambda x, y: x < 0.2), view(CAN), True, id="half was seen before"),
        pytest.param(view(), {}, False, id="nothing is seen"),
    ],
)
def test_an_object_inside_raises_the_heights(before, after, inside):
    assert (risen_cells(before, after) >= 5) == inside
