"""Owns criteria: what a figure of a run is to be, as `max_von_mises(shell) < 60e6`, checked against a scene.

A new figure is an entry of `FIGURES`. Without a name in brackets a criterion holds for all that have the figure.
"""

from __future__ import annotations

import math
import operator
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.contacts import contact_names
from warp_mca.scene.springs import Spring

if TYPE_CHECKING:
    from warp_mca.scene.scene import Scene

RELATIONS = {"<=": operator.le, ">=": operator.ge, "<": operator.lt, ">": operator.gt}
_FORM = re.compile(r"\s*(\w+)\s*(?:\((.+)\))?\s*(<=|>=|<|>)\s*(\S+)\s*")

# Figures of the summary, under its key that lists what has them by name; "" stands for those of the whole run.
FIGURES = {
    "bodies": ("max_von_mises", "max_plastic_strain", "mass"),
    "probes": ("acceleration_max", "acceleration_cfc_max", "velocity_max", "displacement_end"),
    "sections": ("F_max", "M_max"),
    "contacts_by_pair": ("F_max",),
    "springs": ("force_min", "force_max", "elongation_min", "elongation_max"),
    "": ("F_n_max", "F_n_first_peak", "contact_duration", "max_strain", "max_penetration", "energy_error"),
}


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """A criterion as read.

    Attributes:
        text: as it was written.
        figure: one of `FIGURES`.
        of: name of what has it, or None for all that do.
        relation: one of `RELATIONS`.
        limit: [SI unit of the figure].
    """

    text: str
    figure: str
    of: str | None
    relation: str
    limit: float

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
    try:
        number = float(limit)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise bad_value("Scene.criteria", text, f"{limit} is no number; give one in SI units, as 60e6 for 60 MPa")
    return Criterion(text=text.strip(), figure=figure, of=of and of.strip(), relation=relation, limit=number)


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


def _names(scene: Scene, figure: str) -> list[str]:
    """What has a figure, by name."""
    filtered = figure == "acceleration_cfc_max"
    names = {
        "bodies": [body.name for body in scene.bodies if not body.rigid or figure == "mass"],
        "probes": [probe.name for probe in scene.probes if probe.cfc is not None or not filtered],
        "sections": [section.name for section in scene.sections],
        "contacts_by_pair": contact_names(scene.contacts),
        "springs": [load.name for load in scene.loads if isinstance(load, Spring)],
    }
    return [name for key, own in names.items() if figure in FIGURES[key] for name in own]
