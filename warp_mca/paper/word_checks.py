"""Owns how claims are checked: numbers of a run, trends over a study, and words with whether they are the paper's."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from warp_mca.paper import readings as read
from warp_mca.paper.claims import Found, Words
from warp_mca.paper.evidence import Evidence, MissingRunError
from warp_mca.paper.studies import MAIN, STUDIES
from warp_mca.results.result import Result

TIP_SPEED = 3.27  # along the plate at contact, in the paper [m/s]
Reading = Callable[[Result], float]
Check = Callable[[Evidence], Found]


def later(check: Callable[..., Found]) -> Callable[..., Check]:
    """Let a check be called with all but its evidence, its last positional argument, which it then waits for."""
    return lambda *given, **options: lambda evidence: check(*given, evidence, **options)


@later
def of(study: str, value: float, reading: Reading, evidence: Evidence) -> Found:
    """A number of the run of a study with a value."""
    return float(reading(evidence.run(study, value)))


def base(reading: Reading) -> Check:
    """A number of the run with the values of Table 1."""
    return of("base", 0.0, reading)


@later
def chosen(variant: str, found: Check, evidence: Evidence) -> Found:
    """What is found in the runs of another variant than the main one, and of this one only."""
    if evidence.variant != MAIN:
        raise MissingRunError("choices are run on one mesh")
    return found(Evidence(evidence.runs, variant))


@later
def trend(study: str, reading: Reading, unit: str, evidence: Evidence, *, rises: bool) -> Found:
    """Whether a reading rises, or falls, from value to value of a study, and from what to what."""
    values = evidence.values(study)
    found = [reading(evidence.run(study, value)) for value in values]
    steady = all((b > a) == rises and a != b for a, b in pairwise(found))
    listed, given = ", ".join(f"{x:#.3g}" for x in found), ", ".join(f"{v:g}" for v in values)
    return Words(f"{listed} {unit} for {STUDIES[study].quantity} of {given}", steady)


@later
def finest_meshes(study: str, reading: Reading, least: float, evidence: Evidence) -> Found:
    """Whether a reading changes by less than `least` between the two finest meshes."""
    if evidence.variant != MAIN:
        raise MissingRunError("meshes are compared once")
    coarser, finer = (evidence.run(study, value) for value in evidence.values(study)[-2:])
    change = reading(finer) / reading(coarser) - 1.0
    counts = " to ".join(f"{result.summary['n_elements']:,}" for result in (coarser, finer))
    return Words(f"{100 * change:+.2f} % from {counts} elements", abs(change) < least)


def reversal(evidence: Evidence) -> Found:
    """At which velocities of the plate F_t turns from negative to positive."""
    turned = {value: bool(evidence.run("v_plate", value).summary["F_t_reverses"]) for value in (0.4, 0.8)}
    said = ", ".join(f"{'turns' if turns else 'does not turn'} at {value} m/s" for value, turns in turned.items())
    return Words(f"F_t {said}", turned == {0.4: False, 0.8: True})


def two_compressions(evidence: Evidence) -> Found:
    """Whether the contact is compressed twice."""
    count = read.compressions(evidence.run("base", 0.0))
    return Words(f"{count} in one contact", count >= 2)


def stick_in_restitution(evidence: Evidence) -> Found:
    """Whether more than half of the time of sticking at 0.4 m/s lies in restitution."""
    result = evidence.run("v_plate", 0.4)
    sticks = [tuple(stick) for stick in result.summary["sticks"]]
    length = read.overlap(sticks, sticks)
    if not length:
        return Words("no sticking", False)
    share = read.overlap(sticks, read.compression_phases(result)[1]) / length
    return Words(f"{100 * share:.0f} % of the time of sticking lies in restitution", share > 0.5)


def negative_again(evidence: Evidence) -> Found:
    """Whether the tip moves upwards most of the time after contact, and once downwards."""
    result = evidence.run("base", 0.0)
    later = read.after_contact(result, "tip_vy")
    time = result.time[-len(later) :]
    inside = time < 0.75e-3
    if not inside.any():
        raise MissingRunError("the run ends too early")
    share, least = float(np.mean(later > 0.0)), int(np.argmin(later[inside]))
    said = f"upwards for {100 * share:.0f} % of the time; least velocity {later[inside][least]:+.2f} m/s"
    return Words(f"{said}, at {1e3 * time[inside][least]:.2f} ms", share > 0.5 and later[inside][least] < 0.0)


def velocities_hardly_change(evidence: Evidence) -> Found:
    """Whether velocities of the tip at 0.1 ms differ by less than a tenth of v_t from one coefficient to the others."""
    results = evidence.results("mu")
    rows = [read.row_at(result, 0.1e-3) for result in results]
    velocities = [[result["tip_vx"][k], result["tip_vy"][k]] for k, result in zip(rows, results, strict=True)]
    along, down = np.ptp(np.array(velocities), axis=0)
    share = float(max(along, down)) / results[0].summary["v_t"]
    return Words(f"at 0.1 ms v_t differs by {along:.2g} m/s, v_n by {down:.2g} m/s", share < 0.1)


def gross_slip(evidence: Evidence) -> Found:
    """Whether less than a tenth of the contact sticks at the least friction, and more at the greatest."""
    shares = {value: stick_share(evidence.run("mu", value)) for value in (0.1, 1.5)}
    said = ", ".join(f"{100 * share:.0f} % of the contact at μ = {value:g}" for value, share in shares.items())
    return Words(f"sticks {said}", shares[0.1] < 0.1 < shares[1.5])


@later
def succession(study: str, evidence: Evidence) -> Found:
    """Whether bodies of 7 GPa or less touch the plate more than once."""
    values = [value for value in evidence.values(study) if value <= 7.0]
    if not values:
        raise MissingRunError(f"no run of {study} with 7 GPa or less")
    counts = {value: len(evidence.run(study, value).summary["contacts"]) for value in values}
    said = ", ".join(f"{count} at {value:g} GPa" for value, count in counts.items())
    return Words(f"contacts: {said}", any(count > 1 for count in counts.values()))


def many_compressions(evidence: Evidence) -> Found:
    """Whether contacts of rod bodies of 70 GPa or less are compressed more than once."""
    counts = {value: read.compressions(evidence.run("body", value)) for value in evidence.values("body")}
    said = ", ".join(f"{count} at {value:g} GPa" for value, count in counts.items())
    soft = [count for value, count in counts.items() if value <= 70.0]
    return Words(f"compressions: {said}", bool(soft) and min(soft) > 1)


def stick_share(result: Result) -> float:
    """Time of sticking over that of contact [-]."""
    return read.stick_time(result) / (1e3 * result.summary["contact_duration"])


@later
def sticking(study: str, evidence: Evidence, *, rises: bool) -> Found:
    """Whether the share of sticking rises, or falls, from the softest to the stiffest."""
    values = evidence.values(study)
    first, last = (stick_share(evidence.run(study, value)) for value in (values[0], values[-1]))
    said = f"{100 * first:.0f} % of the contact at {values[0]:g} GPa, {100 * last:.0f} % at {values[-1]:g}"
    return Words(f"sticks {said}", (last > first) == rises)


@later
def stress_ratio(first: int, second: int, least: float, most: float, evidence: Evidence) -> Found:
    """Whether the stress on one path over that on another, until 100 us, lies between two limits."""
    ratio = read.stress_ratio(evidence.run("base", 0.0), first, second)
    return Words(f"{ratio:.2f} of it, means over rod AB", least < ratio < most)


def passes(evidence: Evidence) -> Found:
    """Whether stress waves come through hinge A while the paper describes them."""
    time = read.transmitted(evidence.run("base", 0.0))
    return Words(f"stress on OA from {time:.0f} µs on", 20.0 < time < 1e6 * read.EARLY)


@later
def below_tip(reading: Reading, evidence: Evidence) -> Found:
    """Whether a reading falls as the plate gets faster, up to the speed of the tip."""
    values = [value for value in evidence.values("v_plate") if value < TIP_SPEED]
    if len(values) < 2:
        raise MissingRunError("fewer than two velocities below that of the tip")
    numbers = [reading(evidence.run("v_plate", value)) for value in values]
    listed, speeds = ", ".join(f"{x:.3f}" for x in numbers), ", ".join(f"{v:g}" for v in values)
    return Words(f"{listed} ms at {speeds} m/s", numbers[-1] < numbers[0])


def tip_follows_plate(evidence: Evidence) -> Found:
    """Whether the tip moves with the plate in the middle of the first sticking."""
    result = evidence.run("v_plate", 0.4)
    if not result.summary["sticks"]:
        return Words("no sticking", False)
    row = read.row_at(result, float(np.mean(result.summary["sticks"][0])))
    tip, plate = float(result["tip_vx"][row]), float(result["plate_vx"][row])
    share = abs(tip - plate) / abs(result["tip_vx"][0] - result["plate_vx"][0])
    said = f"tip {tip:.2f}, plate {plate:.2f} m/s in the middle of the first sticking"
    return Words(f"{said}: {100 * share:.0f} % of the first difference", share < 0.15)


def end_stress(evidence: Evidence) -> Found:
    """Whether stress on the surface equals that on the axis where the paths begin."""
    ratio = read.end_ratio(evidence.run("base", 0.0))
    return Words(f"Path 1 has {ratio:.2f} of Path 2", 0.75 < ratio < 1.33)
