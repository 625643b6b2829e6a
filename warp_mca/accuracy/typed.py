"""Owns what `Accuracy.typed` may hold: options of a run by name with their values, and parameters of the scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.phases.rate_groups import check_multi_rate
from warp_mca.physics.elements import ELEMENTS
from warp_mca.scene import Scene
from warp_mca.scene.phases import is_mass_scaling


def check_values(typed: Mapping[str, object]) -> None:
    """Refuse values that no option of that name can have; a scene has checked its parameters when it was built.

    Raises:
        RequestError: a value is not allowed.
    """
    for name, value in typed.items():
        if name == "multi_rate":
            check_multi_rate(value)
        elif name in _VALUES:
            allowed, remedy = _VALUES[name]
            if not allowed(value):
                raise bad_value(_field(name), value, remedy)


def check_names(scene: Scene, typed: Mapping[str, object]) -> None:
    """Refuse names that are neither options nor parameters of the scene.

    Raises:
        RequestError: a name is unknown.
    """
    known = dict.fromkeys([*_VALUES, "multi_rate", *scene.parameters])
    for name, value in typed.items():
        if name not in known:
            raise bad_value(
                _field(name), value, f"scene {scene.name} has no such name; choose among {', '.join(known)}"
            )


def _field(name: object) -> str:
    return f"Accuracy.typed[{name!r}]"


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
