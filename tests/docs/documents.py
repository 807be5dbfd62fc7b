"""Reads our Markdown pages: their code blocks in order, with the marks that stand before them."""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
_BLOCK = re.compile(r"(?:^<!-- (?P<mark>[^>]*) -->\n+)?^```(?P<kind>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A code block: `mark` is the comment before it ("slow", "fails", "file: NAME"), `line` where it begins."""

    kind: str
    text: str
    mark: str
    line: int


def blocks(page: Path) -> list[Block]:
    """All code blocks of a page."""
    text = page.read_text(encoding="utf-8")
    found = _BLOCK.finditer(text)
    return [Block(m["kind"], m["text"], m["mark"] or "", text[: m.start()].count("\n") + 1) for m in found]
