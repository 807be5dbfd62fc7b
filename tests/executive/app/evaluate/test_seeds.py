"""Seeds from text."""

import pytest

from executive.app.evaluate.evaluation_file import seed_range
from skills.inputs.errors import InputError


@pytest.mark.parametrize(
    ("text", "count", "seeds"),
    [
        ("1-3", (), (1, 2, 3)),
        ("1,4,7-8", (), (1, 4, 7, 8)),
        ("7", (), (7,)),
        ("1-20", (2,), (1, 2)),
        ("3,7-", (3,), (3, 7, 8)),
        ("8001-", (3,), (8001, 8002, 8003)),
    ],
)
def test_seeds_come_from_ranges_of_which_the_last_may_have_no_end(text, count, seeds):
    assert seed_range(text, *count) == seeds


BAD = [
    *((text, (), "1-20") for text in ("", "a", "1-", "-", "5-3", "1..4")),
    *((text, (2,), "is no range of seeds") for text in ("-", "a-", "1-,4")),
]


@pytest.mark.parametrize(("text", "count", "says"), BAD)
def test_a_bad_range_of_seeds_is_refused(text, count, says):
    with pytest.raises(InputError, match=says):
        seed_range(text, *count)


def test_too_few_seeds_are_refused():
    with pytest.raises(InputError, match="'1-3' holds 3 seeds, fewer than 5"):
        seed_range("1-3", 5)
