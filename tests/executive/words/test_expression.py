"""Expression language of mission files: grammar, types, values and refusals."""

import string
from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.words import expression as language
from executive.words.expression import MOST_TEXT, Expression, ExpressionError, Kind, Template, kind_of, literal
from tests.tables import table

VALUES = {"count": 3.0, "battery": 0.5, "drink": "tea", "clock": "08:05", "held": True}
KINDS = {name: kind_of(value) for name, value in VALUES.items()} | {"seen": Kind.OTHER}


def value(text):
    expression = Expression(text)
    expression.kind(KINDS)
    return expression.value(VALUES)


def refused(text):
    """Message and hint of a refusal."""
    with pytest.raises(ExpressionError) as error:
        value(text)
    return error.value.message, error.value.hint


@pytest.mark.parametrize(*table(__file__, "values"))
def test_value(text, expected):
    found = value(text)
    assert (found, type(found)) == (expected, type(expected))


@pytest.mark.parametrize(*table(__file__, "kinds"))
def test_kind(text, kind):
    assert Expression(text).kind(KINDS) is Kind[kind]


LONG = [
    ("(" * 300, "is no expression", ""),
    ("x" * (language.MOST_LETTERS + 1), "has 501 letters", ""),
    ("-" * (language.MOST_DEPTH + 2) + "1", "nested too deeply", ""),
    ("+".join("1" * (language.MOST_DEPTH + 3)), "nested too deeply", ""),
    ("a" + ".b" * 240, "cannot stand", ""),
    ("9" * 400, "too large", ""),
]


@pytest.mark.parametrize(*table(__file__, "refused", *LONG))
def test_refusal_says_what_and_how_to_put_it_right(text, message, hint):
    said, found = refused(text)
    assert message in said
    assert found == hint if hint else found


@pytest.mark.parametrize("text", ["count / 0 > 1", "count % 0", "count // (2 - 2)", "1 + count / 0.0", "1 / 0"])
def test_a_division_by_a_plain_zero_is_refused_without_values(text):
    with pytest.raises(ExpressionError, match="divides by zero"):
        Expression(text).kind(KINDS)


