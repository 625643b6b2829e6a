"""Owns `tradeoff`: what variants of a scene's model cost and how far their figures are from a reference."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field

from warp_mca.accuracy.combine import combinations, spread
from warp_mca.accuracy.figures import BOUND
from warp_mca.accuracy.files import write_tradeoff, writing_to
from warp_mca.accuracy.findings import TradeOff
from warp_mca.accuracy.knobs import BASE, Trial, one_at_a_time, penalty_of
from warp_mca.accuracy.measure import Bench, Measured, OutOfTimeError
from warp_mca.accuracy.reference import Reference, choose_penalty, find_reference, least_cost
from warp_mca.accuracy.variant import Variant
from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.base.progress import duration_words
from warp_mca.phases.arguments import check_scene, span_of
from warp_mca.phases.settings import settings_of
from warp_mca.scene import Scene

REFERENCE_SHARE = 0.45  # of the budget left after the first runs
COMBINED_SHARE = 0.3  # of the budget left after the reference
COMBINED = 10  # combinations at most
LEAST = 1e-3  # budget that can be asked for [s]
WRITING = 2.0  # of the budget, for the files at the end, or a tenth of it [s]

Progress = Callable[[Measured, str], None]  # what was measured, and what comes next


def tradeoff(
    scene: Scene,
    *,
    budget: float | None = None,
    device: str = "cpu",
    threads: int | None = None,
    duration: float | None = None,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> TradeOff:
    """Run variants of a scene's model, and compare each with a reference in the limit of mesh and contact springs.

    Knobs are turned one at a time, then together where that is promising: `knobs.py`, `combine.py`. A budget decides
    which variants are run, in an order that it does not change, and how fine the meshes of the reference are.

    Args:
        scene: what to run, one impact of it.
        budget: wall-clock time for all runs [s], from the first step on and without compiling kernels; a run that would
            not end in it is stopped. None for all variants.
        device, threads, duration: as in `warp_mca.run`.
        out: folder for tradeoff.json and tradeoff.png; nothing is written if None.
        force: replace those that `out` holds already.
        progress: called after each run with what was measured and with what comes next.

    Raises:
        RequestError: the request cannot be carried out, or the budget is less than the scene as written and the
            coarsest reference take; nothing was written.
        GuardError: a guard stopped the scene as written.
    """
    check_scene("scene", scene)
    span_of(scene, duration)
    if scene.t_end is not None:
        raise bad_value("Scene.t_end", scene.t_end, "variants are compared by one impact; leave t_end out")
    if all(body.rigid for body in scene.bodies):
        remedy = "all its bodies are rigid, whose forces have no limit as contact springs stiffen; make one deformable"
        raise bad_value("scene", scene.name, remedy)
    if budget is not None and not (validate.is_number(budget) and LEAST <= budget <= validate.LONGEST):
        remedy = f"give a finite time above 0 s, at least {LEAST:g} s, or leave it out"
        raise bad_value("budget", validate.brief(budget), remedy)
    settings_of(device, "mixed", threads)
    with writing_to(out, force) as folder:
        found = _Study(Bench(scene, device, threads, duration), budget, progress).run()
        if folder is not None:
            write_tradeoff(found, folder)
    return found


@dataclass
class _Study:
    """A trade-off while it goes on: what was measured, and the time that is left.

    Attributes:
        bench, budget, progress: see `tradeoff`.
        begun: when it began [s].
        runs: variants measured, by `Bench.key`.
        left_out: variants that there was no time for.
        same: variants whose meshes are those of one that was measured, and that one.
    """

    bench: Bench
    budget: float | None
    progress: Progress | None
    begun: float = field(default_factory=time.perf_counter)
    runs: dict[Hashable, Measured] = field(default_factory=dict)
    left_out: list[tuple[Trial, float]] = field(default_factory=list)
    same: list[tuple[Trial, Trial]] = field(default_factory=list)

    def run(self) -> TradeOff:
        """All of it, in order.

        Raises:
            RequestError: the budget does not allow for the least that has to be run.
        """
        if self.budget is not None:
            self.bench.budget = self.budget - min(WRITING, 0.1 * self.budget)
        try:
            self.note(BASE)
        except OutOfTimeError as error:
            remedy = f"the scene as written alone does not end in it ({error}): give several times as much"
            raise bad_value("budget", self.budget, remedy) from error
        least = self.check_least(penalty_of(self.bench.scene))
        penalty, springs = choose_penalty(self.bench, lambda variant: self.affords(variant, 0.15, least), self.note)
        self.check_least(penalty)
        reference = find_reference(self.bench, penalty, springs, REFERENCE_SHARE * self.left, self.note)
        reserve = COMBINED_SHARE * self.left if self.budget is not None else 0.0
        single = [BASE, *one_at_a_time(self.bench.scene)]
        for trial in single:
            self.try_(trial, self.bench.foreseen(trial.variant), reserve)
        self.combine(single, reference)
        return TradeOff(
            scene=self.bench.scene.name,
            device=self.bench.name,
            threads=self.bench.threads,
            duration=span_of(self.bench.scene, self.bench.duration),
            budget=self.budget,
            clock=self.bench.clock,
            reference=reference,
            variants=list(self.runs.values()),
            left_out=self.left_out,
            same=self.same,
            spent=time.perf_counter() - self.begun,
        )

    def combine(self, single: Sequence[Trial], reference: Reference) -> None:
        """Run promising combinations."""
        keys = dict.fromkeys(self.bench.key(trial.variant) for trial in single)
        runs = [self.runs[key] for key in keys if key in self.runs and self.runs[key].trial is not BASE]
        known = [reference.limits[name].left for name in BOUND]
        floor = min((left for left in known if left is not None), default=0.0)
        base = self.runs[self.bench.key(BASE.variant)]
        found = combinations(self.bench, runs, reference.figures, floor)
        done = 0
        for k in spread(len(found), COMBINED)[: 2 * COMBINED]:
            trial, cost = found[k]
            if done < COMBINED and self.try_(trial, cost * base.wall["fe"] + self.bench.beside * base.elements, 0.0):
                done += 1

    def note(self, trial: Trial) -> Measured:
        """Measure a variant. Each is run once, and variants that are the same model share a run."""
        key = self.bench.key(trial.variant)
        if key in self.runs:
            first = self.runs[key].trial
            if first.variant != trial.variant and (trial, first) not in self.same:
                self.same.append((trial, first))
        else:
            self.runs[key] = self.bench.run(trial)
            if self.progress:
                self.progress(self.runs[key], f"{len(self.runs)} runs, {time.perf_counter() - self.begun:.0f} s")
        return self.runs[key]

    def try_(self, trial: Trial, foreseen: float, reserve: float) -> bool:
        """Run a variant if what is left of the budget, less a reserve [s], allows for the time foreseen [s].

        Returns:
            Whether it gave figures.
        """
        if self.bench.key(trial.variant) in self.runs or foreseen <= self.left - reserve:
            return not self.note(trial).stopped
        self.left_out.append((trial, foreseen))
        return False

    def check_least(self, penalty: float | str | None) -> float:
        """The time that the coarsest reference takes with a penalty [s]; 0 without a budget.

        Raises:
            RequestError: less is left of the budget.
        """
        if self.budget is None:
            return 0.0
        least = least_cost(self.bench, penalty)
        if least > self.left:
            base = self.runs[self.bench.key(BASE.variant)].wall["fe"]
            took = f"steps of the scene as written took {duration_words(base)}, those of the coarsest reference about"
            remedy = f"{took} {duration_words(least)}; give at least {1.5 * (base + least):.2g} s"
            raise bad_value("budget", self.budget, remedy)
        return least

    def affords(self, variant: Variant, share: float, reserve: float) -> bool:
        """Whether a variant takes no more than a share of what is left of the budget, less a reserve [s]."""
        return self.bench.foreseen(variant) <= share * (self.left - reserve)

    @property
    def left(self) -> float:
        """Time that is left [s]."""
        return self.bench.end - time.perf_counter()
