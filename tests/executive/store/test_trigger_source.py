"""Trigger sources of other distributions: found by the name of their kind; what is missing or broken says so."""

import sys

import pytest

from executive.store.trigger_source import installed_source, trigger_source
from skills.inputs.errors import InputError
from tests.executive.distribution import write_distribution

MODULE = """
class Source:
    def start(self, topics, fire): self.topics, self.fire = topics, fire
    def stop(self): pass

class Half:
    def stop(self): pass

def broken(): raise OSError("no broker")
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A distribution that registers trigger sources."""
    (tmp_path / "bells.py").write_text(MODULE)
    lines = ("bell = bells:Source", "half = bells:Half", "broken = bells:broken", "gone = bells:Gone")
    write_distribution(tmp_path, "bells", "errand.triggers", *lines)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield
    sys.modules.pop("bells", None)


def test_a_source_is_made_by_the_name_of_its_kind(installed):
    installed_source("bell")
    source = trigger_source("bell")
    source.start(("door",), print)
    assert source.topics == ("door",)
    assert trigger_source("bell") is not source


def test_a_missing_source_is_one_error_that_names_the_group(installed):
    with pytest.raises(InputError) as error:
        installed_source("mqtt")
    assert str(error.value) == (
        "there is no trigger source 'mqtt'; install a package that registers 'mqtt' in the entry-point group "
        "'errand.triggers'; installed are bell, broken, gone and half"
    )


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("broken", r"'broken' \(bells:broken\) cannot be made \(OSError: no broker\); repair or uninstall"),
        ("gone", r"'gone' \(bells:Gone\) cannot be made \(AttributeError"),
        ("half", r"'half' \(bells:Half\) has no start; see"),
    ],
)
def test_a_source_that_cannot_be_used_says_why(installed, kind, words):
    with pytest.raises(InputError, match=words):
        trigger_source(kind)


def test_two_sources_of_one_kind_are_refused(installed, tmp_path):
    write_distribution(tmp_path, "more", "errand.triggers", "bell = more:Source")
    with pytest.raises(InputError, match="bells:Source and more:Source both are trigger source 'bell'"):
        installed_source("bell")
