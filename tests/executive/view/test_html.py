"""Templates: every value that is missing is an error, and times are shown as on a clock."""

import jinja2
import pytest

from executive.view.html import clock_text, render


def test_a_template_without_a_value_that_it_needs_is_refused():
    with pytest.raises(jinja2.UndefinedError, match="page"):
        render("run.html")


@pytest.mark.parametrize(("t_s", "text"), [(0.0, "0:00.0"), (61.04, "1:01.0"), (3600.0, "60:00.0"), (-1.0, "0:00.0")])
def test_a_time_is_shown_in_minutes_and_seconds(t_s, text):
    assert clock_text(t_s) == text
