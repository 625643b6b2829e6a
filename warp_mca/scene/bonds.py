"""Owns `Bond`: what glues the surfaces of a contact to each other until it fails."""

from __future__ import annotations

from dataclasses import dataclass

from warp_mca.base import validate


@dataclass(frozen=True, kw_only=True)
class Bond:
    """Glues slave nodes of a `Contact` to the master's faces on which they lie at the start, until the bond fails.

    A spring with the stiffness of the contact, in all directions alike, holds each node to its place on the face. It
    breaks where its force, along the face's normal and along the face, reaches

        (F_n / (normal A))^2 + (F_t / (shear A))^2 >= 1,    F_n = 0 in compression,

    with the area A of the slave's faces around the node (LS-DYNA keyword manual, tiebreak contact). From then on the
    node is in contact as others are, with friction. The summary lists nodes, how many failed, and where and when the
    first did. Let the finer mesh be the slave: nodes of the master are glued to nothing. Where its faces lie within
    those of the master a uniform stress breaks all at once; of 4 cells on 3 the first break 6 % early.

    Attributes:
        normal: strength in tension [Pa]; None for a bond that tension never breaks.
        shear: strength in shear [Pa]; None for one that shear never breaks.
        gap: largest distance of nodes that are glued from the faces, as a share of the edge of the face [-]; they are
            moved onto the faces, as slaves of a `Tie` are.
    """

    normal: float | None = None
    shear: float | None = None
    gap: float = 0.05

    def __post_init__(self) -> None:
        validate.plain(self)
        strengths = {"normal": self.normal, "shear": self.shear}
        validate.positive("Bond", gap=self.gap, **{k: value for k, value in strengths.items() if value is not None})

    @property
    def fails(self) -> bool:
        """Whether any force breaks it."""
        return self.normal is not None or self.shear is not None
