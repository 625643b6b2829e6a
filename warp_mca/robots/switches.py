"""Owns what the flags of a file's option switch off: the arrays of the model say so, which an impact reads too."""

from __future__ import annotations

from typing import Any

OURS = ("CONTACT", "LIMIT", "FRICTIONLOSS", "SENSOR", "ISLAND")  # what MuJoCo need not compute
CONSTRAINTS = {"EQUALITY", "LIMIT", "FRICTIONLOSS", "CONTACT"}  # which CONSTRAINT switches off
# Fields that are 0 without what a flag switches off; the power series of springs and dampers that are not linear too.
FIELDS = {
    "SPRING": ("jnt_stiffness", "jnt_stiffnesspoly", "tendon_stiffness", "tendon_stiffnesspoly"),
    "DAMPER": ("dof_damping", "dof_dampingpoly", "tendon_damping", "tendon_dampingpoly"),
    "EQUALITY": ("eq_active0",),
    "LIMIT": ("jnt_limited", "tendon_limited"),
    "FRICTIONLOSS": ("dof_frictionloss", "tendon_frictionloss"),
    "CLAMPCTRL": ("actuator_ctrllimited",),
}


def switched_off(mj: Any, flags: int) -> frozenset[str]:
    """What flags of an option switch off, as "ACTUATION"."""
    kinds = {name.removeprefix("mjDSBL_"): int(bit) for name, bit in mj.mjtDisableBit.__members__.items()}
    found = {name for name, bit in kinds.items() if int(flags) & bit}
    return frozenset(found | (CONSTRAINTS if "CONSTRAINT" in found else set()))


def take_out(mj: Any, model: Any) -> None:
    """Take what its flags switch off out of a model, and leave contact, limits and dry friction to us."""
    off = switched_off(mj, model.opt.disableflags)
    for field in (field for name in FIELDS if name in off for field in FIELDS[name]):
        if getattr(model, field, None) is not None:
            getattr(model, field)[:] = 0
    if {"SPRING", "DAMPER"} <= off:  # MuJoCo then leaves out all passive forces
        model.body_gravcomp[:] = 0.0
    for name in OURS:
        model.opt.disableflags |= int(getattr(mj.mjtDisableBit, f"mjDSBL_{name}"))
