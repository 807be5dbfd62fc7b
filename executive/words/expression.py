"""Expression language of mission files: `count + 1`, `battery < 0.3 and not holding`, `"{count} beers"`.

An expression has numbers, texts, true and false, names; + - * / // %; comparisons; and, or, not; `A if C else B`;
brackets; and the functions of `FUNCTIONS`. The grammar is a subset of Python's, parsed by `ast`; no code is executed.
The types of names are checked before a mission runs, and values are computed while the mission runs.
"""

import ast
import enum
import functools
import operator
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from skills.inputs.errors import suggestion
from skills.quantities import QuantityError, clock_text, seconds_in

Value = bool | int | float | str
MOST_LETTERS: Final = 500
MOST_TEXT: Final = 2000
MOST_DEPTH: Final = 30
LARGEST: Final = 1e15


class ExpressionError(ValueError):
    """Error in an expression: syntax, types of names, or value; `hint` says how to correct it."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message, self.hint = message, hint


class Kind(enum.Enum):
    """Type of a value in an expression."""

    NUMBER = "number"
    TEXT = "text"
    TRUTH = "true or false"
    OTHER = "object"  # an output of a skill that only ports can take

    def __str__(self) -> str:
        return self.value


_KINDS: Final[Mapping[type, Kind]] = {bool: Kind.TRUTH, int: Kind.NUMBER, float: Kind.NUMBER, str: Kind.TEXT}


def kind_of(type_or_value: Any) -> Kind:
    """Kind of a Python type or of a value; OTHER for types that no expression can hold."""
    kind = type_or_value if isinstance(type_or_value, type) else type(type_or_value)
    return _KINDS.get(kind, Kind.OTHER)


@dataclass(frozen=True)
class _Function:
    """Named function: the kinds of its arguments (None: one or more numbers), the kind of its result, and its body.

    `instead` says what to write for a call with more arguments, as other languages take them.
    """

    takes: tuple[Kind, ...] | None
    returns: Kind
    body: Callable[..., Value]
    instead: str = ""


FUNCTIONS: Final[Mapping[str, _Function]] = MappingProxyType(
    {
        "abs": _Function((Kind.NUMBER,), Kind.NUMBER, abs),
        "min": _Function(None, Kind.NUMBER, lambda *numbers: min(numbers)),
        "max": _Function(None, Kind.NUMBER, lambda *numbers: max(numbers)),
        "round": _Function((Kind.NUMBER,), Kind.NUMBER, round, "for one decimal, write round(x * 10) / 10"),
        "length": _Function((Kind.TEXT,), Kind.NUMBER, len),
        "lower": _Function((Kind.TEXT,), Kind.TEXT, str.lower),
    }
)


@dataclass(frozen=True)
class Expression:
    """Expression in its text form. Raises ExpressionError when it cannot be parsed."""

    text: str

    def __post_init__(self) -> None:
        _parsed(self.text)

    def __str__(self) -> str:
        return self.text

    @property
    def tree(self) -> ast.expr:
        """Syntax tree."""
        return _parsed(self.text).body

    @property
    def names(self) -> frozenset[str]:
        """Names that the expression reads."""
        functions = {id(node.func) for node in ast.walk(_parsed(self.text)) if isinstance(node, ast.Call)}
        nodes = (node for node in ast.walk(_parsed(self.text)) if isinstance(node, ast.Name))
        return frozenset(node.id for node in nodes if id(node) not in functions) - set(_CONSTANTS)

    def kind(self, kinds: Mapping[str, Kind]) -> Kind:
        """Type of the value. Raises ExpressionError for an unknown name, types that do not fit, or a division by 0."""
        kind = _kind(_parsed(self.text).body, kinds)
        for node in ast.walk(_parsed(self.text)):
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div | ast.FloorDiv | ast.Mod):
                divisor: Any = None
                with suppress(ExpressionError):  # it has names
                    divisor = _value(node.right, {})
                if divisor == 0:
                    _worked_out(node, operator.truediv, 1, divisor)
        if not self.names:
            self.value({})
        return kind

    def value(self, values: Mapping[str, Value]) -> Value:
        """Computes the value. Raises ExpressionError for a division by zero, a huge value or a missing one."""
        return _checked(_value(_parsed(self.text).body, values))


@dataclass(frozen=True)
class Template:
    """Text with expressions in braces: "I saw {count} beers"; `{{` is a brace. Raises ExpressionError if invalid."""

    text: str

    def __post_init__(self) -> None:
        _pieces(self.text)

    @property
    def expressions(self) -> tuple[Expression, ...]:
        """Expressions in the text, in order."""
        return tuple(piece for piece in _pieces(self.text) if isinstance(piece, Expression))

    @property
    def names(self) -> frozenset[str]:
        """Names that the expressions read."""
        return frozenset(name for each in self.expressions for name in each.names)

    def fill(self, values: Mapping[str, Value]) -> str:
        """Replaces each expression by its value. Raises ExpressionError when a value cannot be computed."""
        texts = []
        for piece in _pieces(self.text):
            value = piece if isinstance(piece, str) else piece.value(values)
            yes_or_no = ("no", "yes")[value] if isinstance(value, bool) else str(value)
            texts.append(f"{value:g}" if isinstance(value, float) else yes_or_no)
        return "".join(texts)

    def matches(self, text: str) -> bool:
        """Returns whether this text could result from any values of the expressions; ignores repeated spaces."""
        pieces = [
            re.escape(piece) if isinstance(piece, str) else ".*" for piece in _pieces(" ".join(self.text.split()))
        ]
        return re.fullmatch("".join(pieces), " ".join(text.split())) is not None


def literal(value: Value) -> Expression:
    """Expression for a plain value. Raises ExpressionError when the value is too long or too large."""
    _checked(value)
    return Expression(repr(value) if not isinstance(value, bool) else str(value).lower())


@functools.lru_cache(maxsize=4096)
def _pieces(text: str) -> tuple[str | Expression, ...]:
    pieces: list[str | Expression] = []
    last = 0
    for match in re.finditer(r"\{\{|\}\}|\{([^{}]*)\}|[{}]", text):
        pieces.append(text[last : match.start()])
        found, last = match[0], match.end()
        if found in ("{", "}"):
            raise ExpressionError(f"a brace '{found}' stands alone", "write an expression in {braces}, or {{")
        pieces.append(found[0] if found in ("{{", "}}") else Expression(match[1]))
    return tuple(piece for piece in (*pieces, text[last:]) if piece != "")


@functools.lru_cache(maxsize=4096)
def _parsed(text: str) -> ast.Expression:
    """Parses an expression. Raises ExpressionError for syntax outside the grammar."""
    if len(text) > MOST_LETTERS:
        raise ExpressionError(f"the expression has {len(text)} letters", f"write {MOST_LETTERS} at most")
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ExpressionError(f"'{text[:60]}' is no expression", slip_hint(text) or _HINT) from None
    try:
        _refuse_others(tree.body, 0)
    except ExpressionError as error:
        raise ExpressionError(error.message, slip_hint(text) or error.hint) from None
    return tree


def slip_hint(text: str) -> str:
    """Hint for a number in a form that expressions lack (12:30, 1,5, 30 %); empty for other texts."""
    for pattern, meant in _SLIPS:
        match = re.search(pattern, text)
        if match is not None and (hint := meant(match)):
            return hint
    return ""


def _span_hint(match: re.Match[str]) -> str:
    seconds = seconds_in(match[0])
    return "" if seconds is None else f"write {seconds:g}, in seconds, for {match[0].strip()}"


_SLIPS: Final[tuple[tuple[str, Callable[[re.Match[str]], str]], ...]] = (
    (r"(?<![\w.\"'])(\d{1,2}:\d\d)(?![\w.\"'])", lambda match: f'put it in quotes: "{match[1]}"'),
    (r"(?<![\w.])(\d+),(\d+)(?![\w.])", lambda match: f"write {match[1]}.{match[2]}, with a point"),
    (r"(?<![\w.])(\d+(?:\.\d+)?) ?%(?! ?\w)", lambda match: f"write {float(match[1]) / 100.0:g} for {match[0]}"),
    (r"(?<![\w.])(?:\d+(?:\.\d+)? ?(?:ms|s|sec|seconds?|min|minutes?|h|hours?)\b ?)+", _span_hint),
    (r"(?<![\w.])0+(\d+)(?![\w.])", lambda match: f"write {match[1]}, without the zero before it"),
    (r"(?<![=<>!])=(?!=)", lambda match: "write == to compare"),
)
"""Numbers in other forms, with the hint for each."""


def _refuse_others(node: ast.expr, depth: int) -> None:
    """Raises ExpressionError for syntax outside the grammar."""
    if depth > MOST_DEPTH:
        raise ExpressionError("the expression is nested too deeply", "use 'set' to name a part of it")
    if isinstance(node, ast.Constant):
        if not isinstance(node.value, bool | int | float | str):
            raise ExpressionError(f"{_shown(node, 40)} is no value", _HINT)
        _checked(node.value)
        return
    if isinstance(node, ast.Name):
        return
    for child in _parts(node):
        _refuse_others(child, depth + 1)


def _parts(node: ast.expr) -> tuple[ast.expr, ...]:
    """Operands of a node. Raises ExpressionError for a node outside the grammar."""
    match node:
        case ast.BinOp(left, op, right) if type(op) in _ARITHMETIC:
            return left, right
        case ast.UnaryOp(ast.Not() | ast.USub() | ast.UAdd(), operand):
            return (operand,)
        case ast.BoolOp(_, values):
            return tuple(values)
        case ast.Compare(left, ops, comparators) if all(type(op) in COMPARISONS for op in ops):
            return left, *comparators
        case ast.IfExp(test, body, orelse):
            return test, body, orelse
        case ast.Call(ast.Name(name), arguments, []) if not any(isinstance(a, ast.Starred) for a in arguments):
            if name not in FUNCTIONS:
                raise ExpressionError(f"there is no function '{name}'", suggestion(name, FUNCTIONS))
            return tuple(arguments)
    raise ExpressionError(f"'{_shown(node, 40)}' cannot stand in an expression", _HINT)


def _kind(node: ast.expr, kinds: Mapping[str, Kind]) -> Kind:
    """Type of a node's value. Raises ExpressionError for an unknown name or types that do not fit."""
    match node:
        case ast.Constant(value):
            return kind_of(value)
        case ast.Name(name) if name in _CONSTANTS:
            return Kind.TRUTH
        case ast.Name(name):
            if name not in kinds:
                known = sorted(kinds)
                raise ExpressionError(f"unknown name '{name}'", suggestion(name, known) if known else _HINT)
            if kinds[name] is Kind.OTHER:
                raise ExpressionError(f"'{name}' is no number, text or truth", "ports take it as {from: " + name + "}")
            return kinds[name]
        case ast.BinOp(left, op, right):
            both = {_kind(left, kinds), _kind(right, kinds)}
            if both == {Kind.TEXT} and isinstance(op, ast.Add):
                return Kind.TEXT
            _want(both, Kind.NUMBER, node)
            return Kind.NUMBER
        case ast.UnaryOp(op, operand):
            wanted = Kind.TRUTH if isinstance(op, ast.Not) else Kind.NUMBER
            _want({_kind(operand, kinds)}, wanted, node)
            return wanted
        case ast.BoolOp(_, values):
            _want({_kind(value, kinds) for value in values}, Kind.TRUTH, node)
            return Kind.TRUTH
        case ast.Compare(left, ops, comparators):
            _comparison(node, [_kind(each, kinds) for each in (left, *comparators)], ops)
            return Kind.TRUTH
        case ast.IfExp(test, body, orelse):
            _want({_kind(test, kinds)}, Kind.TRUTH, node)
            first = _kind(body, kinds)
            _want({_kind(orelse, kinds)}, first, node)
            return first
        case ast.Call(ast.Name(name), arguments):
            return _call(node, name, [_kind(each, kinds) for each in arguments])
    raise ExpressionError(f"'{_shown(node, 40)}' cannot stand in an expression", _HINT)


