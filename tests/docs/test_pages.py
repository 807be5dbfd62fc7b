"""What the pages name is there: tests, files, links, commands and their options."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

sys.path.insert(0, str(Path(__file__).parent))
from documents import DOCS, ROOT, commands, links, unknown_command

PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
_TEST = re.compile(r"`(tests/[\w/.]+\.py)(?:::(\w+))?`")
_FILE = re.compile(r"`((?:executive|skills|plant|training|missions|docs)/[\w/.]+\.(?:py|yaml|json|md))`")
_ERRAND = re.compile(r"`(errand [^`]+)`")


def page_id(page):
    return str(page.relative_to(ROOT))


def names_in(path):
    return {node.name for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.FunctionDef)}


def anchors(page):
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def missing_tests(text):
    """The tests that a text names and that are not there."""
    for file, name in _TEST.findall(text):
        path = ROOT / file
        if not path.is_file() or (name and name not in names_in(path)):
            yield f"{file}::{name}"


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_every_test_that_a_page_names_exists(page):
    assert list(missing_tests(page.read_text())) == []


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_every_link_leads_somewhere(page):
    for target, anchor in links(page):
        there = (page.parent / target).resolve() if target else page
        assert there.is_file(), target
        assert not anchor or anchor[1:] in anchors(there), f"{target}{anchor}"


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_every_file_that_a_page_names_exists(page):
    named = [name for name in _FILE.findall(page.read_text()) if not (ROOT / name).is_file()]
    assert named == []


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_every_command_that_a_page_shows_exists(page):
    shown = commands(page) + _ERRAND.findall(page.read_text())
    assert [fault for line in shown if (fault := unknown_command(line))] == []


def test_every_rule_has_a_test():
    rows = [line for line in (DOCS / "semantics.md").read_text().splitlines() if line.startswith("| ")]
    rules = [row for row in rows if not row.startswith("| rule ")]
    assert len(rules) > 40
    assert [row for row in rules if not _TEST.search(row)] == []


def test_all_fourteen_points_have_a_test():
    parts = re.split(r"^## (\d+)\. ", (DOCS / "better.md").read_text(), flags=re.MULTILINE)
    assert parts[1::2] == [str(n) for n in range(1, 15)]
    assert [number for number, text in zip(parts[1::2], parts[2::2], strict=True) if not _TEST.search(text)] == []


def test_a_missing_target_is_noticed():
    assert list(missing_tests("`tests/docs/test_pages.py::test_no_such`")) == ["tests/docs/test_pages.py::test_no_such"]
    assert unknown_command("errand fly") == "no command fly"
    assert unknown_command("errand check --fast file.yaml") == "check has no --fast"


def test_every_page_is_reached_from_the_index():
    reached, waiting = set(), [DOCS / "index.md"]
    while waiting:
        page = waiting.pop()
        if page in reached or page.suffix != ".md":
            continue
        reached.add(page)
        waiting += [(page.parent / target).resolve() for target, _ in links(page) if target]
    assert set(DOCS.rglob("*.md")) <= reached


def nav_of(entry):
    """All pages that an entry of the site's navigation names."""
    if isinstance(entry, str):
        return {entry}
    return set().union(*map(nav_of, entry.values() if isinstance(entry, dict) else entry))


def test_the_site_has_every_page_and_notebook():
    site = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    pages = [*DOCS.rglob("*.md"), *DOCS.rglob("*.ipynb")]
    assert nav_of(site["nav"]) == {str(page.relative_to(DOCS).with_suffix(".md")) for page in pages}


def test_the_site_is_built_and_loads_nothing_from_elsewhere(tmp_path):
    """The hook of the site refuses such a page; links and anchors are checked by `strict`."""
    pytest.importorskip("mkdocs.commands.build", reason="needs the extra docs")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path)]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert built.returncode == 0, built.stderr
    assert (tmp_path / "notebooks" / "first_look.html").is_file()
