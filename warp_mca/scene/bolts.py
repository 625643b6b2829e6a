"""Owns bolts, screws and rivets between two bodies, which stand for a shank without a mesh."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.bodies import Vec3
from warp_mca.scene.loads import LOADS, Load
from warp_mca.scene.phases import Settle
from warp_mca.scene.springs import FARTHEST, check_column

if TYPE_CHECKING:
    from warp_mca.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Bolt(Load):
    """A round elastic shank from a body to another one, with a preload: a Timoshenko beam without mass.

    Its axial stiffness is E A / L, with A = pi d^2 / 4 and the length L between its ends. It bears shear and bending,
    too, does not yield, and bears compression where a head would lift. Each end moves with the nodes of its body within
    `reach`, by their mean motion and rotation, weighted by mass. Bodies in contact stay so; a hole needs no mesh.

    Phases before the impact (`Settle`) tighten it: meanwhile it pulls along its shank with the preload alone, and from
    then on with what its ends move, so that the impact begins with this very preload.

    Attributes:
        name: of the columns `bolt_<name>_N`, axial force, and `bolt_<name>_shear_N`, and of `bolts` in the summary.
        at: middle of its head's seat in the frame of `body` [m].
        other: second body.
        other_at: middle of its thread or nut in the frame of `other` [m].
        diameter: of the shank [m].
        preload: tension before the impact [N].
        E: Young's modulus [Pa].
        nu: Poisson's ratio [-].
        reach: distance from each end within which nodes hold it [m], as the radius of its head; None takes `diameter`,
            or the nodes of the cell around the end where these are too few.
    """

    name: str
    at: Vec3
    other: str
    other_at: Vec3
    diameter: float
    preload: float = 0.0
    E: float = 210e9
    nu: float = 0.3
    reach: float | None = None

    energies = ("spring", "external_work")
    readings = ("bolt_{}_N", "bolt_{}_shear_N")
    module = "warp_mca.physics.loads.bolts"
    on_rigid = True

    def __post_init__(self) -> None:
        super().__post_init__()
        check_column("Bolt", self.name)
        validate.texts(self.title, other=self.other)
        validate.vectors(self.title, at=self.at, other_at=self.other_at)
        for key in ("at", "other_at"):
            if max(map(abs, getattr(self, key))) > FARTHEST:
                raise bad_value(f"{self.title}.{key}", getattr(self, key), f"give a place within {FARTHEST:g} m")
        validate.within(self.title, 1e-9, 1e6, diameter=self.diameter)
        validate.within(self.title, 0.0, 1e12, preload=self.preload)
        validate.within(self.title, 1.0, 1e15, E=self.E)
        if not (validate.is_number(self.nu) and 0.0 <= self.nu < 0.5):
            raise bad_value(f"{self.title}.nu", self.nu, "Poisson's ratio must lie in [0, 0.5)")
        if self.reach is not None:
            validate.within(self.title, 1e-9, 1e6, reach=self.reach)

    @property
    def is_constant(self) -> bool:
        """It knows no time."""
        return True

    @property
    def area(self) -> float:
        """Of its section [m^2]."""
        return 0.25 * math.pi * self.diameter**2

    def bodies(self) -> dict[str, str]:
        """Those of its ends."""
        return {"body": self.body, "other": self.other}


def check_bolts(scene: Scene) -> None:
    """Refuse preloads that no phase before the impact brings on, and names that two bolts have.

    Raises:
        RequestError: there are such bolts.
    """
    bolts = [load for load in scene.loads if isinstance(load, Bolt)]
    validate.unique("Scene.loads", [bolt.name for bolt in bolts], "bolt")
    for bolt in bolts:
        if not bolt.preload:
            continue
        moving = [b.name for b in scene.bodies if b.name in bolt.bodies().values() and (any(b.velocity) or _turns(b))]
        settled = [phase for phase in scene.phases if isinstance(phase, Settle)]
        wanted = "Settle(falling=True)" if moving else "Settle()"
        if not settled or (moving and not any(phase.falling for phase in settled)):
            why = f"{moving[0]} moves, and must settle too" if moving and settled else "nothing brings it on"
            remedy = f"{why} before the impact; give Scene.phases=(mca.{wanted},)"
            raise bad_value(f"{bolt.title}.preload", bolt.preload, remedy)


def _turns(body: object) -> bool:
    return any(getattr(body, "angular_velocity", ()))


LOADS[Bolt.__name__] = Bolt
