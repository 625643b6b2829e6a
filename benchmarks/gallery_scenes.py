"""Owns what the gallery shows of each built-in scene: the time of its picture, a figure, and its known value."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import warp_mca as mca
from warp_mca.verify.case import crossings
from warp_mca.verify.impact import STEEL, hertz, peak_and_duration
from warp_mca.verify.vibration import fitted_frequencies, timoshenko_frequencies
from warp_mca.verify.waves import frequency

Values = Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A scene on the page.

    Attributes:
        at: when it is pictured, as a share of the impact phase [-].
        quantity, unit: of the figure.
        measured: the figure, from the result and the scene's parameters.
        known: its value in theory, from the parameters; None if nobody knows it.
        theory: where the known value comes from.
        look: what `SnapshotFile` takes: field, magnify, limit.
    """

    at: float
    quantity: str
    unit: str
    measured: Callable[[mca.Result, Values], float]
    known: Callable[[Values], float] | None = None
    theory: str = ""
    look: Mapping[str, Any] = field(default_factory=dict)


def _summary(key: str) -> Callable[[mca.Result, Values], float]:
    return lambda result, p: float(result.summary[key])


def _stress_of(body: str) -> Callable[[mca.Result, Values], float]:
    return lambda result, p: float(result.summary["bodies"][body]["max_von_mises"]["value"])


def _last(column: str) -> Callable[[mca.Result, Values], float]:
    return lambda result, p: float(result[column][-1])


def _stress(result: mca.Result, share: float) -> np.ndarray:
    """Axial stress over time [Pa] at a share of the first path's length."""
    path = result.paths[0]
    probe = int(np.argmin(np.abs(path.position - share * path.position[-1])))
    return path.stress[:, probe, 0].astype(np.float64)


def _mean_force(first: float, last: float) -> Callable[[mca.Result, Values], float]:
    """Mean normal force [N] between two shares of the contact."""

    def mean(result: mca.Result, p: Values) -> float:
        start, end = result.summary["contacts"][0]
        inside = (result.time > start + first * (end - start)) & (result.time < start + last * (end - start))
        return float(result.F_n[inside].mean())

    return mean


def _c(p: Values) -> float:
    return math.sqrt(float(p["E"]) / float(p["rho"]))


def _period(result: mca.Result, p: Values) -> float:
    passed = crossings(result.time, result["tip_vy"], 0.0)
    return float(passed[5] - passed[1])


def _pendulum_period(p: Values) -> float:
    from scipy.special import ellipk

    length, side, axial = float(p["length"]), float(p["side"]), int(p["axial"])
    about = length**2 * ((1.0 + 2.0 / axial**2) / 12.0 + 0.25) + side**2 / 8.0  # I / m of the nodes
    return 4.0 * float(ellipk(math.sin(0.5 * p["amplitude"]) ** 2)) * math.sqrt(2.0 * about / (p["gravity"] * length))


def _bending(p: Values) -> float:
    shape = {"length": p["length"], "depth": p["depth"], "E": p["E"], "rho": p["rho"]}
    return timoshenko_frequencies(**shape, G=0.5 * p["E"] / (1.0 + p["nu"]), shear=5.0 / 6.0, count=1)[0]


def _turning(result: mca.Result, p: Values) -> float:
    return float(np.polyfit(result.time, np.unwrap(np.arctan2(result["tip_vy"], result["tip_vx"])), 1)[0])


def _pulse_speed(result: mca.Result, p: Values) -> float:
    """Of the centroid of the pulse between two probes [m/s]."""
    path = result.paths[0]
    probes = [int(np.argmin(np.abs(path.position - share * path.position[-1]))) for share in (0.2, 0.6)]
    passing = [path.stress[:, probe, 0].astype(np.float64) for probe in probes]
    centre = [float((result.time * s).sum() / s.sum()) for s in passing]
    return float(path.position[probes[1]] - path.position[probes[0]]) / (centre[1] - centre[0])


def _ringing(result: mca.Result, p: Values) -> float:
    path = result.paths[0]
    k = math.pi / float(p["length"])
    weight = np.ones(len(path.position))
    weight[[0, -1]] = 0.5
    amplitude = path.stress[:, :, 0].astype(np.float64) @ (weight * np.cos(k * path.position))
    return frequency(result.time, amplitude, k * _c(p)) / (2.0 * math.pi)


