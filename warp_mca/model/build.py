"""Owns the way from a scene and its meshes to a `Model`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.geometry.mesh import Mesh
from warp_mca.model.assembly import Assembly
from warp_mca.model.damping import load_decays, with_damping
from warp_mca.model.mass_scaling import check_masses, scale_masses
from warp_mca.model.own_steps import OwnSteps
from warp_mca.model.rigid_step import bounce_factor, stable_with_rigid
from warp_mca.model.viscosity import share_of_step, with_viscosity
from warp_mca.physics.absorbing.nodes import absorbing_nodes
from warp_mca.physics.contact.axes import contact_axes
from warp_mca.physics.contact.bonds import Place, on_bonds
from warp_mca.physics.contact.general import general_passes
from warp_mca.physics.contact.listed import as_settled, growth, passes_of
from warp_mca.physics.contact.surfaces import surface_faces
from warp_mca.physics.joints.constraints import check_bindings, constraints, free_nodes, join_bodies, nodes_of
from warp_mca.physics.loads.joint_loads import hinge_loads, movable_bases
from warp_mca.physics.loads.nodal import loaded_nodes
from warp_mca.physics.rigid.bodies import Rigid, check_loads, flexible, own_nodes, rigid_bodies
from warp_mca.physics.ties.nodes import check_ties, on_faces, tied_nodes, velocities
from warp_mca.scene import ContactAll, RigidPlane, Scene
from warp_mca.system.contact import ChosenPenalty, ContactPass
from warp_mca.system.loads import LoadedNodes
from warp_mca.system.model import Model

if TYPE_CHECKING:
    from warp_mca.rigid.chain import Chain

Grouping = Callable[[Model, OwnSteps], Model]


def _contacts(
    parts: Assembly, velocity: Array, places: Mapping[int, Place]
) -> tuple[tuple[ContactPass, ...], Array, Array, Array, tuple[ChosenPenalty | None, ...]]:
    """Passes, the axes along which each contact's force is reported, what springs add to the eigenvalue and dashpots to
    the rate of decay at each node, and penalties that were chosen."""
    passes: list[ContactPass] = []
    penalties: list[ChosenPenalty | None] = []
    axes = np.zeros((len(parts.scene.contacts), 2, 3))
    added, decays = np.zeros((2, len(parts.X)))
    for index, contact in enumerate(parts.scene.contacts):
        if isinstance(contact, ContactAll):
            found, value = general_passes(parts, contact, index, velocity)
            added += value
            decays += found[0].decay_share * value
            passes += found
            penalties.append(None)
            continue
        slave = surface_faces(parts, contact.slave)
        master = None if isinstance(contact.master, RigidPlane) else surface_faces(parts, contact.master)
        contact, chosen = as_settled(parts, contact, slave, master, velocity)
        penalties.append(chosen)
        given, factor = (
            passes_of(parts, contact, index, slave, master, places.get(index)),
            bounce_factor(contact, parts.scene),
        )
        for item, nodes, value in given:
            np.add.at(added, nodes, factor * value)
            np.add.at(decays, nodes, item.decay_share * value)
            passes.append(item)
        added += factor * growth(parts, contact, index, given)
        axes[index] = contact_axes(parts.X, contact, slave, master)
    return tuple(passes), axes, added, decays, tuple(penalties)


@np.errstate(over="ignore", invalid="ignore")  # `stable_step` raises for values that are not finite
def build_model(
    scene: Scene,
    meshes: Mapping[str, Mesh],
    X: Mapping[str, Array],
    V: Mapping[str, Array],
    watched: Sequence[tuple[str, int]] = (),
    *,
    chain: Chain | None = None,
    start: float = 0.0,
    grouping: Grouping | None = None,
) -> Model:
    """Assemble a scene whose bodies stand at X [m] and move with V [m/s], by body, shape (node_count, 3), float64.

    `watched` are nodes whose velocity is recorded beside that of tip and target, by body and index in its mesh. What
    acts in the joints of a `chain` and moves its base goes on, from `start` on [s], counted from the release.
    `grouping` sorts the elements by steps of their own.

    Raises:
        RequestError: joints whose nodes do not coincide, nodes bound twice, unknown sets, cells without material.
    """
    shape = X
    places, X = on_bonds(scene, meshes, X)
    ties = tied_nodes(scene, meshes, X)
    parts = Assembly(scene, meshes, on_faces(ties, scene, X), shape)
    velocity = velocities(ties, scene, X, V)
    pairs, joints, couplings = join_bodies(parts)
    soft = flexible(couplings, pairs, own_nodes(parts))
    bases = movable_bases(parts, joints, soft, chain, start)
    check_loads(scene, chain, bases)
    for base in bases:
        pairs["joint_tied"][base.start : base.end] = 0.0
    held = constraints(parts, velocity)
    check_bindings(parts, joints, held, pairs)
    passes, axes, added, decays, penalties = _contacts(parts, velocity, places)
    absorbing = absorbing_nodes(parts, velocity, held, pairs)
    added[absorbing.node] += absorbing.eigenvalues(parts.mass)
    loads = loaded_nodes(parts, start, added, grouping is not None)
    rigid = rigid_bodies(parts, pairs, joints, couplings, passes, loads, velocity)
    check_ties(ties, held, [nodes_of(pairs), absorbing.node, *(body.nodes for body in rigid.rigid_bodies)])
    added, parts.relief = ties.shared(added, parts.mass), ties.relief(parts.mass)
    found: dict[str, Any] = {**_bodies(parts, watched), **held, **pairs}
    found |= _steps(parts, rigid, added, velocity, decays, loads)
    model = Model(
        V=velocity,
        **found,
        mass=ties.carried(parts.mass),
        joints=joints,
        couplings=soft,
        hinge_loads=hinge_loads(parts, free_nodes(held, pairs, ties), chain, start),
        bases=bases,
        loads=loads,
        absorbing=absorbing,
        ties=ties,
        passes=passes,
        contact_axes=axes,
        penalties=penalties,
        **rigid._asdict(),
    )
    return grouping(model, OwnSteps(parts, added, share_of_step(parts, velocity))) if grouping else model


def _bodies(parts: Assembly, watched: Sequence[tuple[str, int]]) -> dict[str, Any]:
    """What a model says of its bodies, by the name of the attribute."""
    blocks, order = parts.blocks()
    rigid_blocks, rigid_order = parts.blocks(rigid=True, first=len(order))
    others = [parts.node_start[body] + node for body, node in watched]
    points = [parts.nearest(parts.scene.tip), parts.nearest(parts.scene.target), *others]
    return {
        "X": parts.X,
        "blocks": blocks,
        "law": parts.law(),
        "gravity": np.array([parts.scene.gravity], dtype=np.float64),
        "points": np.array(points, dtype=np.int32),
        "node_start": parts.node_start,
        "element_start": parts.element_start,
        "element_of": np.concatenate([order, rigid_order]),
        "rigid_blocks": rigid_blocks,
    }


def _steps(
    parts: Assembly,
    rigid: Rigid,
    added: Array,
    velocity: Array,
    decays: Array,
    loads: Mapping[str, Sequence[LoadedNodes]],
) -> dict[str, Any]:
    """Stable step and mass scaling, by the name of the attribute; mass scaling raises the masses of the assembly."""
    plain = stable_with_rigid(parts, rigid, added, velocity) if rigid.rigid_bodies else parts.stable(added)
    stable, scaling = scale_masses(parts, added, plain)
    decay = float((decays + load_decays(loads, parts.mass)).max(initial=0.0))
    stable = with_damping(with_viscosity(stable, parts, velocity, decay), parts, loads, added, decay)
    check_masses(parts, scaling)
    return {"stable": stable, "scaling": scaling}
