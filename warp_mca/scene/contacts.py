"""Owns contacts: surfaces, rigid planes and how they press on each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from types import NoneType
from typing import Literal

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.bodies import Vec3
from warp_mca.scene.bonds import Bond
from warp_mca.scene.contact_laws import CONTACT_LAWS, ContactLaw, DampedPenalty, Penalty
from warp_mca.scene.friction_laws import FRICTION_LAWS, FrictionLaw

MOST_FRICTION = 1e6  # with which nothing slides [-]
MOST_STIFFNESS = 1e12  # of a spring of contact [N/m]: that of diamond, a metre wide
OVERLAP_CHOICES = ("refuse", "stress_free", "press")


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Boundary faces of `body` that the node set `nodes` covers; "boundary" is the whole skin, unless it is a set."""

    body: str
    nodes: str

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Surface", body=self.body, nodes=self.nodes)


@dataclass(frozen=True, kw_only=True)
class RigidPlane:
    """An immovable, analytic half-space; the free side is where `normal` points.

    Attributes:
        point: any point of the plane [m].
        normal: its normal [-]; need not have unit length.
        velocity: of the plane along itself [m/s], as of a belt.
    """

    point: Vec3 = (0.0, 0.0, 0.0)
    normal: Vec3 = (0.0, 1.0, 0.0)
    velocity: Vec3 = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.vectors("RigidPlane", point=self.point, velocity=self.velocity)
        validate.directions("RigidPlane", normal=self.normal)
        if abs(sum(v * n for v, n in zip(self.velocity, self.normal, strict=True))) > 1e-12 * math.hypot(
            *self.velocity
        ):
            raise bad_value("RigidPlane.velocity", self.velocity, "it must be perpendicular to the normal")


class _Springs:
    """What the springs of a contact have, whichever surfaces they keep apart; `Contact` describes it."""

    mu: float
    penalty: float | Literal["auto"] | None
    initial_overlap: Literal["refuse", "stress_free", "press"]
    name: str | None
    law: ContactLaw | None
    friction: FrictionLaw | tuple[FrictionLaw, ...]
    internal: bool

    def _check_springs(self) -> None:
        owner = type(self).__name__
        validate.plain(self)
        if self.law is not None and type(self.law) not in CONTACT_LAWS.values():  # others are not registered
            remedy = f"give a {' or a '.join(CONTACT_LAWS)}; register other classes by warp_mca.register"
            raise bad_value(f"{owner}.law", validate.brief(self.law), remedy)
        validate.flags(owner, internal=self.internal)
        if isinstance(self.penalty, str):
            if self.penalty != "auto":
                raise bad_value(f"{owner}.penalty", self.penalty, "give a finite number above 0, auto or None")
        elif self.penalty is not None:
            validate.positive(owner, penalty=self.penalty)
        if self.initial_overlap not in OVERLAP_CHOICES:
            raise bad_value(f"{owner}.initial_overlap", self.initial_overlap, f"choose {' or '.join(OVERLAP_CHOICES)}")
        if not (validate.is_number(self.mu) and 0.0 <= self.mu <= MOST_FRICTION):
            remedy = f"give a coefficient of friction from 0 to {MOST_FRICTION:g}"
            raise bad_value(f"{owner}.mu", self.mu, remedy)
        for law in self.friction_laws:
            if type(law) not in FRICTION_LAWS.values():  # others are not registered
                remedy = f"give a {' or a '.join(FRICTION_LAWS)}; register other classes by warp_mca.register"
                raise bad_value(f"{owner}.friction", validate.brief(law), remedy)
            if self.mu == 0.0:
                raise bad_value(
                    f"{owner}.mu", self.mu, "give the coefficient at rest, above 0, for the law of friction"
                )
            law.check(self.mu)
        if self.name is not None:
            validate.texts(owner, name=self.name)

    @property
    def friction_laws(self) -> tuple[FrictionLaw, ...]:
        """The laws of `friction`, also where it is a single one."""
        return self.friction if isinstance(self.friction, tuple) else (self.friction,)


