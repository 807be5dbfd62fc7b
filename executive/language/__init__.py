"""Understanding of English requests."""

from executive.language.explain import Explanation, explain
from executive.language.parser import DependencyParser, SpacyParser, Token, load_parser
from executive.language.understand import Status, Understanding, parse_lines, understand

__all__ = [
    "DependencyParser",
    "Explanation",
    "SpacyParser",
    "Status",
    "Token",
    "Understanding",
    "explain",
    "load_parser",
    "parse_lines",
    "understand",
]
