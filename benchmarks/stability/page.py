"""Owns how cells are shown: a line on the terminal, and the tables of stability.md."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path

from benchmarks.measurements import FOLDER, measured
from benchmarks.stability.axis import Axis, ordered_axes
from benchmarks.stability.measure import PRECISIONS, Cell, wrong
from warp_mca.verify.case import USUAL

TEMPLATE = FOLDER / "stability.template.md"

# Words for what runs say: a part of the sentence, the word, and what to do. Stops come first: they share words.
WORDS = (
    ("exceeds energy_tolerance", "energy", "the energy balance was off by more than `energy_tolerance`: the run stops"),
    ("sank deeper than half a face", "sank", "a node sank half a face deep into what it touches: the run stops"),
    ("turned inside out", "inside out", "an element turned inside out: the run stops"),
    ("outran the contact search", "outran", "a node moved too far between two searches for contact: the run stops"),
    ("contact lists overflowed", "lists", "too many faces near a node: the run stops"),
    ("energy is not a number", "not a number", "energy is not a number: the run stops"),
    ("energy imbalance is", "imbalance", "the energy balance is off by more than 1 % of what bodies exchanged"),
    ("strain reached", "strain", "strains above 0.1 are taken as small: choose `kinematics='finite'`"),
    ("of their volume", "volume", "volumes changed by more than 15 %, taken as small: choose `kinematics='finite'`"),
    ("shakes up pressures", "rounding", "rounding in `mixed` disturbs the pressure: choose `--precision float64`"),
    ("of the strain energy of", "bending", "cells too long or too few over the depth bend too stiffly or too freely"),
    ("plastic moment", "plastic moment", "cells too few over the depth yield too early or too late in bending"),
    ("does not let", "no yield", "cells of `hex8r` too few over the depth do not yield in bending"),
    ("went to internal vectors", "lag", "internal vectors lag behind the flow: lower `time_step_scale`"),
    ("contact springs held", "soft springs", "contact springs are soft beside the bodies: raise `penalty`"),
    ("m thick: contact", "through", "nodes sank through a good part of a thin body"),
    ("acted on", "few nodes", "the force acted on too few nodes: refine"),
    ("was still in progress", "contact open", "the run ended before the contact did"),
    ("times shorter than half of the", "slivers", "few small elements set the time step"),
    ("faces of the slave", "coarse slave", "the slave's faces are wider than the master's"),
    ("took slender rods", "slender", "the swing took slender rods, as the paper does: momentum changes at hand-off"),
    (
        "nearly opened between",
        "nearly open",
        "a contact nearly opened between two compressions: compare with a finer mesh",
    ),
    ("went into each other", "into each other", "bodies went into each other where no contact keeps them apart"),
    ("of waves in flat ends", "ring", "flat ends make the contact ring: impulse and mean are right, the peak is not"),
    ("springs made or took", "switching", "contact springs made or took energy as they closed and opened within steps"),
    (" creeps at ", "creep", "a body that should rest on friction creeps"),
    ("mass than its shape", "mass", "flat cells have less mass than the round shape: finer cells"),
    ("through each other", "through itself", "parts of a body went through each other"),
    ("give a bar wave speed of", "units", "no solid has such a stiffness or density: give Pa and kg/m³"),
    ("in millimetres", "size", "size and mass are those of millimetres: give metres"),
    ("across the axis", "across", "friction acts across the axis of `F_t_N`: read the vectors of forces.npz"),
    (
        "excite its cells (flutter)",
        "flutter",
        "friction makes the cells under the tip vibrate: a lower `penalty` lessens it",
    ),
    (
        "moment of inertia of its nodes",
        "inertia",
        "a body turns with more inertia than its shape has: more cells",
    ),
    ("went over to a face", "edge", "nodes went over to another face around a sharp edge"),
)


def word(sentence: str) -> str:
    """What stands for a sentence in the tables; of a refusal the field."""
    return next((short for part, short, _ in WORDS if part in sentence), sentence.split(" = ")[0].split(":")[0])


def percent(share: float) -> str:
    """A share in percent, to two digits."""
    if share != share or share > 9.99:
        return "no figure" if share != share else "> 999 %"
    return "0" if share == 0.0 else "< 0.001 %" if share < 1e-5 else f"{100.0 * share:.2g} %"


def size(error: float, unit: str | None) -> str:
    """An error in its unit, or as a share in percent."""
    return f"{error:.1e} {unit}" if unit else percent(error)


def shown(found: Cell) -> str:
    """A cell of a table."""
    said = ", ".join(dict.fromkeys(map(word, found["said"])))
    if "error" not in found:
        return f"{found['status']}: {said}"
    error = size(found["error"], found.get("unit"))
    error = error if found["within"] else f"**{error}**"
    return f"{error} UNWARNED" if wrong(found) else f"{error} ({said})" if said else error


def line(found: Cell) -> str:
    """A line on the terminal."""
    where = f"{found['axis']} {found['value']} {found['element']} {found['precision']}"
    what = f"{found['figure']} {shown(found)}, {found['steps']} steps" if "error" in found else shown(found)
    return f"{where}: {what}, {found['wall']} s"


def table(item: Axis, cells: Sequence[Cell]) -> list[str]:
    """The table of an axis, of the cells that there are."""
    found = {(cell["value"], cell["element"], cell["precision"]): cell for cell in cells}
    elements = list(item.elements or USUAL)
    lines = ["| | " + " | ".join(elements) + " |", "|---|" + "---|" * len(elements)]
    for value in item.values:
        texts = []
        for element in elements:
            both = [found.get((value, element, precision)) for precision in PRECISIONS]
            text = list(dict.fromkeys(shown(cell) for cell in both if cell))
            texts.append(" / ".join(text) if text else "not run")
        lines.append(f"| {_number(value)} | " + " | ".join(texts) + " |")
    return lines


def _number(value: object) -> str:
    return f"{value:,}" if isinstance(value, int) else f"{value:g}" if isinstance(value, float) else str(value)


def tolerances(cells: Iterable[Cell]) -> str:
    """Largest tolerances of an axis, in words."""
    found: dict[tuple[str, str | None], float] = {}
    for cell in cells:
        if "error" in cell:
            name = cell["figure"], cell.get("unit")
            found[name] = max(found.get(name, 0.0), cell["tolerance"])
    return ", ".join(f"{name} {size(value, unit)}" for (name, unit), value in found.items())


def summary(cells: Sequence[Cell]) -> str:
    """How many cells ended how, in a sentence or two."""
    count = Counter(cell["status"] for cell in cells)
    good = sum(cell.get("within", False) for cell in cells)
    bad = sum(map(wrong, cells))
    outside = sum("error" in cell and not cell["within"] for cell in cells)
    verdict = "none is a wrong number without a warning" if not bad else f"{bad} are WRONG NUMBERS WITHOUT A WARNING"
    return (
        f"Of {len(cells):,} runs {good:,} gave their figures within the tolerance, {outside - bad:,} missed it with a "
        f"warning, {count['stopped']:,} were stopped and {count['refused']:,} refused; {verdict}."
    )


def write_page(cells: Sequence[Cell], path: Path) -> None:
    """Write the page of the cells, in the order of the axes."""
    lines: list[str] = []
    for group, items in groupby(ordered_axes(), key=lambda item: item.group):
        lines += [f"## {group[0].upper()}{group[1:]}", ""]
        for item in items:
            own = [cell for cell in cells if cell["axis"] == item.name]
            lines += [f"### {item.title}", "", item.reference, "", *table(item, own), ""]
            if named := tolerances(own):
                lines += [f"Tolerances of the worst figure: {named}.", ""]
    used = {word(sentence) for cell in cells for sentence in cell["said"]}
    words = [f"| {short} | {meaning} |" for _, short, meaning in WORDS if short in used]
    text = TEMPLATE.read_text(encoding="utf-8").replace("SUMMARY", summary(cells)).replace("WORDS", "\n".join(words))
    text = text.replace("MEASURED", measured("stability"))
    path.write_text(text.replace("TABLES", "\n".join(lines).rstrip()), encoding="utf-8")
