"""Expression language of mission files: grammar, types, values and refusals."""

import string

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.words.expression import (
    FUNCTIONS,
    LARGEST,
    MOST_DEPTH,
    MOST_LETTERS,
    MOST_TEXT,
    Expression,
    ExpressionError,
    Kind,
    Template,
    kind_of,
    literal,
)

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


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("7", 7),
        ("-1.5", -1.5),
        ("+2", 2),
        ("'tea'", "tea"),
        ("true", True),
        ("false", False),
        ("count + 1", 4.0),
        ("2 + 3 * 4", 14),
        ("(2 + 3) * 4", 20),
        ("7 / 2", 3.5),
        ("7 // 2", 3),
        ("-7 // 2", -4),
        ("-7 % 3", 2),
        ("drink + '!'", "tea!"),
        ("count >= 3", True),
        ("0 < count < 3", False),
        ("drink == 'tea'", True),
        ("held != false", True),
        ("clock < '08:30'", True),
        ("battery < 0.3 and not held", False),
        ("battery < 0.3 or held", True),
        ("'few' if count < 5 else 'many'", "few"),
        ("abs(-2)", 2),
        ("min(3, 1, 2)", 1),
        ("max(count)", 3.0),
        ("round(2.6)", 3),
        ("length(drink)", 3),
        ("lower('TEA')", "tea"),
        ("  count  ", 3.0),
    ],
)
def test_value(text, expected):
    found = value(text)
    assert (found, type(found)) == (expected, type(expected))


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("count + 1", Kind.NUMBER),
        ("drink + 'x'", Kind.TEXT),
        ("count == 1", Kind.TRUTH),
        ("not held", Kind.TRUTH),
        ("1 if held else 2", Kind.NUMBER),
        ("length(drink)", Kind.NUMBER),
        ("lower(drink)", Kind.TEXT),
    ],
)
def test_kind(text, kind):
    assert Expression(text).kind(KINDS) is kind


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "'' is no expression"),
        ("1 +", "'1 +' is no expression"),
        ("count = 1", "is no expression"),
        ("a\0b", "is no expression"),
        ("(" * 300, "is no expression"),
        ("x" * (MOST_LETTERS + 1), "has 501 letters"),
        ("-" * (MOST_DEPTH + 2) + "1", "nested too deeply"),
        ("+".join("1" * (MOST_DEPTH + 3)), "nested too deeply"),
        ("None", "None is no value"),
        ("1j", "1j is no value"),
        ("b'a'", "is no value"),
        ("...", "is no value"),
        ("f'{count}'", "cannot stand"),
        ("[1]", "cannot stand"),
        ("count, 1", "cannot stand"),
        ("{}", "cannot stand"),
        ("drink.upper()", "cannot stand"),
        ("drink[0]", "cannot stand"),
        ("lambda: 1", "cannot stand"),
        ("(n := 1)", "cannot stand"),
        ("2 ** 9", "cannot stand"),
        ("1 << 9", "cannot stand"),
        ("~1", "cannot stand"),
        ("1 is 1", "cannot stand"),
        ("'a' in drink", "cannot stand"),
        ("max(*count)", "cannot stand"),
        ("round(count, ndigits=1)", "cannot stand"),
        ("[n for n in drink]", "cannot stand"),
        ("().__class__", "cannot stand"),
        ("__import__('os')", "there is no function '__import__'"),
        ("abs(1)(2)", "cannot stand"),
        ("a" + ".b" * 240, "cannot stand"),
        ("cuont + 1", "unknown name 'cuont'"),
        ("seen == seen", "'seen' is no number, text or truth"),
        ("count + drink", "mixes number with text"),
        ("drink * 3", "mixes number with text"),
        ("drink - drink", "mixes number with text"),
        ("drink % 1", "mixes number with text"),
        ("-drink", "mixes number with text"),
        ("not count", "mixes true or false with number"),
        ("held and count", "mixes true or false with number"),
        ("held + 1", "mixes number with true or false"),
        ("1 if count else 2", "mixes true or false with number"),
        ("1 if held else 'a'", "mixes number with text"),
        ("count == drink", "compares number with text"),
        ("held < held", "orders true and false"),
        ("clock < '8:30'", "'8:30' is no time of day"),
        ("abs()", "takes number"),
        ("min()", "takes one or more numbers"),
        ("min(drink)", "takes one or more numbers"),
        ("length(1)", "takes text"),
        ("1 / 0", "divides by zero"),
        ("1 // 0", "divides by zero"),
        ("1 % 0", "divides by zero"),
        ("1e16", "too large"),
        ("1e400", "too large"),
        ("9" * 400, "too large"),
        ("1e15 * 10", "too large"),
        ("1e15 / 1e-300", "too large"),
    ],
)
def test_refusal_says_what_and_how_to_put_it_right(text, message):
    said, hint = refused(text)
    assert message in said
    assert hint


