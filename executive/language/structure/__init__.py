"""Sentences that decide, repeat, wait and go on: what they mean as the steps of a mission."""

from executive.language.structure.sentence import Structured, structured

__all__ = ["Structured", "structured"]
