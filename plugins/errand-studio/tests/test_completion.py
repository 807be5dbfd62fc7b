"""Completion of keys and values at the cursor, which stands at `|`."""

import pytest

from errand_studio.completion import complete
from executive.app.prepare.worlds import knowledge_of, open_world

HEAD = "name: a\nsteps:\n  - to: hall\n"


@pytest.mark.parametrize(
    ("text", "among", "none"),
    [
        ("nam|", ["name"], ["steps"]),
        (HEAD + "  - sp|", ["speak"], ["name"]),
        (HEAD + "    ret|", ["retries"], ["repeat"]),
        (HEAD + "  - to: kit|", ["kitchen", "kitchen counter"], ["hall"]),
        (HEAD + "  - {to: off|", ["office"], ["on_failure"]),
        (HEAD + "  - {to: office, do: gr|", ["grasp", "greet"], ["find"]),
        (HEAD + "  - {to: office, |", ["do", "object", "retries"], ["to", "repeat"]),
        (HEAD + "    on_failure: |", ["stop", "skip", "retry"], ["kitchen"]),
        (HEAD + "  - repeat: {ti|", ["times"], ["to"]),
        (HEAD + "  - repeat: {times: 2}\n    st|", ["steps"], ["say"]),
        (HEAD + "  - if: holding\n    then:\n      - wai|", ["wait"], ["world"]),
        (HEAD + "  - skill: nav|", ["navigate"], ["grasp"]),
        (HEAD + "  - skill: navigate\n    with: {go|", ["goal"], ["group"]),
        (HEAD + "  - skill: navigate\n    with:\n      go|", ["goal"], ["group"]),
        (HEAD + "  - with:\n      goal: 1\n      po|\n    skill: navigate\n", ["position_tolerance_m"], ["goal"]),
        (HEAD + "  - skill: navigate\n    with:\n      goal: hall\n    re|", ["retries"], ["goal", "with"]),
        (HEAD + "  - take: dr|", ["drink"], ["coke"]),
        ("world: sh|", ["shop"], ["flat"]),
    ],
)
def test_completion_offers_what_fits(text: str, among: list[str], none: list[str]) -> None:
    before, _, after = text.partition("|")
    line = before.count("\n") + 1
    start, options = complete(before + after, line, len(before.split("\n")[-1]), knowledge_of(open_world("flat")))
    labels = [option["label"] for option in options]
    assert set(among) <= set(labels)
    assert not set(none) & set(labels)
    assert start <= len(before.split("\n")[-1])
