"""Owns performance.md of docs/measurements/: tables and the roofline picture, rendered from what the benchmarks stored.

python -m benchmarks.report                 print the page
python -m benchmarks.report --write         write the page and images/roofline.png beside it
python -m benchmarks.report FILE.json …     of these files in place of performance.*.json
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from benchmarks import knobs, short_runs
from benchmarks.blocks import SIZES
from benchmarks.measurements import FOLDER, measured

TEMPLATE = FOLDER / "performance.template.md"
PICTURE = FOLDER / "images" / "roofline.png"
Data = dict[str, Any]


def stored() -> list[Path]:
    """Files that the page is made of."""
    return sorted(FOLDER.glob("performance.*.json"))


def load(paths: list[Path]) -> tuple[list[Data], list[dict]]:
    """What was measured on each device, and rows of the comparison with other codes."""
    found = [json.loads(path.read_text(encoding="utf-8")) for path in paths]
    return [d for d in found if "device" in d], [row for d in found for row in d.get("peers", [])]


def table(head: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def figure(value: float) -> str:
    """Three digits, with separators above a thousand."""
    if abs(value) >= 100.0:
        return f"{value:,.0f}"
    return f"{value:.1f}" if abs(value) >= 10.0 else f"{value:.2f}"


def title(data: Data) -> str:
    """The device as tables name it."""
    return data["name"] + (", one core" if data["threads"] == 1 else "")


def sections(devices: list[Data], body: Any) -> str:
    """`body` of each device under its name."""
    parts = [(title(data), body(data)) for data in devices]
    return "\n\n".join(f"{name}:\n\n{text}" for name, text in parts if text)


def sizes_of(rows: list[dict]) -> list[str]:
    """Sizes that rows have, smallest first."""
    return sorted({row["size"] for row in rows}, key=lambda size: SIZES.get(size) or int(size))


def rates(data: Data) -> str:
    """A row for each element, precision and size, a column for each case."""
    rows = data.get("rates", []) + data.get("savings", [])
    if not rows:
        return ""
    found: dict[tuple[str, ...], dict[str, str]] = {}
    for r in rows:
        found.setdefault((r["element"], r["precision"], r["size"]), {})[r["case"]] = figure(r["rate"] / 1e6)
    names = list(dict.fromkeys(r["case"] for r in rows))
    lines = [[*kind, *(cells.get(name, "") for name in names)] for kind, cells in found.items()]
    return table(["element", "precision", "elements", *names], lines)


def stages(data: Data) -> str:
    """Microseconds of each stage."""
    rows = data.get("savings", [])
    if not rows:
        return ""
    names = list(rows[0]["stages"])
    head = [f"{'one step' if name == 'step' else name} [µs]" for name in names]
    lines = [
        [r["element"], r["precision"], r["size"], *(figure(1e6 * r["stages"][name]) for name in names)] for r in rows
    ]
    return table(["element", "precision", "elements", *head], lines)


def savings(data: Data) -> str:
    """Percent that leaving out each feature saves."""
    rows = data.get("savings", [])
    if not rows:
        return ""
    names = list(rows[0]["saves"])
    lines = [
        [r["element"], r["precision"], r["size"], *(f"{100 * r['saves'][name]:.1f} %" for name in names)] for r in rows
    ]
    return table(["element", "precision", "elements", *(f"no {name}" for name in names)], lines)


def at_ceiling(data: Data, row: dict) -> dict[str, float]:
    """Operations of an element-step, what is moved and computed each second, and the share of the ceiling."""
    kind = "elastic" if row["case"] == "elastic" else "plastic"
    count = next(
        f
        for f in data["flops"]
        if (f["element"], f["precision"], f["case"]) == (row["element"], row["precision"], kind)
    )
    top = data["ceilings"]
    moving = row["step_bytes_per_element"] / top["bytes"]
    computing = count["f32"] / top["f32"] + count["f64"] / top["f64"]
    return {
        "flop": count["f32"] + count["f64"],
        "flops": (count["f32"] + count["f64"]) * row["rate"],
        "bytes": row["step_bytes_per_element"] * row["rate"],
        "share": max(moving, computing) * row["rate"],
    }


def is_largest(row: dict, rows: list[dict]) -> bool:
    """Whether none of `rows` has more of the same element in the same precision."""
    return row["size"] == sizes_of([q for q in rows if all(q[k] == row[k] for k in ("element", "precision"))])[-1]


def memory(data: Data) -> str:
    """Memory held and moved, operations, and how near the ceilings are, at the largest size they are known for."""
    rows = [r for r in data.get("rates", []) if "bytes_per_element" in r]
    if not rows or "ceilings" not in data or "flops" not in data:
        return ""
    lines = []
    for r in rows:
        if not is_largest(r, rows):
            continue
        at = at_ceiling(data, r)
        words = [r["element"], r["precision"], r["case"], r["size"], figure(r["bytes_per_element"])]
        words += [figure(r["step_bytes_per_element"]), figure(at["flop"]), figure(at["bytes"] / 1e9)]
        lines.append([*words, figure(at["flops"] / 1e9), f"{100 * at['share']:.0f} %"])
    head = ["element", "precision", "case", "elements", "held [B/element]"]
    head += ["moved [B/element-step]", "operations/element-step", "moved [GB/s]", "computed [Gflop/s]", "of ceiling"]
    return table(head, lines)


def ceilings(devices: list[Data]) -> str:
    """What each device does at best."""
    found = [(title(d), d["ceilings"]) for d in devices if "ceilings" in d]
    lines = [[name, *(figure(top[k] / 1e9) for k in ("bytes", "f32", "f64"))] for name, top in found]
    return table(["device", "copy, read and written [GB/s]", "float32 [Gflop/s]", "float64 [Gflop/s]"], lines)


def startup(devices: list[Data]) -> str:
    """Seconds to the first step."""
    found = [(title(d), cache, seconds) for d in devices for cache, seconds in d.get("startup", {}).items()]
    if not found:
        return ""
    lines = [[name, cache, *(f"{value:.2f}" for value in seconds.values())] for name, cache, seconds in found]
    return table(["device", "cache", *found[0][2]], lines)


def short(paths: list[Path]) -> str:
    """Table of short runs, from the file that has them."""
    files = [json.loads(path.read_text(encoding="utf-8")) for path in paths]
    return (
        "\n\n".join(table(short_runs.head(d), short_runs.lines(d)) for d in files if "short" in d)
        or "Not measured yet."
    )


def host(devices: list[Data]) -> str:
    """Microseconds of a step on host and device."""
    keys = {
        "host_graph": "host, graph",
        "step": "step, graph",
        "host_plain": "host, no graph",
        "step_plain": "step, no graph",
    }
    lines = [
        [title(d), f"{r['n_elements']:,}", *(figure(1e6 * r[key]) for key in keys)]
        for d in devices
        for r in d.get("host", [])
    ]
    return table(["device", "elements", *(f"{name} [µs]" for name in keys.values())], lines)


def peers(rows: list[dict]) -> str:
    """Rates and errors of other codes; ours comes first."""
    if not rows:
        return "Not measured yet."
    lines = [
        [
            r["problem"],
            f"{r['code']} {r['version']}",
            r["element"],
            f"{r['n_steps']:,}",
            f"{1e6 * r['dt']:.3f}",
            f"{r['wall']:.2f}",
            figure(r["rate"] / 1e6),
            f"{r['slower']:.1f}",
            f"{100 * r['error']:.2f} %",
        ]
        for r in rows
    ]
    head = [
        "bar",
        "code",
        "element",
        "steps",
        "dt [µs]",
        "time [s]",
        "M element-steps/s",
        "times slower than the first",
    ]
    return table([*head, "error"], lines)


def peers_taylor(rows: list[dict]) -> str:
    """Rates and final shapes of Taylor's bar with other codes; ours comes first."""
    if not rows:
        return "Not measured yet."
    lines = [
        [
            f"{r['code']} {r['version']}",
            r["element"],
            f"{r['wall']:.0f}",
            figure(r["rate"] / 1e6),
            f"{r['slower']:.1f}",
            f"{1e3 * r['length']:.2f}",
            f"{1e3 * r['radius']:.2f}",
        ]
        for r in rows
    ]
    head = ["code", "element", "time [s]", "M element-steps/s", "times slower than the first"]
    return table([*head, "length [mm]", "foot's radius [mm]"], lines)


