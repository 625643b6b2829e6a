"""Owns the checks of claims that are words: each returns what was found, and whether it is what the paper says."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from warp_mca.paper import readings as read
from warp_mca.paper.claims import Found, Words
from warp_mca.paper.evidence import Evidence, MissingRunError
from warp_mca.paper.studies import MAIN
from warp_mca.results.result import Result


def finest_meshes(study: str, reading: Callable[[Result], float], least: float) -> Callable[[Evidence], Found]:
    """Whether a reading changes by less than `least` between the two finest meshes."""

    def found(evidence: Evidence) -> Found:
        if evidence.variant != MAIN:
            raise MissingRunError("meshes are compared once")
        coarser, finer = (evidence.run(study, value) for value in evidence.values(study)[-2:])
        change = reading(finer) / reading(coarser) - 1.0
        counts = " to ".join(f"{result.summary['n_elements']:,}" for result in (coarser, finer))
        return Words(f"{100 * change:+.2f} % from {counts} elements", abs(change) < least)

    return found


def two_compressions(evidence: Evidence) -> Found:
    count = read.compressions(evidence.run("base", 0.0))
    return Words(f"{count} compressions in one contact", count >= 2)


def stick_in_restitution(evidence: Evidence) -> Found:
    result = evidence.run("v_plate", 0.4)
    sticks = [tuple(stick) for stick in result.summary["sticks"]]
    length = read.overlap(sticks, sticks)
    if not length:
        return Words("no sticking", False)
    share = read.overlap(sticks, read.compression_phases(result)[1]) / length
    return Words(f"{100 * share:.0f} % of the time of sticking lies in restitution", share > 0.5)


def negative_again(evidence: Evidence) -> Found:
    result = evidence.run("base", 0.0)
    later = read.after_contact(result, "tip_vy")
    share = float(np.mean(later > 0.0))
    time = result.time[-len(later) :][later < 0.0]
    said = f"down again at {1e3 * time[0]:.2f} ms" if len(time) else "never down again until the run ends"
    return Words(f"upwards for {100 * share:.0f} % of the time after contact, {said}", share > 0.5 and len(time) > 0)


def velocities_hardly_change(evidence: Evidence) -> Found:
    spread, force = [], []
    for value in evidence.values("mu"):
        result = evidence.run("mu", value)
        row = read.row_at(result, 0.1e-3)
        spread.append((result["tip_vx"][row], result["tip_vy"][row]))
        force.append(read.first_peak(result))
    most = float(np.ptp(np.array(spread), axis=0).max())
    share = most / evidence.run("base", 0.0).summary["v_t"]
    forces = float(np.ptp(force) / max(force))
    said = f"at 0.1 ms velocities differ by {most:.2g} m/s at most, {100 * share:.0f} % of v_t"
    return Words(f"{said}; peaks by {100 * forces:.0f} %", share < forces)


def gross_slip(evidence: Evidence) -> Found:
    shares = {}
    for value in (0.1, 1.5):
        result = evidence.run("mu", value)
        shares[value] = read.stick_time(result) / (1e3 * result.summary["contact_duration"])
    said = ", ".join(f"{100 * share:.0f} % of the contact at μ = {value:g}" for value, share in shares.items())
    return Words(f"sticks {said}", shares[0.1] < 0.1 < shares[1.5])


def succession(study: str) -> Callable[[Evidence], Found]:
    def found(evidence: Evidence) -> Found:
        values = [value for value in evidence.values(study) if value <= 7.0]
        if not values:
            raise MissingRunError(f"no run of {study} with 7 GPa or less")
        counts = {value: len(evidence.run(study, value).summary["contacts"]) for value in values}
        said = ", ".join(f"{count} at {value:g} GPa" for value, count in counts.items())
        return Words(f"contacts: {said}", any(count > 1 for count in counts.values()))

    return found


def many_compressions(evidence: Evidence) -> Found:
    counts = {value: read.compressions(evidence.run("body", value)) for value in evidence.values("body")}
    said = ", ".join(f"{count} at {value:g} GPa" for value, count in counts.items())
    soft = [count for value, count in counts.items() if value <= 70.0]
    return Words(f"compressions: {said}", bool(soft) and min(soft) > 1)


def stick_share(result: Result) -> float:
    return read.stick_time(result) / (1e3 * result.summary["contact_duration"])


def sticking(study: str, *, rises: bool) -> Callable[[Evidence], Found]:
    """Whether the share of sticking rises, or falls, from the softest to the stiffest."""

    def found(evidence: Evidence) -> Found:
        values = evidence.values(study)
        first, last = (stick_share(evidence.run(study, value)) for value in (values[0], values[-1]))
        said = f"{100 * first:.0f} % of the contact at {values[0]:g} GPa, {100 * last:.0f} % at {values[-1]:g}"
        return Words(f"sticks {said}", (last > first) == rises)

    return found


def stress_ratio(first: int, second: int, least: float, most: float) -> Callable[[Evidence], Found]:
    """Whether the stress on one path over that on another, until 100 us, lies between two limits."""

    def found(evidence: Evidence) -> Found:
        ratio = read.stress_ratio(evidence.run("base", 0.0), first, second, 100e-6)
        return Words(f"{ratio:.2f} of it, means over rod AB", least < ratio < most)

    return found


def passes(evidence: Evidence) -> Found:
    time = read.transmitted(evidence.run("base", 0.0))
    return Words(f"stress on OA from {time:.0f} µs on", 15.0 < time < 60.0)


def earlier(evidence: Evidence) -> Found:
    values = [value for value in evidence.values("v_plate") if value < 3.27]  # beyond, the plate is faster than the tip
    if len(values) < 2:
        raise MissingRunError("fewer than two velocities below that of the tip")
    found = [read.stick_middle(evidence.run("v_plate", value)) for value in values]
    listed = ", ".join(f"{x:.2f}" for x in found)
    return Words(
        f"middle at {listed} of the contact, at {', '.join(f'{v:g}' for v in values)} m/s", found[-1] < found[0]
    )
