"""Owns gravity at the hand-off: what a scene has of it, and the loads of links and bodies that feel more or less."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.scene import Body, BodyForce, Spring

if TYPE_CHECKING:
    from warp_mca.robots.machine import Machine
    from warp_mca.robots.robot import Robot

Loads = tuple[BodyForce | Spring, ...]


def gravity_of(robot: Robot, machine: Machine, rest: str) -> tuple[Any, Loads]:
    """Gravity of the scene [m/s^2], and the loads of what feels another one.

    The scene has what most of the mass feels that moves, (1 - gravcomp) g, or all of it where rigid bodies stand
    beside. Links of another gravcomp are pulled at their mass centre by a constant force, flexible ones and bodies
    beside as a whole. What rides on a flexible link has its name and `rest`.

    Raises:
        RequestError: a clamp acts on drives that compensate.
    """
    model = machine.model
    if int(model.opt.disableflags) & int(machine.mj.mjtDisableBit.mjDSBL_GRAVITY) or not model.opt.gravity.any():
        return (0.0, 0.0, 0.0), ()
    g = np.array(model.opt.gravity)
    links = [k for k in range(model.nbody) if model.body_weldid[k] and model.body_mass[k]]
    shares = {k: float(model.body_gravcomp[k]) for k in links}
    _refuse_clamped(machine, any(shares.values()))
    beside = [item for item in robot.against if isinstance(item, Body)]
    masses = {share: sum(model.body_mass[k] for k in shares if shares[k] == share) for share in shares.values()}
    share = 0.0 if any(item.rigid for item in beside) else max(masses, key=lambda s: (masses[s], s), default=0.0)
    loads: list[BodyForce | Spring] = [BodyForce(body=b.name, acceleration=_vec(share * g)) for b in beside if share]
    for k, own in shares.items():
        name, lift = machine.names.body(k), (share - own) * g
        if own == share:
            continue
        mass, centre, body = float(model.body_mass[k]), np.array(model.body_ipos[k]), name
        if name in robot.flexible:
            loads.append(BodyForce(body=name, acceleration=_vec(lift)))
            if (riding := machine.rests.get(name)) is None:
                continue
            mass, centre, body = riding.mass, riding.centre, name + rest
        pull = mass * float(np.linalg.norm(lift))
        title = f"gravcomp of {name}"
        loads.append(Spring(name=title, body=body, at=_vec(centre), preload=pull, direction=_vec(lift)))
    return _vec((1.0 - share) * g), tuple(loads)


def _refuse_clamped(machine: Machine, compensated: bool) -> None:
    """Refuse drives with clamps that hold the weight of links.

    Raises:
        RequestError: there are such drives.
    """
    model = machine.model
    held = model.jnt_actgravcomp.astype(bool) & model.jnt_actfrclimited.astype(bool)
    if compensated and held.any():
        name = machine.names.joint(int(np.flatnonzero(held)[0]))
        raise bad_value(f"actuatorgravcomp of joint {name}", True, "its clamp acts on it; leave actuatorfrcrange out")


def _vec(values: Array) -> Any:
    return tuple(float(v) for v in values)
