"""Owns report.html: what a run was, its verdict, pictures, figures, how sure they are, and warnings, in one file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from warp_mca.results.criteria import energy_shares
from warp_mca.results.html_page import Figures, Image, image, page, said, section, table
from warp_mca.scene.criteria import read_criterion

if TYPE_CHECKING:
    from warp_mca.results.result import Result

REPORT = "report.html"
CAPTIONS = {  # of the figures of a run, in their order
    "forces.png": "Contact forces, and velocities below",
    "probes.png": "Accelerations of probes and forces through sections",
    "energies.png": "Energies, and the error of their balance",
    "paths.png": "Stress along paths",
    "waves.png": "Waves along paths",
}
Key = tuple[str | int, ...]


class Listed(NamedTuple):
    """A table of what the summary lists by name.

    Attributes:
        title: of the table.
        key: of the summary.
        columns: heading, key within an item, and unit.
    """

    title: str
    key: str
    columns: tuple[tuple[str, Key, str], ...]


def _greatest(what: str, key: str, unit: str) -> tuple[tuple[str, Key, str], ...]:
    """Columns of a value with its place and time."""
    return (what, (key, "value"), unit), ("at", (key, "at"), "m"), ("time", (key, "time"), "s")


LISTS = (
    Listed(
        "Bodies",
        "bodies",
        (
            ("mass", ("mass",), "kg"),
            *_greatest("greatest von Mises stress", "max_von_mises", "Pa"),
            *_greatest("greatest plastic strain", "max_plastic_strain", ""),
        ),
    ),
    Listed(
        "Failed elements",
        "failure",
        (
            ("elements", ("elements",), ""),
            ("mass", ("mass",), "kg"),
            ("first at", ("at",), "m"),
            ("time", ("time",), "s"),
        ),
    ),
    Listed(
        "Contacts",
        "contacts_by_pair",
        (
            ("greatest force", ("F_max",), "N"),
            ("impulse", ("impulse",), "N s"),
            ("closed at the end", ("contact_open_at_end",), ""),
        ),
    ),
    Listed(
        "Glued contacts",
        "bonds",
        (
            ("nodes", ("nodes",), ""),
            ("failed", ("failed",), ""),
            ("first at", ("first_failure", "at"), "m"),
            ("time", ("first_failure", "time"), "s"),
        ),
    ),
    Listed(
        "Joints",
        "joints",
        (
            *_greatest("greatest force", "max_force", "N"),
            *_greatest("greatest moment", "max_moment", "N m"),
        ),
    ),
    Listed("Impulse of joints", "joint_impulse", (("impulse", (), "N s"),)),
    Listed(
        "Bolts",
        "bolts",
        (
            *_greatest("greatest tension", "max_force", "N"),
            *_greatest("least tension", "min_force", "N"),
            *_greatest("greatest shear force", "max_shear", "N"),
        ),
    ),
    Listed(
        "Springs",
        "springs",
        (
            ("least force", ("force_min",), "N"),
            ("greatest force", ("force_max",), "N"),
            ("least elongation", ("elongation_min",), "m"),
            ("greatest elongation", ("elongation_max",), "m"),
        ),
    ),
    Listed(
        "Sections",
        "sections",
        (
            ("greatest force", ("F_max",), "N"),
            ("time", ("F_max_time",), "s"),
            ("greatest moment", ("M_max",), "N m"),
            ("time", ("M_max_time",), "s"),
        ),
    ),
    Listed(
        "Probes",
        "probes",
        (
            ("greatest acceleration, raw", ("acceleration_max",), "m/s^2"),
            ("time", ("acceleration_max_time",), "s"),
            ("class (CFC) [Hz]", ("cfc",), ""),
            ("greatest acceleration, filtered", ("acceleration_cfc_max",), "m/s^2"),
            ("time", ("acceleration_cfc_max_time",), "s"),
            ("greatest velocity", ("velocity_max",), "m/s"),
            ("displacement at the end", ("displacement_end",), "m"),
        ),
    ),
)
MODEL = (  # heading, key, unit
    *(("first contact after the release", ("t_contact",), "s"), ("simulated time", ("simulated_time",), "s")),
    *(("elements", ("n_elements",), ""), ("nodes", ("n_nodes",), ""), ("element", ("element",), "")),
    *(("steps", ("n_steps",), ""), ("time step", ("dt",), "s"), ("device", ("device",), "")),
    *(("precision", ("precision",), ""), ("warp_mca", ("version",), "")),
)
FORCES = (
    *(("first peak", ("F_n_first_peak",), "N"), ("greatest normal force", ("F_n_max",), "N")),
    *(("least tangential force", ("F_t_min",), "N"), ("greatest tangential force", ("F_t_max",), "N")),
    *(("duration of contact", ("contact_duration",), "s"), ("greatest plastic strain", ("max_plastic_strain",), "")),
)
SURE = (  # what is known of errors of the whole run
    ("Error of the energy balance, over initial energy and external work", ("energy_error",), "share"),
    ("The same over the exchanged energy", ("energy_error_exchanged",), "share"),
    ("Estimated error of the first peak by mass scaling", ("mass_scaling", "F_n_first_peak"), "share"),
    ("Greatest depth of a node below the surface that it touches", ("max_penetration",), "m"),
)
HANDED_OVER = (  # of scenes whose rigid bodies swing before they touch
    ("Change of momentum where rigid bodies became flexible", ("handoff_mismatch", "momentum"), "share"),
    ("Change of kinetic energy there", ("handoff_mismatch", "kinetic_energy"), "share"),
)
ESTIMATED = {
    "F_n_first_peak": "first peak",
    "impulse": "impulse",
    "contact_duration": "duration of contact",
    "max_plastic_strain": "greatest plastic strain",
}
BY_NAME = (  # what is known of errors by contact or body
    ("Force lost by soft contact springs, estimated,", "contact_spring_loss", ()),
    ("Mass against the shape,", "bodies", ("mass_error",)),
    ("Mass added by mass scaling,", "mass_added", ()),
)
NO_ESTIMATE = (
    "The error of mesh and time step was not estimated: run with --accuracy 2%, or with --refine 1.5 too, and compare. "
    "Stresses and strains at sharp edges grow without a limit as cells become smaller."
)


def report_html(result: Result, folder: Path, images: Sequence[Image] = ()) -> str:
    """The page.

    Args:
        result: of a run.
        folder: that has the figures of the run.
        images: of the bodies.
    """
    found = Figures(result.summary)
    traces = [
        Image(text, ".png", (folder / name).read_bytes()) for name, text in CAPTIONS.items() if (folder / name).exists()
    ]
    name = str(result.summary.get("scene") or "run")
    return page(
        name,
        [
            f"<h1>{escape(name)}</h1>",
            verdict_html(result.summary.get("criteria", ())),
            section("Criteria", criteria_table(found)),
            section("Bodies", *map(image, images)),
            section("Main figures", _facts(found, FORCES)),
            section("Over time", *map(image, traces)),
            *(section(listed.title, _list(found, listed)) for listed in LISTS),
            section("Energies at the end", _energies(found)),
            section("How sure the figures are", _sure(found), _unsure(found)),
            section("Warnings", *(f'<p class="warning">{escape(text)}</p>' for text in result.warnings)),
            section("Model and run", _facts(found, MODEL), _parameters(found), _wall(found)),
        ],
    )


def verdict_html(criteria: Sequence[Mapping]) -> str:
    """How many criteria are met, in a line."""
    if not criteria:
        return ""
    met = sum(item["met"] for item in criteria)
    kind, text = ("met", "All") if met == len(criteria) else ("unmet", f"{met} of")
    return f'<p class="verdict {kind}">{text} {len(criteria)} criteria are met.</p>'


def criteria_table(found: Figures) -> str:
    """Each criterion with its verdict, value, limit and margin."""
    rows = []
    for k, item in enumerate(found.get("criteria") or ()):
        own, unit = ("criteria", k), read_criterion(item["criterion"]).unit
        met = f'<span class="{"met" if item["met"] else "unmet"}">{"met" if item["met"] else "not met"}</span>'
        cells = [
            found.cell(*own, "criterion"),
            met,
            found.cell(*own, "value", unit=unit, empty="the run could not tell"),
        ]
        cells += [found.cell(*own, "limit", unit=unit), found.cell(*own, "margin", unit="share")]
        cells += [found.cell(*own, "of"), found.cell(*own, "at", unit="m"), found.cell(*own, "time", unit="s")]
        rows.append(cells)
    return table(("criterion", "verdict", "value", "limit", "margin", "decided by", "at", "time"), rows)


def _facts(found: Figures, facts: Sequence[tuple[str, Key, str]]) -> str:
    cells = ((escape(text), found.cell(*key, unit=unit)) for text, key, unit in facts)
    return table(("", "value"), [cell for cell in cells if cell[1]])


def _list(found: Figures, listed: Listed) -> str:
    items = found.get(listed.key) or ()
    names = {str(name): name for name in items} if isinstance(items, Mapping) else {}
    names = names or {str(item["name"]): k for k, item in enumerate(items)}
    rows = [
        [escape(name), *(found.cell(listed.key, at, *key, unit=unit) for _, key, unit in listed.columns)]
        for name, at in names.items()
    ]
    return table(("", *(heading for heading, _, _ in listed.columns)), rows)


def _energies(found: Figures) -> str:
    """The ledger, and each entry as a share of initial energy and external work."""
    energy = found.get("energy") or {}
    shares = energy_shares(energy) if energy else {}
    rows = [
        [escape(name.replace("_", " ")), found.cell("energy", name, unit="J"), said(shares.get(name, 0.0), "share")]
        for name, value in energy.items()
        if value
    ]
    return table(("", "energy", "share of initial energy and external work"), rows)


def _sure(found: Figures) -> str:
    known = (*SURE, *(HANDED_OVER if found.get("t_contact") is not None else ()))
    rows = [(escape(text), found.cell(*key, unit=unit)) for text, key, unit in known]
    for name, text in ESTIMATED.items():
        rows.append((f"Estimated error of the {text}", found.cell("accuracy", "estimate", name, unit="share")))
    for text, key, rest in BY_NAME:
        rows += [(escape(f"{text} {of}"), found.cell(key, of, *rest, unit="share")) for of in found.get(key) or ()]
    return table(("", "value"), [row for row in rows if row[1]])


def _unsure(found: Figures) -> str:
    """What is not known."""
    return "".join(f"<p>{escape(text)}</p>" for text in _unknown(found))


def _unknown(found: Figures) -> Iterator[str]:
    if not found.get("accuracy"):
        yield NO_ESTIMATE
    for name, reason in (found.get("accuracy", "reasons") or {}).items():
        yield f"No estimate of the error of {ESTIMATED.get(name, name)}: {reason}."
    if found.get("contact_open_at_end"):
        yield "A contact was closed at the end: its duration, impulse and greatest force may be those of a part of it."


def _parameters(found: Figures) -> str:
    names = found.get("parameters") or {}
    return table(("parameter", "value"), [(escape(name), found.cell("parameters", name)) for name in names])


def _wall(found: Figures) -> str:
    """Wall times; that of writing the results, this page among them, is in summary.json."""
    stages = [stage for stage in found.get("wall") or () if stage != "output"]
    return table(("wall time", "s"), [(escape(stage), found.cell("wall", stage)) for stage in stages])
