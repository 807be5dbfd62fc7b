"""What the pages name is there: tests, files, links, commands and their options."""

import ast
import re
import subprocess
import sys

import pytest
import yaml

import executive
from tests.docs.documents import DOCS, PAGES, PLUGIN_PAGES, ROOT, blocks, commands, links, unknown_command
from tests.docs.reference import PAGES as REFERENCE

MADE = {DOCS / "reference" / name: text for name, text in REFERENCE.items()}
"""Text of each page that is made, by the place that links name."""
_TEST = re.compile(r"`((?:plugins/[\w-]+/)?tests/[\w/.]+\.py)(?:::(\w+)(?:\[([^\]]+)\])?)?`")
_FILE = re.compile(r"`((?:executive|skills|plant|plugins|missions|docs)/[\w/.-]+\.(?:py|yaml|json|md))`")
_ERRAND = re.compile(r"`(errand [^`]+)`")


def page_id(page):
    return str(page.relative_to(ROOT))


def names_in(path):
    return {node.name for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.FunctionDef)}


def text_of(page):
    return MADE[page] if page in MADE else page.read_text(encoding="utf-8")


def anchors(page):
    headings = re.findall(r"^#+ (.*)$", text_of(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def missing_tests(text):
    """The tests that a text names, with a row of their table or without, and that are not there."""
    for file, name, row in _TEST.findall(text):
        path = ROOT / file
        if not path.is_file() or (name and name not in names_in(path)):
            yield f"{file}::{name}"
        elif row and not any(row in each.read_text() for each in (path, *path.parent.glob("*.yaml"))):
            yield f"{file}::{name}[{row}]"


def broken_links(page):
    for target, anchor in links(text_of(page)):
        there = (page.parent / target).resolve() if target else page
        if not (there in MADE or there.is_file()) or (anchor and anchor[1:] not in anchors(there)):
            yield f"{target}{anchor}"


@pytest.mark.parametrize("page", [*PAGES, *MADE], ids=page_id)
def test_every_test_link_and_file_of_a_page_exists(page):
    text = text_of(page)
    missing = {
        "tests": list(missing_tests(text)),
        "links": list(broken_links(page)),
        "files": [name for name in _FILE.findall(text) if not (ROOT / name).is_file()],
    }
    assert missing == {"tests": [], "links": [], "files": []}


def test_every_command_and_option_of_the_pages_exists():
    shown = {page_id(page): commands(page) + _ERRAND.findall(text_of(page)) for page in PAGES}
    assert [(page, fault) for page, lines in shown.items() for line in lines if (fault := unknown_command(line))] == []


def test_the_named_poses_of_the_page_on_pictures_are_free_in_the_flat(tmp_path):
    places, steps = (
        yaml.safe_load(each.text) for each in blocks(DOCS / "how-to" / "inspect.md") if each.kind == "yaml"
    )
    mission = {"name": "round", "world": "flat", "knowledge": places, **steps}
    (tmp_path / "round.yaml").write_text(yaml.safe_dump(mission, sort_keys=False), encoding="utf-8")
    assert executive.check(tmp_path / "round.yaml").ok


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
    here, rows = "tests/executive/run/test_endings.py", "test_the_steps_under_always_are_done_on_every_end"
    named = [f"{here}::test_no_such", f"{here}::{rows}[no such row]", f"{here}::{rows}[inner first]"]
    assert list(missing_tests(" ".join(f"`{each}`" for each in named))) == named[:2]
    assert unknown_command("errand fly") == "no command fly"
    assert unknown_command("errand check --fast file.yaml") == "check has no --fast"


def test_every_page_is_reached_from_the_index():
    reached, waiting = set(), [DOCS / "index.md"]
    while waiting:
        page = waiting.pop()
        if page in reached or page.suffix != ".md":
            continue
        reached.add(page)
        waiting += [(page.parent / target).resolve() for target, _ in links(text_of(page)) if target]
    assert {*DOCS.rglob("*.md"), *PLUGIN_PAGES, *MADE} <= reached


def nav_of(entry):
    """All pages that an entry of the site's navigation names."""
    if isinstance(entry, str):
        return {entry}
    return set().union(*map(nav_of, entry.values() if isinstance(entry, dict) else entry))


def test_the_site_has_every_page_and_notebook():
    site = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    pages = [
        str(page.relative_to(DOCS).with_suffix(".md")) for page in (*DOCS.rglob("*.md"), *DOCS.rglob("*.ipynb"), *MADE)
    ]
    assert nav_of(site["nav"]) == {*pages, *(page_id(page) for page in PLUGIN_PAGES)}


def test_the_site_is_built_and_loads_nothing_from_elsewhere(tmp_path):
    """The hook of the site refuses such a page; links and anchors are checked by `strict`."""
    pytest.importorskip("mkdocs.commands.build", reason="needs the extra docs")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path)]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert built.returncode == 0, built.stderr
    assert (tmp_path / "notebooks" / "first_look.html").is_file()
    assert (tmp_path / "reference" / "stack.html").is_file()