def _want(found: set[Kind], wanted: Kind, node: ast.expr) -> None:
    if found - {wanted}:
        other = next(iter(found - {wanted}))
        raise ExpressionError(f"'{_shown(node, 60)}' mixes {wanted} with {other}", f"every part must be {wanted}")


def _comparison(node: ast.Compare, kinds: list[Kind], ops: list[ast.cmpop]) -> None:
    for first, op, second in zip(kinds, ops, kinds[1:], strict=False):
        if first is not second:
            hint = _text_hint(node) or "compare one type"
            raise ExpressionError(f"'{_shown(node, 60)}' compares {first} with {second}", hint)
        if first is Kind.TRUTH and not isinstance(op, ast.Eq | ast.NotEq):
            raise ExpressionError(f"'{_shown(node, 60)}' orders true and false", "use == or !=")
    sides = (node.left, *node.comparators)
    if any(isinstance(each, ast.Name) and each.id == CLOCK for each in sides):
        for each in sides:
            if isinstance(each, ast.Constant) and not TIME_OF_DAY.fullmatch(f"{each.value!s}"):
                hint = f'it is from 00:00 to 23:59; write it as "{_nearest_clock(each.value)}"'
                raise ExpressionError(f"{each.value!r} is no time of day", hint)


def _nearest_clock(value: object) -> str:
    try:
        return clock_text(value)
    except QuantityError:
        return "08:30"


