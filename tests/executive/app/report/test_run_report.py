"""What a run's report tells in words."""

import pytest

from executive.app.report.run_report import RobotReport, RunReport, Verdict, counts_text, title_of
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


@pytest.mark.parametrize(
    ("text", "sentences"),
    [
        ("It was lifted. It rests on Robin's tray.", ("It was lifted.", "It rests on Robin's tray.")),
        ('It said "Dinner is ready. Come!" It left.', ('It said "Dinner is ready. Come!" It left.',)),
        ("it said “One. Two; three.”; it left", ("it said “One. Two; three.”;", "it left")),
        ("it heard 'Stop. It's hot!' at 2 s. It stood.", ("it heard 'Stop. It's hot!' at 2 s.", "It stood.")),
        ("Do you want a drink? no; greeted Robin", ("Do you want a drink? no;", "greeted Robin")),
        ('a stray " mark. Goes on', ('a stray " mark.', "Goes on")),
    ],
)
def test_a_reason_is_not_split_inside_quotation_marks(text, sentences):
    assert Verdict("The referee saw", True, "fulfilled", text).sentences == sentences


@pytest.mark.parametrize(
    ("names", "title"),
    [
        (["fetch drink", "fetch drink"], "fetch drink"),
        (["fetch drink", "patrol"], "fetch drink and patrol"),
        (["a", "b", "c", "d", "e"], "a, b, c and 2 more"),
    ],
)
def test_a_title_names_the_missions(names, title):
    assert title_of(names) == title


@pytest.mark.parametrize(
    ("log_time_s", "text"),
    [
        (72.8, "72.8 s simulated in 30.0 s"),
        (79.0, "79.0 s, of which 72.8 s simulated in 30.0 s since the restart"),
    ],
)
def test_the_duration_of_a_resumed_run_is_that_of_its_plots(log_time_s, text):
    referee = RefereeReport(True, "it is so", 0, 0)
    report = RunReport("success", None, "", referee, (), "flat", 1, 72.8, 30.0, 2.4, 10, "", log_time_s=log_time_s)
    assert report.duration_text == text


# both robots have the same plant, and its referee tells both of what Bob dropped
def test_the_report_of_several_robots_tells_each_event_once():
    seen = RefereeReport(True, "it is so.", 0, 1, events=("Bob dropped the can at 12.30 s.",))
    ending = {"outcome": "success", "cause": None, "message": "done", "referee": seen, "commands": ()}
    robots = {name: RobotReport(**ending, kind="fetch") for name in ("Alice", "Bob")}
    times = {"sim_time_s": 20.0, "wall_time_s": 5.0, "real_time_factor": 4.0, "ticks": 400}
    report = RunReport(**ending, world="flat", seed=1, **times, log="", robots=robots)
    assert [line for line in report.lines() if "12.30 s" in line] == ["  Bob dropped the can at 12.30 s."]
