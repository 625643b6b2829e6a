"""Owns what a user asks for with an accuracy: its share, what stays as the user typed it, and which models may do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from warp_mca.accuracy.typed import check_names, check_values
from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene import Scene

LEAST, MOST = 1e-3, 0.5  # shares that can be asked for [-]
REMEDY = f"give a share from {LEAST:.1%} to {MOST:.0%}, as 2% or 0.02"


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """An accuracy that a run is to have.

    Attributes:
        share: greatest error of each figure that has a limit, against that limit [-].
        typed: values by name that must stay: parameters of the scene, and `refine`, `penalty`, `mass_scaling`,
            `multi_rate`, `precision`, `time_step_scale` and `element`.
        full: all bodies keep their masses; only the mesh, the step, springs and the precision are chosen.
    """

    share: float
    typed: Mapping[str, object] = field(default_factory=dict)
    full: bool = False

    def __post_init__(self) -> None:
        if not (validate.is_number(self.share) and LEAST <= self.share <= MOST):
            raise bad_value("accuracy", self.share, REMEDY)
        validate.kinds("Accuracy", Mapping, "give a mapping of values by name", typed=self.typed)
        check_values(self.typed)

    @property
    def percent(self) -> str:
        """The share as a user may type it, as "2%"."""
        return f"{100.0 * self.share:.6g}%"

    def keeping(self, **values: object) -> Accuracy:
        """The same, with more values that must stay; those that are None are left out."""
        given = {name: value for name, value in values.items() if value is not None}
        return Accuracy(share=self.share, typed={**self.typed, **given}, full=self.full)


def accuracy_of(asked: float | str | Accuracy) -> Accuracy:
    """An accuracy as users write it: 0.02, "2%", or an `Accuracy`.

    Raises:
        RequestError: it is not an accuracy, or out of range.
    """
    if isinstance(asked, Accuracy):
        return asked
    if isinstance(asked, str):
        number, percent = asked.strip().removesuffix("%"), asked.strip().endswith("%")
        try:
            asked = float(number) / (100.0 if percent else 1.0)
        except ValueError:
            raise bad_value("accuracy", asked, REMEDY) from None
    return Accuracy(share=asked)


def check_accuracy(scene: Scene, asked: float | str | Accuracy | None) -> None:
    """Refuse what is no accuracy, and names in `Accuracy.typed` that a scene does not have.

    Raises:
        RequestError: it is not an accuracy, or a name is unknown.
    """
    if asked is not None:
        check_names(scene, accuracy_of(asked).typed)