def _text_hint(node: ast.Compare) -> str:
    """Hint for comparing a number, or a time of day, with a text."""
    sides = (node.left, *node.comparators)
    if any(isinstance(each, ast.Name) and each.id == CLOCK for each in sides):
        return 'a time of day is written as "08:30"'
    texts = [each.value for each in sides if isinstance(each, ast.Constant) and isinstance(each.value, str)]
    numbers = (f"write {text}, without quotes" for text in texts if re.fullmatch(r"-?\d+(?:\.\d+)?", text))
    return next((hint for text in texts if (hint := slip_hint(text))), next(numbers, ""))


def _call(node: ast.expr, name: str, kinds: list[Kind]) -> Kind:
    function = FUNCTIONS[name]
    wanted = [Kind.NUMBER] * max(1, len(kinds)) if function.takes is None else list(function.takes)
    if kinds != wanted:
        takes = "one or more numbers" if function.takes is None else f"one {' and one '.join(map(str, wanted))}"
        hint = function.instead if len(kinds) > len(wanted) else ""
        raise ExpressionError(f"{name}() takes {takes}, unlike '{_shown(node, 60)}'", hint or f"give it {takes}")
    return function.returns


def _value(node: ast.expr, values: Mapping[str, Value]) -> Any:
    match node:
        case ast.Constant(value):
            return value
        case ast.Name(name) if name in _CONSTANTS:
            return _CONSTANTS[name]
        case ast.Name(name):
            if name not in values:
                raise ExpressionError(f"'{name}' has no value yet", "give it one under 'variables'")
            return values[name]
        case ast.BinOp(left, op, right):
            return _worked_out(node, _ARITHMETIC[type(op)], _value(left, values), _value(right, values))
        case ast.UnaryOp(op, operand):
            value = _value(operand, values)
            return not value if isinstance(op, ast.Not) else -value if isinstance(op, ast.USub) else value
        case ast.BoolOp(op, parts):
            every = all if isinstance(op, ast.And) else any
            return every(_value(part, values) for part in parts)
        case ast.Compare(left, ops, comparators):
            sides = [_value(each, values) for each in (left, *comparators)]
            return all(COMPARISONS[type(op)](one, other) for one, op, other in zip(sides, ops, sides[1:], strict=False))
        case ast.IfExp(test, body, orelse):
            return _value(body if _value(test, values) else orelse, values)
        case ast.Call(ast.Name(name), arguments):
            return FUNCTIONS[name].body(*(_value(each, values) for each in arguments))
    raise ExpressionError(f"'{_shown(node, 40)}' has no value", _HINT)


