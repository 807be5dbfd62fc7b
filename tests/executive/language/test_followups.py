import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.language.followups import Amendment, Remark, amend, parse_follow_up, parse_remark, skip_fetching
from executive.words.command import parse_command
from skills.api import ObjectKind
from tests.tables import table

FETCH = (
    parse_command("Take [Nothing] to [kitchen] and do [grasp] to [coke]"),
    parse_command("Take [coke] to [start] and do [Nothing] to [Nothing]"),
)


@pytest.mark.parametrize(*table(__file__, "follow_ups"))
def test_follow_ups_are_parsed(text, kind, said, preposition, old):
    follow_up = parse_follow_up(text)
    found = (follow_up.kind.name, follow_up.said, follow_up.preposition, follow_up.instead_of)
    assert found == (kind, said, preposition, old)


@pytest.mark.parametrize("text", ["", "no", "go to the kitchen", "the hammer", "bring me the coke", "nothing", "stop"])
def test_sentence_of_its_own_is_no_follow_up(text):
    assert parse_follow_up(text) is None


def texts(commands):
    return [str(command) for command in commands]


@pytest.mark.parametrize(*table(__file__, "amended"))
def test_commands_are_amended(knowledge, by, commands):
    by = Amendment(**{name: ObjectKind(value) if name == "kind" else value for name, value in by.items()})
    assert texts(amend(FETCH, by, knowledge)) == commands


# what the robot holds -> the commands for a coke
@pytest.mark.parametrize(
    ("held", "commands"),
    [
        (None, texts(FETCH)),
        ("coke", texts(FETCH[1:])),
        ("hammer", ["Take [hammer] to [workbench] and do [place] to [hammer]", *texts(FETCH)]),
    ],
)
def test_a_held_object_is_not_fetched_again_and_another_is_put_down_first(knowledge, held, commands):
    assert texts(skip_fetching(FETCH, held and ObjectKind(held), knowledge)) == commands


WORDS = "no not the coke , but instead of too and a to make it another one please again ' - kitchen".split()  # noqa: SIM905


@settings(deadline=5000)
@given(st.one_of(st.text(max_size=300), st.lists(st.sampled_from(WORDS), max_size=40).map(" ".join)))
def test_any_text_is_read_without_an_error_and_soon(text):
    parse_follow_up(text)
    parse_remark(text)


@pytest.mark.parametrize(*table(__file__, "remarks"))
def test_a_remark_is_known_with_and_without_politeness(text, remark):
    assert parse_remark(text) is Remark[remark]


@pytest.mark.parametrize(*table(__file__, "no_remarks"))
def test_sentence_with_more_words_is_no_remark(text):
    assert parse_remark(text) is None
