"""The README is short and easy to read, and the measure of that is right."""

import pytest

from tests.docs.documents import ROOT
from tests.docs.readability import prose, reading_ease, syllables

README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_readme_is_short_and_plain_english():
    assert len(README.split()) <= 900
    assert reading_ease(README) >= 60


WORDS = {
    "the": 1, "robot": 2, "moves": 1, "makes": 1, "used": 1, "walked": 1, "sense": 1, "through": 1, "noise": 1,
    "noises": 2, "houses": 2, "changes": 2, "table": 2, "tables": 2, "apple": 2, "people": 2, "wanted": 2, "added": 2,
    "picture": 2, "failure": 2, "reading": 2, "doing": 2, "quiet": 2, "battery": 3, "camera": 3, "referee": 3,
    "idea": 3, "area": 3, "video": 3, "radio": 3, "create": 2, "actual": 3, "mission": 2, "missions": 2, "action": 2,
    "language": 2, "simulated": 4, "situation": 4, "material": 4, "behaviour": 3, "documentation": 5, "handled": 2,
}  # fmt: skip


@pytest.mark.parametrize("word", WORDS)
def test_syllables_are_counted_as_a_dictionary_does(word):
    assert syllables(word) == WORDS[word]


def test_heavy_prose_scores_low_and_plain_prose_high():
    heavy = "Considerable organisational complexity notwithstanding, interoperability necessitates revision."
    assert reading_ease(heavy) < 0
    assert reading_ease("The dog ran. The cat sat on the mat.") > 100


def test_code_tables_and_targets_of_links_are_no_prose():
    page = "See [the page](a/b.md).\n\n```sh\nerrand run\n```\n\n    errand parse\n\n| a | b |\n"
    assert prose(page).split() == ["See", "the", "page."]
