"""Owns what follows the surface of bodies as elements fail in an impact: contact, and the watch for passing bodies."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Index
from warp_mca.base.errors import GuardError
from warp_mca.geometry.exposure import Exposure
from warp_mca.model.assembly import Assembly
from warp_mca.physics.contact.listed import as_settled, passes_of
from warp_mca.physics.contact.surfaces import faces_of, surface_faces
from warp_mca.scene import Contact, RigidPlane, Surface
from warp_mca.step.contact_renewal import renew
from warp_mca.system.contact import ContactPass, Faces

if TYPE_CHECKING:
    from warp_mca.phases.prepare import Prepared
    from warp_mca.step.solver import Solver
    from warp_mca.system.state import State

Mask = NDArray[np.bool_]


class Exposed:
    """Surfaces of the bodies of one scene as its elements fail.

    Attributes:
        passes: of contact, as the surfaces are now.
    """

    def __init__(self, ready: Prepared, solver: Solver, state: State) -> None:
        """Begin with whole bodies."""
        self._scene, self._solver, self._state, self._ready = ready.scene, solver, state, ready
        self.passes: tuple[ContactPass, ...] = ready.model.passes
        self._known = 0
        self._faces = {name: Exposure(ready.meshes[name]) for name in ready.scene.failing}
        bodies = [(body.name, ready.model.node_start[body.name]) for body in ready.scene.bodies]
        X = {name: ready.model.X[first : first + len(ready.meshes[name].points)] for name, first in bodies}
        self._parts = Assembly(ready.scene, ready.meshes, X)
        self._contacts = [(k, *self._settled(k, item)) for k, item in enumerate(ready.scene.listed)]

    def _settled(self, index: int, contact: Contact) -> tuple[Contact, bool]:
        """A contact as it was at the start, and whether its surfaces were flat."""
        slave, master = (
            None if isinstance(surface, RigidPlane) else surface_faces(self._parts, surface)
            for surface in (contact.slave, contact.master)
        )
        assert slave is not None
        flat = not any(item.curved for item in self.passes if item.contact == index)
        return as_settled(self._parts, contact, slave, master, self._ready.model.V, flat)[0], flat

    @property
    def _blocks(self) -> list[tuple[int, Index]]:
        """Blocks whose elements may fail, and the numbers of their elements in the concatenated meshes."""
        model = self._solver.model
        return [
            (k, model.element_of[block.first : block.first + block.conn.shape[1]])
            for k, block in enumerate(model.blocks)
            if block.failing
        ]

    def renew(self) -> Mapping[str, Index] | None:
        """Follow the surface, if elements failed since the last time.

        Returns:
            Faces of the skin of each body that changed, in the numbering of its mesh; None if none did.

        Raises:
            GuardError: all elements of a surface in contact have failed.
        """
        failing = [self._state.elements[k].failing for k, _ in self._blocks]
        count = sum(int(own.count.numpy()[0]) for own in failing if own)
        if count == self._known:
            return None
        self._known = count
        for own in failing:
            assert own
            own.left.assign((own.age.numpy() < 0).astype(np.int32))
        alive = self._alive()
        if self.passes:
            self.passes = self._passes(alive)
            renew(self._solver, self._state, self.passes)
        return self._skins(alive)

    def restore(self, path: str | os.PathLike[str]) -> Mapping[str, Index] | None:
        """Give the state the surfaces of a stored one, which is loaded next; as `renew`."""
        with np.load(path, allow_pickle=False) as archive:
            stored = {k: archive[f"elements/{k}/failing/left"] for k, _ in self._blocks}
            self._known = sum(int(left.sum()) for left in stored.values())
        if not self._known:
            return None
        for k, left in stored.items():
            self._state.elements[k].failing.left.assign(left)
        alive = self._alive()
        if self.passes:
            self.passes = self._passes(alive)
            renew(self._solver, self._state, self.passes)
        return self._skins(alive)

    def _alive(self) -> Mask:
        """Whether each element of the concatenated meshes is part of a surface."""
        found = np.ones(self._parts.element_count, dtype=bool)
        for k, element in self._blocks:
            found[element] = self._state.elements[k].failing.left.numpy() == 0
        return found

    def _own(self, body: str, alive: Mask) -> Mask:
        first = self._parts.element_start[body]
        return alive[first : first + self._ready.meshes[body].cell_count]

    def _skins(self, alive: Mask) -> dict[str, Index]:
        found = {name: exposure.skin(self._own(name, alive))[0] for name, exposure in self._faces.items()}
        return {name: faces for name, faces in found.items() if len(faces)}  # of others nothing is left to pass

    def _surface(self, surface: Surface, alive: Mask) -> Faces:
        body = surface.body
        if body not in self._faces:
            return surface_faces(self._parts, surface)
        node, element = self._faces[body].surface(surface.nodes, self._own(body, alive))
        if not len(node):
            time = self._state.steps * self._solver.dt
            raise GuardError(
                f"all elements at the surface {surface.nodes} of body {body} have failed by t = {time:.4g} s; end the "
                "run before"
            )
        return faces_of(self._parts, body, node, element)

    def _passes(self, alive: Mask) -> tuple[ContactPass, ...]:
        found: list[ContactPass] = []
        for index, contact, flat in self._contacts:
            sides = contact.slave, contact.master
            slave, master = (None if isinstance(side, RigidPlane) else self._surface(side, alive) for side in sides)
            assert slave is not None
            found += [given.item for given in passes_of(self._parts, contact, index, slave, master, flat=flat)]
        # the search keeps the pace that was chosen for the margins at the start
        return tuple(_as_far(item, old) for item, old in zip(found, self.passes, strict=True))


def _as_far(item: ContactPass, old: ContactPass) -> ContactPass:
    """A pass that looks ahead as far as the old one at least, with lists as long."""
    return replace(item, margin=max(item.margin, old.margin), room=max(item.room, old.room))
