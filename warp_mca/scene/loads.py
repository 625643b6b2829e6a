"""Owns what the user says of loads: forces on nodes of kinds that a scene lists in `Scene.loads`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType, NoneType
from typing import Any, ClassVar

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.amplitude import CONSTANT, Amplitude

Vec3 = tuple[float, float, float]
MOST = 1e15  # Pa, N, m/s^2 that a load may have
LARGEST = 0.2  # thermal strain


@dataclass(frozen=True, kw_only=True)
class Load:
    """Forces on nodes of a body in the impact phase. A subclass, listed in LOADS, is a kind of them.

    Attributes:
        body: on whose nodes it acts.
        energies: entries of the energy ledger to which a kind adds, in the order of `NodalLoad.energies`.
        refuses: what a kind cannot be combined with, "multi_rate" or "run_batch", and the remedy, for the error.
        module: whose `build` and `Stage` the methods `build` and `stage` stand for, where a kind does not write these.
        readings: columns of the history of each load of a kind, with its name in place of {}, in the order of
            `NodalLoad.readings_of`.
        on_rigid: whether it may act on nodes of rigid bodies.
        inner: whether it acts between points of one body alone, so that bodies that move as rigid ones do not feel it.
    """

    body: str
    energies: ClassVar[tuple[str, ...]] = ("external_work",)
    refuses: ClassVar[Mapping[str, str]] = {}
    module: ClassVar[str] = ""
    readings: ClassVar[tuple[str, ...]] = ()
    on_rigid: ClassVar[bool] = False
    inner: ClassVar[bool] = False

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts(type(self).__name__, body=self.body)

    @property
    def title(self) -> str:
        """Its kind and its name, or its body, for errors."""
        return f"{type(self).__name__} of {self.body}" if self.label == type(self).__name__ else self.label

    @property
    def label(self) -> str:
        """The same without its body, for errors about that."""
        name = getattr(self, "name", None)
        return type(self).__name__ if name is None else f"{type(self).__name__} {name}"

    @property
    def is_constant(self) -> bool:
        """Whether it is the same at all times, so that it may act in phases before the impact, too."""
        return False

    @property
    def counts_from_impact(self) -> bool:
        """Whether it has times that count from the start of the impact phase."""
        return False

    def bodies(self) -> dict[str, str]:
        """Bodies that it names, by field."""
        return {"body": self.body}

    def sets(self) -> dict[str, tuple[str, str, bool]]:
        """Node sets that it names, by field: the body, the set, and whether it must cover faces."""
        return {}

    def build(self, assembly: Any, start: float) -> Any:
        """Its arrays, a `physics.loads.nodal.LoadedNodes`, for a phase that starts so long after the release [s].

        `assembly` is the `system.bodies.Bodies` of the scene, with its meshes and masses.

        Raises:
            RequestError: it cannot act so.
        """
        if not self.module:
            raise NotImplementedError("its class has no build()")
        return import_module(self.module).build(self, assembly)

    @classmethod
    def stage(cls) -> type[Any]:
        """The class of its device side, made of `physics.loads.nodal_stage.NodalLoad`."""
        if not cls.module:
            raise NotImplementedError("its class has no stage()")
        return import_module(cls.module).Stage


@dataclass(frozen=True, kw_only=True)
class TimedLoad(Load):
    """A load of a given size times a factor over time.

    Attributes:
        amplitude: the factor; None for 1 at all times.
    """

    amplitude: Amplitude | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        remedy = "give an Amplitude, or leave it out for a constant load"
        validate.kinds(self.title, (Amplitude, NoneType), remedy, amplitude=self.amplitude)

    @property
    def is_constant(self) -> bool:
        """Whether it has no amplitude."""
        return self.amplitude is None

    @property
    def counts_from_impact(self) -> bool:
        """Whether it has an amplitude."""
        return self.amplitude is not None

    @property
    def table(self) -> Amplitude:
        """The factor over time, also where that is constant."""
        return self.amplitude or CONSTANT


def _check_vector(owner: str, **values: Vec3) -> None:
    """Refuse what is no vector, or beyond MOST."""
    validate.vectors(owner, **values)
    validate.entries(owner, 3, lambda own, **entry: validate.within(own, -MOST, MOST, **entry), **values)


@dataclass(frozen=True, kw_only=True)
class Pressure(TimedLoad):
    """Pressure on a surface: it stays normal to the faces as they move, and acts on the area that they have then.

    Attributes:
        nodes: node set; boundary faces of the body all of whose nodes belong to it are pressed, "boundary" is the skin.
        pressure: [Pa], positive into the body.
    """

    nodes: str
    pressure: float
    module = "warp_mca.physics.loads.faces"

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.texts(self.title, nodes=self.nodes)
        validate.within(self.title, -MOST, MOST, pressure=self.pressure)

    def sets(self) -> dict[str, tuple[str, str, bool]]:
        """Its surface."""
        return {"nodes": (self.body, self.nodes, True)}


@dataclass(frozen=True, kw_only=True)
class Traction(TimedLoad):
    """Force per area on a surface.

    Attributes:
        nodes: node set whose faces it acts on, as for `Pressure`.
        traction: in world axes at the start of the impact phase [Pa].
        follows: whether it turns with each face and acts on the area that this has then; else its direction stays and
            it acts on the area at the start.
    """

    nodes: str
    traction: Vec3
    follows: bool = False
    module = "warp_mca.physics.loads.faces"

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.texts(self.title, nodes=self.nodes)
        _check_vector(self.title, traction=self.traction)
        validate.flags(self.title, follows=self.follows)

    def sets(self) -> dict[str, tuple[str, str, bool]]:
        """Its surface."""
        return {"nodes": (self.body, self.nodes, True)}


@dataclass(frozen=True, kw_only=True)
class Force(TimedLoad):
    """Force on a node set, or on the node nearest to a point; it keeps its direction.

    Attributes:
        force: on all nodes of the set together, in world axes [N].
        nodes: the set; None with `at`.
        at: a point in the frame of the body [m]; None with `nodes`.
        spread: "equal", the same force on each node, or "area", by the area around it of the faces that the set covers.
    """

    force: Vec3
    nodes: str | None = None
    at: Vec3 | None = None
    spread: str = "equal"
    module = "warp_mca.physics.loads.dead"

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_vector(self.title, force=self.force)
        validate.choice(self.title, ("equal", "area"), spread=self.spread)
        if (self.nodes is None) == (self.at is None):
            raise bad_value(f"{self.title}.nodes", self.nodes, "give either nodes or at")
        if self.nodes is not None:
            validate.texts(self.title, nodes=self.nodes)
        if self.at is not None:
            validate.vectors(self.title, at=self.at)
            if self.spread != "equal":
                raise bad_value(f"{self.title}.spread", self.spread, "a point has no area; leave it out, or give nodes")

    def sets(self) -> dict[str, tuple[str, str, bool]]:
        """Its set."""
        return {} if self.nodes is None else {"nodes": (self.body, self.nodes, self.spread == "area")}


@dataclass(frozen=True, kw_only=True)
class BodyForce(TimedLoad):
    """Force on all of a body in proportion to its mass, beside `Scene.gravity`.

    Attributes:
        acceleration: that it would give a free body, in world axes [m/s^2].
    """

    acceleration: Vec3
    module = "warp_mca.physics.loads.dead"

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_vector(self.title, acceleration=self.acceleration)


@dataclass(frozen=True, kw_only=True)
class ThermalStrain(TimedLoad):
    """Strain that a body would have if it were free, alike in all directions, as that of a change of temperature.

    It sets press fits and the preload of bolts: a body that is made colder shrinks onto what it surrounds.

    Attributes:
        expansion: coefficient of thermal expansion [1/K].
        temperature: change at factor 1 [K].
    """

    expansion: float
    temperature: float
    module = "warp_mca.physics.loads.thermal"
    refuses = MappingProxyType({"multi_rate": "leave multi_rate out"})

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.finite(self.title, expansion=self.expansion, temperature=self.temperature)
        strain = abs(self.expansion * self.temperature) * max(map(abs, self.table.values))
        if not strain <= LARGEST:
            remedy = f"it makes a strain of {strain:.3g}; give one of {LARGEST:g} at most"
            raise bad_value(f"{self.title}.temperature", self.temperature, remedy)


LOADS: dict[str, type[Load]] = {kind.__name__: kind for kind in (Pressure, Traction, Force, BodyForce, ThermalStrain)}
