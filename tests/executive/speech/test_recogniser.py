import pytest

from executive.speech.recogniser import Vocabulary, read_vocabulary, vocabulary_of_world
from skills.inputs.errors import InputError


def test_a_world_gives_all_its_names_and_the_robots_own_last(flat):
    words = vocabulary_of_world(flat, called=True)
    assert {"coke", "cola", "drink", "kitchen counter", "worktop", "lounge", "Robin"} <= set(words.names)
    assert words.names[-1] == words.robot_name == "Alice" and len(set(words.names)) == len(words.names)


def test_a_robot_that_need_not_be_called_is_no_part_of_the_prompt(flat):
    words = vocabulary_of_world(flat, called=False)
    assert (words.robot_name, "Alice" in words.prompt) == (None, False)


def test_the_prompt_holds_the_names_and_how_one_calls():
    assert Vocabulary(("sofa", "coke"), "Bob").prompt.startswith("sofa, coke. Hey Bob, ")


def test_the_prompt_omits_names_within_longer_ones():
    assert Vocabulary(("coke", "can of coke", "desk")).prompt.startswith("can of coke, desk. ")


def test_without_names_the_prompt_lists_none():
    assert "Names" not in Vocabulary().prompt


def test_a_file_of_names_has_one_on_each_line(tmp_path):
    file = tmp_path / "names.txt"
    file.write_text("\ufeffbig dish\n\n  washing   machine \nbig dish\n", encoding="utf-8")
    assert read_vocabulary(file, None).names == ("big dish", "washing machine")
    assert read_vocabulary(file, "Alice").names[-1] == "Alice"


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (None, "no such file"),
        (b"\xff\xfe\x00", "UTF-16"),
        (b"x" * 200, "too long"),
        (b"\n".join(b"n%d" % n for n in range(6000)), "too many"),
    ],
    ids=["missing", "UTF-16", "long", "many"],
)
def test_file_without_names_is_refused(tmp_path, content, told):
    file = tmp_path / "names.txt"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InputError, match=told) as refused:
        read_vocabulary(file, None)
    assert refused.value.file == file
