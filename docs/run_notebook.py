"""Runs the code cells of a notebook in one namespace and stores what they print and draw.

python docs/run_notebook.py          # docs/notebooks/*.ipynb
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parent / "notebooks"
Notebook = dict[str, Any]


def executed(notebook: Notebook) -> Notebook:
    """The notebook with the outputs that come now. A cell that raises, raises."""
    namespace: dict[str, Any] = {"__name__": "notebook"}
    cells, count = [], 0
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            count += 1
            outputs = _run("".join(cell["source"]), f"cell {count}", namespace)
            cell = {**cell, "execution_count": count, "outputs": outputs}
        cells.append(cell)
    return {**notebook, "cells": cells}


def _run(source: str, name: str, namespace: dict[str, Any]) -> list[dict[str, Any]]:
    from matplotlib import pyplot

    pyplot.switch_backend("Agg")
    printed, body = io.StringIO(), ast.parse(source)
    last = body.body.pop() if body.body and isinstance(body.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(printed):
        exec(compile(body, name, "exec"), namespace)
        value = None if last is None else eval(compile(ast.Expression(last.value), name, "eval"), namespace)
    shown = [_shown(value)] if hasattr(value, "_repr_html_") else []
    texts = [{"output_type": "stream", "name": "stdout", "text": printed.getvalue().splitlines(keepends=True)}]
    figures = [_drawn(pyplot.figure(number)) for number in pyplot.get_fignums()]
    pyplot.close("all")
    return [*(texts if printed.getvalue() else []), *figures, *shown]


def _shown(value: Any) -> dict[str, Any]:
    data = {"text/html": value._repr_html_().splitlines(keepends=True), "text/plain": [type(value).__name__]}
    return {"output_type": "execute_result", "execution_count": None, "data": data, "metadata": {}}


def _drawn(figure: Any) -> dict[str, Any]:
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=80, bbox_inches="tight")
    data = {"image/png": base64.b64encode(picture.getvalue()).decode() + "\n", "text/plain": ["<Figure>"]}
    return {"output_type": "display_data", "data": data, "metadata": {}}


def main() -> None:
    """Execute all notebooks in place."""
    for path in sorted(FOLDER.glob("*.ipynb")):
        notebook = executed(json.loads(path.read_text(encoding="utf-8")))
        path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
