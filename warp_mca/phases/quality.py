"""Owns the quality of a scene's meshes: size, shape, and which element sets the stable time step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from warp_mca.geometry import Mesh
from warp_mca.scene import Scene


@dataclass(frozen=True, kw_only=True)
class BodyQuality:
    """Mesh of one body.

    Attributes:
        body: its name.
        elements, nodes: how many.
        min_scaled_jacobian: of the worst corner [-]; 1 is a brick, 0 flat, below 0 inverted.
        min_edge: length of the shortest edge [m].
    """

    body: str
    elements: int
    nodes: int
    min_scaled_jacobian: float
    min_edge: float


@dataclass(frozen=True, kw_only=True)
class Quality:
    """Meshes of a scene.

    Attributes:
        bodies: one entry each.
        stable_dt: smallest stable step [s].
        body, element: whose element sets it, and its index in that body's mesh.
        at: centre of that element in the body's frame [m].
        contact_share: share of that element's largest eigenvalue that comes from contact springs [-].
        warnings: what is worth a look in the meshes, one sentence each.
    """

    bodies: tuple[BodyQuality, ...]
    stable_dt: float
    body: str
    element: int
    at: tuple[float, float, float]
    contact_share: float
    warnings: tuple[str, ...] = ()


def quality_table(scene: Scene, meshes: Mapping[str, Mesh]) -> Quality:
    """Measure the meshes of a scene, placed as at the start of the impact phase.

    Args:
        scene: the scene.
        meshes: of every body, by its name.

    Raises:
        RequestError: the bodies cannot be put together, e.g. a joint's nodes do not coincide; or it is no scene.
    """
    from warp_mca.geometry.quality import edge_lengths, scaled_jacobian
    from warp_mca.model.build import build_model
    from warp_mca.phases.meshing import mesh
    from warp_mca.physics.elements.cells import nodal_masses
    from warp_mca.rigid.handoff import hand_off
    from warp_mca.watch.table import told_before

    meshes = mesh(scene, given=meshes)
    bodies = tuple(
        BodyQuality(
            body=name,
            elements=mesh.cell_count,
            nodes=len(mesh.points),
            min_scaled_jacobian=float(scaled_jacobian(mesh).min()),
            min_edge=float(edge_lengths(mesh).min()),
        )
        for name, mesh in ((body.name, meshes[body.name]) for body in scene.bodies)
    )
    start = hand_off(scene, meshes, nodal_masses(scene, meshes))
    model = build_model(scene, meshes, start.positions, start.velocities)
    owner, element = model.owner(model.stable.element)
    x, y, z = meshes[owner].points[meshes[owner].cell(element)].mean(axis=0).tolist()
    return Quality(
        bodies=bodies,
        stable_dt=float(model.stable.dt),
        body=owner,
        element=element,
        at=(x, y, z),
        contact_share=model.stable.contact_share,
        warnings=told_before(scene, meshes, model),
    )