def _shown(node: ast.AST, letters: int) -> str:
    """Text of a subexpression for messages, cut off after this number of letters."""
    try:
        return ast.unparse(node)[:letters]
    except RecursionError:
        return "..."


def _worked_out(node: ast.expr, work: Callable[[Any, Any], Any], left: Any, right: Any) -> Any:
    try:
        return _checked(work(left, right))
    except ZeroDivisionError:
        raise ExpressionError(f"'{_shown(node, 60)}' divides by zero", "ask for zero first, with 'if'") from None
    except OverflowError:
        raise ExpressionError(f"'{_shown(node, 60)}' is too large a number", "use smaller numbers") from None


def _checked(value: Any) -> Value:
    """Returns the value unless it is too large. Raises ExpressionError."""
    if isinstance(value, str):
        if len(value) > MOST_TEXT:
            raise ExpressionError(f"a text of {len(value)} letters", f"keep it below {MOST_TEXT}")
        if any("\ud800" <= letter <= "\udfff" for letter in value):
            raise ExpressionError("a text with half a character", "leave out what \\ud800 to \\udfff stand for")
    elif not isinstance(value, bool) and not abs(value) <= LARGEST:
        raise ExpressionError("a number that is too large", "use smaller numbers")
    return value  # type: ignore[no-any-return]


CLOCK: Final = "clock"
TIME_OF_DAY: Final = re.compile(r"([01]\d|2[0-3]):[0-5]\d")
_HINT: Final = "write it as in 'count + 1', 'battery < 0.3 and not holding' or 'drink == \"tea\"'"
_CONSTANTS: Final[Mapping[str, bool]] = {"true": True, "false": False}
_ARITHMETIC: Final[Mapping[type[ast.operator], Callable[[Any, Any], Any]]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
}
COMPARISONS: Final[Mapping[type[ast.cmpop], Callable[[Any, Any], Any]]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
