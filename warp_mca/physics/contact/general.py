"""Owns the host side of general contact: one pass of the skins of all bodies against each other and themselves."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.physics.contact.resting import at_rest
from warp_mca.physics.contact.skin_edges import edge_eigenvalues, general_edges
from warp_mca.physics.contact.stiffness import CURVED, FLAT, Inertia, flat_modulus, node_mean
from warp_mca.physics.contact.surfaces import LONGEST_LIST, surface_faces, surface_pass
from warp_mca.scene import ContactAll, Surface
from warp_mca.system.contact import SLOTS, ContactPass, Faces, Pairs

if TYPE_CHECKING:
    from warp_mca.system.bodies import Bodies

DEEP = 2.0  # times the width of a face, as far behind which nodes of its own body lie in the wall below it
ASIDE = 1.0  # widths of a face, as far beside it


def general_passes(parts: Bodies, contact: ContactAll, index: int, velocity: Array) -> tuple[list[ContactPass], Array]:
    """The pass of a general contact, that of its edges if some may cross, and what their springs can add to the
    largest eigenvalue at each node [1/s^2].

    Its springs are those that a two-way `Contact` of each pair would have.
    """
    assert not isinstance(contact.penalty, str)  # a scene refuses it
    pairs = parts.scene.general_pairs()
    names = [body.name for body in parts.scene.bodies if any(body.name in pair for pair in pairs)]
    skins = [surface_faces(parts, Surface(body=name, nodes="boundary")) for name in names]
    number = {name: k for k, name in enumerate(names)}
    factor = np.zeros((len(names), len(names)))
    curved = [bool(skin.curved.any()) for skin in skins]
    for one, other in pairs:
        a, b = number[one], number[other]
        default = 0.5 * FLAT  # two equal layers in series
        if a != b:
            default = CURVED if curved[a] or curved[b] else _flat_default(skins[a], skins[b], (parts.K, parts.G))
        factor[a, b] = factor[b, a] = 0.5 * (default if contact.penalty is None else contact.penalty)
    union = Faces(*(np.concatenate([getattr(skin, name) for skin in skins]) for name in Faces.__dataclass_fields__))
    own = union.contact if contact.penalty is None else union.bulk
    of_node = node_mean(union.nodes, union, own)
    settled = at_rest(parts, contact, pairs, union.nodes, 2.0 * factor.max() * of_node, velocity)
    item = surface_pass(settled, index, union, union, of_node, own, 0.0)
    slave_of = np.concatenate([np.full(len(skin.nodes), k) for k, skin in enumerate(skins)])
    order = np.argsort(np.concatenate([skin.nodes for skin in skins]))
    face_of = np.concatenate([np.full(len(skin.node), k) for k, skin in enumerate(skins)])
    folds = [bool(factor[k, k]) for k in range(len(names))]
    offset, barred = _barred(parts.X, union, item, np.array(folds)[face_of])
    body, faces = slave_of[order].astype(np.int32), face_of.astype(np.int32)
    room = max(item.room, min(2 * item.room, LONGEST_LIST)) if any(folds) else item.room  # folds crush cells
    found = Pairs(body=body, face=faces, factor=factor, barred_offset=offset, barred=barred)
    item = replace(item, room=room, pairs=found)
    added = _eigenvalues(parts.mass, item, union)
    edges = general_edges(parts.X, Inertia.of(parts), item, union, contact)
    if edges is None:
        return [item], added
    nodes, value = edge_eigenvalues(edges, parts.mass)
    added[nodes] += value
    return [item, edges], added


def _flat_default(one: Faces, other: Faces, moduli: tuple[Array, Array]) -> float:
    """Factor of the lower stiffness of two flat skins by E / (1 - nu^2), as `spring_stiffness` has it by their layers.

    It takes `flat_modulus` in place of that, and the layers of both skins in series. Skins count by their medians.
    """
    plain, confined, layer = [], [], []
    for skin in (one, other):
        K, G = (modulus[skin.element] for modulus in moduli)
        contact = 4.0 * G * (3.0 * K + G) / (3.0 * K + 4.0 * G)
        stiffness = skin.contact * flat_modulus(contact, K, G) / contact
        plain.append(float(np.median(skin.contact)))
        confined.append(float(np.median(stiffness)))
        layer.append(float(np.median(stiffness / skin.area)))
    return FLAT / (1.0 + min(layer) / max(layer)) * min(confined) / min(plain)


def _barred(X: Array, union: Faces, item: ContactPass, folds: Array) -> tuple[Index, Index]:
    """Faces of its own body that each slave node never meets, compressed rows, int32, of the bodies that may fold.

    These are the faces that hold the node or a neighbour of it, and those of the wall on whose other side it lies.
    """
    from scipy.sparse import csr_array
    from scipy.spatial import KDTree

    nodes, face = item.slave, item.face
    place = np.full(nodes[-1] + 1, -1)
    place[nodes] = np.arange(len(nodes))
    rows = np.repeat(np.arange(len(face)), 4)
    shape = (len(face), len(nodes))
    holds = csr_array((np.ones(len(rows)), (rows, place[face.ravel()])), shape=shape)
    near = (holds.T @ holds @ holds.T).tocoo()  # node to faces that hold it, to their nodes, to faces around these
    found = [np.stack([near.row, near.col])]
    width, unit = np.sqrt(union.area), union.normal / union.area[:, None]
    first = np.flatnonzero(folds)
    if len(first):
        tree = KDTree(X[nodes])
        reach = np.hypot(DEEP * width, (ASIDE + 1.0) * width)[first]
        around = tree.query_ball_point(union.middle[first], reach)
        f, s = np.repeat(first, [len(own) for own in around]), np.concatenate(around).astype(int)
        arm = X[nodes[s]] - union.middle[f]
        depth = -(arm * unit[f]).sum(axis=1)
        aside = np.linalg.norm(arm + depth[:, None] * unit[f], axis=1)
        size = np.linalg.norm(X[face] - union.middle[:, None], axis=2).max(axis=1)
        behind = (depth > 0.0) & (depth < DEEP * width[f]) & (aside < size[f] + ASIDE * width[f])
        found.append(np.stack([s[behind], f[behind]]))
    s, f = np.unique(np.concatenate(found, axis=1), axis=1)
    kept = folds[f]
    s, f = s[kept], f[kept]
    return np.searchsorted(s, np.arange(len(nodes) + 1)).astype(np.int32), f.astype(np.int32)


def _eigenvalues(mass: Array, item: ContactPass, union: Faces) -> Array:
    """What the springs add at each node of the model [1/s^2], shape (node_count,); see `contact_eigenvalues`.

    Each node is slave and master at once. As a slave it may be pressed by as many other bodies as it has springs for,
    or by its own; slaves of several bodies share the area around a master node.
    """
    assert item.pairs is not None
    nodes, own_body, face_body, factor = item.slave, item.pairs.body, item.pairs.face, item.pairs.factor
    around = np.maximum.reduceat(item.face_stiffness[item.face_of_node], item.face_offset[:-1])
    area = node_mean(nodes, union, union.area)
    pressed, reacting = np.zeros((len(factor), len(nodes))), np.zeros(len(nodes))
    for b in range(len(factor)):
        stiffest_face = item.face_stiffness[face_body == b].max()
        stiffest, usual = item.stiffness[own_body == b].max(), float(np.median(area[own_body == b]))
        for a in range(len(factor)):
            if factor[a, b] == 0.0:
                continue
            mine = own_body == a
            k = item.stiffening * item.at_once * factor[a, b] / mass[nodes[mine]]
            shared = np.maximum(1.0, area[mine] / usual)
            pressed[b, mine] = 2.0 * k * np.minimum(item.stiffness[mine], stiffest_face)
            reacts = 2.0 * k * np.minimum(around[mine], stiffest) * shared
            reacting[mine] = np.maximum(reacting[mine], reacts)
    alone = pressed[own_body, np.arange(len(nodes))].copy()
    pressed[own_body, np.arange(len(nodes))] = 0.0
    at_once = np.sort(pressed, axis=0)[-SLOTS if item.sides > 1 else -1 :].sum(axis=0)
    added = np.zeros(len(mass))
    added[nodes] = np.maximum(at_once, alone) + reacting
    return added
