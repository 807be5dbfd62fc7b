"""Lines of code of each room, and the difference to the branch `main`, as far as git knows it.

python -m tests.rooms
"""

import subprocess
import sys
from pathlib import Path

from tests.sources import ROOT, code_lines, modules
from tests.test_structure import BASE


def on_main(room: str) -> int | None:
    """Lines of code of a room on the branch `main`; None without it."""
    listed = git("ls-tree", "-r", "--name-only", "main", room)
    if listed is None:
        return None
    texts = (git("show", f"main:{path}") for path in listed.split() if Path(path).suffix == ".py")
    return sum(code_lines(text) for text in texts if text is not None)


def git(*words: str) -> str | None:
    """Output of a command of git in the project's folder; None where it fails."""
    ended = subprocess.run(("git", *words), cwd=ROOT, capture_output=True, text=True, check=False)
    return ended.stdout if ended.returncode == 0 else None


if __name__ == "__main__":
    for room in BASE:
        lines, old = sum(map(code_lines, modules(room).values())), on_main(room)
        sys.stdout.write(f"{room:24} {lines:6}" + ("\n" if old in (None, lines) else f"  {lines - old:+}\n"))
