"""Owns what the command line shows: tables of scenes and mesh quality, a run's summary."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.table import Table

from warp_mca.base.console import console
from warp_mca.results.headlines import headlines

if TYPE_CHECKING:
    from warp_mca.phases.quality import Quality
    from warp_mca.results.result import Result
    from warp_mca.scene.catalogue import SceneSource


def print_scenes(sources: Sequence[SceneSource]) -> None:
    """Each scene with its presets, and unit, default and range of every parameter."""
    out = console()
    for source in sources:
        out.print(f"\n{source.name}: {source.description}", style="bold")
        for name, values in source.presets.items():
            default = " (default)" if name == source.default_preset else ""
            out.print(f"  preset {name}{default}: {', '.join(f'{k}={_text(v)}' for k, v in values.items()) or '-'}")
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for heading in ("parameter", "default", "unit", "range", "meaning"):
            table.add_column(heading, overflow="fold")
        defaults = source.resolve()
        for name, parameter in source.parameters.items():
            param = parameter.param
            table.add_row(name, _text(defaults[name]), param.unit, param.range or "any", param.description)
        out.print(table)


def print_quality(quality: Quality) -> None:
    """Size and shape of each body's mesh, and the element that sets the stable step."""
    out = console()
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("body")
    for heading in ("elements", "nodes", "min scaled Jacobian [-]", "shortest edge [mm]"):
        table.add_column(heading, justify="right")
    for row in quality.bodies:
        shape = f"{row.min_scaled_jacobian:.3f}", f"{1e3 * row.min_edge:.3f}"
        table.add_row(row.body, f"{row.elements:,}", f"{row.nodes:,}", *shape)
    total = sum(row.elements for row in quality.bodies), sum(row.nodes for row in quality.bodies)
    table.add_row("total", *(f"{count:,}" for count in total))
    out.print(table)
    place = ", ".join(f"{1e3 * x:.2f}" for x in quality.at)
    out.print(
        f"smallest stable step {quality.stable_dt:.4g} s, set by element {quality.element} of {quality.body} "
        f"at ({place}) mm in its frame"
    )
    for warning in quality.warnings:
        out.print(f"warning: {warning}", soft_wrap=True)


def print_summary(result: Result, files: Sequence[str]) -> None:
    """The main figures of a run, its warnings, and the files written."""
    out = console()
    table = Table.grid(padding=(0, 2, 0, 0))
    for label, text in headlines(result.summary):
        table.add_row(label, text)
    out.print(table)
    for warning in result.warnings:
        out.print(f"warning: {warning}", soft_wrap=True)
    for file in files:
        out.print(f"wrote {file}", soft_wrap=True)


def _text(value: object) -> str:
    return f"{value:.10g}" if isinstance(value, float) else str(value)
