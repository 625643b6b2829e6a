"""Owns the names of columns in rows of a sweep: figures keep theirs, parameters that could take one get a prefix."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

OWN = ("index", "status", "reason", "warnings", "wall", "checksum")
# Entries of summary.json that are a single value, and so a column of their own. A new one is listed here.
FIGURES = (
    "F_n_first_peak F_n_max F_t_max F_t_min F_t_reverses batch configuration_error contact_duration "
    "contact_open_at_end device dt element element_steps_per_s energy_drift_rigid energy_error energy_error_exchanged "
    "floating_frames max_penetration max_plastic_strain max_strain method multi_rate n_elements n_nodes n_steps "
    "precision refine scene simulated_time stable_dt t_contact threads touched v_n v_t version"
).split()
# Lists and objects there, but `penalty`, whose figures are all named after a contact.
OTHERS = (
    "F_n_peaks absorbed_impulse accuracy bodies bolts bonds carriage configuration contact_spring_loss "
    "contact_spring_share contacts contacts_by_pair criteria energy extremes failure files flexible_bodies "
    "handoff_mismatch joint_impulse joints mass_added mass_scaling parameters "
    "path_headings phases probes rate_groups rigid_bodies sections "
    "springs sticks theta theta_dot ties units wave_speeds"
).split()
PREFIX = "parameter."
RESERVED = frozenset((*OWN, *FIGURES, *OTHERS))


def parameter_column(name: str) -> str:
    """The column of a parameter: its name, with a prefix where this could be the name of a figure in any run.

    It depends on the name alone, so that all rows of a sweep have the same columns. Names with dots could be those of
    figures in nested objects, as energy.kinetic; no object of a summary is called `parameter`.
    """
    return PREFIX + name if name in RESERVED or "." in name else name


def stored_row(row: Mapping[str, Any], parameters: Iterable[str]) -> dict[str, Any] | None:
    """A row of sweep.csv with parameters in their columns, which in earlier versions were others.

    Args:
        row: by column; those of parameters stand before `status`.
        parameters: names of the sweep's.

    Returns:
        The row, or None if a parameter has taken the place of one of its figures.
    """
    names = list(row)
    first = names[: names.index("status")]
    renamed = {}
    for name in parameters:
        column = parameter_column(name)
        for old in {f"parameters.{name}", name} - {column}:
            if old in first and column not in first:
                if old in FIGURES:
                    return None
                renamed[old] = column
    return {renamed.get(name, name): value for name, value in row.items()}
