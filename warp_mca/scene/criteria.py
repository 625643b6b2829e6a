"""Owns criteria: what a figure of a run is to be, as `max_von_mises(shell) < 60e6`, checked against a scene.

A new figure is an entry of `FIGURES`. Without a name in brackets a criterion holds for all that have the figure. Behind
the name, `cfc=1000` filters an acceleration by that channel frequency class [Hz].
"""

from __future__ import annotations

import math
import operator
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.bolts import Bolt
from warp_mca.scene.contacts import contact_names
from warp_mca.scene.sensors import check_class
from warp_mca.scene.springs import Spring

if TYPE_CHECKING:
    from warp_mca.scene.scene import Scene

RELATIONS = {"<=": operator.le, ">=": operator.ge, "<": operator.lt, ">": operator.gt}
_FORM = re.compile(r"\s*(\w+)\s*(?:\((.+)\))?\s*(<=|>=|<|>)\s*(\S+)\s*")
_FILTERED = re.compile(r"(?:(.*\S)\s*,)?\s*cfc\s*=\s*(\S+)\s*")

# Figures of the summary and their units, under its key that lists what has them by name; "" stands for those of the
# whole run. Those of "energy" are computed: shares of the ledger's entries.
RAW, FILTERED, SHARE = "acceleration_max", "acceleration_cfc_max", "energy_share"
FIGURES: dict[str, dict[str, str]] = {
    "bodies": {"max_von_mises": "Pa", "max_plastic_strain": "", "mass": "kg"},
    "probes": {RAW: "m/s^2", FILTERED: "m/s^2", "velocity_max": "m/s", "displacement_end": "m"},
    "sections": {"F_max": "N", "M_max": "N m"},
    "contacts_by_pair": {"F_max": "N"},
    "joints": {"max_force": "N", "max_moment": "N m"},
    "bolts": {"max_force": "N", "min_force": "N", "max_shear": "N"},
    "springs": {"force_min": "N", "force_max": "N", "elongation_min": "m", "elongation_max": "m"},
    "bonds": {"failed": ""},
    "failure": {"elements": ""},
    "energy": {SHARE: "share"},
    "": {
        **{"F_n_max": "N", "F_n_first_peak": "N", "contact_duration": "s"},
        **{"max_strain": "", "max_penetration": "m", "energy_error": "share"},
    },
}
# Entries of the energy ledger whose share of initial energy and external work a criterion may bound.
ENERGIES = tuple(
    "kinetic elastic plastic hourglass contact friction contact_loss damping joint absorbed external_work".split()
)


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """A criterion as read.

    Attributes:
        text: as it was written.
        figure: one of `FIGURES`.
        of: name of what has it, or None for all that do.
        relation: one of `RELATIONS`.
        limit: [SI unit of the figure].
        cfc: channel frequency class by which an acceleration is filtered [Hz], or None.
    """

    text: str
    figure: str
    of: str | None
    relation: str
    limit: float
    cfc: float | None = None

    @property
    def unit(self) -> str:
        """Unit of the figure; "share" for shares, "" for other pure numbers."""
        return next(units[self.figure] for units in FIGURES.values() if self.figure in units)

    @property
    def upper(self) -> bool:
        """Whether the limit is an upper one, so that the greatest value decides."""
        return self.relation.startswith("<")

    def met(self, value: float | None) -> bool:
        """Whether it holds for a value; None, what a run could not tell, meets nothing."""
        return value is not None and bool(RELATIONS[self.relation](value, self.limit))


def read_criterion(text: str) -> Criterion:
    """A criterion from its text.

    Raises:
        RequestError: it does not read FIGURE < NUMBER or FIGURE(NAME) < NUMBER, or no figure has this name.
    """
    found = _FORM.fullmatch(text) if isinstance(text, str) else None
    if found is None:
        remedy = "write FIGURE(NAME) < NUMBER, with <, <=, > or >=, as max_von_mises(shell) < 60e6"
        raise bad_value("Scene.criteria", text, remedy)
    figure, of, relation, limit = found.groups()
    figures = list(dict.fromkeys(name for names in FIGURES.values() for name in names))
    if figure not in figures:
        raise bad_value("Scene.criteria", text, f"no figure is named {figure}; choose among {', '.join(figures)}")
    number = _number(limit)
    if not math.isfinite(number):
        raise bad_value("Scene.criteria", text, f"{limit} is no number; give one in SI units, as 60e6 for 60 MPa")
    filtered, cfc = _FILTERED.fullmatch(of or ""), None
    if filtered:
        of, cfc = filtered[1], _number(filtered[2])
        if figure != RAW:
            raise bad_value("Scene.criteria", text, f"cfc= filters {RAW} only; leave it out")
        if not (math.isfinite(cfc) and cfc > 0.0):
            remedy = f"{filtered[2]} is no channel frequency class; give 60, 180, 600 or 1000 Hz"
            raise bad_value("Scene.criteria", text, remedy)
    own = of and of.strip()
    return Criterion(text=text.strip(), figure=figure, of=own, relation=relation, limit=number, cfc=cfc)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def check_criteria(scene: Scene) -> None:
    """Refuse criteria that the scene cannot answer.

    Raises:
        RequestError: one is misspelt, or names nothing that has its figure.
    """
    validate.kind_of("Scene.criteria", scene.criteria, (tuple, list), 'give a tuple of texts, as ("F_n_max < 1e4",)')
    for text in scene.criteria:
        criterion = read_criterion(text)
        figure, of = criterion.figure, criterion.of
        known = _names(scene, figure)
        if figure in FIGURES[""]:
            if of is not None:
                raise bad_value("Scene.criteria", text, f"{figure} is of the whole run; leave the name out")
        elif not known:
            raise bad_value("Scene.criteria", text, f"nothing in the scene has {figure}; add what has, or leave it out")
        elif of is not None and of not in known:
            raise bad_value("Scene.criteria", text, f"{of} has no {figure}; choose among {', '.join(known)}")
        elif of is None and figure == SHARE:
            raise bad_value("Scene.criteria", text, f"name the energy in brackets: {', '.join(known)}")
        if criterion.cfc is not None:
            check_class(f"Scene.criteria: cfc of {text}", criterion.cfc, scene.impact.output_interval)


def _names(scene: Scene, figure: str) -> list[str]:
    """What has a figure, by name."""
    filtered, names = figure == FILTERED, contact_names(scene.contacts)
    having = {
        "bodies": [body.name for body in scene.bodies if not body.rigid or figure == "mass"],
        "probes": [probe.name for probe in scene.probes if probe.cfc is not None or not filtered],
        "sections": [section.name for section in scene.sections],
        "contacts_by_pair": names,
        "joints": [joint.name for joint in scene.acting_joints if joint.whole() is not None],
        "bolts": [load.name for load in scene.loads if isinstance(load, Bolt)],
        "springs": [load.name for load in scene.loads if isinstance(load, Spring)],
        "bonds": [name for name, own in zip(names, scene.contacts, strict=True) if getattr(own, "bond", None)],
        "failure": scene.failing,
        "energy": ENERGIES,
    }
    return [name for key, own in having.items() if figure in FIGURES[key] for name in own]
