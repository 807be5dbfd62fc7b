"""Hooks of MkDocs: each notebook becomes a page of the site, and no page loads anything from elsewhere."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

_LINK = re.compile(r"\.ipynb\)")
_LOADED = re.compile(r"""<(?:script|img|iframe)[^>]*\ssrc=["']?https?:[^>]*>|<link[^>]*\shref=["']?https?:[^>]*>""")


def on_files(files: Files, config: Any) -> Files:
    """Add a page for each notebook."""
    for path in sorted(Path(config["docs_dir"]).rglob("*.ipynb")):
        name = path.relative_to(config["docs_dir"]).with_suffix(".md")
        files.append(File.generated(config, str(name), content=page_of(json.loads(path.read_text(encoding="utf-8")))))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Let links to notebooks lead to their pages."""
    return _LINK.sub(".md)", markdown)


def on_post_page(output: str, page: Any, **_: Any) -> str:
    """Refuse a page that needs the network to be shown."""
    found = _LOADED.search(output)
    if found:
        raise PluginError(f"{page.file.src_uri} loads {found[0]}")
    return output


def page_of(notebook: dict[str, Any]) -> str:
    """A notebook as Markdown."""
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
