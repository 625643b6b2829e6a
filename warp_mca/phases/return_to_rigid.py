"""Owns the end of an impact: the rigid motion and the shape that go on, and the energy of what does not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.phases.motion import ImpactPart, Motion, Stress
from warp_mca.phases.plastic_history import take_history
from warp_mca.phases.prepare import Setup
from warp_mca.phases.residual import Relaxation, Shape
from warp_mca.rigid.chain import Chain
from warp_mca.rigid.handback import HandBack, carriage_motion, deformed_chain, hand_back
from warp_mca.rigid.placement import Placement
from warp_mca.rigid.scene_chain import pins
from warp_mca.step.output import NodalStress
from warp_mca.step.solver import Solver
from warp_mca.system.state import State

Array = NDArray[np.float64]
ByBody = dict[str, Array]


def return_to_rigid(
    setup: Setup, before: Motion, part: ImpactPart, relaxation: Relaxation, shown: bool = False
) -> tuple[Motion, ImpactPart]:
    """Project the motion at the end of an impact on the rigid motions of the bodies' shapes at rest.

    Args:
        setup: of the cycle.
        before: the motion at the start of the impact.
        part: the impact.
        relaxation: of its model.
        shown: recorders show the bodies at rest.

    Returns:
        The motion that goes on, and the part with what the way back leaves out.
    """
    model, names = part.impact.ready[0].model, [body.name for body in setup.scene.bodies]
    ends = [model.node_start[name] for name in names[1:]]

    def by_body(values: Array) -> ByBody:
        return dict(zip(names, np.split(values, ends), strict=True))

    u, v = part.impact.at_last_record()
    kept = relaxation.settle(u, part.impact.state)
    now, rest, velocities = by_body(model.X + u), by_body(model.X + kept.u), by_body(v)
    shapes, back = _fit(setup, before, part.end, now, rest, velocities)
    assert back.chain is not None
    rotations = {name: placement.rotation for name, placement in before.placements.items()}
    after = Motion(
        t=part.end,
        chain=back.chain if setup.rigid.inertia == "mesh" else _with_inertia_of(back.chain, setup.chain),
        theta=back.theta,
        theta_dot=back.theta_dot,
        placements=back.placements,
        shapes=shapes,
        history=take_history(relaxation.solver, kept.state, rotations),
        elastic=kept.elastic,
        plastic=kept.plastic,
        hourglass=kept.hourglass,
        rest=_stress_at_rest(relaxation.solver, kept.state, back.placements) if shown else None,
    )
    points = {name: setup.meshes[name].points + shapes[name] for name in names}
    return after, replace(
        part,
        back=back,
        lost=_lost(part, kept, back),
        jump_back=setup.rigid_kinetic(after) - back.kinetic_energy,
        hinge_impulse=_hinge_impulses(setup, back, points, velocities),
    )


def _stress_at_rest(solver: Solver, state: State, placements: Mapping[str, Placement]) -> Stress:
    """What recorders show of bodies in a state of equilibrium."""
    with wp.ScopedDevice(solver.device):
        found = NodalStress(solver, np.arange(solver.model.node_count, dtype=np.int32))
        found.launch(state)
        fields = [
            np.asarray(array.numpy(), dtype=np.float32) for array in (found.tensor, found.von_mises, found.plastic)
        ]
    rotations = {name: placement.rotation for name, placement in placements.items()}
    return Stress(stress=fields[0], von_mises=fields[1], plastic_strain=fields[2], rotations=rotations)


def _fit(
    setup: Setup, before: Motion, t: float, now: ByBody, rest: ByBody, velocities: ByBody
) -> tuple[ByBody, HandBack]:
    """Shapes at rest in the bodies' frames [m], and the rigid motion of these shapes that fits the nodes best.

    Args:
        setup: of the cycle.
        before: the motion at the start of the impact.
        t: time from the release [s].
        now, velocities: positions [m] and velocities [m/s] of the nodes by body, each shape (node_count, 3), float64.
        rest: positions in equilibrium [m].
    """
    points = {name: setup.meshes[name].points for name in now}
    base, held = setup.chain.links[0].body, pins(setup.scene)
    carriage = carriage_motion(setup.chain, t, points[base], setup.masses[base], now[base], velocities[base], held[0])
    near = setup.chain.angles(before.theta)
    common = {"near": near, "held": setup.held, "t": t, "carriage": carriage}
    still = {name: np.zeros_like(x) for name, x in rest.items()}
    shapes = hand_back(setup.chain, points, setup.masses, rest, still, **common).displacements
    deformed = {name: points[name] + shapes[name] for name in points}
    chain = deformed_chain(setup.chain, points, deformed, setup.masses, held)
    return shapes, hand_back(chain, deformed, setup.masses, now, velocities, **common)


def _lost(part: ImpactPart, kept: Shape, back: HandBack) -> float:
    """Energy of vibration [J]: of motion, elements and contact springs at the end, less what goes on."""
    energy = part.impact.scene_runs[0].ledger.energy()
    stored = sum(energy[key] for key in ("kinetic", "elastic", "plastic", "hourglass", "contact"))
    return stored - back.kinetic_energy - kept.strain_energy - back.drive_work


def _hinge_impulses(setup: Setup, back: HandBack, points: Mapping[str, Array], velocities: ByBody) -> ByBody:
    """Impulse on each link through its inbound hinge as its motion becomes rigid [N s], by body, each shape (2,)."""
    found, beyond = {}, np.zeros(2)
    for link in reversed(setup.chain.links):
        _, rigid = back.placements[link.body].place(points[link.body])
        beyond = beyond + setup.masses[link.body] @ (rigid - velocities[link.body])[:, :2]
        found[link.body] = beyond
    return dict(reversed(found.items()))


def _with_inertia_of(chain: Chain, other: Chain) -> Chain:
    """The chain with mass, centre and inertia of another one's links."""
    links = [
        replace(link, mass=own.mass, centre=own.centre, inertia=own.inertia)
        for link, own in zip(chain.links, other.links, strict=True)
    ]
    return replace(chain, links=tuple(links))