@dataclass(frozen=True, kw_only=True)
class Contact(_Springs):
    """Node-to-surface penalty contact with stick-slip friction.

    Attributes:
        slave: surface whose nodes are kept out of the master.
        master: surface of another body, or a rigid plane.
        mu: coefficient of friction [-], the one at rest where `friction` has laws; 0 runs no friction at all.
        penalty: factor f of the penalty stiffness k = f K A^2 / V [-]. None takes E / (1 - nu^2) in place of K, and
            f = 3.8 where a surface is curved. Where both are flat, nodes share, by their area, springs that are as
            stiff as two cells of each surface, so that flat ends do not ring; from nu = 0.39 on cells that cannot
            spread. "auto" chooses f from mesh, curvature,
            mass and speed, so that springs hold at most some 7 % of the energy.
        stiffness: of the spring of each slave node in place of that [N/m], whatever its faces; with two_way of each
            node of the master and of each two edges that cross, too. For rigid bodies, whose cells say nothing of it.
        law: force along the normal over depth and stiffness. None takes `Penalty`, or `DampedPenalty` where bodies lie
            on each other under their weight, with half of critical damping up to the speeds that weight gives.
        friction: law that changes the limit mu F_n of the friction force, or several that do in turn, as
            (DecayingFriction(kinetic=0.2, decay=2.0), ShearCap(tau_max=1e8)); Coulomb's limit by default.
        two_way: whether the master's nodes are also kept out of the slave's faces. None does so where the slave's faces
            are more than 1.5 times as wide as the master's, between bodies of rubber or foam, where a soft flat slave
            ends at the border of a stiffer master, and where the master's nearest node is on a corner or an edge that
            points at a face of the slave.
        initial_overlap: what to do where bodies overlap before the first step: "refuse" the scene; start "stress_free",
            with springs that count depth from there; or "press" them apart, as a press fit: springs come to their full
            force while waves cross the longer body six times. They begin with it where that bears no more than weight.
        name: unique in the scene; None for the bodies' names, "slave–master" or "slave–plane", numbered where a pair
            has several contacts. Results list forces by it.
        normal: direction of the force on the slave that F_n_N reports [-], of any length. None takes the master's mean
            normal at hand-off, or adds up the normal forces as they are where the master is closed. Give it where the
            master turns before the impact, or where only a part of a curved master is touched.
        tangent: direction that F_t_N reports [-], made perpendicular to the normal. None takes normal x z, or the
            perpendicular nearest to +x where the normal is within 20 degrees of the z axis.
        bond: glue between the surfaces, which hold each other until it fails. Tension is a negative F_n_N.
        internal: between parts of one thing, as in `drop_test`: F_n_N and what is read off it leave its forces out.
    """

    slave: Surface
    master: Surface | RigidPlane
    mu: float = 0.0
    penalty: float | Literal["auto"] | None = None
    two_way: bool | None = None
    initial_overlap: Literal["refuse", "stress_free", "press"] = "refuse"
    name: str | None = None
    normal: Vec3 | None = None
    tangent: Vec3 | None = None
    law: ContactLaw | None = None
    friction: FrictionLaw | tuple[FrictionLaw, ...] = ()
    bond: Bond | None = None
    stiffness: float | None = None
    internal: bool = False

    def __post_init__(self) -> None:
        self._check_springs()
        if self.stiffness is not None:
            self._check_stiffness(self.stiffness)
        validate.kinds("Contact", Surface, "give a Surface", slave=self.slave)
        validate.kinds("Contact", (Surface, RigidPlane), "give a Surface or a RigidPlane", master=self.master)
        if self.two_way is not None:
            validate.flags("Contact", two_way=self.two_way)
        if self.two_way and isinstance(self.master, RigidPlane):
            raise bad_value("Contact.two_way", self.two_way, "a rigid plane has no nodes; leave two_way off")
        if isinstance(self.master, Surface) and self.master.body == self.slave.body:
            remedy = "name a body other than the slave's; ContactAll keeps a body out of itself"
            raise bad_value("Contact.master.body", self.master.body, remedy)
        self._check_bond()
        axes = {"normal": self.normal, "tangent": self.tangent}
        validate.directions("Contact", **{name: axis for name, axis in axes.items() if axis is not None})

    def _check_stiffness(self, stiffness: float) -> None:
        validate.positive("Contact", stiffness=stiffness)
        validate.within("Contact", 0.0, MOST_STIFFNESS, stiffness=stiffness)
        for name in ("penalty", "bond"):
            if getattr(self, name) is not None:
                raise bad_value("Contact.stiffness", stiffness, f"leave it or {name} out")

    def _check_bond(self) -> None:
        validate.kinds("Contact", (Bond, NoneType), "give a Bond or None", bond=self.bond)
        for held, why in (
            (isinstance(self.master, RigidPlane), "a rigid plane has no faces to glue to; fix the nodes instead"),
            (self.two_way, "the slave's nodes alone are glued; leave two_way off"),
            (
                not isinstance(self.law, Penalty | DampedPenalty | None),
                "its springs are linear; leave the contact's law out",
            ),
        ):
            if self.bond and held:
                raise bad_value("Contact.bond", self.bond, why)

    @property
    def sides(self) -> tuple[str, str]:
        """What it keeps apart: the slave's body and the master's, or "plane"."""
        return self.slave.body, self.master.body if isinstance(self.master, Surface) else "plane"


