"""Owns what an actor is, one of the things that act on nodes, and the system of which it is made."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warp_mca.system.layout import Layout
    from warp_mca.system.model import Model
    from warp_mca.system.stage import Stage
    from warp_mca.system.state import State
    from warp_mca.system.workspace import Workspace


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
    """Something that acts on nodes. It is made of a `System`, on whose device it allocates; a State holds what changes.

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

    def stages(self, when: When) -> Iterable[Stage]:
        """What it launches in a step, each with its place in `step.step_groups.STEP`; none where a model lacks it."""
        return ()

    def start_forces(self, state: State) -> None:
        """Forces that act at t = 0 already, before `start`."""

    def start(self, state: State) -> None:
        """Take half a step back from t = 0, once free nodes have done so."""


class System:
    """A model on one device and all that acts on it; `step.solver.Solver` advances it.

    Actors are attributes by their names, each made at its first use: whatever it reads of others is made before it.

    Attributes:
        kinds: what makes the actors, by name.
        model: whose arrays they read.
        layout: of the model's scenes.
        device: as Warp names it.
        precision: "mixed" or "float64".
        threads: that compute; one on a GPU, and for a model that is too small to gain from more.
        dt: time step [s]; with `Model.rates` that of their substeps together.
        common_dt: time step of contacts and joints [s].
    """

    kinds: dict[str, Callable[[Any], Actor]]
    model: Model
    layout: Layout
    device: str
    precision: str
    threads: int
    dt: float
    common_dt: float

    @cached_property
    def work(self) -> Workspace:
        """The model on the device, and what a step computes and forgets."""
        raise NotImplementedError

    def __getattr__(self, name: str) -> Any:
        """An actor, which stays."""
        kinds = self.__dict__.get("kinds", {})
        if name not in kinds:
            raise AttributeError(name)
        self.__dict__[name] = found = kinds[name](self)
        return found
