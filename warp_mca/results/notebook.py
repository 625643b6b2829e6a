"""Owns how a result looks in a notebook: its headline numbers, its warnings and the figure of its forces."""

from __future__ import annotations

import base64
import io
from html import escape
from typing import TYPE_CHECKING

from warp_mca.results.headlines import headlines

if TYPE_CHECKING:
    from warp_mca.results.result import Result

DOTS_PER_INCH = 110


def result_html(result: Result) -> str:
    """A table of what the command line prints after a run, warnings, and forces.png inline."""
    rows = "".join(
        f"<tr><th style='text-align:left'>{escape(label)}</th><td style='text-align:left'>{escape(text)}</td></tr>"
        for label, text in headlines(result.summary)
    )
    warnings = "".join(f"<p><b>warning:</b> {escape(sentence)}</p>" for sentence in result.warnings)
    picture = base64.b64encode(_forces(result)).decode()
    image = f"<img alt='contact forces and velocities' style='max-width:100%' src='data:image/png;base64,{picture}'/>"
    return f"<p><b>{escape(str(result.summary['scene']))}</b></p><table>{rows}</table>{warnings}{image}"


def _forces(result: Result) -> bytes:
    """The figure of forces.png as a PNG; of many impacts the first."""
    from warp_mca.results.force_figure import plot_forces

    stream = io.BytesIO()
    figure = plot_forces(result.impact() if result.summary.get("touched", True) else result)
    figure.savefig(stream, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    return stream.getvalue()
