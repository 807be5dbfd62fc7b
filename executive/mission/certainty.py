"""Checks for conditions that always or never hold, by the ranges of their readings: `battery > 30`, `n > 3 and n < 2`.

A comparison of one value with a number is evaluated at the points where its answer can change, within the value's
range, and between them. Any other part of a condition may be true or false. Parameters have already been replaced: a
condition of numbers and truth values alone is not checked.
"""

import ast
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Final

from executive.words.condition import AllOf, AnyOf, Condition, Not, ValueIs, parts_of
from executive.words.expression import CLOCK, COMPARISONS, TIME_OF_DAY, Expression, ExpressionError
from skills.quantities import bounds, range_text, unit_hint

Ranges = Mapping[str, Any]
"""Quantities of the names that have one."""
Decided = Callable[[Mapping[str, Any]], bool]
"""Answer of a condition by the values that it reads."""
MOST_CASES: Final = 4096
_DAY_MIN: Final = 24 * 60


def refuse_certain_comparisons(expression: Expression, ranges: Ranges) -> None:
    """Refuses a comparison whose answer follows from the range of the compared value.

    Raises:
        ExpressionError: names the comparison, the range and the likely mistake.
    """
    for node in ast.walk(expression.tree):
        for pair in _pairs(node) if isinstance(node, ast.Compare) else ():
            line = _line(pair)
            if line is None or line.name is None or not (line.name in (CLOCK, *ranges) or "(" in line.name):
                continue
            answers = {line.holds(point) for point in line.points(ranges)}
            if len(answers) == 1:
                says = "always holds" if answers == {True} else "cannot hold"
                range_, hint = _range_words(line, ranges)
                raise ExpressionError(f"'{ast.unparse(pair)}' {says}: {line.name} is {range_}", hint)


def refuse_certain(condition: Condition, ranges: Ranges) -> None:
    """Refuses a condition whose parts contradict each other, or that cannot fail.

    Raises ExpressionError when the condition cannot hold, or always holds.
    """
    looks = any(not isinstance(part, ValueIs) for part in parts_of(condition))
    cases = _Cases(ranges, apart=looks)
    decided = cases.of(condition)
    if not cases.points:
        return
    names, choices = list(cases.points), list(cases.points.values())
    if math.prod(map(len, choices)) > MOST_CASES:
        return
    answers = {decided(dict(zip(names, case, strict=True))) for case in itertools.product(*choices)}
    if len(answers) == 1 and cases.reads:
        says = "always holds" if answers == {True} else "cannot hold"
        hint = "correct a comparison, or write true or false where that is meant"
        raise ExpressionError(f"'{condition}' {says} for every reading", hint)


@dataclass(frozen=True)
class _Line:
    """Comparison of `slope * name + shift` with zero; `name` is None if the comparison reads no value."""

    name: str | None
    slope: Fraction
    shift: Fraction
    compare: ast.cmpop

    def holds(self, value: Fraction) -> bool:
        """Answer of the comparison if the name has this value."""
        return bool(COMPARISONS[type(self.compare)](self.slope * value + self.shift, 0))

    @property
    def turn(self) -> Fraction | None:
        """Value at which the answer can change; None if it never changes."""
        return None if self.slope == 0 else -self.shift / self.slope

    def points(self, ranges: Ranges) -> list[Fraction]:
        """Values on both sides of the turn and at the turn, within the range of the name."""
        return _samples([] if self.turn is None else [self.turn], *_limits(self.name, ranges))


