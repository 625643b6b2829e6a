"""Owns the device side of contact between edges: one such pass of the scene, or of each scene of a batch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.base.arrays import Index
from warp_mca.base.joining import offsets
from warp_mca.kernels.contact import contact, edge_meet, edge_pairs, edge_search, edge_springs, search
from warp_mca.physics.contact.contact_state import ContactState
from warp_mca.physics.contact.per_scene import per_scene
from warp_mca.physics.contact.skin_edges import EdgePass
from warp_mca.physics.contact.slave_edges import new_springs
from warp_mca.physics.contact.stage import ContactStage
from warp_mca.system.contact import LIST_LENGTH
from warp_mca.system.threads import CONTACT, Split, whole

if TYPE_CHECKING:
    from warp_mca.physics.contact.extremes import NormalForce
    from warp_mca.system.model import Model
    from warp_mca.system.state import State
    from warp_mca.system.workspace import Workspace

ROOM = 4 * LIST_LENGTH  # edges of the slave near one of the master


class EdgeStage(ContactStage):
    """Device side of one pass of edges; its state has a spring for each place of an edge of the slave."""

    items: Sequence[EdgePass]

    def __init__(self, items: Sequence[EdgePass], model: Model, index: int, normal_force: NormalForce) -> None:
        """As `ContactStage`."""
        self._begin(items, model, index, normal_force)
        friction = any(item.mu > 0.0 for item in items)
        self.meet = edge_meet.meet_kernel()
        self.kernel = edge_springs.press_kernel(friction, self.each, self.laws)
        self.share = edge_springs.share_kernel()
        self.bounds = edge_search.edge_bounds_kernel(self.each)
        self.find = edge_search.near_edges_kernel(self.each)
        self._place(model)
        self.slaves = self._edges("slave", "stiffness")
        self.masters = self._edges("master", "master_stiffness")
        first = offsets([len(item.master_edge) for item in items])
        self.count, self.face_scene = int(first[-1]), per_scene(first)
        self.lower, self.upper = (wp.zeros(self.count, dtype=wp.vec3f) for _ in range(2))
        self.bvh: Any = None
        self._make_rows()
        self.met = self._new_met()

    def _edges(self, side: str, stiffness: str) -> Any:
        found = edge_pairs.SkinEdges()
        found.node = wp.array(self._join(f"{side}_edge"), dtype=wp.int32)
        found.beside = wp.array(self._join(f"{side}_beside"), dtype=wp.int32)
        found.size = wp.array(self._join(f"{side}_size"), dtype=wp.float64)
        found.stiffness = wp.array(self._join(stiffness), dtype=wp.float64)
        bodies, tables = self._join(f"{side}_body"), offsets([item.factor.size for item in self.items])
        if side == "slave":  # rows of the table
            rows = zip(self.items, tables, strict=False)
            bodies = np.concatenate([first + len(item.factor) * item.slave_body for item, first in rows])
        found.body = wp.array(bodies, dtype=wp.int32)
        found.factor = wp.array(np.concatenate([item.factor.ravel() for item in self.items]), dtype=wp.float64)
        return found

    def _make_rows(self) -> None:
        """Edges around each node, those of the master counted down from -1; edges that meet each of the slave's."""
        mine, theirs = self._join("slave_edge"), self._join("master_edge")
        self.node, offset, edge = _rows(
            np.concatenate([mine.ravel(), theirs.ravel()]),
            np.repeat(np.concatenate([np.arange(len(mine)), -1 - np.arange(len(theirs))]), 2).astype(np.int32),
        )
        self.offset, self.edge = wp.array(offset, dtype=wp.int32), wp.array(edge, dtype=wp.int32)
        self.nodes = wp.array(self.node, dtype=wp.int32)
        place = np.searchsorted(self.node, mine)
        met = [np.concatenate([edge[offset[k] : offset[k + 1]] for k in ends]) for ends in place]
        chains = [[a, *sorted(set(near[near >= 0].tolist()) - {a})] for a, near in enumerate(met)]
        self.chains = edge_meet.Chains()
        self.chains.offset = wp.array(offsets([len(chain) for chain in chains]), dtype=wp.int32)
        self.chains.edge = wp.array(np.concatenate(chains), dtype=wp.int32)

    def _new_met(self) -> Any:
        found, count = edge_meet.Met(), int(self.springs[-1])
        kinds = {"edge": wp.int32, "before": wp.int32, "weight": wp.vec4d}
        kinds |= dict.fromkeys(("normal", "du", "force", "tangential"), wp.vec3d)
        kinds |= dict.fromkeys(("gap", "rest", "stiffness", "energy"), wp.float64)
        for name, kind in kinds.items():
            setattr(found, name, wp.zeros(count, dtype=kind))
        found.taken = wp.full(count, edge_meet.NOBODY, dtype=wp.int32)
        return found

    def new_state(self) -> ContactState:
        """Springs that nothing presses, and empty lists, on the current device."""
        springs = new_springs(int(self.springs[-1]), 0, self)
        springs.held.zero_()
        return ContactState(
            spring=springs,
            count=wp.zeros(len(self.slave), dtype=wp.int32),
            candidate=wp.zeros((len(self.slave), LIST_LENGTH), dtype=wp.int32),
            face_count=wp.zeros(self.count, dtype=wp.int32),
            face_slave=wp.zeros((self.count, ROOM), dtype=wp.int32),
            u_search=wp.zeros(0, dtype=wp.vec3d),
            slot=wp.zeros((0, 0), dtype=wp.int32),
        )

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [self.meet, self.kernel, self.share]

    def search_kernels(self) -> list[Any]:
        """Those of a search."""
        return [self.bounds, self.find]

    def begin(self, work: Workspace, state: State) -> None:
        """Springs hold nothing before the first step."""

    def find_boxes(self, work: Workspace, u: wp.array) -> None:
        """First part of a search: boxes around the master's edges, and the tree of these."""
        inputs = [work.X, u, self.masters, self.face_scene, self.origin, self.margin]
        wp.launch(self.bounds, self.count, inputs, [self.lower, self.upper])
        self._fit()

    def list_faces(self, work: Workspace, state: State, u: wp.array, split: Split = whole) -> None:
        """Second part of a search: the lists, which contact reads."""
        own = state.contacts[self.index]
        own.face_count.zero_()
        inputs = [self.bvh.id, work.X, u, self.slaves, self.masters, self.slave_scene, self.origin, self.margin]
        lists = [own.count, own.candidate, own.face_count, own.face_slave]
        wp.launch(self.find, len(self.slave), inputs, [*lists, state.flag])
        wp.launch(search.sort_lists, self.count, inputs=[own.face_count], outputs=[own.face_slave])

    def launch(self, work: Workspace, state: State, dt: float, split: Split = whole) -> None:
        """Contact forces of this pass, added to those on nodes; its normal forces, added to the sums of the step."""
        own, first = state.contacts[self.index], iter(range(1, len(state.normal_force)))

        def meet(part: slice) -> None:
            inputs = [part.start, work.X, state.u, state.v, self.slaves, self.masters, self.chains]
            inputs += [own.count, own.candidate, dt, own.spring, self.met]
            wp.launch(self.meet, part.stop - part.start, inputs, block_dim=contact.BLOCK_DIM)

        def press(part: slice) -> None:
            inputs = [part.start, state.v, self.slaves, self.masters, own.count, own.candidate]
            inputs += [self.slave_scene, self.mu, self.per_newton, dt, self.met, own.spring]
            outputs = [state.normal_force[next(first)], state.flag]
            wp.launch(self.kernel, part.stop - part.start, inputs, outputs, block_dim=contact.BLOCK_DIM)

        def share(part: slice) -> None:
            inputs = [part.start, self.nodes, self.offset, self.edge, self.slaves, self.masters]
            inputs += [own.face_count, own.face_slave, own.spring, self.met]
            wp.launch(self.share, part.stop - part.start, inputs, [work.nodal_force], block_dim=contact.BLOCK_DIM)

        springs = int(self.springs[-1])
        split(len(self.slave), meet, CONTACT)
        split(springs, press, CONTACT)
        split(max(springs, len(self.node)), share, CONTACT)


class NoEdgeStage(EdgeStage):
    """A pass of edges that has none, of bodies whose elements may fail: some may come."""

    def __init__(self, items: Sequence[EdgePass], model: Model, index: int, normal_force: NormalForce) -> None:
        """As `ContactStage`."""
        self._begin(items, model, index, normal_force)
        self.count, self.bvh = 0, None

    def kernels(self) -> list[Any]:
        """None."""
        return []

    search_kernels = kernels

    def find_boxes(self, work: Workspace, u: wp.array) -> None:
        """There is nothing to search."""

    def list_faces(self, work: Workspace, state: State, u: wp.array, split: Split = whole) -> None:
        """There is nothing to list."""

    def launch(self, work: Workspace, state: State, dt: float, split: Split = whole) -> None:
        """Nothing presses."""


def _rows(node: Index, entry: Index) -> tuple[Index, Index, Index]:
    """Compressed rows of the entries of each node: the nodes, sorted, the offsets of their rows, and the entries."""
    order = np.argsort(node, kind="stable")
    nodes, first = np.unique(node[order], return_index=True)
    return nodes.astype(np.int32), np.append(first, len(node)).astype(np.int32), entry[order].astype(np.int32)
