"""Owns what the default hexahedron changes in the gallery: scenes with `hex8` and with `hex8i`, and why they differ."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import warp_mca as mca
from benchmarks.gallery_scenes import SCENES
from benchmarks.measurements import FOLDER, measured, note

STORE = FOLDER / "gallery.elements.json"
ELEMENTS = ("hex8", "hex8i")

_PLANE = "plane waves, which bend no cell"
_SLIDES = "slides as a whole: hardly any strain"
_UNIFORM = "one cell, the same strain at all points"
WHY = {
    "two_link": "cells of the rods are longer than wide, so that hex8 bends too little: with three times as many along "
    "them 3041 and 3033 N",
    "three_link": "as two_link; with four times as many cells along the rods 3471 N with either",
    "single_link": "as two_link; with six times as many cells along the rod 1599 and 1596 N",
    "taylor_bar": "one point of the foot, whose cells flatten to a twentieth: it depends on the mesh, and on the step",
    "hertz_sphere": "cells that touch bend, too",
    "single_rod": "the mean is over a force that rings",
    "rod_on_wall": _PLANE,
    "coaxial_rods": _PLANE,
    "graded_bars": _PLANE,
    "pulse_bar": _PLANE,
    "two_metal_bar": _PLANE,
    "tied_bar": _PLANE,
    "ringing_bar": "nearer to finer meshes: 50146 and 50148 Hz with the fine preset",
    "cantilever": "bends right; hex8 bends some 7 % too far here",
    "sliding_block": _SLIDES,
    "block_on_belt": _SLIDES,
    "rolling_sphere": "rolls as a whole",
    "stick_slip": _SLIDES,
    "sticking_block": "sticks: a heat of zero",
    "metal_block": _UNIFORM,
    "strained_element": _UNIFORM,
    "double_pendulum": "error of the steps in time",
    "spinning_rod": "the hinge holds a line of nodes, which gives way the more the finer its cells are, and stiff with "
    "hex8; the known value is for an end that is held as a whole",
}


def compare(name: str, elements: Sequence[str] = ELEMENTS) -> dict[str, dict[str, float]]:
    """Figure of a scene, and CPU time [s] of the shorter of two runs, with each element in all of its bodies."""
    item, asked = SCENES[name], mca.make_scene(name)
    found = {}
    for element in elements:
        scene = replace(asked, bodies=tuple(replace(body, element=element) for body in asked.bodies))
        spent = []
        for _ in range(2):
            begun = time.process_time()
            result = mca.run(scene, device="cpu")
            spent.append(time.process_time() - begun)
        found[element] = {"measured": item.measured(result, result.summary["parameters"]), "cpu_time": min(spent)}
    return found


def measure(names: Iterable[str]) -> None:
    """Compare the scenes that deform, and store what was found."""
    stored = json.loads(STORE.read_text(encoding="utf-8")) if STORE.exists() else {}
    for name in names:
        if name in WHY:
            stored[name] = compare(name)
            print(name, stored[name], flush=True)
    ordered = {name: stored[name] for name in SCENES if name in stored}
    STORE.write_text(json.dumps(ordered, indent=1) + "\n", encoding="utf-8")
    note(STORE, "cpu")


def section(rows: Iterable[dict[str, Any]]) -> str:
    """The table of the page, of what was stored and the rows of gallery.json."""
    if not STORE.exists():
        return ""
    stored = json.loads(STORE.read_text(encoding="utf-8"))
    lines = [_line(row, stored[row["scene"]]) for row in rows if row["scene"] in stored]
    return f"""
## What changes with hex8i

All scenes but `two_link`, which keeps the paper's `hex8`, take the default element of bodies, `hex8i`. Each ran with
either element in all of its bodies. {measured(STORE.stem)} Errors are against the known values above; time is CPU time
of the whole run with `hex8i` over that with `hex8`. Scenes whose bodies are rigid have no elements.

| scene, figure | hex8 | hex8i | change | error of hex8 | of hex8i | time | why |
|---|---|---|---|---|---|---|---|
""" + "".join(lines)


def _line(row: dict[str, Any], found: dict[str, dict[str, float]]) -> str:
    old, new = (found[element]["measured"] for element in ELEMENTS)
    known, unit = row["known"], "" if row["unit"] == "-" else f" {row['unit']}"
    errors = [percent(value, known) if known else "–" for value in (old, new)]
    ratio = found["hex8i"]["cpu_time"] / found["hex8"]["cpu_time"]
    cells = [f"{row['scene']}: {row['quantity']}", f"{old:.5g}{unit}", f"{new:.5g}{unit}", percent(new, old), *errors]
    return "| " + " | ".join([*cells, f"{ratio:.2f}", WHY[row["scene"]]]) + " |\n"


def percent(value: float, reference: float) -> str:
    """How far a value is from another, of two digits with their sign; – where both are zero."""
    return f"{100.0 * (value / reference - 1.0):+.2g} %".replace("-", "−") if reference else "–"