def _rolling_speed(result: mca.Result, p: Values) -> float:
    """Of the ball in the end [m/s]: of its centre, over the last tenth."""
    return float(result["tip_vx"][-len(result.time) // 10 :].mean())


def _through(result: mca.Result, p: Values) -> float:
    return float(np.abs(_stress(result, 0.7)).max() / np.abs(_stress(result, 0.3)).max())


def _impedance(E: float, rho: float) -> float:
    return math.sqrt(E * rho)


HEAT = "Coulomb friction turns half of m v² into heat, whatever its coefficient"
BARS = "one-dimensional wave theory"

SCENES: dict[str, Picture] = {
    "two_link": Picture(
        at=0.1, quantity="first peak of the normal force", unit="N", measured=_summary("F_n_first_peak")
    ),
    "three_link": Picture(
        at=0.1, quantity="first peak of the normal force", unit="N", measured=_summary("F_n_first_peak")
    ),
    "single_link": Picture(
        at=0.1, quantity="first peak of the normal force", unit="N", measured=_summary("F_n_first_peak")
    ),
    "taylor_bar": Picture(
        at=1.0,
        look={"field": "plastic_strain"},
        quantity="greatest equivalent plastic strain",
        unit="-",
        measured=_summary("max_plastic_strain"),
    ),
    "hertz_sphere": Picture(
        at=0.33,
        look={"limit": 30e6},
        quantity="peak force of the whole sphere",
        unit="N",
        measured=lambda result, p: peak_and_duration(result)[0],
        known=lambda p: hertz(float(p["v"]), STEEL)[0],
        theory="Hertz's impact",
    ),
    "single_rod": Picture(
        at=0.25,
        quantity="mean force over the middle of the contact",
        unit="N",
        measured=_mean_force(0.2, 0.8),
        known=lambda p: (
            2.0 * p["section"] * math.sin(0.5 * math.pi / p["section"]) * p["radius"] ** 2 * _c(p) * p["rho"] * p["v"]
        ),
        theory=f"{BARS}, ρ c A v with the area A of the mesh",
    ),
    "rod_on_wall": Picture(
        at=0.25,
        quantity="mean force over the middle of the contact",
        unit="N",
        measured=_mean_force(0.25, 0.75),
        known=lambda p: p["rho"] * _c(p) * p["area"] * p["v"],
        theory=f"{BARS}, ρ c A v",
    ),
    "coaxial_rods": Picture(
        at=0.1,
        quantity="mean force over the middle of the contact",
        unit="N",
        measured=_mean_force(0.25, 0.75),
        known=lambda p: 0.5 * p["rho"] * _c(p) * p["side"] ** 2 * p["v"],
        theory=f"{BARS}, ρ c A v / 2",
    ),
    "graded_bars": Picture(
        at=0.4,
        quantity="mean force over the middle of the contact",
        unit="N",
        measured=_mean_force(0.05, 0.95),
        known=lambda p: p["rho"] * _c(p) * p["side"] ** 2 * p["v"],
        theory=f"{BARS}, ρ c A v",
    ),
    "pulse_bar": Picture(
        at=0.5,
        quantity="speed of the pulse",
        unit="m/s",
        measured=_pulse_speed,
        known=_c,
        theory=f"{BARS}, √(E/ρ)",
    ),
    "two_metal_bar": Picture(
        at=0.6,
        quantity="share of the stress that is let through",
        unit="-",
        measured=_through,
        known=lambda p: 2.0 / (1.0 + _impedance(200e9, 7800.0) / _impedance(70e9, 2700.0)),
        theory=f"{BARS}, 2 Z₂ / (Z₁ + Z₂) with Z = ρ c",
    ),
    "tied_bar": Picture(
        at=0.6,
        quantity="share of the stress that is let through",
        unit="-",
        measured=lambda result, p: float(np.abs(_stress(result, 0.6)).max() / np.abs(_stress(result, 0.25)).max()),
        known=lambda p: 1.0,
        theory="a tie between bars of one impedance sends nothing back",
    ),
    "ringing_bar": Picture(at=0.3, quantity="frequency of its lowest standing wave", unit="Hz", measured=_ringing),
    "cantilever": Picture(
        at=0.35,
        look={"magnify": 10.0},
        quantity="lowest frequency of bending",
        unit="Hz",
        measured=lambda result, p: float(fitted_frequencies(result.time, result["tip_vy"], (_bending(p),))[0]),
        known=_bending,
        theory="Timoshenko's beam",
    ),
    "sliding_block": Picture(
        at=0.3,
        quantity="heat of friction",
        unit="J",
        measured=_last("E_friction"),
        known=lambda p: 12.5 * p["rho"] * p["height"] ** 3 * p["v"] ** 2,
        theory=HEAT,
    ),
    "block_on_belt": Picture(
        at=0.3,
        quantity="heat of friction",
        unit="J",
        measured=_last("E_friction"),
        known=lambda p: 0.1 * p["v"] ** 2,
        theory=HEAT,
    ),
    "rolling_sphere": Picture(
        at=0.3,
        look={"field": "velocity"},
        quantity="speed in the end",
        unit="m/s",
        measured=_rolling_speed,
        known=lambda p: 5.0 / 7.0 * p["v"],
        theory="a solid sphere that slides at first rolls at 5 v / 7",
    ),
    "stick_slip": Picture(
        at=0.5,
        look={"field": "velocity"},
        quantity="greatest friction force",
        unit="N",
        measured=_summary("F_t_max"),
        known=lambda p: float(p["force"]),
        theory="Coulomb's limit μ F_n",
    ),
    "sticking_block": Picture(
        at=0.5,
        quantity="heat of friction over the kinetic energy at first",
        unit="-",
        measured=lambda result, p: float(result["E_friction"][-1] / result["E_kinetic"][0]),
        known=lambda p: 0.0,
        theory="contact that sticks loses nothing",
    ),
    "metal_block": Picture(
        at=0.2,
        look={"field": "plastic_strain"},
        quantity="greatest equivalent plastic strain",
        unit="-",
        measured=_summary("max_plastic_strain"),
    ),
    "strained_element": Picture(
        at=1.0,
        look={"field": "plastic_strain"},
        quantity="greatest equivalent plastic strain",
        unit="-",
        measured=_summary("max_plastic_strain"),
    ),
    "pendulum": Picture(
        at=0.02,
        look={"field": "velocity"},
        quantity="period",
        unit="s",
        measured=_period,
        known=_pendulum_period,
        theory="elliptic integral, with the inertia of the mesh",
    ),
    "double_pendulum": Picture(
        at=0.5,
        look={"field": "velocity"},
        quantity="greatest error of the energy balance",
        unit="-",
        measured=_summary("energy_error"),
    ),
    "spinning_rod": Picture(
        at=0.25,
        look={"field": "velocity"},
        quantity="reaction of the hinge, from its impulse",
        unit="N",
        measured=lambda result, p: float(
            np.linalg.norm(result.summary["joint_impulse"]["O"]) / result.summary["simulated_time"]
        ),
        known=lambda p: 0.5 * p["rho"] * p["side"] ** 2 * p["length"] ** 2 * p["omega"] ** 2,
        theory="m ω² L / 2, whose direction turns with the rod",
    ),
    "spinning_top": Picture(
        at=0.1,
        look={"field": "velocity"},
        quantity="rate of precession",
        unit="rad/s",
        measured=_turning,
        known=lambda p: float(p["precession"]),
        theory="steady precession, from which the spin is set",
    ),
    "arm_strike": Picture(
        at=0.3,
        quantity="greatest von Mises stress of the bar",
        unit="Pa",
        measured=_stress_of("tool"),
    ),
    "leg_landing": Picture(
        at=0.3,
        quantity="greatest von Mises stress of the shin",
        unit="Pa",
        measured=_stress_of("shin"),
    ),
    "gripper": Picture(
        at=0.15,
        quantity="greatest von Mises stress of the part",
        unit="Pa",
        measured=_stress_of("part"),
    ),
}
