"""Owns what moves and holds the bodies of a deck: initial velocities, held nodes, gravity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.rotation import mean_spin
from warp_mca.decks.bodies import DeckBody
from warp_mca.decks.cards import Card, Content
from warp_mca.decks.materials import codes
from warp_mca.decks.places import PARALLEL, Numbers, Places
from warp_mca.geometry.keyword_text import Keyword
from warp_mca.scene.amplitude import Amplitude
from warp_mca.scene.drives import Fixed, Prescribed
from warp_mca.scene.loads import BodyForce

Vec3 = tuple[float, float, float]
RIGID = 1e-5  # of the greatest speed: by so much velocities of nodes may be off a rigid motion, by their digits


class Motion:
    """Initial velocities of all nodes of a deck [m/s], shape (node_count, 3), float64, as `Places.numbers` has them.

    Later keywords replace what earlier ones give to a node.
    """

    def __init__(self, content: Content, places: Places) -> None:
        self._content, self._places = content, places
        self.points = content.units.length * places.points
        self.velocities = np.zeros_like(self.points)
        self._order = np.argsort(places.numbers)
        for item in content.found["velocity"]:
            {"": self._of_set, "_NODE": self._of_nodes, "_GENERATION": self._generated, "_RIGID_BODY": self._of_part}[
                item.name.removeprefix("INITIAL_VELOCITY")
            ](item)

    def rows(self, numbers: Numbers) -> Numbers:
        """Where nodes stand in the arrays.

        Raises:
            ValueError: there is no such node.
        """
        sorted_numbers = self._places.numbers[self._order]
        at = np.minimum(np.searchsorted(sorted_numbers, numbers), len(sorted_numbers) - 1)
        if (missing := sorted_numbers[at] != numbers).any():
            raise ValueError(f"there is no node {numbers[missing][0]}; name nodes that the deck has")
        return self._order[at]

    def _turned(self, card: Card, names: str, quantity: str) -> Array:
        """A vector of a card that its ICID gives in a local system."""
        return np.array(card.numbers(names, quantity)) @ self._places.axes(card.whole("icid"))

    def _of_set(self, item: Keyword) -> None:
        """*INITIAL_VELOCITY: set, nodes left out, then velocities."""
        head = self._content.card(item, 0, "nsid nsidex boxid irigid icid")
        values = self._content.card(item, 1, "vx vy vz vxr vyr vzr")
        values.refuse("vxr vyr vzr", "nodes of solids do not turn; use *INITIAL_VELOCITY_GENERATION")
        numbers = self._places.nodes(head.whole("nsid")) if head.whole("nsid") else self._places.numbers
        if head.whole("boxid"):
            numbers = np.intersect1d(numbers, self._places.in_box(head.whole("boxid")))
        velocity = np.array(values.numbers("vx vy vz", "velocity")) @ self._places.axes(head.whole("icid"))
        self.velocities[self.rows(numbers)] = velocity
        if head.whole("nsidex"):
            more = self._content.card(item, 2, "vxe vye vze vxre vyre vzre")
            other = np.array(more.numbers("vxe vye vze", "velocity")) @ self._places.axes(head.whole("icid"))
            self.velocities[self.rows(self._places.nodes(head.whole("nsidex")))] = other

    def _of_nodes(self, item: Keyword) -> None:
        """*INITIAL_VELOCITY_NODE: a node on each card."""
        for card in self._content.cards(item, "nid vx vy vz vxr vyr vzr icid"):
            row = self.rows(np.array([card.whole("nid")]))
            self.velocities[row] = self._turned(card, "vx vy vz", "velocity")

    def _of_part(self, item: Keyword) -> None:
        """*INITIAL_VELOCITY_RIGID_BODY: velocity of the centre of mass, and rates of turn about it."""
        for card in self._content.cards(item, "pid vx vy vz vxr vyr vzr icid"):
            card.refuse("vxr vyr vzr", "use *INITIAL_VELOCITY_GENERATION, which names a point of the axis")
            rows = self.rows(self._places.of_parts([card.whole("pid")]))
            self.velocities[rows] = self._turned(card, "vx vy vz", "velocity")

    def _generated(self, item: Keyword) -> None:
        """*INITIAL_VELOCITY_GENERATION: a velocity, and a rate of turn about an axis through a point."""
        head = self._content.card(item, 0, "id styp omega vx vy vz ivatn icid")
        axis = self._content.card(item, 1, "xc yc zc nx ny nz phase irigid")
        axis.refuse("phase", "velocities act from the start; set it to 0")
        number, kind = head.whole("id"), head.whole("styp")
        if not number:
            numbers = self._places.numbers
        elif kind == 3:
            numbers = self._places.nodes(number)
        elif kind in (1, 2):
            numbers = self._places.of_parts(self._places.parts(number) if kind == 1 else [number])
        else:
            raise ValueError(f"{head.place}: STYP = {kind} is not read: give 1 for a set of parts, 2 a part, 3 nodes")
        rows = self.rows(numbers)
        self.velocities[rows] = self._turned(head, "vx vy vz", "velocity")
        if omega := head.number("omega", "rate"):
            direction = np.array(axis.numbers("nx ny nz")) @ self._places.axes(head.whole("icid"))
            if not direction.any():
                raise ValueError(f"{axis.place}: OMEGA turns about no axis; give NX, NY, NZ")
            turn = omega * direction / np.linalg.norm(direction)
            centre = np.array(axis.numbers("xc yc zc", "length"))
            self.velocities[rows] += np.cross(turn, self.points[rows] - centre)

    def of_body(self, body: DeckBody) -> dict[str, Vec3]:
        """Velocity at the origin and rate of turn of a body, for `Body`.

        Raises:
            ValueError: its nodes do not move as those of a rigid body.
        """
        rows = self.rows(body.nodes)
        x, v = self.points[rows], self.velocities[rows]
        if (v == v[0]).all():
            return {"velocity": _vector(v[0])}
        turn = mean_spin(x, v, np.ones(len(x)))
        start = v.mean(axis=0) - np.cross(turn, x.mean(axis=0))
        off = np.linalg.norm(v - start - np.cross(turn, x), axis=1)
        if off.max() > RIGID * np.linalg.norm(v, axis=1).max():
            node = body.nodes[off.argmax()]
            what = f"initial velocities of {body.name} are not those of a rigid motion, by {off.max():.3g} m/s at node"
            raise ValueError(f"{what} {node}; give all of its nodes one translation and rotation")
        return {"velocity": _vector(start), "angular_velocity": _vector(turn)}


def _vector(values: Array) -> Vec3:
    x, y, z = (float(value) for value in values)
    return x, y, z


def held_nodes(
    content: Content, places: Places, motion: Motion, bodies: Sequence[DeckBody]
) -> list[Fixed | Prescribed]:
    """What keeps nodes of the deck in place; of bodies that move, their speed there is set to 0.

    Raises:
        ValueError: nodes are held along axes that are not those of the world, or belong to a rigid part.
    """
    held: dict[int, str] = {number: codes(code) for number, code in content.mesh.held.items()}
    for item in content.found["held"]:
        start = 1 if item.name.endswith("_ID") else 0
        for card in content.cards(item, "id cid dofx dofy dofz dofrx dofry dofrz", start):
            axes = "".join(axis for axis in "xyz" if card.whole(f"dof{axis}"))
            if axes and card.whole("cid"):
                axes = _world_axes(places.axes(card.whole("cid")), axes, card.place)
            of_set = "SET" in item.name
            for number in places.nodes(card.whole("id")) if of_set else [card.whole("id")]:
                held[int(number)] = "".join(sorted({*held.get(int(number), ""), *axes}))
    found: list[Fixed | Prescribed] = []
    for body in bodies:
        groups: dict[str, list[int]] = {}
        for number in body.nodes.tolist():
            if axes := held.get(number):
                groups.setdefault(axes, []).append(number)
        if groups and body.rigid:
            raise ValueError(f"nodes of the rigid part {body.name} are held; hold it by CON1 and CON2 of *MAT_RIGID")
        for axes, numbers in groups.items():
            name = body.keep(f"held_{axes}", numbers)
            speeds = motion.velocities[motion.rows(np.array(numbers))]
            still = "".join(axis for k, axis in enumerate("xyz") if axis in axes and not speeds[:, k].any())
            if still:
                found.append(Fixed(body=body.name, nodes=name, axes=still))
            rest: dict[str, Any] = {"body": body.name, "nodes": name, "times": (0.0,), "velocities": (0.0,)}
            found += [Prescribed(axis=axis, **rest) for axis in axes if axis not in still]
    return found


def _world_axes(system: Array, axes: str, place: str) -> str:
    """Axes of the world that are parallel to axes of a system; all of them for all of these."""
    if len(axes) == 3:
        return axes
    found = ""
    for axis in axes:
        row = system["xyz".index(axis)]
        k = int(np.abs(row).argmax())
        if np.linalg.norm(np.delete(row, k)) > PARALLEL:
            raise ValueError(f"{place}: nodes are held along an axis that is none of the world; turn the deck")
        found += "xyz"[k]
    return "".join(sorted(found))


def gravity(
    content: Content, places: Places, bodies: Sequence[DeckBody], duration: float
) -> tuple[Vec3, list[BodyForce]]:
    """Constant acceleration by gravity [m/s^2], and loads where it changes with time.

    *LOAD_BODY_Z with a positive factor accelerates the frame along z, which bodies feel along -z.

    Raises:
        ValueError: a curve ends before the run.
    """
    total, loads = np.zeros(3), list[BodyForce]()
    for item in content.found["gravity"]:
        card = content.card(item, 0, "lcid sf lciddr xc yc zc cid")
        axis = "XYZ".index(item.name[-1])
        direction = -places.axes(card.whole("cid"))[axis]
        factor = card.number("sf", default=1.0) or 1.0
        times, values = places.curve(card.whole("lcid"))
        times = [content.units.si(time, "time") for time in times]
        values = [factor * content.units.si(value, "acceleration") for value in values]
        if times[0] > 0.0 or times[-1] < duration:
            end = f"{times[0]:g} to {times[-1]:g} s, the run from 0 to {duration:g} s"
            raise ValueError(f"{card.place}: the curve of *{item.name} goes from {end}; let it cover the run")
        if max(values) == min(values):
            total += values[0] * direction
            continue
        acceleration = _vector(direction)
        table = Amplitude(times=tuple(times), values=tuple(values))
        loads += [BodyForce(body=body.name, acceleration=acceleration, amplitude=table) for body in bodies]
    return _vector(total + 0.0), loads
