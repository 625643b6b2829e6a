"""Owns the cycle of phases: a swing until something touches, an impact until all has parted, and so on.

Each kind of phase has a driver, which takes a `Motion` and returns the next one with its part of the history.
"""

from __future__ import annotations

from collections.abc import Mapping

from warp_mca.geometry.mesh import Mesh
from warp_mca.model.sensors import locate_sensors
from warp_mca.phases.arguments import Progress
from warp_mca.phases.checkpoint import Checkpoint
from warp_mca.phases.cycle_setup import Setup
from warp_mca.phases.impact_driver import ImpactDriver
from warp_mca.phases.meshing import mesh
from warp_mca.phases.parts import Part
from warp_mca.phases.prepare import Clock
from warp_mca.phases.settings import Settings
from warp_mca.phases.swing_driver import SwingDriver
from warp_mca.physics.elements.cells import nodal_masses
from warp_mca.rigid.body_motion import held_axes
from warp_mca.rigid.handoff import hand_off
from warp_mca.scene import Scene


def begin_cycle(
    scene: Scene, meshes: Mapping[str, Mesh] | None, span: float, settings: Settings, tell: Progress
) -> Setup:
    """Mesh a scene with `t_end`, and swing it to its first touch; each impact will last at most `span` [s].

    Raises:
        RequestError: the scene cannot be built as written.
    """
    assert scene.t_end is not None and scene.rigid is not None
    clock = Clock()
    tell("mesh", 0.0)
    made = mesh(scene, None, meshes)
    masses = nodal_masses(scene, made)
    clock.lap("mesh")
    tell("rigid", 0.0)
    first = hand_off(scene, made, masses, t_end=scene.t_end)
    assert first.chain is not None
    clock.lap("rigid")
    return Setup(
        scene=scene,
        rigid=scene.rigid,
        t_end=scene.t_end,
        span=span,
        meshes=made,
        sensors=locate_sensors(scene, made),
        masses=masses,
        held=held_axes(scene, made),
        first=first,
        chain=first.chain,
        settings=settings,
        clock=clock,
        tell=tell,
    )


def run_cycle(setup: Setup, store: Checkpoint | None = None) -> list[Part]:
    """Go through swings and impacts in turn until the time is up, from what `store` has of them.

    Raises:
        RequestError: the scene cannot be built as written.
        GuardError: an impact lost its footing.
    """
    swings, impacts = SwingDriver(setup), ImpactDriver(setup, store)
    motion, swing = swings.first()
    parts: list[Part] = [swing]
    while swing.swing.ended_by == "touch" and swing.stopped is None:
        after, impact = impacts.run(motion)
        parts.append(impact)
        if after is None:
            break
        motion, swing = swings.run(after)
        setup.clock.lap("rigid")
        parts.append(swing)
    return parts
