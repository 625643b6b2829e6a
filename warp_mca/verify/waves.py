"""Owns the cases of waves: their speeds, elastic and plastic, their dispersion, and what an interface sends back."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.verify.case import Row, Setup, case, crossings

Array = NDArray[np.float64]


def _stress(result: mca.Result, position: float, component: int = 0) -> Array:
    """One component of the stress over time [Pa] at the probe nearest to a position along the first path [m]."""
    path = result.paths[0]
    probe = int(np.argmin(np.abs(path.position - position)))
    return path.stress[:, probe, component].astype(np.float64)


def _peak(curve: Array) -> float:
    """Greatest value of a smooth curve: of the parabola through the samples around its top."""
    top = int(np.argmax(curve))
    offset = np.arange(-5, 6)
    a, b, c = np.polyfit(offset, curve[top + offset], 2)
    return float(c - 0.25 * b * b / a)


@case(
    group="waves",
    title="A long pulse runs along a slender bar at sqrt(E / rho), with the stress rho c v",
    reference="One-dimensional wave theory: Graff, Wave Motion in Elastic Solids (1975), section 2.1.",
    catches=("bulk_modulus_low", "elastic_shear_soft"),
)
def bar_wave(setup: Setup) -> list[Row]:
    """Square bar, 4 mm wide, nu = 0.3; pulse of 80 us, 0.4 m; probes 0.4 m apart."""
    counts = setup.choose((50, 100, 200), (50, 100, 200, 400))
    c, v, near, far = math.sqrt(200e9 / 7800.0), 1.0, 0.2, 0.6
    exact = 7800.0 * c * v
    centroid, half, peak = [], [], []
    for count in counts:
        result = setup.run(setup.scene("pulse_bar", axial=count, v=v))
        curves = [-_stress(result, x) for x in (near, far)]
        mean = [float((result.time * s).sum() / s.sum()) for s in curves]
        rise = [float(crossings(result.time, s, 0.5 * exact)[0]) for s in curves]
        centroid.append((far - near) / (mean[1] - mean[0]))
        half.append((far - near) / (rise[1] - rise[0]))
        peak.append(_peak(curves[1]))
    sizes = tuple(1.0 / count for count in counts)
    return [
        Row(
            quantity="speed of the pulse's centroid",
            exact=c,
            measured=tuple(centroid),
            unit="m/s",
            tolerance=2e-5,
            why="the centroid travels at the speed of infinitely long waves, on any mesh; sums over 600 rows",
        ),
        Row(
            quantity="speed of the rise to half",
            exact=c,
            measured=tuple(half),
            unit="m/s",
            tolerance=5e-4,
            why="dispersion of the mesh with 80 cells in the pulse; that of lateral inertia is 5e-5",
            sizes=sizes,
            least_order=1.8,
        ),
        Row(
            quantity="greatest stress rho c v",
            exact=exact,
            measured=tuple(peak),
            unit="Pa",
            tolerance=5e-4,
            why="dispersion of the mesh, and the mean of the two cells around a probe",
            sizes=sizes,
            least_order=1.7,
        ),
    ]


@case(
    group="waves",
    title="An elastic precursor at the yield stress runs ahead of a plastic wave at sqrt(E_t / rho)",
    reference="Von Karman and Duwez, J. Appl. Phys. 21 (1950) 987; Kolsky, Stress Waves in Solids (1963), chapter VII.",
    catches=("hardening_is_tangent",),
)
def plastic_wave(setup: Setup) -> list[Row]:
    """Square bar, 4 mm wide, nu = 0.3, sigma_y = 400 MPa, E_t = E / 9, driven at three times the yield velocity."""
    counts = setup.choose((160, 320), (160, 320, 640))
    E, rho, sigma_y, E_t, length, rise = 200e9, 7800.0, 400e6, 200e9 / 9.0, 0.4, 40e-6
    c, c_p = math.sqrt(E / rho), math.sqrt(E_t / rho)
    v_y = sigma_y / (rho * c)
    plateau = sigma_y + rho * c_p * (3.0 * v_y - v_y)
    near, middle, far = 0.05, 0.1, 0.15
    precursor, behind, front = [], [], []
    for count in counts:
        scene = setup.scene(
            "pulse_bar",
            **{"drive": "kept", "rise": rise, "v": 3.0 * v_y, "sigma_y": sigma_y, "E_t": E_t},
            **{"length": length, "axial": count, "duration": 125e-6},
        )
        result = setup.run(scene)
        time = result.time
        between = (time > middle / c + 0.75 * rise) & (time < middle / c_p + 0.125 * rise)
        precursor.append(float(-_stress(result, middle)[between].mean()))
        behind.append(float(-_stress(result, near)[time > near / c_p + 1.25 * rise].mean()))
        arrival = [float(crossings(time, -_stress(result, x), 0.5 * (sigma_y + plateau))[0]) for x in (near, far)]
        front.append((far - near) / (arrival[1] - arrival[0]))
    sizes = tuple(length / count for count in counts)
    return [
        Row(
            quantity="stress of the precursor",
            exact=sigma_y,
            measured=tuple(precursor),
            unit="Pa",
            tolerance=1e-3,
            why="the foot of the plastic wave, smeared by lateral inertia, begins within the mean",
            sizes=sizes,
        ),
        Row(
            quantity="stress behind the plastic wave",
            exact=plateau,
            measured=tuple(behind),
            unit="Pa",
            tolerance=1e-3,
            why="lateral inertia of the bar, 4 mm wide: a bar of 2 mm leaves a quarter of it",
            sizes=sizes,
        ),
        Row(
            quantity="speed of the plastic wave",
            exact=c_p,
            measured=tuple(front),
            unit="m/s",
            tolerance=5e-3,
            why="the front, 70 mm long, is smeared over a few cells and bar widths between the probes, 100 mm apart",
            sizes=sizes,
        ),
    ]
