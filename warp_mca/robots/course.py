"""Owns a machine's run through swings and impacts in turn, until its time is up."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from warp_mca.base import validate
from warp_mca.base.errors import GuardError, RequestError, bad_value
from warp_mca.phases.arguments import check_recorders, one_at_a_time
from warp_mca.phases.checkpoint import Checkpoint
from warp_mca.phases.every import DEFAULT, Every, every_of
from warp_mca.phases.prepare import Request
from warp_mca.phases.settings import Settings, settings_of
from warp_mca.phases.simulate import simulate
from warp_mca.recorders.checks import check_files
from warp_mca.results.storage import hold
from warp_mca.robots.film import RobotFilm
from warp_mca.robots.machine import Machine
from warp_mca.robots.swing import RobotSwing, swing
from warp_mca.scene import ImpactPhase

if TYPE_CHECKING:
    from warp_mca.recorders.recorder import Recorder
    from warp_mca.results.result import Result
    from warp_mca.robots.handback import HandBack
    from warp_mca.robots.robot import Robot
    from warp_mca.scene import Scene


@dataclass(frozen=True, kw_only=True)
class RobotRun:
    """What came of a machine's run through swings and impacts in turn.

    Attributes:
        swings: the first one starts the run; each other one follows an impact.
        scenes: of the impacts, as `Robot.strike` makes them.
        impacts: their results.
        backs: the ways back after them; one fewer than impacts where `stopped` says why the machine cannot go on.
        starts: when each impact began, from the start of the run [s].
        t_end: when the run ended, from its start [s].
        robot: the machine at its end; at the start of the last swing where that ended the run.
        stopped: why it ended before its time, in one sentence, or None.
        said: what recorders warned of.
        failed: names of recorders that failed.
    """

    swings: tuple[RobotSwing, ...]
    scenes: tuple[Scene, ...]
    impacts: tuple[Result, ...]
    backs: tuple[HandBack, ...]
    starts: tuple[float, ...]
    t_end: float
    robot: Robot
    stopped: str | None = None
    said: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()


STRIKE = {"stiffness", "mu", "fixed", "faces", "name"}  # of `Robot.strike`, beside the impact


def checked_run(
    robot: Robot,
    t_end: float,
    strike: Mapping[str, Any],
    settings: tuple[str, str, int | None],
    recorders: Sequence[Recorder],
    kept: tuple[str | os.PathLike[str] | None, str | Every | None, bool],
) -> RobotRun:
    """As `Robot.run`: `settings` are device, precision and threads there, `kept` are out, checkpoint and force.

    Raises:
        RequestError: as in `Robot.swing` and `Robot.strike`; an argument is none, or an output cannot be made.
        GuardError: an impact lost its footing.
    """
    validate.times("Robot.run", t_end=t_end)
    validate.kinds("Robot.run", ImpactPhase, "give an ImpactPhase", impact=strike["impact"])
    if unknown := sorted(set(strike) - STRIKE - {"impact"}):
        raise bad_value("Robot.run", unknown[0], "give stiffness, mu, fixed, faces and name of strike, or none")
    check_recorders(recorders)
    check_files(recorders)
    (out, checkpoint, force), found = kept, settings_of(*settings)
    every = every_of("mca", checkpoint if out is None else checkpoint or DEFAULT, out, recorders)
    if out is None or every is None:
        return run(robot, t_end, strike, found, recorders)
    with hold(out, force=force) as folder:
        store = Checkpoint(folder.path, every, force)
        ended = run(robot, t_end, strike, found, recorders, store)
        store.remove()
        return ended


@one_at_a_time
def run(
    robot: Robot,
    t_end: float,
    strike: Mapping[str, Any],
    settings: Settings,
    recorders: Sequence[Recorder],
    store: Checkpoint | None = None,
) -> RobotRun:
    """Swing and strike in turn until t_end [s]; `strike` has the arguments of `Robot.strike`.

    `store` has the state of the impact that was under way and of those that had ended, from which they go on. Swings
    are computed again, so that controllers have their own state again, too.

    Raises:
        RequestError: as in `Robot.swing` and `Robot.strike`; an output cannot be made.
        GuardError: an impact lost its footing.
    """
    course = _Course(robot, t_end, strike, settings, recorders, store)
    done = False
    try:
        course.run()
        done = True
    finally:
        if course.film:
            course.film.finish(done)
    return course.found()


class _Course:
    def __init__(
        self, robot: Robot, t_end: float, strike: Mapping[str, Any], settings: Settings, recorders: Any, store: Any
    ) -> None:
        self._store = store
        self._robot, self._t_end, self._strike, self._settings = robot, t_end, strike, settings
        self._recorders, self.film, self._t = recorders, None, 0.0
        self._lists: dict[str, list[Any]] = {key: [] for key in ("swings", "scenes", "impacts", "backs", "starts")}
        self._stopped: str | None = None

    def run(self) -> None:
        while self._t < self._t_end and self._stopped is None:
            robot, start = self._robot, self._t
            machine = Machine(robot)
            found = swing(robot, machine, robot.pairs(machine), self._t_end - start)
            self._keep(swings=found)
            self._t += found.t_end
            if self._recorders:
                self._show(machine, found, start)
            if found.touch is None:
                return
            self._impact(found, start)

    def _show(self, machine: Machine, found: RobotSwing, start: float) -> None:
        first = self.film is None
        if self.film is None:
            self.film = RobotFilm(self._robot, machine, found, self._recorders, self._t_end)
        self.film.swing(self._robot, found, start, first, found.touch is not None)

    def _impact(self, found: RobotSwing, start: float) -> None:
        robot, film = self._robot, self.film
        scene = robot.strike(swing=found, **self._strike)
        shown = [film.impact(found, start)] if film else []
        number = 1 + len(self._lists["impacts"])
        kept: dict[str, Any] = {"store": self._store, "number": number} if self._store else {}
        request = Request(span=scene.impact.duration, settings=self._settings, recorders=shown, **kept)
        (result,) = simulate([scene], None, request)
        if result.stopped is not None:
            raise GuardError(f"impact {number}: {result.stopped}")
        self._keep(scenes=scene, impacts=result, starts=self._t)
        try:
            back = robot.after(found, scene, result)
        except RequestError as error:
            self._t += float(result.summary["simulated_time"])
            self._stopped = str(error)
            return
        self._keep(backs=back)
        self._t = start + back.robot.clock - robot.clock
        self._robot = back.robot

    def _keep(self, **items: Any) -> None:
        for key, item in items.items():
            self._lists[key].append(item)

    def found(self) -> RobotRun:
        lists: dict[str, Any] = {key: tuple(items) for key, items in self._lists.items()}
        film = self.film
        said, failed = (tuple(film.said), tuple(film.recording.failed)) if film else ((), ())
        return RobotRun(**lists, t_end=self._t, robot=self._robot, stopped=self._stopped, said=said, failed=failed)
