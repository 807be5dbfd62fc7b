"""What a run's report tells in words."""

import pytest

from executive.app.report.run_report import Verdict, counts_text
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


def test_a_short_verdict_is_one_line():
    verdict = Verdict("The referee saw", True, "fulfilled", "The beer rests on Robin's tray.")
    assert list(verdict.lines()) == [
        "[bold]The referee saw:[/bold] [green]✓[/green] fulfilled: The beer rests on Robin's tray."
    ]


def test_a_long_verdict_is_a_list_of_its_sentences():
    sentences = ("The hammer was lifted from the workbench in the workshop.", "The coke rests on the kitchen table.")
    sentences = (*sentences, "The robot was in the hall at (4.00, 4.50).")
    first, *items = Verdict("The referee saw", False, "not fulfilled", " ".join(sentences)).lines()
    assert first.endswith("not fulfilled:")
    assert items == [f"  • {sentence}" for sentence in sentences]
