"""How far each element is from known answers: `python -m benchmarks.elements [ELEMENT ...]`.

Measures the problems of the verification cases of bending, plates, plastic limits and rubber for each element, in
float64, keeps the errors in elements.json of docs/measurements/ and writes elements.md there from its template.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from benchmarks.measurements import FOLDER, measured, note
from warp_mca.base.errors import McaError
from warp_mca.physics.elements import ELEMENTS
from warp_mca.verify import bent, layers, limits, solids
from warp_mca.verify.case import Setup

STORE = FOLDER / "elements.json"
Problem = tuple[str, str, Callable[[Setup], Any]]  # heading of its table, row or rows, what measures them


def moved_plate(count: int, setup: Setup) -> list[float]:
    """Mean and farthest error of the distorted plates [-]."""
    errors = np.array([bent.plate(setup, count, 0.2, seed) for seed in bent.SEEDS])
    return [float(errors.mean()), float(errors[np.abs(errors).argmax()])]


def trapezoids(aspect: int, setup: Setup) -> float:
    """Mean error of three beams of trapezoids [-]."""
    return float(np.mean([bent.beam(setup, 1, aspect, 0.3, 0.1, seed) for seed in bent.SEEDS[:3]]))


def problems() -> Iterator[Problem]:
    """All of them, in the order of the page; rows of one problem are divided by |."""
    for count in (1, 2, 4):
        for nu in (0.0, 0.3, 0.499):
            for aspect in bent.ASPECTS:
                row = f"{count} {'layer' if count == 1 else 'layers'}, ν = {nu:g}, cells {aspect} : 1"
                yield "Cantilever", row, partial(bent.beam, layers=count, nu=nu, aspect=aspect)
    for aspect in bent.ASPECTS:
        yield "Cantilever", f"1 layer, ν = 0.3, cells {aspect} : 1, trapezoids", partial(trapezoids, aspect)
    for count, width in bent.WIDE.items():
        yield "Clamped plate, one layer", f"cells {width} : 1", partial(bent.plate, count=count)
    for count, width in bent.WIDE.items():
        row = f"cells {width} : 1, distorted, mean|cells {width} : 1, distorted, farthest"
        yield "Clamped plate, one layer", row, partial(moved_plate, count)
    for count in (2, 4, 8):
        for nu in solids.COOK:
            row = f"Cook's panel, ν = {nu:.4g}, {count} × {count} cells"
            yield "Solids", row, partial(solids.cook, count=count, nu=nu)
    row = "rubber, ν = 0.4999: energy|rubber: pressure in the middle|rubber: scatter of pressure"
    yield "Solids", row, lambda setup: solids.rubber(setup, solids.edge_cells(setup))
    for count in (1, 2, 4):
        row = f"plastic moment, {count} {'layer' if count == 1 else 'layers'}"
        yield "Plastic limits", row, partial(limits.moment, layers=count)
    for name, what, counts in (("tube", limits.tube, (1, 2, 4)), ("upset cube", limits.upsetting, (2, 4))):
        for count in counts:
            yield "Plastic limits", f"{name}, {count} cells", partial(what, count=count)
    for cells in ((10, 2, 1), (20, 4, 1), (30, 5, 2)):
        row = f"strip under sudden gravity, {cells[0]} × {cells[1]} × {cells[2]} cells"
        yield "Runs", row, partial(layers.strip, cells=cells)
    for count in (1, 2):
        name = f"yielding bar, 25 × 3 × {count} cells"
        yield "Runs", f"{name}: tip|{name}: plastic work", partial(layers.bar, cells=(25, 3, count))


def measure(element: str) -> dict[str, float | None]:
    """Error of an element in each row [-]; None where it finds no answer."""
    setup, found = Setup(precision="float64", element=element), {}
    for _, rows, of in problems():
        names = rows.split("|")
        try:
            values = np.atleast_1d(of(setup)).tolist()
        except McaError:
            values = [None] * len(names)
        found |= dict(zip(names, values, strict=True))
        print(element, rows, ", ".join(shown(value) for value in values), flush=True)
    return found


def shown(error: float | None) -> str:
    """An error as the page shows it."""
    if error is None:
        return "–"
    return (f"{100.0 * error:+.2g}" if abs(error) < 0.095 else f"{100.0 * error:+.0f}").replace("-", "−")


def tables(stored: dict[str, dict[str, float | None]]) -> str:
    """All tables, a column for each element."""
    text, heading = [], ""
    names = [name for name in ELEMENTS if name in stored]
    for title, rows, _ in problems():
        if title != heading:
            text += [
                "",
                f"## {title}",
                "",
                "| error in % | " + " | ".join(names) + " |",
                "|---" * (len(names) + 1) + "|",
            ]
            heading = title
        for row in rows.split("|"):
            text.append(f"| {row} | " + " | ".join(shown(stored[name].get(row)) for name in names) + " |")
    return "\n".join(text[1:])


def render() -> str:
    """The page, of what was stored."""
    page = (FOLDER / "elements.template.md").read_text(encoding="utf-8")
    stored = json.loads(STORE.read_text(encoding="utf-8"))
    return page.replace("{measured}", measured("elements")).replace("{tables}", tables(stored))


def main() -> None:
    """Measure, store and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.elements", description=__doc__.splitlines()[0])
    parser.add_argument("elements", nargs="*", metavar="ELEMENT", help="out of those there are (default: all)")
    parser.add_argument("--render", action="store_true", help="only write the page from the errors kept")
    args = parser.parse_args()
    if not args.render:
        stored = json.loads(STORE.read_text(encoding="utf-8")) if STORE.exists() else {}
        stored |= {element: measure(element) for element in args.elements or ELEMENTS}
        stored = {element: stored[element] for element in ELEMENTS if element in stored}
        STORE.write_text(json.dumps(stored, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        note(STORE, "cpu")
    (FOLDER / "elements.md").write_text(render(), encoding="utf-8")


if __name__ == "__main__":
    main()
