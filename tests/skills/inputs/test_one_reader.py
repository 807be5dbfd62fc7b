"""The YAML reader is the only one."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[3]
LOADING = ("load", "safe_load", "full_load", "unsafe_load", "load_all", "compose", "parse", "scan")
ELSEWHERE = {
    "executive/language/lexicon.py": "tables of words, among them 'on' and 'no'",
    "executive/mission/parameters.py": "a value of one line",
}


def calls(source):
    """Reading functions of PyYAML that a source calls."""
    for node in ast.walk(ast.parse(source)):
        called = node.func if isinstance(node, ast.Call) else None
        if isinstance(called, ast.Attribute) and isinstance(called.value, ast.Name) and called.value.id == "yaml":
            yield from (called.attr for name in LOADING if called.attr == name)


def test_no_module_reads_yaml_by_itself():
    files = [file for package in ("executive", "plant", "skills") for file in (ROOT / package).rglob("*.py")]
    texts = {str(file.relative_to(ROOT)): file.read_text(encoding="utf-8") for file in files}
    named = {name: text for name, text in texts.items() if "yaml." in text and not name.startswith("skills/inputs/")}
    alone = {name for name, text in named.items() if list(calls(text))}
    assert alone and alone <= set(ELSEWHERE)


def test_a_module_that_reads_yaml_by_itself_is_found():
    assert list(calls("import yaml\nyaml.safe_load('a')\nyaml.safe_dump({})")) == ["safe_load"]
