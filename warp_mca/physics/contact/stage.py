"""Owns the device side of contact: one pass of the scene, or of each scene of a batch, in the same launches."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.joining import offsets
from warp_mca.kernels.contact import contact, edges, nearest, pair_search, search, sides
from warp_mca.kernels.contact.laws import Laws
from warp_mca.kernels.records.columns import PASS, PASS_COLUMNS
from warp_mca.physics.contact.bonds import bond_lists, list_bonds
from warp_mca.physics.contact.contact_state import ContactState
from warp_mca.physics.contact.dashpots import check_dashpots
from warp_mca.physics.contact.friction_laws import friction_rows
from warp_mca.physics.contact.per_scene import device_pairs, numbers, per_scene, vectors
from warp_mca.physics.contact.slave_edges import SlaveEdges, faces_of_slaves, new_springs
from warp_mca.system.contact import LIST_LENGTH, SLOTS, ContactPass
from warp_mca.system.reading import on_host
from warp_mca.system.threads import CONTACT, Split, whole

if TYPE_CHECKING:
    from warp_mca.physics.contact.extremes import NormalForce
    from warp_mca.system.model import Model
    from warp_mca.system.state import State
    from warp_mca.system.workspace import Workspace


def has_sides(model: Model) -> bool:
    """Whether a master of the model has several sides, which need the latest forces on nodes, or may get some."""
    return any(item.side.any() or (model.fails and item.plane is None) for item in model.passes)


class ContactStage:
    """Device side of one contact pass.

    Attributes:
        items: the pass of each scene; no slave meets the faces of another scene.
        index: of the pass in a scene; its state is `State.contacts[index]`.
        column: of its sums in a record.
        sides: of the master, the most of any scene; each slave has a spring and a list of faces for each.
        springs, first: first spring of each scene, and the number of all, shape (scene_count + 1,), int32, on the host
            and on the device.
    """

    def __init__(self, items: Sequence[ContactPass], model: Model, index: int, normal_force: NormalForce) -> None:
        """Allocate on the current device; `normal_force` says how normal forces are summed."""
        self._begin(items, model, index, normal_force)
        friction = any(item.mu > 0.0 for item in items)
        if items[0].plane is not None:
            self.kernel = contact.plane_kernel(friction, self.each, self.may_rest, self.laws, model.fails)
            self._make_planes()
            return
        slots = SLOTS if self.general and self.sides > 1 else 1
        self.kernel = (
            contact.surface_kernel(friction, self.each, self.laws, self.noted, self.general, self.slave_lanes)
            if self.sides == 1
            else sides.sided_kernel(friction, self.each, self.sides // slots, self.laws, slots, self.slave_lanes)
        )
        self.react = contact.react_kernel(self.each, self.lanes, self.noted)
        self.bounds = search.bounds_kernel(self.each)
        self.find = search.candidates_kernel(self.each, self.sides, self.general)
        self.clear = (pair_search if self.general else search).clear_kernel(self.each, self.sides)
        self.slots = pair_search.slots_kernel(self.each, self.sides) if self.general and self.sides > 1 else None
        self._make_faces(model)

    def _begin(self, items: Sequence[ContactPass], model: Model, index: int, normal_force: NormalForce) -> None:
        """What springs need, whatever presses them."""
        self.items, self.index, self.column = items, index, PASS + PASS_COLUMNS * index
        self.per_newton, self.node_count = normal_force.per_newton(items), model.node_count
        self.each, self.slots = len(items) > 1, None
        self.sides = max(item.sides for item in items)
        self.noted = has_sides(model)
        slaves = offsets([len(item.slave) for item in items])
        self.springs = self.sides * slaves
        self.first = wp.array(self.springs, dtype=wp.int32)
        self.slave_scene = per_scene(slaves)
        self.slave = wp.array(self._join("slave"), dtype=wp.int32)
        self.stiffness = wp.array(self._join("stiffness"), dtype=wp.float64)
        self.lanes = contact.LANES if wp.get_device().is_cuda and not self.on_plane else 1
        self.mu, self.overlaps = numbers([item.mu for item in items]), {item.initial_overlap for item in items}
        self.may_rest = items[0].plane is None or self.overlaps != {"refuse"} or model.fails
        bonded, pressed = any(item.bonds is not None for item in items), "press" in self.overlaps
        self.laws = Laws(items[0].law, items[0].friction, bonded, pressed, any(item.returns for item in items))
        self.slave_lanes = contact.slave_lanes(self.lanes, len(self.slave), self.sides, bonded)
        check_dashpots(items)
        rows = np.repeat([item.parameters for item in items], np.diff(self.springs), axis=0)
        self.parameters = wp.array(rows, dtype=wp.float64, ndim=2)
        self.friction_parameters = wp.array(friction_rows(items, self.sides), dtype=wp.float64, ndim=2)

    def _join(self, name: str) -> NDArray:
        return np.concatenate([getattr(item, name) for item in self.items])

    def _rows(self, face: str, offset: str, number: str) -> tuple[wp.array, wp.array]:
        """Compressed rows of all scenes, which count faces and entries on."""
        faces, entries = (offsets([len(getattr(item, name)) for item in self.items]) for name in (face, number))
        rows = [getattr(item, offset)[:-1] + start for item, start in zip(self.items, entries, strict=False)]
        numbers = [getattr(item, number) + start for item, start in zip(self.items, faces, strict=False)]
        return (
            wp.array(np.append(np.concatenate(rows), entries[-1]), dtype=wp.int32),
            wp.array(np.concatenate(numbers), dtype=wp.int32),
        )

    def new_state(self) -> ContactState:
        """Springs that no face presses, and empty lists, on the current device."""
        surface = not self.on_plane
        lists, faces = (int(self.springs[-1]), len(self.face)) if surface else (0, 0)
        room = max(item.room for item in self.items)
        return ContactState(
            spring=new_springs(int(self.springs[-1]), int(self.springs[-1]) if self.sides > 1 else 0, self),
            count=wp.zeros(lists, dtype=wp.int32),
            candidate=wp.zeros((lists, LIST_LENGTH), dtype=wp.int32),
            face_count=wp.zeros(faces, dtype=wp.int32),
            face_slave=wp.zeros((faces, room), dtype=wp.int32),
            u_search=wp.zeros(self.node_count if surface else 0, dtype=wp.vec3d),
            slot=wp.full((len(self.slave), SLOTS) if self.slots else (0, 0), -1, dtype=wp.int32),
        )

    def _make_planes(self) -> None:
        planes = [item.plane for item in self.items if item.plane is not None]
        unit = [n / np.linalg.norm(n) for n in (np.asarray(plane.normal, dtype=float) for plane in planes)]
        self.planes = [vectors([p.point for p in planes]), vectors(unit), vectors([p.velocity for p in planes])]
        self.deepest = numbers([item.deepest for item in self.items])

    def _make_faces(self, model: Model) -> None:
        faces = offsets([len(item.face) for item in self.items])
        masters = offsets([len(item.master) for item in self.items])
        self.longest = numbers([item.longest for item in self.items])
        self._place(model)
        self.face_scene, self.master_scene = per_scene(faces), per_scene(masters)
        self.face = wp.array(self._join("face"), dtype=wp.int32)
        self.face_stiffness = wp.array(self._join("face_stiffness"), dtype=wp.float64)
        self.side = wp.array(self._join("side"), dtype=wp.int32) if self.sides > 1 else 0
        self.master = wp.array(self._join("master"), dtype=wp.int32)
        self.face_offset, self.face_of_node = self._rows("face", "face_offset", "face_of_node")
        self.pairs, self.edges = device_pairs([item.pairs for item in self.items]), None
        self.slave_faces = edges.SlaveFaces()
        self.slave_faces.node = self.slave
        if self.sides > 1 or self.general:
            rows = self._rows("slave_face", "slave_offset", "face_of_slave")
            self.slave_faces = faces_of_slaves(self, self._join("slave_face"), rows)
        if self.sides > 1:
            self.edges = SlaveEdges(self)
        self.lower, self.upper = (wp.zeros(len(self.face), dtype=wp.vec3f) for _ in range(2))
        self.bvh: Any = None

    def _place(self, model: Model) -> None:
        """Where the search looks, and how far ahead."""
        self.margin = numbers([item.margin for item in self.items])
        self.origin = vectors([model.X[item.master].mean(axis=0) for item in self.items])

    @property
    def on_plane(self) -> bool:
        """Whether the master is a rigid plane, in each scene."""
        return self.items[0].plane is not None

    @property
    def general(self) -> bool:
        """Whether this is the pass of a general contact."""
        return self.items[0].pairs is not None

    @property
    def is_replayable(self) -> bool:
        """Whether a graph can hold the search: on a GPU, once a first search has built the tree of boxes."""
        return not self.on_plane and self.bvh is not None and wp.get_device(self.slave.device).is_cuda

    @property
    def blocks(self) -> int:
        """Blocks of threads that look at the slaves, most of which are idle where a master has sides."""
        return -(-(self.slave_lanes if self.sides == 1 else 1) * len(self.slave) // contact.BLOCK_DIM)

    def kernels(self) -> list[Any]:
        """Those of a step."""
        if self.on_plane:
            return [self.kernel]
        return [self.kernel, self.react, *([self.edges.carry] if self.edges else [])]

    def search_kernels(self) -> list[Any]:
        """Those of a search."""
        if self.on_plane:
            return []
        found = [self.bounds, self.find, self.clear, *([self.slots] if self.slots else [])]
        return found + ([self.edges.find] if self.edges else []) + bond_lists(self)

    def begin(self, work: Workspace, state: State) -> None:
        """Note which slaves are clear of the master before the first step, after the first search."""
        if not self.on_plane:
            own = state.contacts[self.index]
            inputs = [self.bvh.id, work.X, state.u, self.slave, self.face, *self._tables(own), self.side]
            inputs += [self.slave_scene, self.origin, self.longest]
            wp.launch(self.clear, len(self.slave), inputs=inputs, outputs=[own.spring.held])

    def find_boxes(self, work: Workspace, u: wp.array) -> None:
        """First part of a search, or broad phase: boxes around the master's faces, and the tree of these."""
        if self.on_plane:
            return
        inputs = [work.X, u, self.face, self.face_scene, self.origin, self.margin]
        wp.launch(self.bounds, len(self.face), inputs=inputs, outputs=[self.lower, self.upper])
        self._fit()

    def _fit(self) -> None:
        """The tree of boxes, anew or as they have moved."""
        if self.bvh is None:
            self.bvh = wp.Bvh(self.lower, self.upper, groups=self.face_scene if self.each else None)
        else:
            self.bvh.refit()

    def list_faces(self, work: Workspace, state: State, u: wp.array, split: Split = whole) -> None:
        """Second part of a search: what each slave may touch until the next one."""
        if self.on_plane:
            return
        own = state.contacts[self.index]
        own.face_count.zero_()

        def launch(kernel: Any, inputs: Sequence[Any], outputs: Sequence[Any], part: slice) -> None:
            wp.launch(kernel, part.stop - part.start, [part.start, *inputs], outputs)

        inputs = [self.bvh.id, work.X, u, self.slave_faces, self.face, self.pairs_of(own)]
        places = [self.slave_scene, self.origin]
        if self.slots:
            split(len(self.slave), partial(launch, self.slots, [*inputs, *places, own.spring], [own.slot]), CONTACT)
        inputs += [self.side, *places]
        lists = [own.count, own.candidate, own.face_count, own.face_slave, own.u_search, state.flag]
        split(len(self.slave), partial(launch, self.find, inputs, lists), CONTACT)
        if self.edges:
            self.edges.list_faces(self, work, state, u, split)
        list_bonds(self, own, state)
        wp.launch(search.sort_lists, len(self.face), [own.face_count], [own.face_slave])
        wp.launch(search.mark_masters, len(self.master), [u, self.master], [own.u_search])

    def launch(self, work: Workspace, state: State, dt: float, split: Split = whole) -> None:
        """Contact forces of this pass, added to those on nodes; its normal forces, added to the sums of the step."""
        own, first = state.contacts[self.index], iter(range(1, len(state.normal_force)))

        def launch(kernel: Any, lanes: int, inputs: Sequence[Any], part: slice) -> None:
            threads = lanes * (part.stop - part.start)
            outputs: list[Any] = [work.nodal_force, state.flag]
            if not self.on_plane:
                outputs.insert(1, state.recent_force)
            if kernel is self.kernel:  # a row of sums for each range of slaves
                outputs.insert(1, state.normal_force[next(first)])
            wp.launch(kernel, threads, [part.start, *inputs], outputs, block_dim=contact.BLOCK_DIM)

        nodes, slaves = [work.X, state.u, state.v], [self.slave, self.stiffness]
        if self.on_plane:
            inputs = [*nodes, *slaves, self.slave_scene, *self.planes, self.mu, self.deepest]
            inputs += [self.per_newton, dt, own.spring]
            split(len(self.slave), partial(launch, self.kernel, 1, inputs), CONTACT)
            return
        inputs = [*nodes, own.u_search, *slaves, self.faces_of(own), *(self._tables(own) or [0])]
        if self.edges:
            inputs = [self._surfaces(work, state), state.v, own.u_search]
        inputs += [self.slave_scene, self.mu, self.margin, self.per_newton, dt, own.spring]
        split(len(self.slave), partial(launch, self.kernel, self.slave_lanes, inputs), CONTACT)
        inputs = [state.u, own.u_search, self.master, self.face_offset, self.face_of_node, self.face]
        inputs += [own.face_count, own.face_slave, self.master_scene, self.margin, own.spring]
        split(len(self.master), partial(launch, self.react, self.lanes, inputs), CONTACT)
        if self.edges:
            self.edges.launch(work, own, split)

    def faces_of(self, own: ContactState) -> Any:
        """The master's faces with what the latest search listed."""
        found = nearest.Master()
        found.face, found.stiffness = self.face, self.face_stiffness
        found.count, found.candidate = own.count, own.candidate
        return found

    def pairs_of(self, own: ContactState) -> Any:
        """Bodies of a general contact with the springs that each node has for them; empty in a listed contact."""
        self.pairs.slot = own.slot
        return self.pairs

    def _tables(self, own: ContactState) -> list[Any]:
        """The argument that kernels of general contact have beside those of a listed one."""
        return [self.pairs_of(own)] if self.general else []

    def _surfaces(self, work: Workspace, state: State) -> Any:
        """Both surfaces, as the kernel of a master with several sides takes them."""
        assert self.edges
        found = edges.Surfaces()
        own = state.contacts[self.index]
        found.X, found.u, found.slaves = work.X, state.u, self.edges.faces
        found.master, found.pairs = self.faces_of(own), self.pairs_of(own)
        return found

    def rest_at(self, state: State, depth: NDArray[np.float64], rate: NDArray[np.float64]) -> None:
        """Let springs be free of force at these depths, which shrink at a rate [m], both of shape (spring_count,)."""
        spring = state.contacts[self.index].spring
        spring.rest.assign(depth)
        spring.pressed.assign(np.column_stack([rate, 0.0 * rate])[: len(spring.pressed)])

    def depths(self, state: State, scene: int) -> NDArray[np.float64]:
        """Largest penetration so far of each spring of a scene [m], those of slave 0 first, shape (spring_count,)."""
        return on_host(state.contacts[self.index].spring.depth)[self.springs[scene] : self.springs[scene + 1]]
