"""Hooks of MkDocs: add the pages of plug-ins, notebooks and the reference; no page loads anything from elsewhere."""

from __future__ import annotations

import json
import posixpath
import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

sys.path.insert(0, str(Path(__file__).resolve().parent))
import figures
from make_reference import pages as reference_pages

ROOT = Path(__file__).resolve().parent.parent
PLUGIN_FILES = "plugins/*/docs/*.*"
"""Pages and pictures of plug-ins; the site has them under the same path."""
_LINK = re.compile(r"\]\((?!https?:|#)([^)#\s]+)(#[^)\s]*)?\)")
_LOADED = re.compile(r"""<(?:script|img|iframe)[^>]*\ssrc=["']?https?:[^>]*>|<link[^>]*\shref=["']?https?:[^>]*>""")


def on_files(files: Files, config: Any) -> Files:
    """Adds a page for each notebook, each page of the reference, and each file of a plug-in's documentation."""
    docs = Path(config["docs_dir"])
    for path in sorted(docs.rglob("*.ipynb")):
        name = path.relative_to(docs).with_suffix(".md")
        files.append(File.generated(config, str(name), content=page_of(json.loads(path.read_text(encoding="utf-8")))))
    for name, text in reference_pages().items():
        files.append(File.generated(config, f"reference/{name}", content=text))
    for path in sorted(ROOT.glob(PLUGIN_FILES)):
        files.append(File.generated(config, str(path.relative_to(ROOT)), abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Any, files: Files, **_: Any) -> str:
    """Puts the quoted figures in, and lets links that lead to a file of the repository lead to its page."""
    try:
        text = figures.quoted(markdown)
    except figures.UnknownFigureError as error:
        raise PluginError(f"{page.file.src_uri}: {error}") from error
    return _LINK.sub(lambda found: f"]({_site_target(found[1], page.file.src_uri, files)}{found[2] or ''})", text)


def _site_target(target: str, source: str, files: Files) -> str:
    """Returns a link's target, relative to the source page, as the site has it."""
    folder = posixpath.dirname(_repository_path(source))
    there = posixpath.normpath(posixpath.join(folder, re.sub(r"\.ipynb$", ".md", target)))
    uri = there.removeprefix("docs/")
    known = files.get_file_from_path(uri) is not None and _repository_path(uri) == there
    return posixpath.relpath(uri, posixpath.dirname(source)) if known else target


def _repository_path(uri: str) -> str:
    return uri if uri.startswith("plugins/") else f"docs/{uri}"


def on_post_page(output: str, page: Any, **_: Any) -> str:
    """Refuses a page that needs the network to be shown."""
    found = _LOADED.search(output)
    if found:
        raise PluginError(f"{page.file.src_uri} loads {found[0]}")
    return output


def page_of(notebook: dict[str, Any]) -> str:
    """Returns a notebook as Markdown."""
    return "\n\n".join(part for cell in notebook["cells"] for part in _parts(cell)) + "\n"


def _parts(cell: dict[str, Any]) -> list[str]:
    source = "".join(cell["source"])
    if cell["cell_type"] != "code":
        return [source]
    return [f"```python\n{source}\n```", *map(_shown, cell["outputs"])]


def _shown(output: dict[str, Any]) -> str:
    if "text" in output:
        return f"```text\n{''.join(output['text'])}```"
    data = output["data"]
    if "text/html" in data:
        return f'<div class="result">{"".join(data["text/html"])}</div>'
    return f'<img alt="figure" src="data:image/png;base64,{data["image/png"].strip()}">'
