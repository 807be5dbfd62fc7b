"""Templates of sentences: their notation, and the samples beside them."""

import re
from functools import cache
from pathlib import Path

import pytest
import yaml

import executive.language
from executive.language.lexicon import word_list
from executive.language.templates import Page, Template, page

TABLES = Path(executive.language.__file__).with_name("tables")
PAGES = sorted(path.stem for path in (TABLES / "intents").glob("*.yaml") if path.stem != "common")
WORLD = {"names": ("Robin", "Maya"), "around": ("office", "kitchen", "hall")}
GIVEN = {
    "remarks": {"opener": ("vacuum",), "opener_form": ("vacuuming",)},
    "rewording": {
        "opener": ("guide", "vacuum"),
        "opener_form": {"vacuuming": "vacuum"},
        "own_form": {"sweeping": "sweep"},
    },
    "speech": {**WORLD, "noted": ("slowly",)},
    "clauses": {"asking": tuple(word_list("openers"))},
    "robots": {"one": ("Alice", "Bob"), "verb": ("bring", "brings", "come", "go")},
    "wake": {"own": ("Alice",)},
    "zones": {"room": WORLD["around"]},
}
EXPRESSIONS, LOOK_AROUNDS = 0, 0
"""Regular expressions in the pages of templates, and those of them that look around."""
LONGEST_LINE = 120
_EXPRESSION = re.compile(r"\(\?|\\[a-zA-Z]|\[\^|[\])][+*]|\.[+*]")


@cache
def opened(name):
    return Page(name, **GIVEN.get(name, {}))


ROWS = [
    pytest.param(name, intent, n, id=f"{name}: {intent} {n}")
    for name in PAGES
    for intent, rows in opened(name).table["intents"].items()
    for n in range(len(rows))
]


@pytest.mark.parametrize(("name", "intent", "n"), ROWS)
def test_each_sample_matches_its_template_and_no_other_of_its_page(name, intent, n):
    own = opened(name)
    rows = own.table["intents"][intent]
    alone, earlier = Template(own, [rows[n]]), Template(own, rows[:n])
    assert rows[n]["samples"]
    for sample in rows[n]["samples"]:
        ends = not {"before", "not_before"} & rows[n].keys()
        assert (alone.fullmatch if ends else alone.match)(sample) is not None, sample
        assert earlier.fullmatch(sample) is None, sample  # the rows of an intent are tried in their order
        others = [one for one in own.table["intents"] if one != intent and own[one].fullmatch(sample)]
        assert others == [], sample


@pytest.mark.parametrize(("name", "intent", "n"), [row for row in ROWS if row.values[0] in ("rewording", "denials")])
def test_each_sample_of_a_rewording_becomes_the_text_beside_it(name, intent, n):
    row = opened(name).table["intents"][intent][n]
    for said, reworded in row["samples"].items():
        assert Template(opened(name), [row]).fullmatch(said).instead == reworded


def test_pages_have_templates_and_no_regular_expressions():
    texts = {path.name: path.read_text(encoding="utf-8") for path in (TABLES / "intents").glob("*.yaml")}
    found = [line for text in texts.values() for line in text.splitlines() if _EXPRESSION.search(line)]
    assert len(found) <= EXPRESSIONS, found
    assert sum("(?" in line for line in found) <= LOOK_AROUNDS
    assert max(len(line) for text in texts.values() for line in text.splitlines()) <= LONGEST_LINE


@pytest.mark.parametrize(
    ("template", "text", "slots"),
    [
        ("(if|in case) {condition} , [then] {steps}", "In case it is late, then stop", ("it is late", "stop")),
        ("go to {place} [for {span}]", "go to the hall for ten minutes", ("the hall", "ten minutes")),
        ("the door[s] (is|are) [not] {how}", "the doors aren't open", ("open",)),
        ("wait {number} minutes", "wait twenty five minutes", ("twenty five",)),
        ("wait {number} minutes", "wait 2.5 minutes", ("2.5",)),
        ("say {text} to {who}", "say it is noon to Robin", ("it is noon", "Robin")),
    ],
)
def test_slots_take_the_words_between_the_others(template, text, slots):
    match = Template(page("clauses"), [{"template": template}]).fullmatch(text)
    assert {*slots} <= {*match.slots.values()}


@pytest.mark.parametrize(
    ("template", "text"),
    [
        ("the door", "the doorbell"),
        ("go to {place}", "go to"),
        ("(bring|get) it", "bring get it"),
        ("stop[s]", "stop s"),
        ("{word} please", "stop it please"),
    ],
)
def test_a_template_matches_whole_words_only(template, text):
    assert Template(page("clauses"), [{"template": template}]).fullmatch(text) is None


def test_a_match_tells_its_place_in_the_text():
    match = page("clauses")["unless"].search("Go home,  unless it's late")
    assert (match.text, match.start, match.end, match.after) == ("unless", 10, 16, 4)


@pytest.mark.parametrize("name", ["R2-D2", "Bob (2)", "a|b", "<r>", "x[1", "Big Bob"])
def test_words_that_a_page_is_given_are_no_templates(name):
    assert page("wake", own=(name,))["greets"].fullmatch(f"hey {name}")["name"] == name


@pytest.mark.parametrize(
    ("row", "text", "found"),
    [
        ({"before": ["(can|could) you"]}, "stop can you", "stop"),
        ({"before": ["(can|could) you"]}, "stop can we", None),
        ({"before": [""]}, "stop", "stop"),
        ({"before": [""]}, "stop it", None),
        ({"not_before": ["it"]}, "stop it", None),
        ({"not_before": ["it"]}, "stop", "stop"),
        ({"not_before": [""]}, "stop", None),
    ],
)
def test_a_row_looks_at_what_follows_its_template(row, text, found):
    match = Template(page("clauses"), [{"template": "stop", **row}]).match(text)
    assert (None if match is None else match.text) == found


def test_a_template_with_an_unknown_rule_is_refused():
    with pytest.raises(KeyError, match="nowhere"):
        Template(page("clauses"), [{"template": "go to <nowhere>"}]).fullmatch("go to it")


def test_every_page_reads_as_plain_text():
    for path in (TABLES / "intents").glob("*.yaml"):
        found = yaml.load(path.read_text(encoding="utf-8"), Loader=yaml.BaseLoader)
        assert {*found} <= {"rules", "lists", "openers", "objects", "intents"}, path.name
