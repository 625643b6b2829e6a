"""Owns `Tie`: two surfaces whose meshes need not match, glued to each other."""

from __future__ import annotations

from dataclasses import dataclass

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.contacts import Surface


@dataclass(frozen=True, kw_only=True)
class Tie:
    """Glues the nodes of a surface to the faces of another one, for the whole run.

    The motion of each slave node is that of its place on the master's face, u = sum N_k u_k; its mass and the forces on
    it go to the corners of the face with the same shape functions N_k. Let the finer mesh be the slave: nodes of the
    master between those of the slave are tied to nothing.

    Attributes:
        slave: surface whose nodes are tied.
        master: surface whose faces carry them, of another body or of another part of the same one (`Parts`).
        gap: largest distance of slave nodes from the faces at the start, as a share of the edge of the face [-]; they
            are moved onto the faces, before masses are computed, and take the velocity there. Bodies in one motion keep
            it exactly; mass, momentum and energy change by what the slave's cells gain or lose, of the order of the
            distance over the thickness of the slave's body.
    """

    slave: Surface
    master: Surface
    gap: float = 0.05

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.kinds("Tie", Surface, "give a Surface", slave=self.slave, master=self.master)
        if self.slave == self.master:
            raise bad_value(f"{self.title}.master", self.master.nodes, "name a surface other than the slave's")
        validate.positive(self.title, gap=self.gap)

    @property
    def title(self) -> str:
        """What is tied to what, for errors and reports."""
        return f"Tie {self.slave.body}:{self.slave.nodes}–{self.master.body}:{self.master.nodes}"
