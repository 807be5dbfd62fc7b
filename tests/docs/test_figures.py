"""Measured figures on pages come from `docs/figures`, and each file there says how it was measured."""

import json
import re
import sys
from datetime import date

import pytest

from tests.docs.documents import DOCS, PAGES, ROOT

sys.path.insert(0, str(DOCS))
import figures

FILES = sorted(figures.FOLDER.glob("*.json"))
OF_README = [("manipulation", "held"), ("manipulation_others", "held"), ("photographs", "found")]
UNQUOTED = {"plugins/errand-ros2/docs/ros2.md"}
"""Pages whose figures do not stand in files yet."""
_CODE = re.compile(r"^```.*?^```$|`[^`\n]*`", re.MULTILINE | re.DOTALL)
_MEASURED = re.compile(r"(?<![\w.-])\d[\d.,]* (?:%|m?s|[mck]?m|[kMG]B|of \d+)(?![\w-])")
_HEADING = re.compile(r"#+ (?:Figures|Measured|Measuring)")


def pages():
    return [page for page in PAGES if str(page.relative_to(ROOT)) not in UNQUOTED and page.name != "README.md"]


def page_id(page):
    return str(page.relative_to(ROOT))


def loose_figures(text):
    """The numbers with a unit beside quoted figures, in a section of figures, or beside a benchmark's name."""
    in_figures = False
    plain = _CODE.sub("`...`", re.sub(r"`[^`]*tests[./]benchmarks[^`]*`", "BENCHMARK", text))
    for paragraph in re.split(r"\n\n|\n(?=- )", plain):
        if paragraph.startswith("#"):
            in_figures = _HEADING.match(paragraph) is not None
        if in_figures or "{{ figures." in paragraph or "BENCHMARK" in paragraph:
            yield from _MEASURED.findall(figures.QUOTE.sub("", paragraph))


def test_the_measured_numbers_of_pages_come_from_files():
    texts = {page_id(page): page.read_text(encoding="utf-8") for page in pages()}
    assert {page: found for page, text in texts.items() if (found := list(loose_figures(text)))} == {}
    assert [page for page, text in texts.items() if "{{" in figures.quoted(_CODE.sub("", text))] == []


def test_a_number_beside_a_benchmark_is_noticed():
    named = "# A page\n\nWait 3 s.\n\n`python -m tests.benchmarks.fleet`: 9 of 10 in 4.5 s"
    in_section = "## Figures\n\n{{ figures.fleet.x }} and 7 %"
    assert list(loose_figures(f"{named}\n\n{in_section}")) == ["9 of 10", "4.5 s", "7 %"]


def test_each_file_says_how_its_figures_were_measured():
    for file in FILES:
        data = json.loads(file.read_text(encoding="utf-8"))
        assert [key for key in figures.KEYS if key not in data] == [], file.name
        assert data.keys() <= {*figures.KEYS, "recorded", "note"}, file.name
        assert data["values"], file.name
        assert [date.fromisoformat(day) for day in (data["date"], data.get("recorded")) if day] or not data["date"]


def test_every_figure_is_quoted():
    quoted = {name for page in PAGES for name, _ in figures.QUOTE.findall(page.read_text(encoding="utf-8"))}
    assert {file.stem for file in FILES} - quoted == {name for name, _ in OF_README} - quoted


def test_the_figures_of_the_readme_stand_in_the_files():
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    values = {figures.load(name)["values"][key] for name, key in OF_README}
    assert [value for value in values if value not in text] == []
    assert set(re.findall(r"\d+ of \d+", text)) <= values


@pytest.mark.parametrize("quote", ["{{ figures.nothing.held }}", "{{ figures.fleet.nothing }}"])
def test_a_quote_of_a_figure_that_is_not_there_is_refused(quote):
    with pytest.raises(figures.UnknownFigureError, match="nothing"):
        figures.quoted(quote)


# a value, a table, an origin of which nothing is known
@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("held", "48 of 48"),
        ("table", "| a | b |\n| --- | --- |\n| 1 | x&#124;y |"),
        (None, "command not recorded; not recorded: seeds, date, machine, commit"),
    ],
)
def test_figures_become_text(key, text, tmp_path, monkeypatch):
    values = {"held": "48 of 48", "table": [["a", "b"], ["1", "x|y"]]}
    data = {**dict.fromkeys(figures.KEYS), "values": values}
    (tmp_path / "some.json").write_text(json.dumps(data))
    monkeypatch.setattr(figures, "FOLDER", tmp_path)
    assert figures.shown("some", key) == text