@dataclass
class _Cases:
    """Readings that a condition depends on, each with the values at which the answer may change.

    A look takes time: with a look in the condition, each part of it reads its own values (`apart`).
    """

    ranges: Ranges
    apart: bool
    points: dict[str, list[Any]] = field(default_factory=dict)
    reads: bool = False
    turns: dict[str, set[Fraction]] = field(default_factory=dict)
    part: int = 0

    def of(self, condition: Condition) -> Decided:
        """Answer of a condition as a function of the values that it reads."""
        match condition:
            case AllOf(parts=parts):
                return _joined(all, [self.of(part) for part in parts])
            case AnyOf(parts=parts):
                return _joined(any, [self.of(part) for part in parts])
            case Not(part=inner):
                below = self.of(inner)
                return lambda case: not below(case)
            case ValueIs(expression=expression):
                self.part += 1 if self.apart else 0
                return self._node(expression.tree)
        return self._free()

    def _node(self, node: ast.expr) -> Decided:
        match node:
            case ast.BoolOp(op, values):
                return _joined(all if isinstance(op, ast.And) else any, [self._node(each) for each in values])
            case ast.UnaryOp(ast.Not(), operand):
                below = self._node(operand)
                return lambda case: not below(case)
            case ast.Name(name) if name not in ("true", "false"):
                return self._read(name, [False, True], bool)
            case ast.Compare():
                return _joined(all, [self._pair(pair) for pair in _pairs(node)])
        return self._free()

    def _pair(self, pair: ast.Compare) -> Decided:
        """Answer of one comparison."""
        line, words = _line(pair), _words(pair)
        if line is not None and line.name is not None and line.turn is not None:
            turns = self.turns.setdefault(f"{line.name} {self.part}", set())
            turns.add(line.turn)
            return self._read(line.name, _samples(turns, *_limits(line.name, self.ranges)), line.holds)
        if words is not None:
            name, text, is_equal = words
            texts = dict.fromkeys([*self.points.get(f"{name} {self.part}", ["\0"]), text])
            return self._read(name, [*texts], lambda value: (value == text) is is_equal)
        return self._free()

    def _read(self, name: str, values: list[Any], test: Callable[[Any], bool]) -> Decided:
        """Answer of a test on a reading, which may have any of these values."""
        key = f"{name} {self.part}"
        self.reads, self.points[key] = True, values
        return lambda case: test(case[key])

    def _free(self) -> Decided:
        """Answer that may be true or false, independently of all others."""
        key = f" {len(self.points)}"
        self.points[key] = [False, True]
        return lambda case: bool(case[key])


def _joined(every: Callable[[Iterator[bool]], bool], parts: Sequence[Decided]) -> Decided:
    return lambda case: every(part(case) for part in parts)


def _pairs(node: ast.Compare) -> Iterator[ast.Compare]:
    """Comparisons in a chain: `0 < n < 3` has two."""
    sides = (node.left, *node.comparators)
    for first, op, second in zip(sides, node.ops, sides[1:], strict=False):
        yield ast.Compare(first, [op], [second])


def _line(pair: ast.Compare) -> _Line | None:
    """Comparison, rewritten as a comparison of a linear term with zero; None if it is not linear."""
    if isinstance(pair.left, ast.Constant) and not isinstance(pair.comparators[0], ast.Constant):
        turned = {ast.Lt: ast.Gt, ast.LtE: ast.GtE, ast.Gt: ast.Lt, ast.GtE: ast.LtE}
        swapped = turned.get(type(pair.ops[0]), type(pair.ops[0]))()
        return _line(ast.Compare(pair.comparators[0], [swapped], [pair.left]))
    sides = (pair.left, pair.comparators[0])
    texts = any(isinstance(each, ast.Constant) and isinstance(each.value, str) for each in sides)
    if texts and not any(isinstance(each, ast.Name) and each.id == CLOCK for each in sides):
        return None
    left, right = map(_affine, sides)
    if left is None or right is None:
        return None
    names = {side[0] for side in (left, right)} - {None}
    if len(names) > 1:
        return None
    return _Line(next(iter(names), None), left[1] - right[1], left[2] - right[2], pair.ops[0])