def render(paths: list[Path]) -> str:
    """The page: its text with tables in place of marks."""
    devices, rows = load(paths)
    errors = [r["force_error"] for d in devices for r in d.get("rates", []) if "force_error" in r]
    names = ("warp_mca", "warp", "numpy", "python", "driver")
    lines = [[title(d), d["device"], *(d["versions"].get(k, "") for k in names)] for d in devices]
    unsound = [r for d in devices for part in ("rates", "savings") for r in d.get(part, []) if not r["sound"]]
    assert not unsound, f"contact search or state failed in {unsound[0]}"
    marks = {
        "measured": "\n".join(f"- `{path.name}`: {measured(path.stem)}" for path in paths if path.parent == FOLDER),
        "devices": table(["device", "name", "warp_mca", "Warp", "NumPy", "Python", "driver"], lines),
        "rates": sections(devices, rates),
        "force_error": f"{max(errors):.0e}" if errors else "not measured",
        "stages": sections(devices, stages),
        "savings": sections(devices, savings),
        "ceilings": ceilings(devices),
        "memory": sections(devices, memory),
        "startup": startup(devices),
        "host": host(devices),
        "short": short(paths),
        "knobs": sections(devices, lambda d: table(knobs.HEAD, knobs.lines(d["knobs"])) if "knobs" in d else ""),
        "peers": peers([r for r in rows if r["problem"] != "taylor"]),
        "peers_taylor": peers_taylor([r for r in rows if r["problem"] == "taylor"]),
    }
    text = TEMPLATE.read_text(encoding="utf-8")
    for name, value in marks.items():
        text = text.replace(f"{{{name}}}", value)
    return text


