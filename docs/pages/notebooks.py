"""Owns notebooks of the documentation: runs one when the pages are built, and makes a page of its cells and outputs.

Notebooks are stored without outputs. They run in this process, without Jupyter, so cells hold plain Python only.
"""

from __future__ import annotations

import ast
import contextlib
import html
import io
import json
from pathlib import Path
from typing import Any

Pictures = dict[str, bytes]


def render(path: Path) -> tuple[str, Pictures]:
    """The page of a notebook, in Markdown, and the pictures that its figures became, by their names beside the page.

    Raises whatever a cell raises.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    names: dict[str, Any] = {"__name__": "__main__"}
    page, pictures = [], Pictures()
    for number, cell in enumerate(json.loads(path.read_text(encoding="utf-8"))["cells"]):
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            page.append(source)
        elif cell["cell_type"] == "code":
            page.append(f"```python\n{source}\n```")
            printed, value = _run(source, names, f"{path.name}, cell {number}")
            page += [f"```text\n{printed.rstrip()}\n```"] if printed.strip() else []
            page += [_shown(value)] if value is not None else []
            for name, picture in _figures(f"{path.stem}-{number}"):
                pictures[name] = picture
                page.append(f"![Figure of the cell above]({name})")
    return "\n\n".join(page) + "\n", pictures


def _run(source: str, names: dict[str, Any], title: str) -> tuple[str, Any]:
    """Run a cell: what it printed, and the value of the expression in its last line, None where a semicolon ends it."""
    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(tree, title, "exec"), names)
        value = eval(compile(ast.Expression(last.value), title, "eval"), names) if isinstance(last, ast.Expr) else None
    return out.getvalue(), None if source.rstrip().endswith(";") else value


def _shown(value: Any) -> str:
    """A value as a notebook shows it."""
    if hasattr(value, "_repr_html_"):
        return f'<div class="output" markdown="0">\n{value._repr_html_()}\n</div>'
    return f"<pre>{html.escape(repr(value))}</pre>"


def _figures(stem: str) -> list[tuple[str, bytes]]:
    """Open figures of pyplot as PNG, which are closed."""
    import matplotlib.pyplot as plt

    found = []
    for number in plt.get_fignums():
        data = io.BytesIO()
        plt.figure(number).savefig(data, dpi=120)
        found.append((f"{stem}-{number}.png", data.getvalue()))
    plt.close("all")
    return found
