"""What the project's modules import, define and document: each source is parsed once in a process."""

import ast
import io
import re
import tokenize
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PRODUCT = ("executive", "skills", "plant")
PLUGINS = tuple(sorted(str(path.parent.relative_to(ROOT)) for path in ROOT.glob("plugins/*/errand_*/__init__.py")))
"""Folders of the packages of plug-ins."""
_LAYOUT = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER),
}


@dataclass(frozen=True)
class Source:
    """Facts about one source.

    `imports` are absolute names, also of imports within functions and for types; relative imports stay inside their
    package. `functions` are names with lines; `docstrings` are the public parts' names with their first lines.
    """

    imports: tuple[str, ...]
    functions: tuple[tuple[str, int], ...]
    docstrings: tuple[tuple[str, str], ...]


@cache
def read(text: str) -> Source:
    """Parses a source as Python 3.11."""
    module = ast.parse(text, feature_version=(3, 11))
    found = list(statements(module))
    functions = [node for node in found if isinstance(node, ast.FunctionDef)]
    documented = ((getattr(node, "name", ""), ast.get_docstring(node)) for node in (module, *public_parts(module)))
    return Source(
        tuple(name for node in found for name in imported(node)),
        tuple((node.name, (node.end_lineno or node.lineno) - node.lineno + 1) for node in functions),
        tuple((name, text.partition("\n")[0]) for name, text in documented if text),
    )


@cache
def code_lines(text: str) -> int:
    """Number of lines with code: no blank lines, comments and docstrings."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    lines = {k for each in tokens if each.type not in _LAYOUT for k in range(each.start[0], each.end[0] + 1)}
    strings = (
        node
        for node in statements(ast.parse(text, feature_version=(3, 11)))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    )
    return len(lines - {k for node in strings for k in range(node.lineno, (node.end_lineno or node.lineno) + 1)})


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """All statements within a node, those within functions included."""
    for block in ("body", "orelse", "finalbody", "handlers", "cases"):
        for each in getattr(node, block, ()):
            yield each
            yield from statements(each)


def imported(node: ast.AST) -> Iterator[str]:
    """The absolute names that a statement imports."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom) and node.level == 0:
        yield from (f"{node.module}.{alias.name}" for alias in node.names)


def public_parts(node: ast.AST) -> Iterator[ast.ClassDef | ast.FunctionDef]:
    """Public classes and functions, and the public methods of these classes."""
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.ClassDef | ast.FunctionDef) and not part.name.startswith("_"):
            yield part
            if isinstance(part, ast.ClassDef):
                yield from public_parts(part)


@cache
def modules(*folders: str) -> Mapping[str, str]:
    """The sources of all modules in some folders by path."""
    paths = [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]
    return {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in paths}


def dotted(path: str) -> str:
    """The dotted name of a module; a package's is that of its folder."""
    path = re.sub(r"^plugins/[^/]+/", "", path)
    return path.removesuffix(".py").replace("/", ".").removesuffix(".__init__")


@cache
def import_graph(*folders: str) -> Mapping[str, frozenset[str]]:
    """The modules in some folders that each of them imports."""
    return graph_of({dotted(path): text for path, text in modules(*folders).items()})


def graph_of(sources: Mapping[str, str]) -> Mapping[str, frozenset[str]]:
    """The modules among `sources` that each of them imports."""
    graph = {}
    for name, text in sources.items():
        wanted = {each if each in sources else each.rpartition(".")[0] for each in read(text).imports}
        graph[name] = frozenset(wanted & sources.keys() - {name})
    return graph
