"""Owns single measurements of a trade-off: one variant run, its figures and what it cost; and costs foreseen."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Hashable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from warp_mca.accuracy.figures import Figures, figures_of
from warp_mca.accuracy.knobs import BASE, Trial
from warp_mca.accuracy.same_mesh import Meshes
from warp_mca.accuracy.simulation import run
from warp_mca.accuracy.variant import Variant
from warp_mca.base.errors import McaError
from warp_mca.base.log import LOGGER
from warp_mca.base.progress import duration_words
from warp_mca.geometry.mesh import Mesh
from warp_mca.phases.meshing import mesh
from warp_mca.results.result import Result
from warp_mca.scene import Scene

FIXED = 20_000  # elements that a GPU computes in the time that a step costs in any case
SPRINGS = 1.3  # penalty whose springs shorten the stable step by the square root of 2
AUTO_PENALTY = 4.0  # about what "auto" chooses for links and balls, to foresee its cost
MULTI_RATE = 0.4  # share of element steps that remain with several rates, roughly
COMPILING = 2.0  # longer waits before the first step are compilations of kernels, which happen once [s]
FORESEEN = 0.05  # share of the steps after which the time of all can be estimated
ELEMENTS = {"hex8r": 0.5, "hex8w": 1.5, "hex8w3": 2.3}  # time of an element over that of hex8 or hex8i, on a CPU


class OutOfTimeError(McaError):
    """A run did not end, or would not end, before the time of the bench is over."""


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A variant that was run.

    Attributes:
        trial: what was asked for.
        figures: headline figures, see `figures_of`.
        elements, steps: of the model, and of its time [-]; of several rates the longest steps.
        element_steps: computed elements, summed over all steps [-].
        wall: seconds: "fe" the steps, "whole" all of the run but compiling kernels, "cpu" processor time of the steps.
        stopped: why there are no figures: the request was refused, or a guard stopped the run; empty otherwise.
    """

    trial: Trial
    figures: Figures = field(default_factory=dict)
    elements: int = 0
    steps: int = 0
    element_steps: float = 0.0
    wall: Mapping[str, float] = field(default_factory=dict)
    stopped: str = ""


class Bench:
    """Runs variants of one scene on one device, and foresees what others cost.

    Attributes:
        scene, device, threads, duration: as in `warp_mca.run`.
        base: the scene as written, once it was run.
        name: of the device, once that was run.
        beside: least time that a run took beside its steps and compiling, for each element [s].
        budget: time for all runs [s], from the first step of the scene as written on, without compiling kernels.
        end: of that time, by `time.perf_counter` [s]; a run that would not end by then is stopped.
    """

    def __init__(self, scene: Scene, device: str, threads: int | None, duration: float | None) -> None:
        self.scene, self.device, self.threads, self.duration = scene, device, threads, duration
        self.base: Measured | None = None
        self.name = device
        self.beside, self.budget, self.end = math.inf, math.inf, math.inf
        self._made: dict[object, Mesh] = {}
        self._meshes = Meshes(scene)

    @property
    def clock(self) -> str:
        """The time that variants are compared by, a key of `Measured.wall`.

        The processor time of one thread does not depend on what else the machine does; on an idle machine it equals the
        wall time.
        """
        return "cpu" if self.device == "cpu" and self.threads == 1 else "fe"

    def key(self, variant: Variant) -> Hashable:
        """Equal for variants that are the same model: the same meshes, and all else changed alike."""
        with quiet():
            return self._meshes.key(variant)

    def run(self, trial: Trial) -> Measured:
        """Run a variant. A refusal, or a guard that stops it, is part of the measurement.

        Raises:
            McaError: the scene as written cannot be run; OutOfTimeError in the time that is left.
        """
        watch, begun = _Watch(self.budget if trial is BASE else math.inf, self.end), time.perf_counter()
        try:
            scene = trial.variant.applied(self.scene)
            options = {"threads": self.threads, "duration": self.duration, **trial.variant.options}
            with quiet(trial is not BASE):
                meshes = mesh(scene, self._made)
                result = run(scene, device=self.device, meshes=meshes, progress=watch, **options)
        except (McaError, MemoryError, RuntimeError) as error:  # Warp raises RuntimeError where a GPU has no room
            if trial is BASE:
                raise
            return Measured(trial=trial, stopped=str(error) or type(error).__name__)
        finally:
            self.end = watch.end
        summary = result.summary
        whole = time.perf_counter() - begun - summary["wall"]["compile"]
        wall = {"fe": summary["wall"]["fe"], "whole": whole, "cpu": watch.processor or summary["wall"]["fe"]}
        found = Measured(
            trial=trial,
            figures=figures_of(result),
            elements=summary["n_elements"],
            steps=summary["n_steps"],
            element_steps=element_steps(result),
            wall=wall,
        )
        self.beside = min(self.beside, (whole - wall["fe"]) / found.elements)
        if trial is BASE:
            self.base, self.name = found, str(summary["device"])
            self.end = time.perf_counter() + self.budget - wall["fe"]
        return found

    def time_of(self, found: Measured) -> float:
        """What a variant took, by the bench's clock [s]."""
        return found.wall[self.clock]

    def work_of(self, found: Measured) -> float:
        """What a variant costs by counts, in the scene's element steps in `mixed`: always the same, as counts are."""
        work = found.element_steps * self._share(found.trial.variant)
        return work + (FIXED * found.steps if self.device != "cpu" else 0.0)

    def foreseen(self, variant: Variant) -> float:
        """What running a variant will take, all of it [s]: its steps, and what the mesh takes.

        Raises:
            ValueError: the scene as written was not run yet.
        """
        steps, finer = self.foreseen_steps(variant), (variant.refine or self.scene.refine) / self.scene.refine
        assert self.base is not None
        return steps + self.beside * self.base.elements * max(1.0, finer**3)

    def foreseen_steps(self, variant: Variant) -> float:
        """What the steps of a variant will take [s]: its work over that of the scene as written, times its time.

        Raises:
            ValueError: the scene as written was not run yet.
        """
        if self.base is None:
            raise ValueError("run BASE first")
        base, finer = self.base, (variant.refine or self.scene.refine) / self.scene.refine
        steps = finer * _steps(variant, self.scene)
        share = (MULTI_RATE if variant.multi_rate is not None else 1.0) * self._share(variant)
        fixed = FIXED if self.device != "cpu" else 0.0
        return base.wall["fe"] * steps * (fixed + share * finer**3 * base.elements) / (fixed + base.elements)

    def _share(self, variant: Variant) -> float:
        """Time of an element over that of the scene as written [-]."""
        double = variant.precision == "float64"
        if self.device == "cpu":
            own = str(self.scene.bodies[0].element)
            share = ELEMENTS.get(variant.element or own, 1.0) / ELEMENTS.get(own, 1.0)
            return share * (1.1 if double else 1.0)
        return 2.0 if double else 1.0