@pytest.mark.parametrize(
    ("text", "values", "message"),
    [
        ("drink + drink", {"drink": "x" * (MOST_TEXT // 2 + 1)}, "a text of"),
        ("1 / count", {"count": 0}, "divides by zero"),
        ("count", {}, "'count' has no value yet"),
    ],
)
def test_a_value_that_cannot_be_is_refused_when_it_happens(text, values, message):
    expression = Expression(text)
    assert expression.kind(KINDS) is KINDS[text.split()[-1]]
    with pytest.raises(ExpressionError, match=message):
        expression.value(values)


def test_names_are_those_that_it_reads():
    assert Expression("max(count, 1) > battery and true").names == {"count", "battery"}
    assert Template("{count} of {max(count, battery)}").names == {"count", "battery"}


def test_a_refusal_fits_in_a_stack_that_is_nearly_full():
    def below(depth):
        return below(depth - 1) if depth else refused("a" + ".c" * 245)[0]

    assert "cannot stand" in below(500)


@pytest.mark.parametrize("plain", [0, -3, 2.5, -0.0, 1e-320, True, False, "", 'it\'s "so"', "a\\n\n", "é🙂"])
def test_literal_has_the_value(plain):
    found = literal(plain).value({})
    assert (found, type(found)) == (plain, type(plain))


@pytest.mark.parametrize("plain", [float("inf"), float("nan"), 1e300, 10**400, "x" * 600, "\ud800"])
def test_literal_that_is_too_large_is_refused(plain):
    with pytest.raises(ExpressionError):
        literal(plain)


@pytest.mark.parametrize(*table(__file__, "templates"))
def test_template_is_filled(text, expected):
    assert Template(text).fill(VALUES) == expected


@pytest.mark.parametrize("text", ["{", "}", "a {b", "{{a}", "{}", "{a!r}", "{1 +}", "{import os}"])
def test_broken_template_is_refused(text):
    with pytest.raises(ExpressionError) as error:
        Template(text)
    assert error.value.hint


# Anything at all gives a value of a kind that an expression can hold, or an ExpressionError.

WORDS = (
    *VALUES, *language.FUNCTIONS, "true", "false", "0", "1", "1e15", "2.5", "'a'", "''", '"08:30"', "+", "-", "*", "/",
    "//", "%", "==", "!=", "<", "<=", ">", ">=", "and", "or", "not", "if", "else", "(", ")", ",", "{", "}", "[", "]",
    ".", ":", "lambda", "in", "is", "**", "@", "~", "None", "seen", "f''", "b''", "\\", "#", "\n", "=", ":=", "await",
)  # fmt: skip
ANY_TEXT = st.text(max_size=60) | st.lists(st.sampled_from(WORDS), max_size=25).map(" ".join)


def check(text, values):
    """Reads and evaluates an expression, and checks what comes of it."""
    kind = None
    try:
        expression = Expression(text)
        kind = expression.kind(KINDS)
        assert kind in (Kind.NUMBER, Kind.TEXT, Kind.TRUTH)
        found = expression.value(values)
    except ExpressionError as error:
        assert error.message
        assert error.hint or kind
        return
    assert kind_of(found) is kind
    assert kind is not Kind.NUMBER or abs(found) <= language.LARGEST
    assert kind is not Kind.TEXT or len(found) <= MOST_TEXT


@settings(max_examples=150, deadline=None)
@given(ANY_TEXT)
def test_any_text_gives_a_value_or_an_expression_error(text):
    check(text, VALUES)


NUMBERS = st.sampled_from(["count", "battery", "0", "1", "2.5", "1e15", "1e-300"])
TEXTS = st.sampled_from(["drink", "clock", "'a'", "''"])
TRUTHS = st.sampled_from(["held", "true", "false"])


OPERATORS = st.sampled_from(["+", "-", "*", "/", "//", "%", "==", "!=", "<", "<=", ">", ">=", "and", "or"])


@st.composite
def of_the_grammar(draw, depth=3):
    """Expression whose types mostly fit."""
    form = draw(st.integers(0, 6)) if depth else 0
    if form < 2:
        return draw(NUMBERS | TEXTS | TRUTHS)
    parts = [draw(of_the_grammar(depth - 1)) for _ in range((1, 1, 3, 2, 2)[form - 2])]
    if form == 2:
        return draw(st.sampled_from(["(not {})", "(-{})"])).format(*parts)
    if form == 3:
        return f"{draw(st.sampled_from(sorted(language.FUNCTIONS)))}({parts[0]})"
    if form == 4:
        return "({} if {} else {})".format(*parts)
    return f"({parts[0]} {draw(OPERATORS)} {parts[1]})"


@settings(max_examples=150, deadline=None)
@given(
    of_the_grammar(),
    st.floats(-1e15, 1e15) | st.sampled_from([0.0, 1e15, -1e15]),
    st.text(string.printable, max_size=20),
)
def test_expressions_of_the_grammar_give_a_value_or_an_expression_error(text, number, word):
    check(text, {**VALUES, "count": number, "drink": word})


@settings(max_examples=150, deadline=None)
@given(st.text(max_size=40) | st.lists(st.sampled_from(["{", "}", "{{", "}}", "count", "a", " "])).map("".join))
def test_any_template_is_a_text_or_an_expression_error(text):
    with suppress(ExpressionError):
        template = Template(text)
        for each in template.expressions:
            each.kind(KINDS)
        assert isinstance(template.fill(VALUES), str)


@settings(max_examples=150, deadline=None)
@given(st.booleans() | st.integers() | st.floats() | st.text(max_size=600))
def test_literal_of_any_value_is_itself_or_refused(plain):
    try:
        expression = literal(plain)
        kind = expression.kind({})
    except ExpressionError:
        return
    assert (kind, expression.value({})) == (kind_of(plain), plain)


@pytest.mark.parametrize(*table(__file__, "could_be"))
def test_a_text_could_be_a_template_with_some_values(template, text, could):
    assert Template(template).matches(text) is could
