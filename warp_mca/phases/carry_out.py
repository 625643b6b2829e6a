"""Owns how one solver carries out its phases: those before an impact in turn, then the impact, stored on the way."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.base.log import warn
from warp_mca.phases.checkpoint import Checkpoint, damage_explained
from warp_mca.phases.flexible_swing import FlexibleSwing
from warp_mca.phases.prepare import Prepared, Request
from warp_mca.phases.settle import settle
from warp_mca.phases.stretch import Stretch, steps_of
from warp_mca.scene import Settle
from warp_mca.step.steps import Steps

if TYPE_CHECKING:
    from warp_mca.phases.impact import Impact

# Of phases before the impact; others have `advance`.
DRIVERS: dict[type, Callable[..., Stretch]] = {Settle: settle, FlexibleSwing: FlexibleSwing.advance}
Told = Callable[[], None]


def begin(ready: Sequence[Prepared], request: Request, span: float | None = None, **more: Any) -> Impact:
    """The impact phase of scenes side by side, of a `span` [s] if not that of the request; `more` as in `Impact`.

    Raises:
        RequestError: steps cannot be chosen, or bodies overlap that must not.
    """
    from warp_mca.phases.impact import Impact

    warn(sentence for item in ready for sentence in item.warnings)
    request.tell("compile", 0.0)
    impact = Impact(ready, span or request.span, **request.settings.solver, **more)
    request.clock.lap("compile")
    return impact


class Course:
    """What one solver has carried out of its phases.

    Attributes:
        impact: the solver and its state.
        store: where the state is stored, and from which it goes on; None for never.
        clock: wall time by stage, that of a run before an interruption included.
        stretches: the phases before the impact that are over.
        number: of the impact in a run of several, whose end is kept until the run is over; None in a run of one.
    """

    def __init__(self, impact: Impact, request: Request, method: str = "mca", number: int | None = None) -> None:
        self.impact, self.store, self.clock, self.number = impact, request.store, request.clock, number
        self.stretches: list[Stretch] = []
        if self.store:
            self.store.is_for(impact, request.span, request.settings, method)

    def run(
        self,
        phases: Sequence[Any],
        told: Told,
        *,
        tell: Callable[[float], None] = lambda done: None,
        opening: Callable[[], None] = lambda: None,
        ended: Callable[[], bool] | None = None,
    ) -> None:
        """To the end of the impact, from where an earlier run of the same request was.

        Args:
            phases: before the impact: of the kinds in `DRIVERS`, or with `advance(impact, tell)`, which gives a
                `Stretch`. One that stores its state on the way has `restore(running)`, too.
            told: as in `Impact.advance`.
            tell: gets the share that is done of a phase before the impact.
            opening: takes what must be known of the impact before its state is stored.
            ended: as in `Impact.advance`.

        Raises:
            RequestError: the folder holds the state of another request.
            GuardError: a phase before the impact lost its footing.
        """
        try:
            self._run(phases, told, tell, opening, ended)
        finally:  # an interrupt and an error of a callback, too: their tracebacks hold the solver
            if pool := self.impact.solver.replay.pool:
                pool.close()

    def _run(
        self,
        phases: Sequence[Any],
        told: Told,
        tell: Callable[[float], None],
        opening: Callable[[], None],
        ended: Callable[[], bool] | None,
    ) -> None:
        found = self.store.stored(self.number) if self.store else None
        running = self._restore(*found) if found else None
        for phase in phases[len(self.stretches) :]:
            if running is not None:
                phase.restore(running)
            self.stretches.append(_before(phase, self.impact, tell))
            found = None
        if found is None:
            opening()
        at_end = found is not None and self.store is not None and found[2] != self.store.path
        if self.store and not at_end:
            last = None if self.number is None else self.impact.steps.count - 1
            self._go_on(self.store, told, ended, last)
            if self.number is not None and self.impact.stopped[0] is None:
                self.store.store_end(self.impact, self.number)
        self.impact.advance(told=told, ended=ended)

    def keep(self, running: Any = None) -> None:
        """Store the state, and of a phase before the impact what it needs to go on, as JSON can hold it."""
        assert self.store is not None
        if self.number is not None:
            self.store.store(self.impact, {"impact": self.number})
            return
        self.clock.lap("fe")
        arrays = {f"{k}/{n}": a for k, item in enumerate(self.stretches) for n, a in item.records.arrays().items()}
        place = {
            "stretches": [item.facts() for item in self.stretches],
            "steps": asdict(self.impact.steps),
            "wall": self.clock.wall,
            "running": running,
        }
        self.store.store(self.impact, place, arrays)

    def _restore(self, place: Mapping[str, Any], arrays: Mapping[str, NDArray], path: Any) -> Any:
        """Go on from what was stored.

        Returns:
            What `keep` got of the phase that was under way.

        Raises:
            RequestError: the file is damaged.
        """
        assert self.store is not None
        running = None
        if self.number is None:
            with damage_explained(self.store.path):
                self.stretches, steps, wall = restored(place, arrays, self.impact.steps.dt)
                running = place["running"]
                for stage, seconds in wall.items():
                    self.clock.wall[stage] += seconds
            self.impact.steps = steps
        self.impact.load(path)
        return running

    def _go_on(self, store: Checkpoint, told: Told, ended: Callable[[], bool] | None, last: int | None) -> None:
        """Advance to the end, or so many steps as `last`, and store the state as often as the checkpoint says."""
        impact = self.impact
        store.begin(impact)
        most = impact.steps.count if last is None else last
        while impact.stopped[0] is None and (stop := store.next_stop(impact)) < most:
            impact.advance(until=stop, told=told, ended=ended)
            if impact.state.steps < stop:
                return  # it has ended
            if impact.stopped[0] is None and store.is_due(impact):
                self.keep()
        impact.advance(until=last, told=told, ended=ended)


def _before(phase: Any, impact: Impact, tell: Callable[[float], None]) -> Stretch:
    """Carry out a phase that comes before the impact.

    Raises:
        RequestError: one of the user's own failed, or returned something else than a `Stretch`.
    """
    driver = DRIVERS.get(type(phase))
    if driver:
        return driver(phase, impact, tell)
    kind = type(phase).__name__
    found = validate.call("Scene.phases", kind, "advance()", phase.advance, impact, tell)
    if not isinstance(found, Stretch):
        raise bad_value("Scene.phases", kind, f"its advance() must return a Stretch, not a {type(found).__name__}")
    return found


def restored(
    place: Mapping[str, Any], arrays: Mapping[str, NDArray], dt: float
) -> tuple[list[Stretch], Steps, dict[str, float]]:
    """Stretches, steps of the phase under way and wall time, as `Course.keep` stored them of steps of dt [s].

    Raises:
        KeyError, TypeError, ValueError: a value is missing, or of another type or range.
    """
    stretches = []
    for k, facts in enumerate(place["stretches"]):
        own = {name.removeprefix(f"{k}/"): a for name, a in arrays.items() if name.startswith(f"{k}/")}
        stretches.append(Stretch.of(facts, own, dt))
    return stretches, steps_of(place["steps"], dt), {name: float(seconds) for name, seconds in place["wall"].items()}
