"""Owns the claims of the paper: a new one is an entry in `CLAIMS`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from warp_mca.paper import readings as read
from warp_mca.paper import word_checks as check
from warp_mca.paper.claims import Claim, Found
from warp_mca.paper.evidence import Evidence
from warp_mca.paper.studies import MESHES
from warp_mca.results.result import Result

PENALTY_REASON = "springs of the factor 0.1 take part of the peak, more of it the coarser the cells at the tip are"
PURE_FEM = "pure finite elements are not run at this level"


def _of(study: str, value: float, reading: Callable[[Result], float]) -> Callable[[Evidence], Found]:
    return lambda evidence: float(reading(evidence.run(study, value)))


def _base(reading: Callable[[Result], float]) -> Callable[[Evidence], Found]:
    return _of("base", 0.0, reading)


def _trend(study: str, reading: Callable[[Result], float], *, rises: bool) -> Callable[[Evidence], Found]:
    return partial(read.trend, study=study, reading=reading, rises=rises)


def _compliance(study: str, figure: str, soft: float, stiff: float, reason: str) -> tuple[Claim, ...]:
    what = {"tip": "tip", "body": "rod body", "rod": "whole rod"}[study]
    return (
        Claim(
            f"{study}_trend",
            f"Fig. {figure}",
            f"the contact gets shorter as the {what} gets stiffer",
            "falls",
            _trend(study, read.duration, rises=False),
            "ms",
        ),
        Claim(
            f"{study}_soft",
            f"Fig. {figure}",
            f"duration of contact with a {what} of 0.7 GPa",
            soft,
            _of(study, 0.7, read.duration),
            "ms",
            0.12,
            reason,
        ),
        Claim(
            f"{study}_stiff",
            f"Fig. {figure}",
            f"duration of contact with a {what} of 7000 GPa",
            stiff,
            _of(study, 7000.0, read.duration),
            "ms",
            0.12,
            reason,
        ),
    )


_SOFT = "these runs take penalty 1; the softer springs of the other columns make contacts longer, as the paper's may be"

CLAIMS: tuple[Claim, ...] = (
    Claim(
        "mesh",
        "Sect. 3.1, Fig. 7",
        "peak of F_n between the two finest meshes changes by less than 2.5 %",
        "< 2.5 %",
        check.finest_meshes(MESHES, read.first_peak, 0.025),
        reason="at this level the meshes are coarse",
    ),
    Claim(
        "t_contact",
        "Sect. 3.3",
        "time of first contact",
        0.256,
        _base(lambda r: r.summary["t_contact"]),
        "s",
        0.005,
    ),
    Claim(
        "v_n", "Sect. 3.2, Fig. 8", "normal velocity at contact", 2.25, _base(lambda r: r.summary["v_n"]), "m/s", 0.02
    ),
    Claim(
        "v_t",
        "Sect. 3.2, Fig. 8",
        "tangential velocity at contact",
        3.27,
        _base(lambda r: r.summary["v_t"]),
        "m/s",
        0.05,
        "ours is that of the centre of the tip's sphere, the paper's that of its point Q",
    ),
    Claim(
        "first_peak",
        "Table 2, Fig. 9b",
        "first peak of F_n",
        3.23526,
        _base(read.first_peak),
        "kN",
        0.03,
        PENALTY_REASON,
    ),
    Claim(
        "two_compressions",
        "Sect. 3.4.1",
        "the contact is compressed twice within one contact",
        "two compressions",
        check.two_compressions,
        reason="the second one is what hinge A returns: it hangs on the hinge and on the mesh",
    ),
    Claim("fem_peak", "Table 2", "first peak over that of pure finite elements", 98.5, None, "%", reason=PURE_FEM),
    Claim("fem_cost", "Table 2", "cost over that of pure finite elements", 0.705, None, "%", reason=PURE_FEM),
    Claim(
        "fem_motion",
        "Fig. 9a",
        "angles differ from pure finite elements by less than 0.5 %",
        0.5,
        None,
        "%",
        reason=PURE_FEM,
    ),
    Claim(
        "bar_speed",
        "Sect. 3.3",
        "speed of longitudinal waves by theory, sqrt(E/ρ)",
        5091.0,
        _base(lambda r: r.summary["wave_speeds"]["bar"]),
        "m/s",
        0.002,
    ),
    Claim(
        "front",
        "Sect. 3.3, Fig. 11d",
        "way of the fastest wave in 20 µs",
        0.108,
        _base(lambda r: read.front(r, 20e-6)),
        "m",
        0.12,
        "where a front begins depends on the least stress that counts; long cells blur it",
    ),
    Claim(
        "paths_1_3",
        "Sect. 3.3, Fig. 11",
        "stress on Path 1 is slightly greater than on Path 3 until 100 µs",
        "> 1",
        check.stress_ratio(1, 3, 1.0, 1.5),
    ),
    Claim(
        "paths_2_1",
        "Sect. 3.3, Fig. 11",
        "stress on Path 2 is much less than on Path 1 until 100 µs",
        "much less",
        check.stress_ratio(2, 1, 0.0, 0.6),
    ),
    Claim(
        "transmission",
        "Sect. 3.3, Fig. 11",
        "part of the waves has passed hinge A, into rod OA, after 20 µs",
        "after 20 µs",
        check.passes,
    ),
    Claim(
        "v_plate_peak",
        "Fig. 12",
        "peak of F_n rises with the velocity of the plate",
        "rises",
        _trend("v_plate", lambda r: 1e-3 * r.summary["F_n_max"], rises=True),
        "kN",
    ),
    Claim(
        "reversal",
        "Fig. 12",
        "F_t turns from negative to positive from 0.8 m/s on, and not at 0.4 m/s",
        "0.8: yes, 0.4: no",
        read.reversal,
        reason="two tied pairs of nodes yield on fine meshes, and F_t turns later; with lugs or pins it turns",
    ),
    Claim(
        "stick_restitution",
        "Fig. 12",
        "at 0.4 m/s the contact sticks in restitution",
        "in restitution",
        check.stick_in_restitution,
    ),
    Claim(
        "stick_moves",
        "Fig. 12",
        "sticking moves towards compression as the plate gets faster",
        "earlier",
        check.earlier,
        "share of the contact",
    ),
    Claim(
        "negative_again",
        "Fig. 13",
        "after contact v_n is mainly upwards, and downwards again at about 0.65 ms",
        "mainly upwards, 0.65 ms",
        check.negative_again,
    ),
    Claim(
        "mu_trend", "Fig. 14", "peak of F_n falls as μ grows", "falls", _trend("mu", read.first_peak, rises=False), "kN"
    ),
    Claim(
        "mu_low_peak",
        "Fig. 14",
        "peak of F_n at μ = 0.1",
        4.10,
        _of("mu", 0.1, read.first_peak),
        "kN",
        0.12,
        PENALTY_REASON,
    ),
    Claim(
        "mu_high_peak",
        "Fig. 14",
        "peak of F_n at μ = 1.5",
        2.44,
        _of("mu", 1.5, read.first_peak),
        "kN",
        0.12,
        PENALTY_REASON,
    ),
    Claim("mu_low_F_t", "Fig. 14", "peak of F_t at μ = 0.1", -0.42, _of("mu", 0.1, read.greatest_F_t), "kN", 0.12),
    Claim("mu_high_F_t", "Fig. 14", "peak of F_t at μ = 1.5", -2.31, _of("mu", 1.5, read.greatest_F_t), "kN", 0.12),
    Claim(
        "mu_low_contact", "Fig. 14", "duration of contact at μ = 0.1", 0.42, _of("mu", 0.1, read.duration), "ms", 0.12
    ),
    Claim(
        "mu_high_contact", "Fig. 14", "duration of contact at μ = 1.5", 0.39, _of("mu", 1.5, read.duration), "ms", 0.12
    ),
    Claim(
        "mu_stick", "Fig. 14", "time of sticking grows with μ", "grows", _trend("mu", read.stick_time, rises=True), "ms"
    ),
    Claim(
        "gross_slip",
        "Sect. 3.4.2",
        "gross slip at small μ, longer sticking at great μ (0.3 and 0.47 in the paper)",
        "slip, then sticking",
        check.gross_slip,
    ),
    Claim(
        "mu_velocities",
        "Fig. 15",
        "forces change clearly with μ, velocities of the tip hardly",
        "hardly",
        check.velocities_hardly_change,
    ),
    *_compliance("tip", "16", 1.0, 0.33, _SOFT),
    *_compliance("body", "17", 1.39, 0.22, _SOFT),
    *_compliance("rod", "18", 1.57, 0.14, _SOFT),
    Claim(
        "body_succession",
        "Fig. 17",
        "succession collisions with a soft body",
        "several contacts",
        check.succession("body"),
    ),
    Claim(
        "rod_succession",
        "Fig. 18",
        "succession collisions with a soft rod",
        "several contacts",
        check.succession("rod"),
    ),
    Claim(
        "body_compressions",
        "Sect. 3.4.3",
        "several compressions with a rod body of 70 GPa or less",
        "several",
        check.many_compressions,
        reason="at 70 GPa the second one hangs on the hinge",
    ),
    Claim("tip_stick", "Table 3", "a soft tip sticks more easily", "softer: more", check.sticking("tip", rises=False)),
    Claim("body_stick", "Table 3", "a soft body slips more easily", "softer: less", check.sticking("body", rises=True)),
    Claim(
        "limit_peak",
        "(ours)",
        "with pins and stiff springs the first peak has a limit: the mesh changes it by less than 1 %",
        "< 1 %",
        check.finest_meshes("limit", read.first_peak, 0.01),
        reason="at this level the meshes are coarse",
    ),
    Claim(
        "limit_contact",
        "(ours)",
        "with pins and stiff springs the duration has a limit: the mesh changes it by less than 1 %",
        "< 1 %",
        check.finest_meshes("limit", read.duration, 0.01),
        reason="at this level the meshes are coarse",
    ),
)
