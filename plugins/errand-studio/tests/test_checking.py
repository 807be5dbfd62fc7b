"""Checks of texts: messages at lines, what is judged, drives on the map; and the examples of the palette."""

from pathlib import Path

import pytest

from errand_studio.checking import Insight, Message, MissionChecks, PlanMaps
from errand_studio.fragments import map_svg, tree_html
from errand_studio.palette import Names, examples
from executive.app.prepare.worlds import knowledge_of, open_world

TEXT = "name: round\nsteps:\n  - to: hall\n  - say: bring me a beer from the kitchen\n"
MISPLACED = frozenset({"use", "place", "answer"})
"""Examples that need another file, an object in the gripper, or a person of another world."""


@pytest.fixture(scope="module")
def checks() -> MissionChecks:
    return MissionChecks()


def check(checks: MissionChecks, folder: Path, text: str) -> Insight:
    """Checks a text as the draft of `round.yaml`."""
    file = folder / ".round.draft.yaml"
    file.write_text(text)
    return checks.check(file, "round.yaml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            TEXT.replace("to: hall", "to: hal"),
            Message(3, "unknown place or person 'hal'", "did you mean 'hall'?", True, ("hal", "hall")),
        ),
        (TEXT.replace("say", "sy"), Message(4, "unknown key 'sy'", "did you mean 'say'?", True, ("sy", "say"))),
    ],
)
def test_a_message_has_its_line_and_a_replacement(
    checks: MissionChecks, tmp_path: Path, text: str, message: Message
) -> None:
    assert check(checks, tmp_path, text).messages == (message,)


def test_a_message_names_the_file_and_not_its_draft(checks: MissionChecks, tmp_path: Path) -> None:
    (tmp_path / "part.yaml").write_text("name: part\nsteps:\n  - to: hal\n")
    insight = check(checks, tmp_path, "name: round\nsteps:\n  - use: part.yaml\n")
    assert insight.errors == 1
    assert "part.yaml:3" in insight.messages[0].text
    assert ".draft" not in insight.messages[0].text


def test_the_referee_judges_each_command_at_its_line(checks: MissionChecks, tmp_path: Path) -> None:
    judged = [(each.line, each.goal) for each in check(checks, tmp_path, TEXT).judged]
    assert judged == [
        (3, "went, at hall, at the end of the mission"),
        (4, "grasped, beer, from kitchen counter or kitchen table or bathroom cabinet …, at the end of the mission"),
        (4, "handed over, beer, at the end of the mission"),
    ]


def test_tree_and_map_mark_the_same_lines(checks: MissionChecks, tmp_path: Path) -> None:
    insight = check(checks, tmp_path, TEXT)
    plan = PlanMaps().map_of(insight)
    assert plan is not None
    lines = [line for line, _ in plan.paths]
    assert lines[:2] == [3, 4]
    assert 'data-line="3"' in map_svg(plan)
    assert 'data-line="3"' in tree_html(insight.trees)


def test_a_broken_text_has_no_tree(checks: MissionChecks, tmp_path: Path) -> None:
    insight = check(checks, tmp_path, "name: [\n")
    assert (insight.errors, insight.trees, insight.prepared) == (1, (), None)


@pytest.mark.parametrize("number", range(len(examples(Names((), (), (), (), ())))))
def test_an_example_of_the_palette_is_a_right_step(checks: MissionChecks, tmp_path: Path, number: int) -> None:
    example = examples(Names.of(knowledge_of(open_world("flat"))))[number]
    steps = "".join(f"  {line}\n" for line in example.text.splitlines())
    insight = check(checks, tmp_path, f"name: round\nsteps:\n{steps}")
    if example.key not in MISPLACED:
        assert [message.text for message in insight.messages if message.is_error] == []
    assert example.about