def _affine(node: ast.expr) -> tuple[str | None, Fraction, Fraction] | None:
    """Name, slope and shift of a linear term; None if the term is not linear."""
    match node:
        case ast.Constant(bool()):
            return None
        case ast.Constant(int() | float() as value):
            return None, Fraction(0), Fraction(str(value))
        case ast.Constant(str() as text) if TIME_OF_DAY.fullmatch(text):
            return None, Fraction(0), Fraction(int(text[:2]) * 60 + int(text[3:]))
        case ast.Name(name):
            return name, Fraction(1), Fraction(0)
        case ast.Call(ast.Name("abs" | "length")):
            return ast.unparse(node), Fraction(1), Fraction(0)
        case ast.UnaryOp(ast.USub() | ast.UAdd() as op, operand):
            return _scaled(_affine(operand), Fraction(-1 if isinstance(op, ast.USub) else 1))
        case ast.BinOp(left, op, right):
            return _combined(_affine(left), op, _affine(right))
    return None


_Affine = tuple[str | None, Fraction, Fraction]


def _combined(left: _Affine | None, op: ast.operator, right: _Affine | None) -> _Affine | None:
    if left is None or right is None:
        return None
    match op:
        case ast.Add() | ast.Sub():
            sign = Fraction(1 if isinstance(op, ast.Add) else -1)
            if left[0] is not None and right[0] is not None and left[0] != right[0]:
                return None
            return left[0] or right[0], left[1] + sign * right[1], left[2] + sign * right[2]
        case ast.Mult() if right[0] is None:
            return _scaled(left, right[2])
        case ast.Mult() if left[0] is None:
            return _scaled(right, left[2])
        case ast.Div() if right[0] is None and right[2] != 0:
            return _scaled(left, 1 / right[2])
    return None


def _scaled(line: _Affine | None, factor: Fraction) -> _Affine | None:
    return None if line is None else (line[0], line[1] * factor, line[2] * factor)


def _words(pair: ast.Compare) -> tuple[str, str, bool] | None:
    """Name, text, and whether both must be equal, read from a comparison of a name with a text."""
    sides = (pair.left, pair.comparators[0])
    names = [each.id for each in sides if isinstance(each, ast.Name) and each.id != CLOCK]
    texts = [each.value for each in sides if isinstance(each, ast.Constant) and isinstance(each.value, str)]
    if len(names) != 1 or len(texts) != 1 or not isinstance(pair.ops[0], ast.Eq | ast.NotEq):
        return None
    return names[0], texts[0], isinstance(pair.ops[0], ast.Eq)


def _limits(name: str | None, ranges: Ranges) -> tuple[Fraction | None, Fraction | None]:
    """Least and greatest value that a name can have; None for an end without limit."""
    if name == CLOCK:
        return Fraction(0), Fraction(_DAY_MIN - 1)
    if name is not None and "(" in name:
        return Fraction(0), None
    limits = bounds(ranges.get(name or ""))
    low, high = limits.get("ge", limits.get("gt")), limits.get("le", limits.get("lt"))
    return None if low is None else Fraction(str(low)), None if high is None else Fraction(str(high))


def _samples(turns: Sequence[Fraction] | set[Fraction], low: Fraction | None, high: Fraction | None) -> list[Fraction]:
    """Values to test: the turns within a range, the ends of the range, and values between and beyond these."""
    inside = {turn for turn in turns if (low is None or turn >= low) and (high is None or turn <= high)}
    known = sorted(inside | {end for end in (low, high) if end is not None})
    between = [(first + second) / 2 for first, second in itertools.pairwise(known)]
    below = [known[0] - 1] if low is None and known else []
    above = [known[-1] + 1] if high is None and known else []
    return [*below, *known, *between, *above] or [Fraction(0)]


def _range_words(line: _Line, ranges: Ranges) -> tuple[str, str]:
    """Range of the value in a comparison, in words, and a hint."""
    if line.name == CLOCK:
        return "from 00:00 to 23:59", "write a time after midnight and before 23:59"
    if line.name is None or line.name not in ranges:
        return "0 or more", "compare it with a number above 0"
    hint = ranges[line.name]
    meant = "" if line.turn is None else unit_hint(float(line.turn), hint)
    return range_text(hint), meant or "compare it with a number within this range"
