"""Owns the looks at the shape of bodies in an impact phase: when they are due, and how shapes come to the host."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.step.transfer import Transfer
from warp_mca.watch.bending import LOOKS, samples_of, seen
from warp_mca.watch.bent_cells import Array, Cells
from warp_mca.watch.held import Question, Seen, look_at_bending, look_at_skins

if TYPE_CHECKING:
    from warp_mca.step.solver import Solver
    from warp_mca.system.state import State
    from warp_mca.watch.bent_scenes import Together
    from warp_mca.watch.held import Home
    from warp_mca.watch.ledger import Ledger
    from warp_mca.watch.passing import Watch


class SceneLooks:
    """What is looked at of the bodies of one scene; what was seen is kept in the records of its ledger.

    Attributes:
        ledger: of the scene.
        watch: what may go into each other.
        index: number of the scene in the solver's layout.
        home: where a helper looks in place of this process; None without one.
        last: what `bent` returns where the scenes of a batch were looked at together at the end; None before.
    """

    last: Array | None = None

    def __init__(self, solver: Solver, ledger: Ledger, watch: Watch, index: int, home: Home | None = None) -> None:
        self.ledger, self.watch, self.index, self.home, self._solver = ledger, watch, index, home, solver
        self.nodes = slice(*solver.layout.nodes[index : index + 2].tolist())

    @cached_property
    def samples(self) -> list[Cells]:
        """Cells whose bending is looked at."""
        return samples_of(self.ledger.model)

    def bent(self, u: Array) -> Array:
        """`SceneRecords.stiffened` with these displacements of all scenes [m], too."""
        before = self.ledger.kept.stiffened
        if self.last is not None:
            return self.last
        return seen(self.ledger.model, self.samples, u[self.nodes], before) if self.samples else before

    def arrived(self, steps: int, u: Array, found: Mapping[str, NDArray]) -> Seen:
        """What there is to look at after so many steps.

        Args:
            steps: since the start of the phase.
            u: displacements of the nodes that are watched [m], shape (node_count, 3), float64.
            found: `speed_square` of the state, and the greatest depths of the springs of each contact pass.
        """
        squares = found["speed_square"]
        speed = math.sqrt(squares[self.nodes].max() if len(squares) > 1 else squares[0])
        springs = [stage.springs[self.index : self.index + 2] for stage in self._solver.contacts]
        pressed = np.array([found[str(k)][a:b].max(initial=0.0) for k, (a, b) in enumerate(springs)])
        return Seen(u, speed, pressed, steps * self._solver.dt, self.ledger.kept.passed)

    def look_for_passing(self, own: Seen) -> tuple[Array, int]:
        """As `Watch.look`."""
        x = self.ledger.model.X[self.watch.nodes] + own.u
        return self.watch.look(x, own.speed, own.pressed, own.time, own.passed)


class Looks:
    """Looks of one call of `Impact.advance`; the device goes on meanwhile."""

    def __init__(
        self,
        solver: Solver,
        state: State,
        scenes: Sequence[SceneLooks],
        span: float,
        together: Callable[[], Together],
    ) -> None:
        """Prepare the way of what is looked at.

        Args:
            solver, state: of the scenes.
            scenes: what is looked at of each.
            span: of the phase [s].
            together: cells of all scenes that this process looks at, where there are several.
        """
        self.state, self.scenes, self._together, self._steps = state, scenes, together, (solver.dt, span)
        looked_at = any(item.samples for item in scenes)
        self._shape = Transfer({"u": state.u}, solver.device) if looked_at else None
        self._bending: tuple[Array, list[SceneLooks], Question] | None = None  # what was asked, on its way
        self._skin: tuple[list[tuple[SceneLooks, Seen]], Question] | None = None
        self._watch, self._watched = None, list[SceneLooks]()
        self._due: set[SceneLooks] = set()
        watched = [(item, item.nodes.start) for item in scenes if len(item.watch.nodes)]
        if not watched:
            return
        self._ends = np.cumsum([len(item.watch.nodes) for item, _ in watched])
        self._watched = [item for item, _ in watched]
        with wp.ScopedDevice(solver.device):
            nodes = wp.array(np.concatenate([item.watch.nodes + first for item, first in watched]), dtype=wp.int32)
            self._gathered: Any = wp.indexedarray(state.u, [nodes])
            self._skins = wp.zeros(len(nodes), dtype=wp.vec3d)
        springs = {str(stage.index): state.contacts[stage.index].spring.depth for stage in solver.contacts}
        sources = {"u": self._skins, "speed_square": state.speed_square} | springs
        self._watch = Transfer(sources, solver.device)

    def serve(self, state: State, scenes: Sequence[SceneLooks], span: float) -> bool:
        """Whether they can look at these scenes of a state in a phase of such a span, and nothing is under way."""
        alike = self.state is state and self.scenes == scenes and self._steps[1] == span
        ways = [way for way in (self._shape, self._watch) if way]
        return alike and not (self._bending or self._skin or any(way.pending for way in ways))

    def row(self, interval: int, intervals: int) -> None:
        """Look at the bending of bodies, once in a while, where this output interval begins."""
        if self._shape and interval and interval % max(1, intervals // LOOKS) == 0:
            self._see_shape()
            self._shape.send(0)

    def until(self, count: int, whole: int) -> int:
        """How many of the next `count` steps can be taken at once, of a part that has so many as a `whole`.

        Parts are cut only for looks that follow each other faster than parts do.
        """
        kept = [item.ledger.kept for item in self._watched]
        return min([count, *(k.due - self.state.steps for k in kept if k.wait < whole)])

    def watch(self, whole: int = 0, last: bool = False) -> None:
        """Look for bodies in each other if that is due; what the look before saw tells when the next one is.

        Args:
            whole: steps of the part that goes on; 0 between two.
            last: whether the phase is over, so that a look is due.
        """
        kept = [item.ledger.kept for item in self._watched]
        due = {k for k in kept if last or (k.due <= self.state.steps and not k.wait >= whole > 0)}
        if not due:
            return self._ask()
        self._see_skins()
        assert self._watch
        wp.copy(self._skins, self._gathered)
        self._watch.send(self.state.steps)
        self._due = {item for item in self._watched if item.ledger.kept in due}
        if any(not k.apart for k in due):
            self._see_skins()  # the first look tells when the second is due
        for k in due:
            k.wait, k.due = k.apart, self.state.steps + k.apart

    def finish(self) -> None:
        """Take in what is on its way."""
        self._see_shape()
        self._see_skins()

    def _ask(self) -> None:
        """Let helpers look at what has arrived, while the device goes on."""
        if self._shape and not self._bending and self._shape.arrived:
            self._ask_for_shape()
        if self._watch and not self._skin and self._watch.arrived:
            self._ask_for_skins()

    def _ask_for_shape(self) -> None:
        assert self._shape
        _, shape = self._shape.receive()
        own = [item for item in self.scenes if item.home]
        asked = [(shape["u"][item.nodes], item.ledger.kept.stiffened) for item in own]
        self._bending = shape["u"], own, Question(look_at_bending, [item.home for item in own if item.home], asked)

    def _see_shape(self) -> None:
        while self._bending or (self._shape and self._shape.pending):
            if not self._bending:
                self._ask_for_shape()
            assert self._bending
            (u, own, question), self._bending = self._bending, None
            if len(self.scenes) == 1:
                self.scenes[0].ledger.kept.stiffened = self.scenes[0].bent(u)
                continue
            if len(own) < len(self.scenes):  # others see nothing new there
                before = [item.ledger.kept.stiffened for item in self.scenes]
                for item, found in zip(self.scenes, self._together().seen(u, before), strict=True):
                    item.ledger.kept.stiffened = found
            for item, answer in zip(own, question.answers(), strict=True):
                item.ledger.kept.stiffened = item.bent(u) if answer is None else answer

    def _ask_for_skins(self) -> None:
        assert self._watch
        steps, found = self._watch.receive()
        parts = zip(self._watched, np.split(found["u"], self._ends[:-1]), strict=True)
        due = [(item, item.arrived(steps, u, found)) for item, u in parts if item in self._due]
        own = [(item.home, shown) for item, shown in due if item.home]
        question = Question(look_at_skins, [home for home, _ in own], [(shown,) for _, shown in own], *self._steps)
        self._skin = due, question

    def _see_skins(self) -> None:
        while self._skin or (self._watch and self._watch.pending):
            if not self._skin:
                self._ask_for_skins()
            assert self._skin
            (due, question), self._skin = self._skin, None
            here = [(item, item.look_for_passing(shown)) for item, shown in due if not item.home]
            own = [(item, shown) for item, shown in due if item.home]
            for (item, shown), answer in zip(own, question.answers(), strict=True):
                here.append((item, item.look_for_passing(shown) if answer is None else answer))
            for item, found in here:
                item.ledger.kept.passed, item.ledger.kept.apart = found
