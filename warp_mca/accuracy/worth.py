"""Owns what each knob is worth on a scene and a device, and the tables of a trade-off on the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from warp_mca.accuracy.convergence import LEAST_ORDER, NO_RUN
from warp_mca.accuracy.figures import BOUND, NAMES, errors

if TYPE_CHECKING:
    from rich.table import Table

    from warp_mca.accuracy.findings import TradeOff
    from warp_mca.accuracy.measure import Measured

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
    """What a variant is worth beside the scene as written.

    `times_faster` by the clock, `times_less_work` by counts of element steps, and `change`, the share by which it
    changes each figure [-].
    """
    return {
        "times_faster": found.time_of(found.base) / found.time_of(run),
        "times_less_work": found.base.element_steps / run.element_steps,
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
    springs += " (no time to check that)" if springs and not reference["springs"] else ""
    lines = [f"reference: limit of meshes of {meshes} elements, {reference['precision']}{springs}"]
    for name in NAMES:
        value, unit = reference["figures"][name], UNITS[name]
        if value is None:
            why = reference["why"][name]
            lines.append(f"  {HEADINGS[name]}: {why}" if why == NO_RUN else f"  {HEADINGS[name]}: no limit, {why}")
            continue
        left, order = reference["left"][name], reference["order"][name]
        known = "" if left is None else f" ± {100.0 * left:.2g} %"
        observed = "" if order is None or order < LEAST_ORDER else f", observed order {order:.1f}"
        lines.append(f"  {HEADINGS[name]}: {value:.5g}{' ' * bool(unit)}{unit}{known}{observed}")
    return lines


def present(contents: Mapping[str, Any]) -> list[str]:
    """Figures that runs have."""
    return [name for name in NAMES if contents["reference"]["why"].get(name) != NO_RUN]


def knob_rows(contents: Mapping[str, Any]) -> list[list[str]]:
    """The table of knobs, one at a time: how many times faster and less work, and what that changes. Headings first."""
    names = present(contents)
    found = [["knob", "times faster", "less work", *(HEADINGS[name] for name in names), "value"]]
    rows = [row for row in contents["variants"] if row["knob"] not in ("combined", "reference", "as written")]
    order = list(dict.fromkeys(row["knob"] for row in rows))
    for row in sorted(rows, key=lambda row: order.index(row["knob"])):
        if row["stopped"]:
            found.append([row["knob"], *[""] * (2 + len(names)), f"{words(row['knobs'])}: {row['stopped']}"])
            continue
        ratios = [f"{row[key]:.2f}" for key in ("times_faster", "times_less_work")]
        found.append([row["knob"], *ratios, *(share(row["change"][name]) for name in names), words(row["knobs"])])
    return found


def frontier_rows(contents: Mapping[str, Any]) -> list[list[str]]:
    """The table of variants that no other beats in both time and greatest bound error. Headings first."""
    clock, names = contents["time"], [n for n in present(contents) if contents["reference"]["figures"][n] is not None]
    front = [row for row in contents["variants"] if "bound" in row.get("frontier", []) or row["knob"] == "as written"]
    found = [["steps [s]", "whole [s]", "elements", "steps", *(HEADINGS[name] for name in names), "variant"]]
    for row in sorted(front, key=lambda row: row["wall"][clock]):
        times = [f"{row['wall'][clock]:.3g}", f"{row['wall']['whole']:.3g}"]
        counts = [f"{row['elements']:,}", f"{row['steps']:,}"]
        mark = "" if "bound" in row["frontier"] else " (not on the frontier)"
        found.append([*times, *counts, *(share(row["errors"][name]) for name in names), words(row["knobs"]) + mark])
    return found


def print_tradeoff(contents: Mapping[str, Any]) -> None:
    """The reference, what each knob is worth, and the frontier."""
    from warp_mca.base.console import console

    out = console()
    bound = ", ".join(HEADINGS[name] for name in BOUND)
    out.print("\n" + "\n".join(reference_lines(contents)))
    out.print("\nOne knob at a time: times faster than the scene as written, and what that changes in its figures")
    out.print(_table(knob_rows(contents)))
    out.print(f"\nFrontier: no other variant is both faster and closer to the reference in {bound}; errors")
    out.print(_table(frontier_rows(contents)))
    if contents["same_mesh"]:
        names = "; ".join(f"{words(row['knobs'])} (that of {words(row['as'])})" for row in contents["same_mesh"])
        out.print(f"\nleft out, for the mesh is that of another variant: {names}")
    if contents["left_out"]:
        names = "; ".join(words(row["knobs"]) for row in contents["left_out"])
        out.print(f"\nleft out, for the budget: {names}")


def _table(rows: list[list[str]]) -> Table:
    """The first row is that of headings; texts in the last column are wrapped."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    last = len(rows[0]) - 1
    for k, heading in enumerate(rows[0]):
        text = k in (0, last) and not heading.endswith("]")
        lines = heading if text else heading.replace(" ", "\n")  # narrow columns leave room for the last one
        table.add_column(
            lines, justify="left" if text else "right", no_wrap=k < last, overflow="fold", vertical="bottom"
        )
    for row in rows[1:]:
        table.add_row(*row)
    return table


def _value(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float)
