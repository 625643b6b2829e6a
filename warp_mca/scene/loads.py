"""Owns what the user says of loads: forces on nodes of kinds that a scene lists in `Scene.loads`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from warp_mca.base import validate


@dataclass(frozen=True, kw_only=True)
class Load:
    """Forces on nodes of a body in the impact phase. A subclass, listed in LOADS, is a kind of them.

    Attributes:
        body: on whose nodes it acts.
        energies: entries of the energy ledger to which a kind adds, in the order of `NodalLoad.energies`.
        refuses: what a kind cannot be combined with, "multi_rate" or "run_batch", and the remedy, for the error.
    """

    body: str
    energies: ClassVar[tuple[str, ...]] = ("external_work",)
    refuses: ClassVar[Mapping[str, str]] = {}

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts(type(self).__name__, body=self.body)

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
        raise NotImplementedError("its class has no build()")

    @classmethod
    def stage(cls) -> type[Any]:
        """The class of its device side, made of `physics.loads.nodal_stage.NodalLoad`."""
        raise NotImplementedError("its class has no stage()")


LOADS: dict[str, type[Load]] = {}
