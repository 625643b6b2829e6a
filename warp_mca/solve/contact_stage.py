"""Owns the device side of contact: one pass of the scene, or of each scene of a batch, in the same launches."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.kernels.contact import contact, edges, nearest, search, sides, spring
from warp_mca.model.layout import offsets
from warp_mca.model.surfaces import LIST_LENGTH, ContactPass
from warp_mca.solve.extremes import NormalForce
from warp_mca.solve.threads import CONTACT, Split, whole

if TYPE_CHECKING:
    from warp_mca.model.model import Model


def per_scene(first: NDArray[np.int32]) -> Any:
    """Scene of each entry for kernels: 0 where there is one scene, else an array; see `kernels.hardware.each`."""
    if len(first) == 2:
        return 0
    return wp.array(np.repeat(np.arange(len(first) - 1), np.diff(first)), dtype=wp.int32)


def _numbers(values: Sequence[float]) -> Any:
    """A number of each scene, as kernels take it."""
    return values[0] if len(values) == 1 else wp.array(list(values), dtype=wp.float64)


def _vectors(values: Sequence[Any]) -> Any:
    """A vector of each scene, as kernels take it."""
    return wp.vec3d(*values[0]) if len(values) == 1 else wp.array(np.asarray(values), dtype=wp.vec3d)


class ContactStage:
    """Device side of one contact pass.

    Attributes:
        items: the pass of each scene; no slave meets the faces of another scene.
        column: of its sums in a record.
        sides: of the master, the most of any scene; each slave has a spring and a list of faces for each.
        springs, first: first spring of each scene, and the number of all, shape (scene_count + 1,), int32, on the host
            and on the device.
        spring: state of the springs, those of slave 0 first.
    """

    def __init__(self, items: Sequence[ContactPass], model: Model, column: int) -> None:
        self.items, self.column = items, column
        self.each = len(items) > 1
        self.sides = max(item.sides for item in items)
        slaves = offsets([len(item.slave) for item in items])
        self.springs = self.sides * slaves
        self.first = wp.array(self.springs, dtype=wp.int32)
        self.slave_scene = per_scene(slaves)
        self.slave = wp.array(self._join("slave"), dtype=wp.int32)
        self.stiffness = wp.array(self._join("stiffness"), dtype=wp.float64)
        self.mu = _numbers([item.mu for item in items])
        self.stress_free = any(item.initial_overlap == "stress_free" for item in items)
        self.spring = self._new_springs()
        friction = any(item.mu > 0.0 for item in items)
        if items[0].plane is not None:
            self.kernel = contact.plane_kernel(friction, self.each, self.stress_free)
            self._make_planes()
            return
        self.kernel = (
            contact.surface_kernel(friction, self.each, self.stress_free)
            if self.sides == 1
            else sides.sided_kernel(friction, self.each, self.sides, self.stress_free)
        )
        self.lanes = contact.LANES if wp.get_device().is_cuda else 1
        self.react, self.bounds = contact.react_kernel(self.each, self.lanes), search.bounds_kernel(self.each)
        self.find = search.candidates_kernel(self.each, self.sides)
        self.clear = search.clear_kernel(self.each, self.sides)
        self._make_faces(model)

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

    def _new_springs(self) -> Any:
        """Springs that no face presses; where some are stress-free, their resting depth is 0."""
        count, found = int(self.springs[-1]), spring.Spring()
        for name in ("tangential", "force", "impulse"):
            setattr(found, name, wp.zeros(count, dtype=wp.vec3d))
        for name in (
            "energy",
            "friction",
            "drive",
            "normal_impulse",
            "stick_impulse",
            "depth",
            "lost",
            "stiffness",
        ):
            setattr(found, name, wp.zeros(count, dtype=wp.float64))
        found.rest = wp.zeros(count if self.stress_free else 0, dtype=wp.float64)
        found.held = wp.full(count, spring.ANY_DEPTH, dtype=wp.float64)
        found.face = wp.full(count, -1, dtype=wp.int32)
        found.weight = wp.zeros(count, dtype=wp.vec4d)
        return found

    def _make_planes(self) -> None:
        planes = [item.plane for item in self.items if item.plane is not None]
        normals = [np.asarray(plane.normal, dtype=float) for plane in planes]
        unit = [normal / np.linalg.norm(normal) for normal in normals]
        self.planes = [_vectors([p.point for p in planes]), _vectors(unit), _vectors([p.velocity for p in planes])]
        self.deepest = _numbers([item.deepest for item in self.items])

    def _make_faces(self, model: Model) -> None:
        lists, faces = int(self.springs[-1]), offsets([len(item.face) for item in self.items])
        masters = offsets([len(item.master) for item in self.items])
        self.margin = _numbers([item.margin for item in self.items])
        self.longest = _numbers([item.longest for item in self.items])
        self.origin = _vectors([model.X[item.master].mean(axis=0) for item in self.items])
        self.face_scene, self.master_scene = per_scene(faces), per_scene(masters)
        self.face = wp.array(self._join("face"), dtype=wp.int32)
        self.side = wp.array(self._join("side"), dtype=wp.int32) if self.sides > 1 else 0
        self.master = wp.array(self._join("master"), dtype=wp.int32)
        self.face_offset, self.face_of_node = self._rows("face", "face_offset", "face_of_node")
        if self.sides > 1:
            self.slave_faces = edges.SlaveFaces()
            self.slave_faces.face = wp.array(self._join("slave_face"), dtype=wp.int32)
            rows = self._rows("slave_face", "slave_offset", "face_of_slave")
            self.slave_faces.offset, self.slave_faces.face_of_slave = rows
        self.surface = nearest.Master()
        self.surface.face = self.face
        self.surface.stiffness = wp.array(self._join("face_stiffness"), dtype=wp.float64)
        self.surface.count = wp.zeros(lists, dtype=wp.int32)
        self.surface.candidate = wp.zeros((lists, LIST_LENGTH), dtype=wp.int32)
        self.face_count = wp.zeros(len(self.face), dtype=wp.int32)
        self.face_slave = wp.zeros((len(self.face), max(item.room for item in self.items)), dtype=wp.int32)
        self.u_search = wp.zeros(model.node_count, dtype=wp.vec3d)
        self.lower = wp.zeros(len(self.face), dtype=wp.vec3f)
        self.upper = wp.zeros(len(self.face), dtype=wp.vec3f)
        self.bvh: Any = None

    @property
    def on_plane(self) -> bool:
        """Whether the master is a rigid plane, in each scene."""
        return self.items[0].plane is not None

    @property
    def blocks(self) -> int:
        """Blocks of threads that look at the slaves."""
        return -(-len(self.slave) // contact.BLOCK_DIM)

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [self.kernel] if self.on_plane else [self.kernel, self.react]

    def search_kernels(self) -> list[Any]:
        """Those of a search."""
        return [] if self.on_plane else [self.bounds, self.find, self.clear]

    def search(self, X: wp.array, u: wp.array, flag: wp.array) -> None:
        """Broad phase: list what each slave may touch until the next search."""
        if self.on_plane:
            return
        inputs = [X, u, self.face, self.face_scene, self.origin, self.margin]
        wp.launch(self.bounds, len(self.face), inputs=inputs, outputs=[self.lower, self.upper, self.face_count])
        slaves = [X, u, self.slave]
        if self.bvh is None:
            self.bvh = wp.Bvh(self.lower, self.upper, groups=self.face_scene if self.each else None)
            inputs = [self.bvh.id, *slaves, self.face, self.side, self.slave_scene, self.origin, self.longest]
            wp.launch(self.clear, len(self.slave), inputs=inputs, outputs=[self.spring.held])
        else:
            self.bvh.refit()
        wp.launch(
            self.find,
            len(self.slave),
            inputs=[self.bvh.id, *slaves, self.side, self.slave_scene, self.origin],
            outputs=[self.surface.count, self.surface.candidate, self.face_count, self.face_slave, self.u_search, flag],
        )
        wp.launch(search.sort_lists, len(self.face), inputs=[self.face_count], outputs=[self.face_slave])
        wp.launch(search.mark_masters, len(self.master), inputs=[u, self.master], outputs=[self.u_search])

    def touch(
        self,
        X: wp.array,
        u: wp.array,
        v: wp.array,
        dt: float,
        force: wp.array,
        sums: NormalForce,
        flag: wp.array,
        split: Split = whole,
    ) -> None:
        """Contact forces of this pass, added to `force`; its normal forces, added to `sums`."""
        rows = iter(sums.rows)  # a row of sums for each range of slaves

        def launch(kernel: Any, lanes: int, inputs: Sequence[Any], part: slice) -> None:
            threads = lanes * (part.stop - part.start)
            outputs = [force, next(rows), flag] if kernel is self.kernel else [force, flag]
            wp.launch(kernel, threads, [part.start, *inputs], outputs, block_dim=contact.BLOCK_DIM)

        slaves = [self.slave, self.stiffness]
        if self.on_plane:
            inputs = [X, u, v, *slaves, self.slave_scene, *self.planes, self.mu, self.deepest]
            inputs += [sums.per_newton, dt, self.spring]
            split(len(self.slave), partial(launch, self.kernel, 1, inputs), CONTACT)
            return
        if self.sides > 1:
            slaves = [self.slave, self.slave_faces, self.stiffness]
        inputs = [X, u, v, self.u_search, *slaves, self.surface]
        inputs += [self.slave_scene, self.mu, self.margin, sums.per_newton, dt, self.spring]
        split(len(self.slave), partial(launch, self.kernel, 1, inputs), CONTACT)
        inputs = [u, self.u_search, self.master, self.face_offset, self.face_of_node, self.face]
        inputs += [self.face_count, self.face_slave, self.master_scene, self.margin, self.spring]
        split(len(self.master), partial(launch, self.react, self.lanes, inputs), CONTACT)

    def initial_depths(
        self, X: wp.array, u: wp.array, v: wp.array, force: wp.array, sums: NormalForce, flag: wp.array
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Depth [m] and energy [J] of each spring before the first step, shape (spring_count,), after the first search.

        The springs themselves stay as they are; `force`, `sums` and `flag` are written to.
        """
        held = wp.clone(self.spring.held)
        self.touch(X, u, v, 0.0, force, sums, flag)
        depth, energy = self.spring.depth.numpy(), self.spring.energy.numpy()
        self.spring = self._new_springs()
        self.spring.held = held
        return depth, energy

    def rest_at(self, depth: NDArray[np.float64]) -> None:
        """Let springs be free of force at these depths [m], shape (spring_count,)."""
        self.spring.rest = wp.array(depth, dtype=wp.float64)

    def depths(self, scene: int) -> NDArray[np.float64]:
        """Largest penetration so far of each spring of a scene [m], those of slave 0 first, shape (spring_count,)."""
        return self.spring.depth.numpy()[self.springs[scene] : self.springs[scene + 1]]
