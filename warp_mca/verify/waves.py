"""Owns the cases of waves: their speeds, elastic and plastic, their dispersion, and what an interface sends back."""

from __future__ import annotations

import math

import numpy as np

import warp_mca as mca
from warp_mca.base.arrays import Array
from warp_mca.verify.case import SHAPES, Row, Setup, case, crossings


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
    reference="One-dimensional wave theory: Graff, Wave Motion in Elastic Solids (1975), chapter 2.",
)
def bar_wave(setup: Setup) -> list[Row]:
    """Square bar, 2 mm wide, nu = 0.3; pulse of 80 us, 0.4 m; probes 0.4 m apart."""
    counts = setup.choose((50, 100, 200), (50, 100, 200, 400))
    c, v, near, far = math.sqrt(200e9 / 7800.0), 1.0, 0.2, 0.6
    exact = 7800.0 * c * v
    centroid, half, peak = [], [], []
    for count in counts:
        result = setup.run(setup.scene("pulse_bar", axial=count, v=v, side=0.002))
        curves = [-_stress(result, x) for x in (near, far)]
        mean = [float((result.time * s).sum() / s.sum()) for s in curves]
        rise = [float(crossings(result.time, s, 0.5 * exact)[0]) for s in curves]
        centroid.append((far - near) / (mean[1] - mean[0]))
        half.append((far - near) / (rise[1] - rise[0]))
        peak.append(_peak(curves[1]))
    sizes = tuple(1.0 / count for count in counts)
    # lumped mass slows waves down; thin tetrahedra, stiffer across, speed them up
    cancelled = setup.by_element(
        "", tet4="; of tetrahedra errors of either sign, so that no order shows with 50 to 400 cells"
    )
    any_mesh = "the centroid travels at the speed of infinitely long waves, on any mesh; sums over 600 rows"
    dispersed = "dispersion of the mesh with 80 cells in the pulse; that of lateral inertia is 1e-5" + cancelled
    between = "dispersion of the mesh, and the mean of the two cells around a probe" + cancelled
    order = setup.by_element(1.8, tet4=None)
    lower = setup.by_element(1.7, tet4=None)
    return [
        Row("speed of the pulse's centroid", c, centroid, "m/s", 2e-5, any_mesh),
        Row("speed of the rise to half", c, half, "m/s", 5e-4, dispersed, sizes=sizes, least_order=order),
        Row("greatest stress rho c v", exact, peak, "Pa", 5e-4, between, sizes=sizes, least_order=lower),
    ]


@case(
    group="waves",
    title="An elastic precursor at the yield stress runs ahead of a plastic wave at sqrt(E_t / rho)",
    reference="Von Karman and Duwez, J. Appl. Phys. 21 (1950) 987; Kolsky, Stress Waves in Solids (1963), chapter VII.",
)
def plastic_wave(setup: Setup) -> list[Row]:
    """Square bar, 2 mm wide, nu = 0.3, sigma_y = 400 MPa, E_t = E / 9, driven at three times the yield velocity."""
    counts = setup.choose(setup.by_element((160, 320), hex8r=(320, 640), tet4=(320, 640)), (160, 320, 640))
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
            **{"side": 0.002, "length": length, "axial": count, "duration": 125e-6},
        )
        result = setup.run(scene)
        time = result.time
        between = (time > middle / c + 0.75 * rise) & (time < middle / c_p + 0.125 * rise)
        precursor.append(float(-_stress(result, middle)[between].mean()))
        behind.append(float(-_stress(result, near)[time > near / c_p + 1.25 * rise].mean()))
        levels = [sigma_y + share * (plateau - sigma_y) for share in (0.3, 0.5, 0.7)]  # ripples shift each a little
        curves = [-_stress(result, x) for x in (near, far)]
        arrival = [float(np.mean([crossings(time, s, level)[0] for level in levels])) for s in curves]
        front.append((far - near) / (arrival[1] - arrival[0]))
    sizes = tuple(length / count for count in counts)
    lateral = "lateral inertia of the bar, 2 mm wide: one of 4 mm has three times as much" + setup.by_element(
        "",
        hex8i=" with hex8, six times with this element, a bar of 1 mm a quarter; 2 x 2 cells over the quarter of the "
        "section show 0.033 %, those of hex8 0.045 %, of which its single cell sees a third",
    )
    inertia = setup.by_element(3e-4, hex8i=3.5e-4)
    smeared = "the front is smeared over cells that it crosses, 80 between the probes"
    return [
        *_precursor_rows(setup, precursor, sigma_y, sizes),
        Row("stress behind the plastic wave", plateau, behind, "Pa", inertia, lateral, sizes=sizes),
        Row("speed of the plastic wave", c_p, front, "m/s", 2e-3, smeared, sizes=sizes),
    ]


