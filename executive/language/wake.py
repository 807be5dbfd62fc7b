"""The wake phrase: "Hey Alice", or the bare name set off by a comma."""

from __future__ import annotations

import re
from dataclasses import dataclass

__all__ = ["WakeResult", "strip_wake"]

_GREETING = r"(?:hey|hi|ok|okay|hello)"


@dataclass(frozen=True)
class WakeResult:
    """The sentence without its wake phrase, whether that was there, and who else was called instead."""

    text: str
    addressed: bool
    other_name: str | None = None


def strip_wake(text: str, name: str) -> WakeResult:
    """Take the wake phrase for the robot called `name` out of `text`, where it stands.

    It is "Hey NAME" (also Hi, OK, Hello) anywhere, or the bare name set off by a comma at the beginning or the end. A
    bare name at the beginning without a comma is taken out, too, but does not count as addressing.
    """
    own = re.escape(name)
    forms = (
        rf"\b{_GREETING}\b[\s,]*\b{own}\b[\s,.!:;-]*",
        rf"^\W*{own}\b(?:\s*[,.!:;-]+\s*|(?=\s+(?:please|(?:can|could|would|will)\s+you)\b))",
        rf",\s*{own}\b(?=\W*$)",
    )
    for form in forms:
        rest, count = re.subn(form, " ", text, count=1, flags=re.IGNORECASE)
        if count:
            return WakeResult(" ".join(rest.split()).strip(" ,"), addressed=True)
    other = re.match(rf"\s*(?i:{_GREETING})\b[\s,]+([A-Z][\w'-]*)\s*,", text)
    bare = re.sub(rf"^\W*{own}\b(?:\s+|$)", "", text, count=1, flags=re.IGNORECASE)
    return WakeResult(bare, addressed=False, other_name=other.group(1) if other else None)
