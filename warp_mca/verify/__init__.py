"""Owns verification: problems with known answers, what the engine makes of them, and the report of it.

A case is a function in one of FILES, registered by the decorator `case`; it returns rows. The report lists them by
group.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module

from warp_mca.base.errors import bad_value
from warp_mca.verify.case import CASES, Case, Level, Row, Setup, case

GROUPS = ("elements", "material", "waves", "impact", "friction", "rigid", "loads")
FILES = (
    "elements",
    "bent",
    "solids",
    "limits",
    "layers",
    "vibration",
    "material",
    "large_strain",
    "metals",
    "rubber",
    "damping",
    "failure",
    "waves",
    "absorbing",
    "tied",
    "bending",
    "impact",
    "viscoelastic_ball",
    "taylor",
    "rates",
    "friction",
    "friction_laws",
    "partial_slip",
    "rolling",
    "rigid",
    "hinges",
    "rigid_bodies",
    "robots",
    "body_joints",
    "joint_loops",
    "jointed_impacts",
    "loads",
)

__all__ = ["FILES", "GROUPS", "Case", "Level", "Row", "Setup", "case", "cases"]


def cases(names: Sequence[str] = ()) -> list[Case]:
    """The cases of these names, or of these groups; all of them by default.

    Raises:
        RequestError: there is no such case.
    """
    for file in FILES:
        import_module(f"warp_mca.verify.{file}")
    for name in names:
        if name not in CASES and name not in GROUPS:
            raise bad_value("case", name, f"choose among {', '.join(CASES)}, or a group: {', '.join(GROUPS)}")
    order = {f"warp_mca.verify.{file}": k for k, file in enumerate(FILES)}  # whichever was imported first
    found = sorted(CASES.values(), key=lambda item: order.get(item.measure.__module__, len(FILES)))
    return [item for item in found if not names or item.name in names or item.group in names]