def _precursor_rows(setup: Setup, precursor: list[float], sigma_y: float, sizes: tuple[float, ...]) -> list[Row]:
    """Stress of the elastic precursor [Pa], which ends at sigma_y."""
    smeared = "the foot of the plastic wave, smeared by lateral inertia, begins within the mean"
    common = {"exact": sigma_y, "unit": "Pa"}
    every = {"quantity": "stress of the precursor", "measured": tuple(precursor), "sizes": sizes, **common}
    if setup.element != "tet4":
        return [Row(**every, tolerance=4e-4, why=smeared)]
    mesh = "what order 1 / 2 leaves of the change from the mesh before"
    tolerance = (precursor[-1] - precursor[-2]) / sigma_y / (2.0**0.5 - 1.0)
    limit = precursor[-1] - (precursor[-2] - precursor[-1]) / (2.0 ** (2.0 / 3.0) - 1.0)
    finest = "stress of the precursor, extrapolated from the two finest meshes with order 2 / 3"
    return [
        Row(
            **every,
            tolerance=tolerance,
            why=f"{smeared}; so does the mesh, over (L h^2)^(1/3): {mesh}",
            least_order=0.5,
        ),
        Row(quantity=finest, measured=(limit,), **common, tolerance=4e-4, why=smeared),
    ]


def frequency(time: Array, curve: Array, guess: float) -> float:
    """Angular frequency of a curve's strongest vibration within 20 % of a guess [rad/s]: the top of its spectrum."""
    from scipy.optimize import minimize_scalar

    windowed = np.hanning(len(time)) * (curve - curve.mean())

    def strength(omega: float) -> float:
        return float(np.abs(windowed @ np.exp(-1j * omega * time)))

    scan = np.linspace(0.8 * guess, 1.2 * guess, 400)
    top, step = scan[int(np.argmax([strength(omega) for omega in scan]))], scan[1] - scan[0]
    found = minimize_scalar(lambda omega: -strength(omega), bounds=(top - step, top + step), method="bounded")
    return float(found.x)  # type: ignore[attr-defined]


def _phase_speeds(result: mca.Result, length: float, guesses: dict[int, float]) -> list[float]:
    """Phase speeds of standing waves along a bar [m/s]: with n half waves in the length, for each n and its guess."""
    path = result.paths[0]
    weight = np.ones(len(path.position))
    weight[[0, -1]] = 0.5
    speeds = []
    for n, guess in guesses.items():
        k = n * math.pi / length
        amplitude = path.stress[:, :, 0].astype(np.float64) @ (weight * np.cos(k * path.position))
        speeds.append(frequency(result.time, amplitude, guess * k) / k)
    return speeds


