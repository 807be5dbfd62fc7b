"""Our own sentences, in families; see the files in `sentences/`."""

import re
from pathlib import Path

import pytest
import yaml

from executive.language.understand import Status, understand
from executive.words.command import parse_command

FAMILIES = {
    file.stem: yaml.safe_load(file.read_text(encoding="utf-8"))
    for file in sorted((Path(__file__).parent / "sentences").glob("*.yaml"))
}

NEED_COMMAS = {"bring the saw to the bench, scratch that, bring the drill to the bench"}


def sentences(kind):
    return [
        pytest.param(text, expected, id=f"{family}: {text}")
        for family, kinds in FAMILIES.items()
        for text, expected in kinds.get(kind, {}).items()
    ]


def every_third(rows):
    """The rows, of which the night has two thirds."""
    return [
        pytest.param(*row.values, id=row.id, marks=[pytest.mark.nightly] * (number % 3 > 0))
        for number, row in enumerate(rows)
    ]


def answer_to(sentence, parser):
    return understand(sentence, parser=parser, knowledge=None, require_wake=False)


@pytest.mark.parametrize(("sentence", "commands"), sentences("understood"))
def test_a_sentence_becomes_its_commands(parser, sentence, commands):
    answer = answer_to(sentence, parser)
    assert (answer.reason, [str(command) for command in answer.commands]) == (None, commands)


@pytest.mark.parametrize(
    ("sentence", "commands"),
    [row for row in every_third(sentences("understood")) if row.values[0] not in NEED_COMMAS],
)
def test_it_needs_neither_capitals_nor_punctuation(parser, sentence, commands):
    bare = " ".join(re.sub(r"[^a-z0-9' ]", " ", sentence.lower()).split())
    found = [str(command).lower() for command in answer_to(bare, parser).commands]
    assert found == [command.lower() for command in commands]


def test_all_commands_parse_back():
    understood = (kinds.get("understood", {}) for kinds in FAMILIES.values())
    commands = {command for kind in understood for commands in kind.values() for command in commands}
    assert [command for command in sorted(commands) if str(parse_command(command)) != command] == []


@pytest.mark.parametrize(("sentence", "part"), sentences("refused"))
def test_a_sentence_is_refused_whole_with_the_part_named(parser, sentence, part):
    answer = answer_to(sentence, parser)
    assert (answer.status, answer.commands) == (Status.REFUSED, ()) and part in answer.reason


@pytest.mark.parametrize(("sentence", "word"), sentences("question"))
def test_incomplete_sentence_makes_a_question(parser, sentence, word):
    answer = answer_to(sentence, parser)
    assert (answer.status, answer.commands) == (Status.QUESTION, ()) and word in answer.reason


def test_there_are_enough_sentences():
    assert sum(len(rows) for kinds in FAMILIES.values() for rows in kinds.values()) >= 450
