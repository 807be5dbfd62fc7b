"""Where the files of the pages are: HTML, styles and scripts."""

from __future__ import annotations

from pathlib import Path
from typing import Final

__all__ = ["PAGE_FOLDER"]

PAGE_FOLDER: Final = Path(__file__).parent / "page"