def _pochhammer(a: float, k: float, E: float, nu: float, rho: float) -> float:
    """Phase speed of the lowest longitudinal wave of a round bar [m/s], from the frequency equation.

    Args:
        a: radius [m].
        k: wavenumber [1/m].
        E, nu, rho: of the bar [Pa], [-], [kg/m^3].
    """
    from scipy.optimize import brentq
    from scipy.special import jv

    bar = math.sqrt(E / rho)
    dilatational = bar * math.sqrt((1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu)))
    shear = bar / math.sqrt(2.0 * (1.0 + nu))

    def equation(c: float) -> float:
        p = k * np.sqrt(complex((c / dilatational) ** 2 - 1.0))
        q = k * np.sqrt(complex((c / shear) ** 2 - 1.0))
        J0p, J1p, J0q, J1q = jv(0, p * a), jv(1, p * a), jv(0, q * a), jv(1, q * a)
        left = 2.0 * p / a * (q * q + k * k) * J1p * J1q - (q * q - k * k) ** 2 * J0p * J1q
        return float(((left - 4.0 * k * k * p * q * J1p * J0q) / (q * k**4)).real)  # over q, it has no imaginary part

    # The lowest branch comes first: from the Rayleigh speed at least, up to the bar speed.
    scan = np.linspace(0.55 * bar, 1.001 * bar, 200)
    values = [equation(c) for c in scan]
    first = next(i for i in range(len(scan) - 1) if values[i] * values[i + 1] < 0.0)
    return float(brentq(equation, scan[first], scan[first + 1], xtol=1e-9))  # type: ignore[arg-type]


@case(
    group="waves",
    title="Longitudinal waves of a round bar slow down as they shorten",
    reference="Pochhammer and Chree, the root of their equation: Graff, Wave Motion in Elastic Solids (1975), "
    "chapter 8; Davies, Phil. Trans. R. Soc. A 240 (1948) 375.",
)
def pochhammer(setup: Setup) -> list[Row]:
    """Bar of radius a = 10 mm and length 5 a between planes of symmetry, one or three half waves in it."""
    meshes = setup.choose(((4, 20), (6, 30)), ((4, 20), (6, 30), (8, 40)))
    a, length, E, nu, rho = 0.01, 0.05, 200e9, 0.3, 7800.0
    c0 = math.sqrt(E / rho)
    exact = {n: _pochhammer(a, n * math.pi / length, E, nu, rho) for n in (1, 3)}
    speeds = []
    for section, axial in meshes:
        result = setup.run(setup.scene("ringing_bar", section=section, axial=axial, duration=120e-6, rows=600))
        speeds.append(_phase_speeds(result, length, exact))
    sizes = tuple(length / axial for _, axial in meshes)
    rows = []
    for k, (n, tolerance) in enumerate(((1, 6e-4), (3, 9e-3))):
        what, shares = f"c / c0 at a / wavelength = {n * a / (2.0 * length):.1f}", [found[k] / c0 for found in speeds]
        why = f"dispersion of the mesh, with {2 * meshes[-1][1] // n} cells in the wavelength and six across the core "
        why += "of the section"
        rows.append(Row(what, exact[n] / c0, shares, "-", tolerance, why, sizes=sizes, least_order=1.8))
    return rows


@case(
    group="waves",
    title="An interface of two metals sends back (Z2 - Z1) / (Z1 + Z2) of a pulse and lets 2 Z2 / (Z1 + Z2) pass",
    reference="Graff, Wave Motion in Elastic Solids (1975), chapter 2; Z = rho c.",
    elements=SHAPES,
)
def impedance_step(setup: Setup) -> list[Row]:
    """Steel, then aluminium, 0.5 m each, no Poisson effect; pulse of 50 us, probes 0.2 m from the interface."""
    counts = setup.choose((50, 100, 200), (50, 100, 200, 400))
    c = math.sqrt(200e9 / 7800.0)
    Z, Z_far = 7800.0 * c, math.sqrt(70e9 * 2700.0)
    back, on = [], []
    for count in counts:
        result = setup.run(setup.scene("two_metal_bar", axial=count))
        near, far = -_stress(result, 0.3), -_stress(result, 0.7)
        arriving = result.time < 0.5 / c + 25e-6  # the pulse's middle meets the interface
        back.append(-_peak(-near[~arriving]) / _peak(near[arriving]))
        on.append(_peak(far) / _peak(near[arriving]))
    exact = {"sent back": (Z_far - Z) / (Z + Z_far), "let through": 2.0 * Z_far / (Z + Z_far)}
    why = "dispersion of the mesh, with 100 cells in the pulse, alike before and behind the interface"
    sizes = tuple(0.5 / count for count in counts)
    return [
        Row(f"share of the stress that is {name}", exact[name], measured, "-", 2e-4, why, sizes=sizes)
        for name, measured in (("sent back", back), ("let through", on))
    ]
