import numpy as np
import pytest

from skills.geometry import line_of_sight


class Wall:
    """Costmap with a wall at x = 1 from y = -1 to y = 1."""

    def clearance_m(self, points_W):
        return np.where((np.abs(points_W[:, 0] - 1.0) < 0.1) & (np.abs(points_W[:, 1]) < 1.0), -0.1, 1.0)


# point seen from the origin, distance (m) from which obstacles count -> visible
@pytest.mark.parametrize(
    ("point", "beyond_m", "visible"),
    [((0.8, 0.0), 0.3, True), ((2.0, 0.0), 0.3, False), ((1.0, 2.0), 0.3, True), ((2.0, 0.0), 1.2, True)],
)
def test_a_wall_blocks_the_line_of_sight_unless_it_is_nearer_than_obstacles_count(point, beyond_m, visible):
    assert line_of_sight(Wall(), np.zeros(2), np.array([point]), beyond_m=beyond_m).tolist() == [visible]
