import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.language.remarks import Remark, remark_of


@pytest.mark.parametrize(
    ("text", "remark"),
    [
        ("stop", Remark.STOP),
        ("Stop!", Remark.STOP),
        ("please stop right now", Remark.STOP),
        ("don’t move", Remark.STOP),
        ("wait", Remark.WAIT),
        ("Wait a second, please.", Remark.WAIT),
        ("ok hold on", Remark.WAIT),
        ("go on", Remark.GO_ON),
        ("okay, you can go on now", Remark.GO_ON),
        ("could you continue please?", Remark.GO_ON),
        ("never mind", Remark.CANCEL),
        ("cancel that, please", Remark.CANCEL),
        ("Where are you?", Remark.WHERE),
        ("can you tell me where you are", Remark.WHERE),
        ("what room are you in", Remark.WHERE),
        ("What are you doing right now?", Remark.DOING),
        ("why are you waiting", Remark.DOING),
        ("what can you do?", Remark.ABLE),
        ("Thank you!", Remark.THANKS),
    ],
)
def test_a_remark_is_known_with_and_without_politeness(text, remark):
    assert remark_of(text) is remark


@pytest.mark.parametrize(
    "text",
    [
        "",
        "stop the music",
        "wait in the kitchen and bring me a coke",
        "go on to the kitchen",
        "go to the kitchen",
        "where is the hammer",
        "where are you going to put the hammer",
        "what are you doing with the hammer",
        "cancel my appointment",
        "is there a stop sign in the hall",
        "don't stop",
    ],
)
def test_what_says_more_is_no_remark(text):
    assert remark_of(text) is None


@given(st.text(max_size=300))
def test_any_text_is_judged_without_an_error(text):
    remark_of(text)
