"""Owns what a user asks for with an accuracy: its share, what stays as the user typed it, and which models may do."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.phases.rate_groups import check_multi_rate
from warp_mca.physics.elements import ELEMENTS
from warp_mca.scene import Scene
from warp_mca.scene.phases import is_mass_scaling

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
        for name, value in self.typed.items():
            if name == "multi_rate":
                check_multi_rate(value)
            elif name in _VALUES:
                allowed, remedy = _VALUES[name]
                if not allowed(value):
                    raise bad_value(f"Accuracy.typed[{name!r}]", value, remedy)

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
    if asked is None:
        return
    known = dict.fromkeys([*_VALUES, "multi_rate", *scene.parameters])
    for name, value in accuracy_of(asked).typed.items():
        if name not in known:
            remedy = f"scene {scene.name} has no such name; choose among {', '.join(known)}"
            raise bad_value(f"Accuracy.typed[{name!r}]", value, remedy)


def _is_positive(value: object) -> bool:
    return validate.is_number(value) and value > 0.0  # pyright: ignore[reportOperatorIssue]


def _is_scale(value: object) -> bool:
    return _is_positive(value) and value <= 1.0  # pyright: ignore[reportOperatorIssue]


def _is_penalty(value: object) -> bool:
    return value is None or _is_positive(value) or _is_one_of("auto")(value)


def _is_mass_scaling(value: object) -> bool:
    return value is None or is_mass_scaling(value)


def _is_one_of(*names: str) -> Callable[[object], bool]:
    return lambda value: isinstance(value, str) and value in names


# Whether a value is allowed, and the remedy; None stands for no added mass and the default springs.
_VALUES: Mapping[str, tuple[Callable[[object], bool], str]] = {
    "refine": (_is_positive, "give a finite number above 0"),
    "penalty": (_is_penalty, "give a finite number above 0, auto or None"),
    "mass_scaling": (_is_mass_scaling, "give a factor of 1 or above for the stable step, or a step as 2e-8s"),
    "precision": (_is_one_of("mixed", "float64"), "choose mixed or float64"),
    "time_step_scale": (_is_scale, "give a number above 0, at most 1"),
    "element": (lambda value: _is_one_of(*ELEMENTS)(value), f"choose among {', '.join(ELEMENTS)}"),
}
