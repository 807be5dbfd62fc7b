"""Mutants: small defects drawn in the product, and how many of them the tests catch; prints JSON.

    python -m tests.benchmarks.mutants draw mutants.json [--seed 65] [--count 60]
    python -m tests.benchmarks.mutants probe mutants.json --tree COPY
    python -m tests.benchmarks.mutants run mutants.json --tree COPY [--only 3,17]

A mutant turns a comparison, changes a constant, empties a branch or swaps two arguments. `probe` runs the whole suite
once in a copy of the tree (with a `.venv` of its own), with a probe before each place, and stores which tests come by.
`run` applies each mutant to the copy, and runs these tests, the fastest first, until one fails. Places that a probe
cannot stand before (values of a module or class, compiled kernels) are tried with all tests, those of the mirrored
folder first.
"""

import ast
import json
import os
import random
import re
import signal
import subprocess
from collections import defaultdict
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from tests.benchmarks.harness import command, show
from tests.sources import PLUGINS

HERE = Path.cwd()
PACKAGES = ("executive", "skills", "plant")
TURNED = {ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
          ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In}  # fmt: skip
KINDS = ("comparison", "constant", "branch", "arguments")
PROBE = """
import os
_seen = set()
def hit(number):
    test = os.environ.get("PYTEST_CURRENT_TEST", "").rsplit(" ", 1)[0]
    if (number, test) not in _seen:
        _seen.add((number, test))
        with open(os.environ["ERRAND_PROBES"], "a") as file:
            file.write(f"{number}\\t{test}\\n")
"""
LIMIT_S = 900.0
"""Time limit of a group of tests (s); a mutant that hangs is caught."""
GROUP = 300
"""Tests that run together."""


@dataclass(frozen=True)
class Mutant:
    """A defect: the text between two offsets (bytes) of a file is replaced; `line` begins the statement around it."""

    number: int
    kind: str
    path: str
    line: int
    begin: int
    end: int
    old: str
    new: str
    probed: bool
    tests: tuple[str, ...] = ()

    def apply(self, tree):
        """Write the defect into the tree; the file's text as it was."""
        file = tree / self.path
        text = file.read_bytes()
        assert text[self.begin : self.end].decode() == self.old, f"{self.path}:{self.line} is another"
        file.write_bytes(text[: self.begin] + self.new.encode() + text[self.end :])
        return text.decode()


def mutants_of(path, root):
    """All defects that can be made in a module."""
    source = path.read_bytes()
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    for statement, probed in statements(ast.parse(source), probed=False):
        for kind, node, new in changes(statement):
            first, last = (node[0], node[-1]) if isinstance(node, list) else (node, node)
            begin, end = starts[first.lineno - 1] + first.col_offset, starts[last.end_lineno - 1] + last.end_col_offset
            place = str(path.relative_to(root)), statement.lineno, begin, end, source[begin:end].decode()
            yield Mutant(0, kind, *place, new, probed)


def statements(parent, *, probed):
    """Statements that may hold a defect, and whether a probe may stand before them."""
    for name in ("body", "orelse", "finalbody", "handlers", "cases"):
        for child in getattr(parent, name, ()):
            if isinstance(child, ast.FunctionDef):
                compiled = any("compiled" in ast.unparse(each) for each in child.decorator_list)
                yield from statements(child, probed=not compiled)
            elif not isinstance(child, ast.Import | ast.ImportFrom):
                if isinstance(child, ast.stmt) and not isinstance(child, ast.ClassDef):
                    yield child, probed and not (isinstance(parent, ast.If) and name == "orelse")  # perhaps an elif
                yield from statements(child, probed=probed)


def changes(statement):
    """Changes of a statement without those in its body: kind, what is replaced, and by what."""
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        return
    if isinstance(statement, ast.If) and not isinstance(statement.body[0], ast.Pass | ast.Import | ast.ImportFrom):
        yield "branch", statement.body, "pass"
    for node in expressions(statement):
        if isinstance(node, ast.Compare) and (turned := TURNED.get(type(node.ops[0]))):
            other = ast.Compare(node.left, [turned(), *node.ops[1:]], node.comparators)
            yield "comparison", node, f"({ast.unparse(other)})"
        elif isinstance(node, ast.Constant) and isinstance(node.value, bool | int | float):
            yield "constant", node, str(not node.value if isinstance(node.value, bool) else node.value + 1)
        elif isinstance(node, ast.Call) and len(node.args) > 1:
            first, second, *more = node.args
            starred = any(isinstance(each, ast.Starred) for each in node.args)
            if not starred and ast.unparse(first) != ast.unparse(second):
                yield "arguments", node, ast.unparse(ast.Call(node.func, [second, first, *more], node.keywords))


def expressions(node):
    """Expressions in a statement, without those of statements in it and without annotations and formatted texts."""
    for name, value in ast.iter_fields(node):
        if name in ("body", "orelse", "finalbody", "handlers", "annotation", "cases"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.expr | ast.keyword | ast.comprehension | ast.withitem) and not isinstance(
                child, ast.JoinedStr
            ):
                yield child
                yield from expressions(child)


