import pytest

from skills.inputs.errors import MOST_LETTERS, InputError, definite, known_names, requote, suggestion, with_article


def test_a_message_that_repeats_an_endless_name_is_cut_off():
    error = InputError(f"unknown place '{'x' * 5000}'", hint="known are kitchen", file="m.yaml", line=3)
    assert len(error.message) == MOST_LETTERS + 3
    assert str(error).startswith("m.yaml:3: unknown place 'xxx")
    assert str(error).endswith("...; known are kitchen")


def test_a_message_escapes_control_characters():
    assert str(InputError("no 'a\x1b[31m\u202eb\nc\udcff'", hint="x\x07")) == r"no 'a\x1b[31m\u202eb c\udcff'; x\x07"


@pytest.mark.parametrize(
    ("said", "known", "hint"),
    [
        ("workbench", ["workbench", "hall"], "known are hall"),
        ("workbench", ["workbench", "workbenches"], "did you mean 'workbenches'?"),
        ("workbench", ["workbench"], "none is known"),
        ("Workbench", ["workbench"], "did you mean 'workbench'?"),
    ],
)
def test_a_suggestion_is_never_the_word_that_was_said(said, known, hint):
    assert suggestion(said, known) == hint


def test_without_a_known_name_none_is_listed():
    assert known_names("x", []) == "none is known"


@pytest.mark.parametrize(
    "phrase", ["a hammer", "an extinguisher", "an orange cube", "a unit", "an hour", "a one-way door"]
)
def test_a_noun_gets_the_article_of_its_sound(phrase):
    assert with_article(phrase.partition(" ")[2]) == phrase


@pytest.mark.parametrize(
    ("noun", "said"),
    [("hammer", "the hammer"), ("my mug", "my mug"), ("the desk", "the desk"), ("Robin's mug", "Robin's mug")],
)
def test_a_noun_has_one_definite_article_at_most(noun, said):
    assert definite(noun) == said


@pytest.mark.parametrize(
    ("said", "part", "quoted"),
    [
        ("take the hammer to the moon", "take to the moon", "take the hammer to the moon"),
        ("Meet my sister, Ann", "my sister Ann", "my sister, Ann"),
        ("go to the moon", "go to the moon", "go to the moon"),
        ("count all the plums", "how many plums", "plums"),
        ("wait at most ten minutes", "go to most ten minutes", "most ten minutes"),
    ],
)
def test_a_reason_quotes_the_speakers_own_words(said, part, quoted):
    assert requote(f"I do not understand '{part}'; say more", said) == f"I do not understand '{quoted}'; say more"
