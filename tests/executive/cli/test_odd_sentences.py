"""Odd sentences on the command line: one clear line, exit status 2, at once."""

import json
import time

import pytest
from typer.testing import CliRunner

from executive.cli import entry

ODD = {
    "empty": "",
    "blank": "   ",
    "ten thousand words": "fetch " * 10_000,
    "one endless word": "a" * 100_000,
    "control characters": "\x07\x1b[31m\x08",
    "emoji": "🙂🙂🙂",
    "Chinese": "把饮料从厨房拿来",
    "Arabic": "أحضر لي مشروبًا",
    "German": "Bring mir bitte ein Bier aus der Küche",
    "quotes and brackets": "[]\"'{}",
    "mixed up": "the the of of kitchen from bring bring",
}


@pytest.mark.parametrize("sentence", ODD.values(), ids=ODD)
@pytest.mark.parametrize("command", [("parse",), ("tree",), ("run", "--no-wake", "--say"), ("run", "--say")])
def test_an_odd_sentence_is_refused_in_one_line(command, sentence):
    begin = time.process_time()
    result = CliRunner().invoke(entry.app, [*command, sentence])
    assert (result.exit_code, result.stdout) == (2, "")
    (line,) = result.stderr.splitlines()
    assert line.startswith("errand: ")
    assert len(line) < 2000
    assert time.process_time() - begin < 10.0


def test_a_file_of_odd_sentences_is_answered_line_by_line(tmp_path):
    path = tmp_path / "odd.txt"
    path.write_text("\n".join(text.replace("\x08", "") for text in ODD.values()), encoding="utf-8")
    result = CliRunner().invoke(entry.app, ["parse", "--jsonl", "--file", str(path)])
    answers = [json.loads(line) for line in result.stdout.splitlines()]
    assert result.exit_code == 0
    assert len(answers) >= len(ODD)
    assert {answer["status"] for answer in answers} <= {"refused", "question"}


def test_emoji_and_control_characters_around_a_sentence_do_no_harm():
    result = CliRunner().invoke(entry.app, ["parse", "🙂 go to\x07 the kitchen 🙂"])
    assert result.stdout.splitlines() == ["Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"]
