"""Templates: every value that is missing is an error, and times are shown as on a clock."""

from types import SimpleNamespace

import jinja2
import pytest

from executive.view.html import _environment, clock_text, render


def test_a_template_without_a_value_that_it_needs_is_refused():
    with pytest.raises(jinja2.UndefinedError, match="page"):
        render("run.html")


@pytest.mark.parametrize(("t_s", "text"), [(0.0, "0:00.0"), (61.04, "1:01.0"), (3600.0, "60:00.0"), (-1.0, "0:00.0")])
def test_a_time_is_shown_in_minutes_and_seconds(t_s, text):
    assert clock_text(t_s) == text


@pytest.mark.parametrize(("sentences", "items"), [(("It fell.", "Robin has <nothing>."), 2), (("It fell.",), 0)])
def test_a_verdict_of_several_sentences_is_a_list(sentences, items):
    verdict = SimpleNamespace(
        who="The referee saw", good=False, word="no", text=" ".join(sentences), sentences=sentences
    )
    html = _environment().get_template("parts.html").module.verdicts([verdict])
    assert html.count("<li>") == items
    assert "<nothing>" not in html
