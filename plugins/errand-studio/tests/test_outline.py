"""Edits of missions by the outline, with all shipped missions."""

import random
import re
from collections import Counter

import pytest

from errand_studio.outline import WRAPS, double, edited, insert, list_paths, move, path_at, remove, rows, wrap
from executive.app.prepare.mission_files import shipped_missions
from skills.inputs.errors import InputError
from skills.inputs.yaml_source import parse_yaml
from tests.sources import ROOT

TEXTS = {name: file.read_text() for name, file in shipped_missions().items()}
KITCHEN = """name: kitchen
# all steps
steps:
  # first
  - to: kitchen   # there
    retries: 1
    # behind the first

  - if: battery > 0.5
    then: [{to: hall}, dock]
    else:
      - speak: |
          low
      # last word
      - to: start
  # the end
"""
ONE_LINE = "name: short\nsteps: [{to: hall}, {to: kitchen}]\n"


def steps_of(text: str) -> list[tuple[str | int, ...]]:
    """Returns the paths of all steps."""
    return [row.path for row in rows(text) if not row.is_list]


def comments(text: str) -> Counter[str]:
    """Counts the comments of a text."""
    return Counter(re.findall(r"(?:^|\s)(#.*)", text))


def lists_with_dashes(text: str) -> list[tuple[str | int, ...]]:
    """Returns the paths of the lists that a step can enter without a change of their layout."""
    data, found = parse_yaml(text, ROOT / "x"), []
    for path in list_paths(text):
        line = text.splitlines()[data.lines.get(path, 1) - 1]
        if re.search(rf"\b{path[-1]}:\s*(#.*)?$", line):
            found.append(path)
    return found


def there_and_back(text: str) -> int:
    """Moves each step to each list with dashes and to the start of its own list, and back; returns the number."""
    count = 0
    for path in steps_of(text):
        for to in {*lists_with_dashes(text), path[:-1]}:
            if to[: len(path)] == path:
                continue
            moved = move(text, path, to, 0)
            gone = len(path) - 1
            shift = len(to) > gone and to[:gone] == path[:gone] and isinstance(to[gone], int) and to[gone] > path[-1]
            now = (*to[:gone], to[gone] - 1, *to[gone + 1 :]) if shift else to
            home = path[:-1]
            up = len(home) > len(to) and home[: len(to)] == to
            home = (*home[: len(to)], home[len(to)] + 1, *home[len(to) + 1 :]) if up else home
            assert move(moved, (*now, 0), home, path[-1]) == text, (path, to)
            count += 1
    return count


@pytest.mark.parametrize("name", TEXTS)
def test_each_step_moved_there_and_back_leaves_the_file_as_it_was(name: str) -> None:
    assert there_and_back(TEXTS[name]) >= len(steps_of(TEXTS[name]))


def test_steps_of_all_layouts_move_there_and_back() -> None:
    for text in (KITCHEN, KITCHEN.replace("\n", "\r\n"), KITCHEN.replace("  #", "#"), ONE_LINE, ONE_LINE.strip()):
        assert there_and_back(text) > 1


def test_a_step_takes_its_comments_along() -> None:
    moved = move(KITCHEN, ("steps", 0), ("steps",), 1)
    first, second = moved.index("# behind the first"), moved.index("# last word")
    assert second < moved.index("# first") < first < moved.index("# the end")
    assert moved.startswith("name: kitchen\n# all steps\nsteps:\n\n  - if")


def test_the_outline_lists_steps_with_their_lists() -> None:
    shown = [(row.depth, row.kind or row.text, row.text, row.line, row.end) for row in rows(KITCHEN)]
    assert shown == [
        (0, "to", "kitchen", 5, 7),
        (0, "if", "battery > 0.5", 9, 15),
        (1, "then", "then", 10, 10),
        (2, "to", "hall", 10, 10),
        (2, "dock", "", 10, 10),
        (1, "else", "else", 11, 15),
        (2, "speak", "low", 12, 13),
        (2, "to", "start", 15, 15),
    ]
    assert path_at(KITCHEN, 13) == ("steps", 1, "else", 0)


def test_a_step_is_doubled_and_removed() -> None:
    doubled = double(KITCHEN, ("steps", 0))
    assert doubled.count("retries: 1") == 2
    assert remove(doubled, ("steps", 1)) == KITCHEN


@pytest.mark.parametrize("kind", WRAPS)
def test_a_step_is_wrapped(kind: str) -> None:
    wrapped = wrap(KITCHEN, ("steps", 1, "then", 1), kind)
    assert parse_yaml(wrapped, ROOT / "x").data["steps"][1]["then"][0] == {"to": "hall"}
    assert comments(wrapped) == comments(KITCHEN)
    assert comments(wrap(KITCHEN, ("steps", 0), kind)) == comments(KITCHEN)


def test_a_step_is_inserted_into_an_empty_branch() -> None:
    text = "name: a\nsteps:\n- if: holding\n  then: # nothing\n- to: hall\n"
    assert insert(text, ("steps", 0, "then"), 0, "- wait:\n    seconds: 2") == (
        "name: a\nsteps:\n- if: holding\n  then: # nothing\n  - wait:\n      seconds: 2\n- to: hall\n"
    )


def test_a_step_does_not_move_into_itself() -> None:
    with pytest.raises(InputError, match="into itself"):
        move(KITCHEN, ("steps", 1), ("steps", 1, "else"), 0)


def test_an_anchor_behind_its_alias_is_refused() -> None:
    text = "name: a\nsteps:\n  - &go {to: hall}\n  - *go\n"
    with pytest.raises(InputError, match="cannot be edited by the outline"):
        move(text, ("steps", 1), ("steps",), 0)


def test_random_edits_change_the_data_as_asked_and_keep_all_comments() -> None:
    draw, texts, done = random.Random(7), [TEXTS[name] for name in sorted(TEXTS)[:20]], 0
    while done < 200:
        number = draw.randrange(len(texts))
        text, what = texts[number], draw.choice(("move", "double", "remove", "wrap", "insert"))
        path, to = draw.choice(steps_of(text)), draw.choice(list_paths(text))
        data = parse_yaml(text, ROOT / "x").data
        if what == "move" and to[: len(path)] != path:
            index = draw.randrange(3)
            after = move(text, path, to, index)
            assert parse_yaml(after, ROOT / "x").data == edited(data, "move", path, to, index)
        elif what == "double":
            after = double(text, path)
        elif what == "remove" and len(steps_of(text)) > 2:
            after = remove(text, path)
        elif what == "wrap":
            after = wrap(text, path, draw.choice(list(WRAPS)))
        elif what == "insert":
            after = insert(text, to, 0, "- {to: hall}")
        else:
            continue
        kept = comments(text) - comments(after)
        assert not kept or what == "remove", (what, path)
        texts[number], done = after, done + 1
