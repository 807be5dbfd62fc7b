"""Slugs: names as parts of path ids and of file names."""

import re
import zlib
from typing import Final

LONGEST_SLUG: Final = 80


def slug(text: str) -> str:
    """Converts a text to one part of a path id or file name: lower case, hyphens between words, no dots or slashes.

    A long text is cut off and ends with a checksum, so that texts with the same beginning stay different.
    """
    words = re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "unnamed"
    if len(words) <= LONGEST_SLUG:
        return words
    checksum = f"{zlib.crc32(words.encode()):08x}"
    return f"{words[: LONGEST_SLUG - len(checksum) - 1].rstrip('-')}-{checksum}"