def roofline(paths: list[Path], target: Path) -> None:
    """The picture: ceilings of each device, and elastic elements at the largest size."""
    from warp_mca.results.figure_style import BLACK, BLUE, GREEN, VERMILION, new_figure, save_png, tidy

    devices = [d for d in load(paths)[0] if {"ceilings", "flops", "rates"} <= set(d)]
    page = new_figure(4.6 * max(1, len(devices)), 3.6)
    colours = {"hex8": BLUE, "hex8r": VERMILION, "tet4": GREEN}
    for k, data in enumerate(devices):
        axes = page.add_subplot(1, len(devices), k + 1)
        top = data["ceilings"]
        x = [1.0, 100.0]
        for name, style in (("f32", "-"), ("f64", "--")):
            ridge = top[name] / top["bytes"]
            line = sorted([x[0], min(max(ridge, x[0]), x[1]), x[1]])
            y = [min(top["bytes"] * value, top[name]) / 1e9 for value in line]
            axes.plot(line, y, style, color=BLACK, linewidth=1.2, label={"f32": "float32", "f64": "float64"}[name])
        elastic = [r for r in data["rates"] if r["case"] == "elastic" and "bytes_per_element" in r]
        for r in elastic:
            if is_largest(r, elastic):
                at = at_ceiling(data, r)
                marker = "o" if r["precision"] == "mixed" else "s"
                label = f"{r['element']} {r['precision']}"
                place = at["flop"] / r["step_bytes_per_element"], at["flops"] / 1e9
                axes.plot(*place, marker, color=colours[r["element"]], label=label, linestyle="none")
        axes.set(xscale="log", yscale="log", xlabel="operations per byte moved", ylabel="Gflop/s")
        axes.set_title(title(data), fontsize=9)
        axes.set_ylim(top["f64"] / 1e9 / 40.0, top["f32"] / 1e9 * 4.0)
        axes.xaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_major_formatter("{x:,g}")
        axes.yaxis.set_minor_formatter("")
        axes.legend(fontsize=7, frameon=False, loc="upper left", ncols=2)
        tidy(axes)
    save_png(page, target)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.report", description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--write", action="store_true", help="write performance.md and images/roofline.png")
    args = parser.parse_args()
    paths = args.files or stored()
    text = render(paths)
    if not args.write:
        print(text, end="")
        return
    (FOLDER / "performance.md").write_text(text, encoding="utf-8")
    roofline(paths, PICTURE)


if __name__ == "__main__":
    main()
