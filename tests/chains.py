"""Impact phases of chains of bars that touch nothing, which go on from a rigid phase."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.model.build import Grouping, build_model
from warp_mca.model.paths import locate
from warp_mca.phases.impact import Impact
from warp_mca.phases.prepare import Prepared
from warp_mca.physics.elements.cells import nodal_masses
from warp_mca.rigid.handback import HandBack, carriage_motion, hand_back
from warp_mca.rigid.handoff import HandOff, hand_off
from warp_mca.rigid.scene_chain import pins
from warp_mca.rigid.swing import Swing, swing_until

START, SPAN = 0.02, 1e-3  # of the impact phase, from the release [s]
LENGTH = 0.2
TORQUE = mca.JointTorque(joint="A", times=(0.0, 0.0205, 0.03), torques=(1.0, 3.0, -20.0))
BASE = mca.BaseMotion(times=(0.0, 0.0204, 0.03), vx=(0.5, 1.5, 0.5), vy=(0.0, -1.0, 1.0))


def bars(count: int = 2, gravity: float = 9.8, elements: int = 10, **rigid: Any) -> mca.Scene:
    """Equal bars in a row from O at the origin; joints O, A, B from there outwards."""
    names = [f"bar{k}" for k in range(count)]
    box = mca.Box(size=(LENGTH, 0.02, 0.02), divisions=(elements, 2, 2), origin=(0.0, -0.01, -0.01))
    metal = mca.Elastic(E=70e9, nu=0.3, rho=2700.0)
    end, joints = (LENGTH, 0.0, 0.0), [mca.Revolute(name="O", body=names[0], at=(0.0, 0.0, 0.0))]
    joints += [mca.Revolute(name="AB"[k], body=names[k], at=end, other=names[k + 1]) for k in range(count - 1)]
    given = {"theta": (1.0, 1.4)[:count], "theta_dot": (-3.0, 2.0)[:count], **rigid}
    return mca.Scene(
        name="bars",
        bodies=tuple(mca.Body(name=name, geometry=box, material=metal, element="hex8") for name in names),
        joints=tuple(joints),
        gravity=(0.0, -gravity, 0.0),
        rigid=mca.RigidPhase(
            tip=mca.Tip(body=names[-1], centre=(LENGTH, 0.0, 0.0), radius=0.01),
            target=mca.RigidPlane(point=(0.0, -9.0, 0.0)),
            **given,
        ),
        impact=mca.ImpactPhase(duration=SPAN, output_interval=1e-4),
    )


def ready(scene: mca.Scene, start: float = START, grouping: Grouping | None = None) -> Prepared:
    """A scene whose impact phase begins after so much of its rigid phase [s]."""
    meshes = mca.mesh(scene)
    begin = hand_off(scene, meshes, nodal_masses(scene, meshes), t_end=start)
    model = build_model(
        scene, meshes, begin.positions, begin.velocities, chain=begin.chain, start=start, grouping=grouping
    )
    return Prepared(scene, meshes, begin, model, locate(scene, model, meshes))


def impact(*scenes: mca.Scene, start: float = START, span: float = SPAN, **settings: Any) -> Impact:
    """Their impact phase side by side, in float64, before its first step."""
    chosen = {"device": "cpu", "precision": "float64", "threads": 1, **settings}
    return Impact([ready(item, start) for item in scenes], span, **chosen)


def rigid_end(begin: HandOff, start: float = START, span: float = SPAN) -> Swing:
    """The rigid phase that goes on in place of the impact."""
    assert begin.chain is not None
    return swing_until(begin.chain, begin.theta, begin.theta_dot, (), t_start=start, t_end=start + span)


def motion_at_end(found: Impact, end: float = START + SPAN) -> HandBack:
    """The rigid motion that fits the nodes of a lone scene at the last record."""
    item, (u, v) = found.ready[0], found.at_last_record()
    chain, names = item.start.chain, [body.name for body in item.scene.bodies]
    assert chain is not None

    def by_body(field: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        starts = [item.model.node_start[name] for name in names[1:]]
        return dict(zip(names, np.split(field, starts), strict=True))

    positions, velocities = by_body(item.model.X + u), by_body(v)
    points = {name: mesh.points for name, mesh in item.meshes.items()}
    masses, base = nodal_masses(item.scene, item.meshes), names[0]
    own = (points[base], masses[base], positions[base], velocities[base])
    carriage = carriage_motion(chain, end, *own, pins(item.scene)[0])
    near = chain.angles(item.start.theta)
    return hand_back(chain, points, masses, positions, velocities, near=near, t=end, carriage=carriage)
