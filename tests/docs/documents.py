"""Reads our Markdown pages: their code blocks in order, with the marks that stand before them, and their commands."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

from executive.cli.entry import COMMANDS, help_lines, plugin_command, shipped_command
from skills.inputs.plugins import OBSERVERS, installed_plugins

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PLUGIN_PAGES = sorted(ROOT.glob("plugins/*/docs/*.md"))
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md")), *PLUGIN_PAGES]
"""All pages that are written by hand."""
_COMMANDS = {name: shipped_command(name) for name in COMMANDS}
_COMMANDS |= {name: plugin_command(name) for name in help_lines() if "." not in name}
for group, short in (name.split(".") for name in help_lines() if "." in name):
    _COMMANDS[group].add_command(plugin_command(f"{group}.{short}"), short)
_BLOCK = re.compile(r"(?:^<!-- (?P<mark>[^>]*) -->\n+)?^```(?P<kind>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"\]\((?!https?:)([^)#]*)(#[^)]*)?\)")


@dataclass(frozen=True)
class Block:
    """A code block: `mark` is the comment before it ("slow", "fails", "file: NAME"), `line` where it begins."""

    kind: str
    text: str
    mark: str
    line: int


def blocks(page):
    """All code blocks of a page."""
    text = page.read_text(encoding="utf-8")
    found = _BLOCK.finditer(text)
    return [Block(m["kind"], m["text"], m["mark"] or "", text[: m.start()].count("\n") + 1) for m in found]


def commands(page):
    """The lines of a page's shell blocks that call `errand`."""
    lines = [line for block in blocks(page) if block.kind == "sh" for line in block.text.splitlines()]
    return [line for line in lines if line.startswith("errand ")]


def links(text):
    """The links of a page's text that stay with us: file and anchor, each empty when it is not said."""
    return _LINK.findall(text)


def unknown_command(line):
    """What is wrong with a command line of ours, or None."""
    words = shlex.split(line, comments=True)
    if words[1] in ("--version", "--install-completion"):  # of no command
        return None
    if words[1] not in _COMMANDS:
        return f"no command {words[1]}"
    command, rest = _COMMANDS[words[1]], words[2:]
    while rest and rest[0] in getattr(command, "commands", {}):
        command, rest = command.commands[rest[0]], rest[1:]
    if command.context_settings.get("allow_interspersed_args") is False:  # options of a program follow it
        rest = rest[: next((k for k, word in enumerate(rest) if word.endswith(".py")), None)]
    known = {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)}
    known |= {f"--{each.name}" for each in installed_plugins(OBSERVERS)} if "--observe" in known else set()
    return next((f"{command.name} has no {word}" for word in rest if word.startswith("-") and word not in known), None)
