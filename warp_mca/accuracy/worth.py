"""Owns what each knob is worth on a scene and a device, and the tables of a trade-off on the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from warp_mca.accuracy.figures import BOUND, NAMES, errors

if TYPE_CHECKING:
    from rich.table import Table

    from warp_mca.accuracy.measure import Measured
    from warp_mca.accuracy.tradeoff import TradeOff

HEADINGS = {
    "F_n_first_peak": "first peak",
    "impulse": "impulse",
    "contact_duration": "duration",
    "max_plastic_strain": "plastic strain",
    "path_stress": "path stress",
}
UNITS = {
    "F_n_first_peak": "N",
    "impulse": "N s",
    "contact_duration": "s",
    "max_plastic_strain": "",
    "path_stress": "Pa",
}


def worth_of(found: TradeOff, run: Measured) -> dict[str, Any]:
    """How many times faster a variant is than the scene as written, and the share by which it changes each figure."""
    return {
        "times_faster": found.time_of(found.base) / found.time_of(run),
        "change": errors(run.figures, found.base.figures),
    }


def words(knobs: Mapping[str, Any]) -> str:
    """The knobs of a variant in one line."""
    return ", ".join(f"{key}={_value(value)}" for key, value in knobs.items()) or "as written"


def share(value: float | None) -> str:
    """A share as signed percent; a dash where there is none."""
    return "–" if value is None else f"{100.0 * value:+.2f} %" if abs(value) < 0.1 else f"{100.0 * value:+.1f} %"


def reference_lines(contents: Mapping[str, Any]) -> list[str]:
    """What the reference is, a line for each figure; figures without a limit with the reason."""
    reference = contents["reference"]
    meshes = ", ".join(f"{level['elements']:,}" for level in reference["levels"])
    springs = f", contact springs with penalty {reference['penalty']:g}" if _is_number(reference["penalty"]) else ""
    lines = [f"reference: limit of meshes of {meshes} elements, {reference['precision']}{springs}"]
    for name in NAMES:
        value, unit = reference["figures"][name], UNITS[name]
        if value is None:
            lines.append(f"  {HEADINGS[name]}: no limit: {reference['why'][name]}")
            continue
        left, order = reference["left"][name], reference["order"][name]
        known = "" if left is None else f" ± {100.0 * left:.2g} %"
        observed = "" if order is None else f", observed order {order:.1f}"
        lines.append(f"  {HEADINGS[name]}: {value:.5g}{' ' * bool(unit)}{unit}{known}{observed}")
    return lines


def knob_rows(contents: Mapping[str, Any]) -> list[list[str]]:
    """Cells of the table of knobs, one at a time: how many times faster, and what that changes."""
    rows = [row for row in contents["variants"] if row["knob"] not in ("combined", "reference")]
    order = list(dict.fromkeys(row["knob"] for row in rows))
    cells = []
    for row in sorted(rows, key=lambda row: order.index(row["knob"])):
        if row["stopped"]:
            cells.append([row["knob"], words(row["knobs"]), "", "", *[""] * len(NAMES), row["stopped"]])
            continue
        faster = f"{row['times_faster']:.2f}"
        changes = [share(row["change"][name]) for name in NAMES]
        cells.append([row["knob"], words(row["knobs"]), f"{row['elements']:,}", faster, *changes, ""])
    return cells


def frontier_rows(contents: Mapping[str, Any]) -> list[list[str]]:
    """Cells of the table of the frontier: variants that no other beats in time and in the greatest bound error."""
    clock = contents["time"]
    front = [row for row in contents["variants"] if "bound" in row.get("frontier", [])]
    return [
        [
            words(row["knobs"]),
            f"{row['elements']:,}",
            f"{row['steps']:,}",
            f"{row['wall'][clock]:.3g}",
            f"{row['wall']['whole']:.3g}",
            *(share(row["errors"][name]) for name in NAMES),
        ]
        for row in sorted(front, key=lambda row: row["wall"][clock])
    ]


KNOB_HEAD = ["knob", "value", "elements", "times faster", *HEADINGS.values(), ""]
FRONTIER_HEAD = ["variant", "elements", "steps", "steps [s]", "whole [s]", *HEADINGS.values()]


def print_tradeoff(contents: Mapping[str, Any]) -> None:
    """The reference, what each knob is worth, and the frontier."""
    from warp_mca.report.console import console

    out = console()
    bound = ", ".join(HEADINGS[name] for name in BOUND)
    out.print("\n".join(reference_lines(contents)))
    out.print("\nOne knob at a time: times faster than the scene as written, and what that changes in its figures")
    out.print(_table(KNOB_HEAD, knob_rows(contents), left=(0, 1, len(KNOB_HEAD) - 1)))
    out.print(f"\nFrontier: no other variant is both faster and closer to the reference in {bound}; errors")
    out.print(_table(FRONTIER_HEAD, frontier_rows(contents), left=(0,)))
    if contents["left_out"]:
        names = "; ".join(words(row["knobs"]) for row in contents["left_out"])
        out.print(f"\nleft out, for the budget: {names}")


def _table(head: list[str], rows: list[list[str]], left: tuple[int, ...]) -> Table:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for k, heading in enumerate(head):
        table.add_column(heading, justify="left" if k in left else "right")
    for row in rows:
        table.add_row(*row)
    return table


def _value(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float)
