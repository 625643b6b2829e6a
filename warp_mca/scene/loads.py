"""Owns what the user says of loads: forces on nodes of kinds that a scene lists in `Scene.loads`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, ClassVar

from warp_mca.base import validate


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
    def is_constant(self) -> bool:
        """Whether it is the same at all times, so that it may act in phases before the impact, too."""
        return False

    def bodies(self) -> dict[str, str]:
        """Bodies that it names, by field."""
        return {"body": self.body}

    def sets(self) -> dict[str, tuple[str, str, bool]]:
        """Node sets that it names, by field: the body, the set, and whether it must cover faces."""
        return {}

    def build(self, assembly: Any, start: float) -> Any:
        """Its arrays, a `physics.loads.nodal.LoadedNodes`, for a phase that starts so long after the release [s].

        `assembly` is the `model.assembly.Assembly` of the scene, with its meshes and masses.

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


LOADS: dict[str, type[Load]] = {}
