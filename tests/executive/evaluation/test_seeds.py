"""Seeds from text."""

import pytest

from executive.evaluation.seeds import seed_range
from skills.files.errors import InputError


@pytest.mark.parametrize(("text", "seeds"), [("1-3", (1, 2, 3)), ("7", (7,)), ("1,4,7-8", (1, 4, 7, 8))])
def test_seed_ranges(text, seeds):
    assert seed_range(text) == seeds


@pytest.mark.parametrize("text", ["", "a", "1-", "-", "5-3", "1..4"])
def test_bad_seed_ranges_are_refused(text):
    with pytest.raises(InputError, match="1-20"):
        seed_range(text)
