"""Odd sentences on the command line: one clear line, exit status 2, at once."""

import json
import time

import pytest

from tests.executive.cli.calls import errand
from tests.tables import yaml_beside

ODD_TEXTS = yaml_beside(__file__, "odd_sentences.yaml")

ODD = ODD_TEXTS | {"one endless word": "a" * 100_000, "ten thousand words": "fetch " * 10_000}


@pytest.mark.parametrize("sentence", ODD.values(), ids=ODD)
@pytest.mark.parametrize("command", [("parse",), ("tree",), ("run", "--no-wake", "--say"), ("run", "--say")])
def test_an_odd_sentence_is_refused_in_one_line(command, sentence):
    begin = time.process_time()
    result = errand(*command, sentence)
    assert (result.exit_code, result.stdout) == (2, "")
    (line,) = result.stderr.splitlines()
    assert line.startswith("errand: ")
    assert len(line) < 2000
    assert time.process_time() - begin < 10.0


def test_a_file_of_odd_sentences_is_answered_line_by_line(tmp_path):
    path = tmp_path / "odd.txt"
    path.write_text("\n".join(text.replace("\x08", "") for text in ODD.values()), encoding="utf-8")
    result = errand("parse", "--jsonl", "--file", str(path))
    answers = [json.loads(line) for line in result.stdout.splitlines()]
    assert result.exit_code == 0
    assert len(answers) >= len(ODD)
    assert {answer["status"] for answer in answers} <= {"refused", "question"}


def test_emoji_and_control_characters_around_a_sentence_do_no_harm():
    result = errand("parse", "🙂 go to\x07 the kitchen 🙂")
    assert result.stdout.splitlines() == ["Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"]
