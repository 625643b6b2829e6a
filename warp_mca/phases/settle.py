"""Owns the phase in which bodies come to rest under gravity before an impact, by damping in proportion to mass.

Bodies swing about their equilibrium. Their kinetic energy has its first maximum after a quarter of the period,
t = pi / (2 w), where they pass it (Cundall, Explicit finite-difference methods in geomechanics, 1976): there velocities
become zero. From then on all velocities shrink by exp(-2 w t), which is critical damping of a motion of frequency w. It
follows the motion that is left, see `HalfSteps.look`: with the first w slow motions would only creep. w is at most the
first one, and at least that of which a quarter of the period has passed since the start, so that bodies that nothing
holds come to rest, too. The ledger books what is lost as damping.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.errors import GuardError, bad_value
from warp_mca.phases.division import MAX_STEPS, coarser
from warp_mca.phases.half_steps import HalfSteps
from warp_mca.phases.stretch import Stretch, stretch_ended
from warp_mca.physics.contact.slave_edges import return_energy
from warp_mca.scene import Settle

if TYPE_CHECKING:
    from warp_mca.phases.impact import Impact

Array = NDArray[np.float64]
STEPS = 10  # between two looks at the kinetic energy at most, until it was at its greatest
SHORT = 0.7  # share of that between every second two: looks half a period apart would always see a motion turn back
LOOKS = 8  # at least until then, and in each quarter of the period of what moves later
LENGTHS = (1, 2, 5, STEPS)  # of what is advanced at once: a graph of launches is captured for each other number
ROWS = 500  # of the history, where it lasts as long as it may


def settle(phase: Settle, impact: Impact, tell: Callable[[float], None]) -> Stretch:
    """Advance an impact phase that has not begun until its bodies rest; `tell` gets the share of the time.

    Raises:
        RequestError: its duration holds too few steps, or too many.
        GuardError: a guard stopped it, or the bodies do not rest in time.
    """
    solver, state, fine = impact.solver, impact.state, impact.steps
    model = solver.model
    if not 2 * STEPS < phase.duration / fine.dt < MAX_STEPS:
        remedy = f"give a time of more than {2 * STEPS} and fewer than {MAX_STEPS:.0e} steps of {fine.dt:.3g} s"
        raise bad_value("Settle.duration", phase.duration, remedy)
    joined = max(1, round(phase.duration / ROWS / fine.interval))
    speed = float(np.linalg.norm(impact.ready[0].scene.gravity)) * phase.duration
    steps = coarser(fine, model, joined, math.ceil(phase.duration / (joined * fine.interval)), speed)
    impact.take(steps)
    _return_energy(impact, False)
    motion = HalfSteps(impact, phase.falling)
    motion.slow(0.0)
    motion.fall()
    greatest = kinetic = 0.0
    quiet = reached = quarter = 0  # steps, the last one of a quarter of the period of what moves
    passed = short = False
    while quiet <= max(reached, quarter) or state.steps * fine.dt < motion.rise:
        if state.steps >= steps.count - STEPS:
            just = "fell below the tolerance only just before"
            left = just if quiet else f"is still {kinetic / greatest:.2g} of its most"
            raise GuardError(
                f"bodies do not rest after Settle.duration = {phase.duration:g} s: their kinetic energy {left}; give a "
                "longer duration, or hold what falls"
            )
        wanted = max(1, min(STEPS, state.steps // LOOKS), quarter // LOOKS)
        wanted, short = max(1, int(SHORT * wanted)) if short else wanted, not short
        stride = min(wanted, steps.count - STEPS - state.steps)
        _advance(impact, stride)
        tell(state.steps / steps.count)
        kinetic = motion.look()
        if kinetic > greatest:
            greatest, reached = kinetic, state.steps
        quiet = 0 if kinetic > phase.tolerance * greatest else quiet + stride
        rising, passed = not passed and kinetic == greatest, passed or kinetic < greatest
        later = state.steps > reached + stride
        risen = state.steps * fine.dt > motion.rise
        quarter = round(min(max(motion.quarter / fine.dt if risen else 0.0, reached), state.steps))
        motion.quarter = quarter * fine.dt
        motion.slow(1.0 if rising else math.exp(-math.pi * stride / quarter) if later else 0.0)
    motion.rest(fine.per_interval - 1)
    stretch = stretch_ended(impact, "settle", "rest", fine)
    motion.release(impact.scene_runs[0])
    _return_energy(impact, True)
    return stretch


def _return_energy(impact: Impact, on: bool) -> None:
    """Whether contact springs return what closing and opening took, which they tell by velocities."""
    with wp.ScopedDevice(impact.solver.device):
        for stage, own in zip(impact.solver.contacts, impact.state.contacts, strict=True):
            return_energy(stage, own.spring, on)


def _advance(impact: Impact, stride: int) -> None:
    """Take so many steps."""
    end = impact.state.steps + stride
    while (left := end - impact.state.steps) > 0:
        impact.advance(until=impact.state.steps + max(length for length in LENGTHS if length <= left))
