"""Arithmetic in recipes: numbers, names, + - * / **, and a few functions that may draw at random."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from functools import cache
from typing import Final

import numpy as np

Number = float | str
"""A number, or an expression over a recipe's names."""

_OPERATORS: Final[Mapping[type[ast.operator], Callable[[float, float], float]]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
}
_FUNCTIONS: Final[Mapping[str, Callable[..., float]]] = {
    "uniform": lambda rng, low, high: rng.uniform(low, high),
    "log_uniform": lambda rng, low, high: np.exp(rng.uniform(np.log(low), np.log(high))),
    "normal": lambda rng, mean, deviation: rng.normal(mean, deviation),
    "whole": lambda rng, low, high: rng.integers(low, high, endpoint=True),
    "pick": lambda rng, *values: rng.choice(values),
    "min": lambda _, *values: min(values),
    "max": lambda _, *values: max(values),
    "round": lambda _, value: round(value),
    "sin": lambda _, angle: np.sin(angle),
    "cos": lambda _, angle: np.cos(angle),
}


def evaluate(value: Number, names: Mapping[str, float], rng: np.random.Generator) -> float:
    """Evaluates a number or an expression. Raises ValueError for anything but arithmetic over the known names."""
    return float(value) if isinstance(value, int | float) else _value(_parsed(value), names, rng)


@cache
def _parsed(text: str) -> ast.expr:
    try:
        return ast.parse(text, mode="eval").body
    except SyntaxError as error:
        raise ValueError(f"{text!r} is no expression: {error.msg}") from None


def _value(node: ast.expr, names: Mapping[str, float], rng: np.random.Generator) -> float:
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name(id=name) if name in names:
            return names[name]
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            return -_value(inner, names, rng)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(left, names, rng), _value(right, names, rng))
        case ast.Call(func=ast.Name(id=name), args=arguments) if name in _FUNCTIONS:
            return float(_FUNCTIONS[name](rng, *(_value(each, names, rng) for each in arguments)))
    known = ", ".join([*sorted(names), *_FUNCTIONS])
    raise ValueError(f"{ast.unparse(node)!r} is neither a number nor one of {known}")
