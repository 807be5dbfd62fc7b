import re

import pytest

from skills.durations import DURATION_PATTERN, seconds_in
from tests.tables import table


@pytest.mark.parametrize(*table(__file__, "durations"))
def test_a_duration_is_read(text, seconds):
    assert seconds_in(text) == pytest.approx(seconds)


@pytest.mark.parametrize(*table(__file__, "no_durations"))
def test_a_text_without_a_duration_gives_none(text):
    assert seconds_in(text) is None


@pytest.mark.parametrize("text", ["2 min", "1 h 30 min", "90 s", "PT5M", "1 hour and 30 minutes"])
def test_an_editor_takes_the_usual_forms(text):
    assert re.search(DURATION_PATTERN, text)
