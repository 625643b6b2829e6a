"""Owns the cycle of phases: a swing until something touches, an impact until all has parted, and so on.

Each kind of phase has a driver, which takes a `Motion` and returns the next one with its part of the history.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

from warp_mca.geometry.mesh import Mesh
from warp_mca.phases.cycle_result import cycle_result
from warp_mca.phases.cycle_rows import Story
from warp_mca.phases.film import Film
from warp_mca.phases.impact_driver import ImpactDriver
from warp_mca.phases.motion import Motion, Part, SwingPart
from warp_mca.phases.prepare import Request, place
from warp_mca.phases.swing_driver import SwingDriver
from warp_mca.results.result import Result
from warp_mca.rigid.handoff import hand_off
from warp_mca.scene import Scene

Phase = Callable[[Motion | None], tuple[Motion | None, Part]]


class Cycle:
    """A run through swings and impacts in turn.

    Attributes:
        setup: what the phases share.
        story: what the phases so far add to the run.
        film: what recorders see of it, from the first touch on; None without recorders.
    """

    def __init__(self, scene: Scene, meshes: Mapping[str, Mesh] | None, request: Request) -> None:
        """Mesh a scene with `t_end`, and swing it to its first touch.

        Raises:
            RequestError: the scene cannot be built as written.
        """
        self.setup = place(scene, meshes, request, by=partial(hand_off, t_end=scene.t_end))
        self.story, self.swings, self.impacts = Story(self.setup), SwingDriver(self.setup), ImpactDriver(self.setup)

    @property
    def film(self) -> Film | None:
        return self.impacts.film

    def run(self) -> Result:
        """Until the time is up: each phase takes the motion that the one before left, its event says which one follows.

        Raises:
            RequestError: the scene cannot be built as written.
            GuardError: an impact lost its footing.
        """
        phase: Phase | None = self.swings.first
        motion: Motion | None = None
        done = False
        try:
            while phase is not None:
                motion, part = phase(motion)
                phase = self._after(motion, part)
                self._take(motion, part, phase is not None)
            done = True
        finally:
            if self.film:
                self.film.finish(done)
        result = cycle_result(self.setup, self.story, self.film.said if self.film else ())
        return replace(result, failed=self.film.failed if self.film else ())

    def _after(self, motion: Motion | None, part: Part) -> Phase | None:
        """The phase that follows the event that ended another one."""
        if motion is None or part.stopped is not None or part.ended_by == "t_end":
            return None
        return self.impacts.run if isinstance(part, SwingPart) else self.swings.run

    def _take(self, motion: Motion | None, part: Part, following: bool) -> None:
        """Keep what a phase adds, and show it."""
        kept = self.story.add(part, following)
        request = self.setup.request
        if request.recorders and self.impacts.film is None:
            assert motion is not None
            ready = self.impacts.prepare(motion)[0]
            self.impacts.film = Film(self.setup, request.recorders, ready, self.story.origin)
        if self.film:
            self.film.take(part, kept, self.story.rows[-1])
            request.clock.lap("output")
