"""Where the robot starts, as users write it and the store keeps it."""

import pytest

from executive.mission.errors import InputError
from executive.mission.request import Start
from skills.robot import Pose2D


@pytest.mark.parametrize("start", [Start(), Start(Pose2D(1.25, -3.0, 0.1))])
def test_a_start_is_read_back_as_it_was_written(start):
    assert Start.of(str(start)) == start


@pytest.mark.parametrize("text", ["", "nowhere", "1 2", "1 2 3 4", "1 2 nan", "1 2 x"])
def test_what_is_no_start_is_refused_with_a_hint(text):
    with pytest.raises(InputError, match="is no start") as error:
        Start.of(text)
    assert "unknown" in error.value.hint
