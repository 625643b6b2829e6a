"""Owns pages of HTML in one file, without network: tables, pictures as data URIs, figures with their exact values."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

from warp_mca.results.figure_style import engineering

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #222; background: #fff }
body { max-width: 62em; margin: 2em auto; padding: 0 1em }
h1 { font-size: 1.6em; margin-bottom: 0.2em }
h2 { font-size: 1.15em; margin: 1.8em 0 0.5em; border-bottom: 1px solid #ccc }
table { border-collapse: collapse; font-variant-numeric: tabular-nums }
.wide { overflow-x: auto; margin-bottom: 1em }
th, td { text-align: left; padding: 0.2em 1.2em 0.2em 0; vertical-align: top; border-bottom: 1px solid #e6e6e6 }
th { font-weight: 600; color: #555 }
img, video { max-width: 100%; max-height: 34em }
figure { margin: 0 0 1.2em }
figcaption { color: #555 }
td data { white-space: nowrap }
.met { color: #00674a; font-weight: 600 }
.unmet { color: #b03a00; font-weight: 600 }
.verdict, .warning { padding: 0.5em 0.9em; border-left: 5px solid; background: #f5f5f5 }
.warning { border-color: #e69f00 }
""".strip()
MEDIA = {".png": "image/png", ".gif": "image/gif", ".mp4": "video/mp4"}
FIXED = {"Pa": (1e-6, "MPa"), "m": (1e3, "mm"), "m/s^2": (1.0, "m/s²"), "share": (1e2, "%")}
SCALED = ("s", "N", "N m", "N s", "J")  # brought to a number of few digits


class Image(NamedTuple):
    """A picture or film.

    Attributes:
        caption: below it.
        suffix: of its kind of file, a key of `MEDIA`.
        data: of that file.
    """

    caption: str
    suffix: str
    data: bytes


def page(title: str, parts: Iterable[str]) -> str:
    """A whole page with these parts of its body."""
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{escape(title)}</title>'
    body = "\n".join(part for part in parts if part)
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}<style>{STYLE}</style></head><body>\n{body}\n</body></html>\n'


def section(title: str, *parts: str) -> str:
    """A heading with what is below it; "" where nothing is."""
    below = "\n".join(part for part in parts if part)
    return f"<h2>{escape(title)}</h2>\n{below}" if below else ""


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Rows of cells of HTML below their headings, without columns in which no row has anything; "" without rows."""
    kept = [k for k in range(len(headings)) if any(row[k] for row in rows)]
    if not kept:
        return ""
    head = "".join(f"<th>{escape(headings[k])}</th>" for k in kept)
    body = "\n".join(f"<tr>{''.join(f'<td>{row[k]}</td>' for k in kept)}</tr>" for row in rows)
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></div>'


def image(shown: Image) -> str:
    """A picture or film with its caption."""
    source = f"data:{MEDIA[shown.suffix]};base64,{base64.b64encode(shown.data).decode()}"
    caption = escape(shown.caption)
    if shown.suffix == ".mp4":
        media = f'<video controls loop muted src="{source}"></video>'
    else:
        media = f'<img alt="{caption}" src="{source}">'
    return f"<figure>{media}<figcaption>{caption}</figcaption></figure>"


class Figures:
    """Figures of a summary as HTML: a text to read, with the key in the summary and the exact value in the markup."""

    def __init__(self, summary: Mapping[str, Any]) -> None:
        self.summary = summary

    def get(self, *key: str | int) -> Any:
        """What the summary has under keys and indices that follow each other; None where it has not."""
        found: Any = self.summary
        for part in key:
            if isinstance(found, list | tuple):
                found = found[part] if isinstance(part, int) and part < len(found) else None
            else:
                found = found.get(part) if isinstance(found, Mapping) else None
        return found

    def cell(self, *key: str | int, unit: str = "", empty: str = "") -> str:
        """The figure under `key`, in `unit`, as a `data` element; `empty` where the summary has none or null."""
        value = self.get(*key)
        if value is None:
            return empty
        exact = escape(json.dumps(value, default=lambda item: item.tolist()))
        name = escape(json.dumps(key))
        return f'<data data-key="{name}" value="{exact}">{escape(said(value, unit))}</data>'


def said(value: Any, unit: str = "") -> str:
    """A figure as one reads it: `107.1 MPa`, `(1.875, 4.375, 0) mm`, `yes`.

    Args:
        value: number, list of numbers, text, True or False.
        unit: of the summary; "share" for shares that are shown in percent.
    """
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    numbers = [float(item) for item in value] if isinstance(value, list | tuple) else [float(value)]
    scale, shown = FIXED.get(unit, (1.0, unit))
    if unit in SCALED:
        scale, shown = engineering(max((abs(x) for x in numbers), default=0.0), unit)
    if not unit and isinstance(value, int):
        return f"{value:,}"
    texts = [f"{scale * x + 0.0:.4g}" for x in numbers]  # 0 without a sign
    text = f"({', '.join(texts)})" if isinstance(value, list | tuple) else texts[0]
    return f"{text} {shown}".strip()