def drawn_mutants(root, seed, count):
    """Draws as many of each kind, each in another module."""
    rng = random.Random(seed)
    found = [mutant for package in PACKAGES for path in sorted((root / package).rglob("*.py"))
             for mutant in mutants_of(path, root)]  # fmt: skip
    rng.shuffle(found)
    drawn = []
    for mutant in found:
        of_kind = sum(each.kind == mutant.kind for each in drawn)
        if of_kind * len(KINDS) < count and all(each.path != mutant.path for each in drawn):
            drawn.append(replace(mutant, number=len(drawn)))
    return drawn[:count]


def with_tests(tree, drawn):
    """Runs the suite with probes; the mutants with the tests that come by their places."""
    hits = tree / "probes.txt"
    hits.write_text("")
    (site,) = (tree / ".venv").glob("lib/python*/site-packages")
    (site / "errand_probe.py").write_text(PROBE)
    before = {each.path: (tree / each.path).read_text() for each in drawn}
    for each in (each for each in drawn if each.probed):
        lines = before[each.path].splitlines(keepends=True)
        statement = lines[each.line - 1]
        indent = statement[: len(statement) - len(statement.lstrip())]
        lines[each.line - 1] = f"{indent}__import__('errand_probe').hit({each.number})\n{statement}"
        (tree / each.path).write_text("".join(lines))
    try:
        suite(tree, ("-n3", "--dist", "worksteal", "-q"), 3600.0, ERRAND_PROBES=str(hits))
    finally:
        for path, text in before.items():
            (tree / path).write_text(text)
    tests = defaultdict(set)
    for line in hits.read_text().splitlines():
        number, _, test = line.partition("\t")
        tests[int(number)].add(test)
    return [replace(each, tests=tuple(sorted(tests[each.number] - {""}))) for each in drawn]


def suite(tree, arguments, limit_s, **environment):
    """Runs tests in the tree: the first that fails, or the end of what they print where they break off, or nothing."""
    command = [str(tree / ".venv/bin/python"), "-m", "pytest", "--ignore-glob=*_benchmarks.py", *arguments]
    path = f"{tree / '.venv/bin'}:{os.environ['PATH']}"
    with subprocess.Popen(
        command, cwd=tree, env={**os.environ, **environment, "PATH": path, "PYTHONPATH": ""}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
    ) as process:  # fmt: skip
        try:
            printed = process.communicate(timeout=limit_s)[0]
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return "a time-out"
    failed = re.search(r"^(?:FAILED|ERROR) (.*)", printed, re.MULTILINE)
    return failed[1] if failed else printed[-300:] * (process.returncode != 0)


def caught(tree, mutant, seconds):
    """Applies a mutant and runs its tests, those of the mirrored folder and then the fastest first: who catches it."""
    mirrored = f"tests/{Path(mutant.path).parent}/"
    known = [test for test in mutant.tests if test in seconds]
    order = sorted(known, key=lambda test: (not test.startswith(mirrored), seconds[test]))
    folder = next(each for each in (tree / mirrored, *(tree / mirrored).parents) if each.is_dir())
    groups = [order[first : first + GROUP] for first in range(0, len(order), GROUP)]
    every = ["tests", *(f"{Path(package).parent}/tests" for package in PLUGINS)]
    for group in groups if mutant.probed else [[str(folder)], every]:
        listed = tree / "selected.txt"
        listed.write_text("\n".join(group))
        before = mutant.apply(tree)
        try:
            found = suite(tree, ("-x", "-n2", "--dist", "worksteal", f"@{listed}"), LIMIT_S)
        finally:
            (tree / mutant.path).write_text(before)
        if found:
            return found
    return ""


def read(file):
    return [Mutant(**each) for each in json.loads(file.read_text())["mutants"]]


def draw(file: Path, seed: int = 65, count: int = 60, tree: Path = HERE):
    """Draws mutants of a tree into a file."""
    file.write_text(json.dumps({"mutants": [asdict(each) for each in drawn_mutants(tree, seed, count)]}, indent=1))


def probe(file: Path, tree: Path = HERE):
    """Adds the tests that come by the places of a file's mutants."""
    file.write_text(json.dumps({"mutants": [asdict(each) for each in with_tests(tree, read(file))]}, indent=1))


def run(file: Path, tree: Path = HERE, only: tuple[int, ...] = ()):
    """Runs the tests of a file's mutants, of all or of some."""
    durations = json.loads((tree / "out/tests/durations.json").read_text())
    seconds = {each["name"]: each["seconds"] for each in durations["tests"]}
    for each in read(file):
        if not only or each.number in only:
            place = f"{each.path}:{each.line}"
            by = caught(tree, each, seconds)
            show({"number": each.number, "place": place, "kind": each.kind, "caught_by": by})


if __name__ == "__main__":
    command(draw, probe, run)