def test_a_misspelled_name_and_function_are_suggested():
    assert refused("cuont + 1")[1] == "did you mean 'count'?"
    assert refused("lenght(drink)")[1] == "did you mean 'length'?"


def test_a_text_that_grows_too_long_is_refused():
    text = Expression("drink + drink")
    with pytest.raises(ExpressionError, match="a text of"):
        text.value({"drink": "x" * (MOST_TEXT // 2 + 1)})


def test_half_a_character_is_refused():
    assert "half a character" in refused(r"'\ud800'")[0]


def test_division_by_a_zero_value_fails_when_it_happens():
    expression = Expression("1 / count")
    assert expression.kind(KINDS) is Kind.NUMBER
    with pytest.raises(ExpressionError, match="divides by zero"):
        expression.value({"count": 0})


def test_name_without_a_value_is_refused():
    with pytest.raises(ExpressionError, match="'count' has no value yet"):
        Expression("count").value({})


def test_operand_that_is_not_needed_is_not_evaluated():
    assert value("held or 1 / (count - 3) > 0") is True
    assert value("1 if held else 1 / (count - 3)") == 1


def test_names_are_those_that_it_reads():
    assert Expression("max(count, 1) > battery and true").names == {"count", "battery"}


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


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("no braces", "no braces"),
        ("I saw {count} beers", "I saw 3 beers"),
        ("{count + 0.5}{drink}", "3.5tea"),
        ("{held} {not held}", "yes no"),
        ("{{count}}", "{count}"),
        ("", ""),
    ],
)
def test_template_is_filled(text, expected):
    assert Template(text).fill(VALUES) == expected


@pytest.mark.parametrize("text", ["{", "}", "a {b", "{{a}", "{}", "{a!r}", "{1 +}", "{import os}"])
def test_broken_template_is_refused(text):
    with pytest.raises(ExpressionError) as error:
        Template(text)
    assert error.value.hint


def test_names_of_a_template():
    assert Template("{count} of {max(count, battery)}").names == {"count", "battery"}


# Anything at all gives a value of a kind that an expression can hold, or an ExpressionError.

WORDS = (
    *VALUES, *FUNCTIONS, "true", "false", "0", "1", "1e15", "2.5", "'a'", "''", '"08:30"', "+", "-", "*", "/", "//",
    "%", "==", "!=", "<", "<=", ">", ">=", "and", "or", "not", "if", "else", "(", ")", ",", "{", "}", "[", "]", ".",
    ":", "lambda", "in", "is", "**", "@", "~", "None", "seen", "f''", "b''", "\\", "#", "\n", "=", ":=", "await",
)  # fmt: skip
ANY_TEXT = st.text(max_size=60) | st.lists(st.sampled_from(WORDS), max_size=25).map(" ".join)


def meant(text, values):
    """Value; None when the expression is refused."""
    try:
        expression = Expression(text)
        kind = expression.kind(KINDS)
    except ExpressionError as error:
        assert error.message
        assert error.hint
        return None
    assert kind in (Kind.NUMBER, Kind.TEXT, Kind.TRUTH)
    try:
        found = expression.value(values)
    except ExpressionError as error:
        assert error.message
        return None
    assert kind_of(found) is kind
    assert kind is not Kind.NUMBER or abs(found) <= LARGEST
    assert kind is not Kind.TEXT or len(found) <= MOST_TEXT
    return found


@settings(max_examples=150, deadline=None)
@given(ANY_TEXT)
def test_any_text_gives_a_value_or_an_expression_error(text):
    meant(text, VALUES)


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
        return f"{draw(st.sampled_from(sorted(FUNCTIONS)))}({parts[0]})"
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
    meant(text, {**VALUES, "count": number, "drink": word})


@settings(max_examples=150, deadline=None)
@given(st.text(max_size=40) | st.lists(st.sampled_from(["{", "}", "{{", "}}", "count", "a", " "])).map("".join))
def test_any_template_is_a_text_or_an_expression_error(text):
    try:
        template = Template(text)
        for each in template.expressions:
            each.kind(KINDS)
        filled = template.fill(VALUES)
    except ExpressionError:
        return
    assert isinstance(filled, str)


@settings(max_examples=150, deadline=None)
@given(st.booleans() | st.integers() | st.floats() | st.text(max_size=600))
def test_literal_of_any_value_is_itself_or_refused(plain):
    try:
        expression = literal(plain)
        assert expression.kind({}) is kind_of(plain)
    except ExpressionError:
        return
    assert expression.value({}) == plain


@pytest.mark.parametrize(
    ("template", "text", "could"),
    [("{n} beers", "3 beers", True), ("{n} beers", "which?", False), ("a  {{x}}", "a {x}", True), ("a.", "ab", False)],
)
def test_a_text_could_be_a_template_with_some_values(template, text, could):
    assert Template(template).matches(text) is could
