"""Owns what loads with a factor over time share: nodes that take all loads of a kind in one launch, and their work."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.arrays import Array
from warp_mca.base.joining import AS_IS, joinable, offsets
from warp_mca.kernels.loads.amplitude import Tables
from warp_mca.physics.loads.lasting import Lasting
from warp_mca.physics.loads.nodal_stage import NodalLoad
from warp_mca.system.actor import When
from warp_mca.system.loads import LoadedNodes
from warp_mca.system.stage import Stage, Step

if TYPE_CHECKING:
    from warp_mca.system.actor import System
    from warp_mca.system.state import State

Index = NDArray[np.int32]


@joinable
@dataclass(frozen=True, kw_only=True)
class TimedNodes(LoadedNodes):
    """Nodes of a load with a factor over time.

    Attributes:
        times, values: of the factor [s], [-], shape (entry_count,), float64.
        force: size of the force at factor 1 and at the start [N].
    """

    times: NDArray[np.float64] = field(metadata=AS_IS)
    values: NDArray[np.float64] = field(metadata=AS_IS)
    force: float = field(default=0.0, metadata=AS_IS)

    def impulse(self, duration: float) -> float:
        """As in `LoadedNodes`: force times the integral of the factor's size, taken as straight between its times."""
        t = np.unique(np.clip([0.0, *self.times, duration], 0.0, duration))
        return self.force * float(np.trapezoid(np.abs(np.interp(t, self.times, self.values)), t))


@dataclass(eq=False)
class PushState:
    """What the loads of a kind have done to each of their nodes.

    Attributes:
        force: in the latest step [N], shape (count,), vec3d.
        work: up to t(n) [J], shape (count,), float64.
        clock: steps taken [-], shape (count,), int32.
    """

    force: wp.array
    work: wp.array
    clock: wp.array


def tables_of(items: Sequence[Any]) -> Any:
    """The factors of loads over time, on the current device; their `times` and `values`."""
    found = Tables()
    found.first = wp.array(offsets([len(item.times) for item in items]), dtype=wp.int32)
    sums = [np.append(0.0, np.cumsum(0.5 * np.diff(i.times) * (i.values[1:] + i.values[:-1]))) for i in items]
    for name, columns in (("times", [i.times for i in items]), ("values", [i.values for i in items]), ("sums", sums)):
        setattr(found, name, wp.array(np.concatenate(columns), dtype=wp.float64))
    return found


def grouped(node: Index) -> tuple[Index, Index, Index]:
    """Different nodes in rising order; entries of `node` sorted by them; where those of each begin, and the end."""
    nodes, counts = np.unique(node, return_counts=True)
    return nodes.astype(np.int32), np.argsort(node, kind="stable").astype(np.int32), offsets(counts.tolist())


class PushedNodes(NodalLoad):
    """All loads of a kind: each node takes the sum of those on it, so that none is written by two threads.

    A subclass gives `listed` and `push`.

    Attributes:
        node: those under loads, in rising order, shape (count,), int32.
        order: entries of `listed` by node, of which those of each begin at `begin`.
        lasting: what ends with elements that fail, or None; `ending` is the array that it writes.
    """

    lasting: Lasting | None = None
    ending: Any = None

    def __init__(self, solver: System, name: str) -> None:
        """Allocate on the current device."""
        self.node, self.order, self.begin = grouped(self.listed(solver.model.loads[name]))
        super().__init__(solver, name)
        self.tables = tables_of(self.items)
        self.device_node, self.device_begin = (wp.array(it, dtype=wp.int32) for it in (self.node, self.begin))

    def listed(self, items: Sequence[Any]) -> Index:
        """Node of each entry, a load's share at a node; a node has one or more."""
        raise NotImplementedError

    def counts(self) -> Index:
        """Nodes of each scene."""
        return np.diff(np.searchsorted(self.node, self.solver.layout.nodes)).astype(np.int32)

    def new_state(self) -> PushState:
        """State before the first step, on the current device."""
        return PushState(
            force=wp.zeros(self.count, dtype=wp.vec3d),
            work=wp.zeros(self.count, dtype=wp.float64),
            clock=wp.zeros(self.count, dtype=wp.int32),
        )

    def may_end(self, nodes: Index, ending: Any) -> None:
        """Let entries end with the elements that have all of their `nodes`, as `Lasting` takes these."""
        if self.solver.model.fails:
            self.ending = ending
            self.lasting = Lasting(self.solver, nodes, wp.clone(ending))

    def stages(self, when: When) -> Iterable[Stage]:
        """Which loads have ended, ahead of the forces; those of `NodalLoad`."""
        if when.common and self.lasting:
            yield Stage("frames", f"ends of loads: {self.name}", self._end)
        yield from super().stages(when)

    def _end(self, step: Step) -> None:
        assert self.lasting
        self.lasting.renew(step.state, self.ending)

    def launch(self, kernel: Any, inputs: list[Any], step: Step, start: bool) -> None:
        """Launch a kernel of `kernels.loads.nodes`; `inputs` are those between the nodes and `v`."""
        state, own = step.state, step.state.parts[self.name]
        given = [self.device_node, self.device_begin, *inputs, state.v, self.solver.common_dt, start]
        outputs = [self.work.nodal_force, own.force, own.work, own.clock]
        wp.launch(kernel, self.count, inputs=given, outputs=outputs)

    def feel(self, state: State, ahead: State, way: Array) -> None:
        """Count the work of the forces."""
        own = state.parts[self.name]
        force = 0.5 * (own.force.numpy() + ahead.parts[self.name].force.numpy())
        own.work.assign(own.work.numpy() + (force * way[self.node]).sum(axis=1))

    def energies_of(self, state: State) -> list[wp.array]:
        """Work."""
        return [state.parts[self.name].work]
