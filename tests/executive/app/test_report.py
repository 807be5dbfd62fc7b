"""What a run's report tells in words."""

import pytest

from executive.app.report import counts_text
from executive.words.goal import RefereeReport


@pytest.mark.parametrize(
    ("counts", "text"),
    [
        ((0, 0), "0 collisions, 0 drops"),
        ((1, 1), "1 collision, 1 drop"),
        ((2, 0, 1, 1), "2 collisions (1 with people), 0 drops, 1 time somebody walked into the robot"),
    ],
)
def test_the_counts_are_formatted_in_words(counts, text):
    assert counts_text(RefereeReport(True, "it is so", *counts)) == text
