"""Owns what an actor is: one of the things that act on nodes, with its state, kernels and stages."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warp_mca.step.stage import Stage
    from warp_mca.step.state import State


@dataclass(frozen=True)
class When:
    """The step or substep whose stages are listed.

    Attributes:
        level: highest level of `Model.rates` whose elements and nodes take part; None for all.
        chain: the only level whose nodes take part; None for all up to `level`.
        common: whether contacts, joints and loads act, which all take the same steps.
    """

    level: int | None = None
    chain: int | None = None
    common: bool = True


class Actor:
    """Something that acts on nodes. It is made of a solver, on whose device it allocates; a State holds what changes.

    The methods that list stages are called in the order in which they stand here, see `step/step_groups.py`. Those of
    an actor that a model lacks list none.

    Attributes:
        block_dim: threads of a block of its kernels; None for Warp's own number.
    """

    block_dim: int | None = None

    def new_state(self) -> Any:
        """Its part of the State before the first step: a dataclass of arrays, a list of these, or None."""
        return None

    def kernels(self) -> list[Any]:
        """Kernels of a step, one of each module."""
        return []

    def record_kernels(self) -> list[Any]:
        """Those of a record or a search, which have blocks of Warp's own size."""
        return []

    def start_forces(self, state: State) -> None:
        """Forces that act at t = 0 already, before `start`."""

    def start(self, state: State) -> None:
        """Take half a step back from t = 0, once free nodes have done so."""

    def frames(self, when: When) -> Iterable[Stage]:
        """Displacements in frames that float with bodies."""
        return ()

    def forces(self, when: When) -> Iterable[Stage]:
        """Forces at u(n), v(n-1/2)."""
        return ()

    def keep(self, when: When) -> Iterable[Stage]:
        """What a record reads while nodes move."""
        return ()

    def search(self, when: When) -> Iterable[Stage]:
        """Search for contact while nodes move, for the steps that follow."""
        return ()

    def energies(self, when: When) -> Iterable[Stage]:
        """Energies and stresses at t(n)."""
        return ()

    def look(self, when: When) -> Iterable[Stage]:
        """What recorders show of springs, before their sums begin anew."""
        return ()

    def sums(self, when: When) -> Iterable[Stage]:
        """Sums of energies and forces of each scene."""
        return ()

    def picture(self, when: When) -> Iterable[Stage]:
        """What recorders show of stresses."""
        return ()

    def advance(self, when: When) -> Iterable[Stage]:
        """Nodes that it moves."""
        return ()

    def follow(self, when: When) -> Iterable[Stage]:
        """Nodes that follow others which have moved."""
        return ()

    def correct(self, when: When) -> Iterable[Stage]:
        """What acts on the velocities that all else gave."""
        return ()

    def motion(self, when: When) -> Iterable[Stage]:
        """Sums over nodes, once they have moved."""
        return ()

    def works(self, when: When) -> Iterable[Stage]:
        """Sums of works, once nodes have moved."""
        return ()
