"""Understanding of English requests."""

from executive.language.parser import DependencyParser, SpacyParser, Token, load_parser
from executive.language.understand import Status, Understanding, parse_lines, understand

__all__ = [
    "DependencyParser",
    "SpacyParser",
    "Status",
    "Token",
    "Understanding",
    "load_parser",
    "parse_lines",
    "understand",
]
