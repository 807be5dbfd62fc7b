"""The pages of requests about people: each sample matches its template."""

from pathlib import Path

import pytest

import errand_people
from executive.language.templates import Page, Template

FOLDER = Path(errand_people.__file__).parent
PAGES = {
    path.stem: Page(path.stem, file=path, names=("Robin", "Maya"), around=("office", "kitchen", "hall", "desk"))
    for path in FOLDER.glob("*.yaml")
}
ROWS = [
    (name, intent, n)
    for name, page in PAGES.items()
    for intent, rows in page.table["intents"].items()
    for n in range(len(rows))
]


@pytest.mark.parametrize(("name", "intent", "n"), ROWS)
def test_each_sample_matches_its_template(name, intent, n):
    page = PAGES[name]
    rows = page.table["intents"][intent]
    template, earlier = Template(page, [rows[n]]), Template(page, rows[:n])
    assert rows[n]["samples"]
    for sample in rows[n]["samples"]:
        assert template.fullmatch(sample) is not None, sample
        assert earlier.fullmatch(sample) is None, sample


def test_both_pages_are_read():
    assert {*PAGES} == {"asking", "people"}
