"""What is wrong with a value in a file, as pydantic found it, in plain words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from rapidfuzz import fuzz, process

from skills.quantities import QuantityError, shown

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

__all__ = ["first_error", "nearest_of", "plain_hint", "plain_words"]

_MOST_WORDS: Final = 8
_PLAINER: Final[Mapping[str, str]] = MappingProxyType(
    {
        "model_type": "should be a mapping of keys to values",
        "model_attributes_type": "should be a mapping of keys to values",
        "dataclass_type": "should be a mapping of keys to values",
        "dict_type": "should be a mapping of keys to values",
        "tuple_type": "should be a list",
        "list_type": "should be a list",
        "string_type": "should be a text",
        "float_type": "should be a number",
        "float_parsing": "should be a number",
        "int_type": "should be a whole number",
        "int_parsing": "should be a whole number",
        "int_from_float": "should be a whole number",
        "bool_type": "should be true or false",
        "bool_parsing": "should be true or false",
        "string_too_short": "should not be empty",
        "too_short": "should not be empty",
        "too_long": "has too many parts",
        "string_pattern_mismatch": "should hold something that can be seen, and no control characters",
        "finite_number": "should be a finite number",
        "invalid_key": "the key should be a text",
        "missing": "is missing",
        "extra_forbidden": "is unknown",
        "unexpected_keyword_argument": "is unknown",
    }
)


def plain_words(error: ErrorDetails) -> str:
    """What is wrong: "should be from 0 to 1"."""
    kind, context = error["type"], error.get("ctx", {})
    if isinstance(context.get("error"), QuantityError):
        return str(context["error"].what)
    if kind == "too_short" and context["min_length"] > 1:
        return f"should have {context['min_length']} parts or more"
    if kind in ("literal_error", "enum"):
        return f"should be {_listed(_allowed(error))}"
    said = _PLAINER.get(kind, error["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, "))
    return f"should be {said.removeprefix('Input should be ')}" if said.startswith("Input should be ") else said


def plain_hint(error: ErrorDetails, word: str | None = None) -> str:
    """What to do about it; `word` is what stands in the file where YAML reads it as true or false."""
    value = error.get("input")
    refusal = error.get("ctx", {}).get("error")
    if isinstance(refusal, QuantityError):
        return refusal.hint
    if error["type"] == "string_type" and isinstance(value, bool):
        said = word or ("yes" if value else "no")
        return f'put it in quotes: "{said}"' if word else f'put it in quotes, as in "{said}"'
    if error["type"] == "string_type" and isinstance(value, int | float):
        return f'put it in quotes: "{value if isinstance(value, float) else shown(value)}"'
    if error["type"] == "invalid_key":
        return "put the key in quotes"
    near = process.extractOne(str(value), _allowed(error), scorer=fuzz.ratio, score_cutoff=70.0)
    return f"it reads {shown(value)} now" if near is None else f"did you mean '{near[0]}'?"


def nearest_of(word: str, known: Sequence[str]) -> str:
    """The hint for a word that is not known: the one that was probably meant, else the first that are known."""
    near = process.extractOne(word, known, scorer=fuzz.ratio, score_cutoff=70.0) if word else None
    if near is not None:
        return f"did you mean '{near[0]}'?"
    more = f" and {len(known) - _MOST_WORDS} more" if len(known) > _MOST_WORDS else ""
    return f"known are {', '.join(known[:_MOST_WORDS])}{more}"


def _allowed(error: ErrorDetails) -> list[str]:
    """The words that are allowed where only some are."""
    expected = str(error.get("ctx", {}).get("expected", ""))
    return [word.strip().strip("'") for part in expected.split(" or ") for word in part.split(", ") if word.strip()]


def _listed(words: list[str]) -> str:
    shown_words = [f"'{word}'" for word in words[:_MOST_WORDS]]
    if len(words) > _MOST_WORDS:
        return f"{', '.join(shown_words)} or one of {len(words) - _MOST_WORDS} more"
    return f"{', '.join(shown_words[:-1])} or {shown_words[-1]}" if len(words) > 1 else shown_words[0]


def first_error(errors: list[ErrorDetails]) -> tuple[tuple[Any, ...], str, str]:
    """Where the first error is, what is wrong there, and what to do; an unknown key goes before a missing one."""
    first = min(errors, key=lambda each: each["type"] not in ("extra_forbidden", "unexpected_keyword_argument"))
    return first["loc"], plain_words(first), plain_hint(first)
