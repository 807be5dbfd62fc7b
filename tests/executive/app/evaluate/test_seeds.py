"""Seeds from text."""

import pytest

from executive.app.evaluate.evaluation_file import seed_range
from skills.files.errors import InputError


@pytest.mark.parametrize(("text", "seeds"), [("1-3", (1, 2, 3)), ("7", (7,)), ("1,4,7-8", (1, 4, 7, 8))])
def test_seed_ranges(text, seeds):
    assert seed_range(text) == seeds


@pytest.mark.parametrize("text", ["", "a", "1-", "-", "5-3", "1..4"])
def test_bad_seed_ranges_are_refused(text):
    with pytest.raises(InputError, match="1-20"):
        seed_range(text)


@pytest.mark.parametrize(
    ("text", "count", "seeds"), [("8001-", 3, (8001, 8002, 8003)), ("3,7-", 3, (3, 7, 8)), ("1-20", 2, (1, 2))]
)
def test_the_first_seeds_come_from_a_range_that_may_have_no_end(text, count, seeds):
    assert seed_range(text, count) == seeds


def test_too_few_seeds_are_refused():
    with pytest.raises(InputError, match="'1-3' holds 3 seeds, fewer than 5"):
        seed_range("1-3", 5)


@pytest.mark.parametrize("text", ["-", "a-", "1-,4"])
def test_a_bad_range_of_seeds_is_refused(text):
    with pytest.raises(InputError, match="is no range of seeds"):
        seed_range(text, 2)
