"""Owns relays: sliders of almost no mass that carry what a machine's joint has no room for.

A relay on the ground slides by c q of a joint, by a coupler; further ones slide on it by those of other joints. What
holds the last one to the ground, a slide, so has the coordinate x = sum c q: there act the spring and the actuators of
a tendon, or a second motor with a clamp of its own. Impulses of couplers carry their force to the joints, c times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.scene import Articulation, Body, Coupler, Freedom

if TYPE_CHECKING:
    from warp_mca.robots.machine import Machine

LIGHT = 1e-6  # mass of a relay over the least of the inertias that it moves with
X = (1.0, 0.0, 0.0)


def relay(
    machine: Machine, name: str, parts: Sequence[tuple[int, float, Coupler]], carried: Sequence[Freedom]
) -> tuple[list[Body], list[Articulation]]:
    """Bodies and joints of a relay.

    Args:
        machine: at its hand-off.
        name: of what acts there.
        parts: joints of the file, c of each, and a coupler to it at that ratio.
        carried: what acts on x, slides whose position and axis are set here.
    """
    model, data, mobility = machine.model, machine.data, np.diag(np.linalg.inv(machine.mass_matrix()))
    places = [int(model.jnt_qposadr[joint]) for joint, _, _ in parts]
    dofs = [int(model.jnt_dofadr[joint]) for joint, _, _ in parts]
    ratios = [c for _, c, _ in parts]
    ways = [c * float(data.qpos[at] - model.qpos0[at]) for c, at in zip(ratios, places, strict=True)]
    rates = np.cumsum([c * float(data.qvel[dof]) for c, dof in zip(ratios, dofs, strict=True)])
    mass = LIGHT / max(float(mobility[dof]) * c**2 for c, dof in zip(ratios, dofs, strict=True))
    names = [f"{name} relay {k + 1}" for k in range(len(parts))]
    own: dict[str, Any] = {"rigid": True, "mass": mass, "centre": (0.0, 0.0, 0.0), "inertia": (mass, mass, mass)}
    bodies = [Body(name=item, velocity=(float(rate), 0.0, 0.0), **own) for item, rate in zip(names, rates, strict=True)]
    slides = [
        Freedom(kind="slide", axis=X, position=way, follows=coupler)
        for way, (_, _, coupler) in zip(ways, parts, strict=True)
    ]
    joints = [
        Articulation(name=f"{item} slide", body=item, other=below, freedoms=(slide,))
        for item, below, slide in zip(names, [None, *names], slides, strict=False)
    ]
    for k, item in enumerate(carried):
        acting = replace(item, kind="slide", axis=X, position=sum(ways))
        joints.append(Articulation(name=f"{name} {k + 1}", body=names[-1], freedoms=(acting,)))
    return bodies, joints
