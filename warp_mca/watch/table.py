"""Owns the table of all guards, warnings and advice, in the order in which a run tells them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.watch import (
    bending,
    contacts,
    elements,
    energy,
    guards,
    histories,
    inertia,
    meshes,
    motion,
    passing,
    units,
    vibration,
)
from warp_mca.watch.row import Context, Finished, Row

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.model.model import Model
    from warp_mca.scene import Scene

FIGURES: tuple[Row, ...] = (
    elements.large_strain,
    elements.lost_volume,
    elements.shaken_pressure,
    inertia.raised_inertia,
    bending.bending,
    bending.bending_flow,
    bending.bending_without_flow,
    energy.imbalance_of_exchange,
    energy.energy_of_switching,
    energy.turned_edge,
    energy.soft_springs,
    contacts.small_patch,
    contacts.driven_into_a_plane,
    contacts.deep_in_a_thin_body,
    contacts.undented_master,
    motion.lost_velocity,
    motion.stretched_set,
)
BEFORE: tuple[Row, ...] = (
    meshes.note_of_a_reader,
    meshes.sliver,
    meshes.doubled_node,
    meshes.loose_pieces,
    meshes.path_without_stress,
    meshes.coarse_slave,
    meshes.coarse_shape,
    meshes.free_joint_node,
    meshes.coarse_tied_slave,
    units.strange_material,
    units.low_yield_stress,
    units.high_yield_stress,
    units.large_part,
    units.small_part,
    units.large_body,
    units.small_body,
    units.large_angle,
    units.gravity_in_millimetres,
    units.penalty_in_newtons_per_metre,
    units.supersonic_approach,
)
EVENTS: tuple[Row, ...] = (
    meshes.coarse_mass,
    motion.slender_rods,
    passing.overlap_at_the_start,
    passing.below_a_plane,
    passing.bodies_in_each_other,
    passing.body_in_itself,
    histories.no_contact,
    histories.unfinished_contact,
    histories.nearly_opened,
    histories.grazing_touch,
    histories.normal_off_its_axis,
    histories.friction_across_the_tangent,
    vibration.flutter,
    vibration.vibration_aside,
    vibration.ringing,
    motion.creep,
)
TABLE: tuple[Row, ...] = (*guards.ROWS, *FIGURES, *BEFORE, *EVENTS)


def told_before(scene: Scene, meshes: Mapping[str, Mesh], model: Model) -> tuple[str, ...]:
    """What is worth a look in a scene before it runs, one sentence each.

    Args:
        scene: the scene.
        meshes: of its bodies, by name.
        model: assembled of them.
    """
    return _told(BEFORE, Context(scene=scene, meshes=meshes, model=model))


def told_at_the_end(finished: Finished, before: Sequence[str]) -> tuple[str, ...]:
    """All that a run says of itself, one sentence each, with what was told `before` it."""
    return (*_told(FIGURES, finished), *before, *_told(EVENTS, finished))


@np.errstate(over="ignore", invalid="ignore")  # of absurd values, which are told or stopped elsewhere
def _told(rows: Sequence[Row], context: Context) -> tuple[str, ...]:
    return tuple(sentence for item in rows for sentence in item.told(context))