@dataclass(frozen=True, kw_only=True)
class ContactAll(_Springs):
    """General contact: the skin of each body against those of all others and against itself, in both directions.

    Pairs with a listed `Contact` are left to that, which so gives a pair its own friction and stiffness. Bodies that a
    joint or a tie connects are left out, because they may overlap there, and so are pairs of two rigid bodies: list a
    `Contact` where these shall meet. Rigid planes are always listed.

    Attributes:
        mu, law, friction, initial_overlap, internal: as in `Contact`, for all pairs.
        penalty: as in `Contact`, though not "auto".
        exclude: pairs of bodies that are not kept apart; a body paired with itself has no self-contact.
        self_contact: whether bodies are kept out of themselves; rigid ones cannot fold.
        name: unique in the scene; None for "all". Its force is the sum of the sizes of the normal forces of all pairs.
    """

    exclude: tuple[tuple[str, str], ...] = ()
    self_contact: bool = True
    mu: float = 0.0
    penalty: float | Literal["auto"] | None = None
    initial_overlap: Literal["refuse", "stress_free", "press"] = "refuse"
    name: str | None = None
    law: ContactLaw | None = None
    friction: FrictionLaw | tuple[FrictionLaw, ...] = ()
    internal: bool = False

    def __post_init__(self) -> None:
        self._check_springs()
        if self.penalty == "auto":
            raise bad_value("ContactAll.penalty", self.penalty, "it is chosen pair by pair; list the pair as a Contact")
        validate.flags("ContactAll", self_contact=self.self_contact)
        remedy = 'give pairs of bodies, as [("a", "b")]'
        validate.kind_of("ContactAll.exclude", self.exclude, (tuple, list), remedy)
        for pair in self.exclude:
            if not (isinstance(pair, (tuple, list)) and len(pair) == 2 and all(isinstance(name, str) for name in pair)):
                raise bad_value("ContactAll.exclude", validate.brief(pair), remedy)
        object.__setattr__(self, "exclude", tuple((one, other) for one, other in self.exclude))

    @property
    def two_way(self) -> bool:
        """Always: either direction has half the stiffness."""
        return True


def contact_names(contacts: Sequence[Contact | ContactAll]) -> tuple[str, ...]:
    """A name for each contact: its own, or "slave–master" by their bodies, numbered from the second of a pair on.

    That of a general contact is "all".
    """
    taken = {contact.name for contact in contacts if contact.name is not None}
    names: list[str] = []
    for contact in contacts:
        name = contact.name
        if name is None:
            pair = "all" if isinstance(contact, ContactAll) else "–".join(contact.sides)
            numbered = (pair if k == 1 else f"{pair} {k}" for k in range(1, len(contacts) + 1))
            name = next(text for text in numbered if text not in taken)
            taken.add(name)
        names.append(name)
    return tuple(names)