@contextmanager
def quiet(on: bool = True) -> Iterator[None]:
    """Silence warnings of runs: variants are meant to be worse than what one would run."""
    logger = logging.getLogger(LOGGER)
    before, logger.disabled = logger.disabled, on or logger.disabled
    try:
        yield
    finally:
        logger.disabled = before


def element_steps(result: Result) -> float:
    """Elements that a run computed, summed over its steps [-]."""
    summary = result.summary
    groups: list[dict[str, Any]] = summary.get("rate_groups") or []
    if not groups:
        return float(summary["n_elements"] * summary["n_steps"])
    longest = max(group["step"] for group in groups)
    return sum(group["elements"] * summary["n_steps"] * longest / group["step"] for group in groups)


def _steps(variant: Variant, scene: Scene) -> float:
    """Steps of a variant over those of the scene with the same mesh [-], by rules of thumb."""

    def stiff(penalty: object) -> float:
        value = AUTO_PENALTY if penalty == "auto" else float(penalty) if isinstance(penalty, int | float) else 0.0
        return math.sqrt(1.0 + value / SPRINGS)

    own = max((stiff(contact.penalty) for contact in scene.contacts), default=1.0)
    steps = stiff(variant.penalty) / own if variant.penalty is not None else 1.0
    if isinstance(variant.mass_scaling, int | float):
        steps /= variant.mass_scaling
    return steps * scene.impact.time_step_scale / (variant.time_step_scale or scene.impact.time_step_scale)


class _Watch:
    """Follows the progress of a run, measures the processor time of its steps, and stops it when time is over.

    The first report comes after some rows; the time before it is extrapolated in proportion.
    """

    def __init__(self, steps: float = math.inf, end: float = math.inf) -> None:
        """Of a run whose steps may take so long [s], and which must end by then, by `time.perf_counter` [s].

        Compiling kernels does not count; loading them does.
        """
        self.steps, self.end = steps, end
        self._stage, self._told = "", 0.0
        self._first: tuple[float, float, float] | None = None
        self._last = (0.0, 0.0, 0.0)

    def __call__(self, stage: str, done: float) -> None:
        """Note the progress of the steps, and the times.

        Raises:
            OutOfTimeError: by the pace of its steps so far, the run does not end in time.
        """
        now = time.perf_counter()
        if self._stage == "compile" and now > self._told + COMPILING:
            self.end += now - self._told
        self._stage, self._told = stage, now
        ahead = 0.0
        if stage == "impact":
            self._last = (done, time.process_time(), now)
            self._first = self._first or self._last
            share, spent = done - self._first[0], now - self._first[2]
            if done > FORESEEN and share > 0.0:
                ahead = spent * (1.0 - done) / share
                if spent / share > self.steps:
                    raise OutOfTimeError(f"its steps take about {duration_words(spent / share)}")
        if now + ahead > self.end:
            raise OutOfTimeError(f"the budget would end about {duration_words(now + ahead - self.end)} before it")

    @property
    def processor(self) -> float:
        """Processor time of all steps [s]; 0 where there was one report only."""
        if self._first is None or self._last[0] <= self._first[0]:
            return 0.0
        return (self._last[1] - self._first[1]) / (self._last[0] - self._first[0])
