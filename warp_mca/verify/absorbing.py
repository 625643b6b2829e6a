"""Owns the cases of absorbing boundaries: what they send back of plane waves, at right angles and at others."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.phases.carry_out import begin
from warp_mca.phases.prepare import Request, prepare
from warp_mca.phases.settings import Settings
from warp_mca.step.solver import Solver
from warp_mca.system.state import State
from warp_mca.verify.case import SHAPES, Row, Setup, case

Array = NDArray[np.float64]

MATERIAL = mca.Elastic(E=70e9, nu=0.25, rho=2700.0)
WIDTH = 1.0  # standard deviation of a packet, in wavelengths
REACH = 3.5 * WIDTH  # half of its extent
DEPTH = 9.0  # of the slab, in wavelengths: what is sent back does not return from its other side


def reflected_share(wave: str, slowness: Array, wave_speeds: dict[str, float]) -> Array:
    """Share of the energy of plane waves that dashpots rho c_p and rho c_s on a plane boundary send back [-].

    Incident P ("P") or SV ("S") waves raise a reflected P and a reflected SV wave, whose amplitudes A, B make the sum
    of traction t = sigma n and of Z v vanish at the boundary, Z = rho diag(c_p, c_s) (Lysmer and Kuhlemeyer, 1969,
    Eqs. 8 to 12, with a = b = 1). The share is the flux of energy along the normal of both over that of the incident.

    Args:
        wave: "P" or "S".
        slowness: along the boundary, sin(angle) / c [s/m], shape (count,).
        wave_speeds: of the material, see `Elastic.wave_speeds`.
    """
    c_p, c_s = wave_speeds["dilatational"], wave_speeds["shear"]
    cosine = {c: np.sqrt(1.0 - (slowness * c).astype(complex) ** 2) for c in (c_p, c_s)}

    def imbalance(c: float, sign: float) -> Array:
        """(t + Z v) / (-i omega rho) of a wave that runs towards the boundary, sign 1, or away, shape (2, count)."""
        d = np.stack([sign * cosine[c], slowness * c + 0j])
        p = d if c == c_p else np.stack([-d[1], d[0]])
        along = (c_p**2 - 2.0 * c_s**2) * (d * p).sum(axis=0)
        traction = np.stack([along + 2.0 * c_s**2 * d[0] * p[0], c_s**2 * (d[0] * p[1] + d[1] * p[0])]) / c
        return np.stack([c_p * p[0], c_s * p[1]]) - traction

    back = np.stack([imbalance(c_p, -1.0), imbalance(c_s, -1.0)], axis=1)
    own = c_p if wave == "P" else c_s
    amplitudes = np.linalg.solve(np.moveaxis(back, 2, 0), -imbalance(own, 1.0).T[:, :, None])[:, :, 0].T
    flux = sum(np.abs(a) ** 2 * c * np.real(cosine[c]) for a, c in zip(amplitudes, (c_p, c_s), strict=True))
    return np.asarray(flux / (own * np.real(cosine[own])))


def _slab(setup: Setup, angle: float, cells: int) -> mca.Scene:
    """Plane strain, wavelength 1, one cell thick; the side xmax absorbs; long enough for a packet at this angle."""
    h, t = 1.0 / cells, math.tan(math.radians(angle))
    height = 2.0 * REACH + 2.0 * REACH * t + 2.0 * REACH * (1.0 / math.cos(math.radians(angle)) - 1.0)
    divisions = round(DEPTH * cells), round(height * cells), 1
    box = mca.Box(size=(divisions[0] * h, divisions[1] * h, h), divisions=divisions)
    return setup.with_element(
        mca.Scene(
            name="absorbing_slab",
            bodies=(mca.Body(name="slab", geometry=box, material=MATERIAL),),
            fixed=tuple(mca.Fixed(body="slab", nodes=nodes, axes="z") for nodes in ("zmin", "zmax")),
            absorbing=(mca.Absorbing(body="slab", nodes="xmax"),),
            impact=mca.ImpactPhase(duration=1.0, output_interval=1.0),
        )
    )


def _packet(wave: str, angle: float, X: Array, start: Array, t: float) -> tuple[Array, Array, Array, Array]:
    """Displacements, velocities at time t, and of each component sin(angle) / c and energy, of a packet at time 0.

    Each Fourier component k of a Gaussian around `start` runs with c along k: u = k f for P, k x z f for S.
    """
    c = _speed(wave)
    x, y = (np.unique(X[:, k].round(9)) for k in (0, 1))
    k_x = 2.0 * math.pi * np.fft.fftfreq(len(x), x[1] - x[0])
    k_y = 2.0 * math.pi * np.fft.fftfreq(len(y), y[1] - y[0])
    k = np.stack(np.meshgrid(k_x, k_y, indexing="ij"))
    size = np.maximum(np.linalg.norm(k, axis=0), 1e-12)
    direction = np.array([math.cos(angle), math.sin(angle)])
    middle = 2.0 * math.pi * direction
    apart = ((k - middle[:, None, None]) ** 2).sum(axis=0)
    shift = k[0] * (start[0] - x[0]) + k[1] * (start[1] - y[0])
    f = np.exp(-0.5 * WIDTH**2 * apart - 1j * shift) * (k[0] > 0.0)
    polarised = k / size if wave == "P" else np.stack([-k[1], k[0]]) / size
    column, row = np.searchsorted(x, X[:, 0].round(9)), np.searchsorted(y, X[:, 1].round(9))

    def at_nodes(spectrum: Array) -> Array:
        field = np.fft.ifft2(spectrum * polarised, axes=(1, 2)).real
        return np.stack([field[0, column, row], field[1, column, row], np.zeros(len(X))], axis=1)

    u, v = at_nodes(f), at_nodes(-1j * c * size * f * np.exp(-1j * c * size * t))
    scale = 1e-5 / np.abs(u).max()
    energy = np.abs(size * f) ** 2
    real = energy > 1e-12 * energy.max()
    return scale * u, scale * v, (k[1] / size / c)[real], energy[real]


def sent_back(setup: Setup, wave: str, degrees: float, cells: int) -> tuple[float, float]:
    """Share of a packet's energy that is reflected, by theory and measured, for a number of cells per wavelength."""
    angle, theory = math.radians(degrees), math.nan

    def shape(solver: Solver, state: State) -> None:
        nonlocal theory
        start = np.array([DEPTH - REACH, REACH])
        u, v, slowness, energy = _packet(wave, angle, solver.model.X, start, -0.5 * solver.dt)
        share = reflected_share(wave, slowness, MATERIAL.wave_speeds)
        theory = float((share * energy).sum() / energy.sum())
        state.u.assign(u)
        state.v.assign(v)

    span = 2.0 * REACH / math.cos(angle) / _speed(wave)
    kept = _kept(setup, _slab(setup, degrees, cells), span, shape)
    return theory, kept


def _speed(wave: str) -> float:
    return MATERIAL.wave_speeds["dilatational" if wave == "P" else "shear"]


def _kept(setup: Setup, scene: mca.Scene, span: float, shape: Callable[[Solver, State], None]) -> float:
    """Share of the energy that `shape` gives a state that absorbing boundaries leave in it after a time [s]."""
    request = Request(span=span, settings=Settings(setup.device, setup.precision, 1))
    impact = begin([prepare(scene, None, request)], request, shape=shape)
    impact.advance()
    energy = impact.scene_runs[0].ledger.energy()
    return (energy["kinetic"] + energy["elastic"] + energy["hourglass"]) / energy["initial"]


def _column_amplitude(setup: Setup, wave: str, cells: int) -> float:
    """Amplitude sent back of a Gaussian pulse that runs along a column and meets its end at right angles [-]."""
    h, width, length = 1.0 / cells, 1.0 / (2.0 * math.pi), 2.0
    box = mca.Box(size=(length, h, h), divisions=(round(length * cells), 1, 1))
    across = "yz" if wave == "P" else "xz"
    scene = mca.Scene(
        name="absorbing_column",
        bodies=(mca.Body(name="column", geometry=box, material=MATERIAL),),
        fixed=tuple(mca.Fixed(body="column", nodes=nodes, axes=across) for nodes in ("ymin", "ymax")),
        absorbing=(mca.Absorbing(body="column", nodes="xmax"),),
        impact=mca.ImpactPhase(duration=1.0, output_interval=1.0),
    )
    c, axis = _speed(wave), 0 if wave == "P" else 1

    def shape(solver: Solver, state: State) -> None:
        s = (solver.model.X[:, 0] - 0.5 * length) / width
        ahead = s + 0.5 * c * solver.dt / width  # half a step before the start
        u, v = np.zeros_like(solver.model.X), np.zeros_like(solver.model.X)
        u[:, axis] = 1e-5 * width * np.exp(-0.5 * s**2)
        v[:, axis] = 1e-5 * c * ahead * np.exp(-0.5 * ahead**2)  # v = -c du/dx
        state.u.assign(u)
        state.v.assign(v)

    return math.sqrt(max(_kept(setup, setup.with_element(scene), length / c, shape), 0.0))


@case(
    group="waves",
    title="An absorbing end sends back nothing of waves that meet it at right angles",
    reference="Lysmer and Kuhlemeyer, J. Eng. Mech. Div. ASCE 95 (1969) 859; traction rho c v of a plane wave.",
    elements=SHAPES,
)
def absorbing_end(setup: Setup) -> list[Row]:
    """Column between planes of symmetry; Gaussian pulse, k = 1 / width at its strongest: wavelength 1, length 2."""
    counts = setup.choose((25, 50), (25, 50, 100))
    why = f"dispersion of the mesh, with {counts[-1]} cells in the wavelength"
    sizes = tuple(1.0 / count for count in counts)
    tolerance = setup.choose((5e-3,), (2e-3,))[0]
    rows = []
    for wave in "PS":
        found = [_column_amplitude(setup, wave, count) for count in counts]
        what = f"amplitude of {wave} waves that is sent back"
        rows.append(Row(what, 0.0, found, "-", tolerance, why, scale=1.0, sizes=sizes, least_order=1.7))
    return rows


@case(
    group="waves",
    title="An absorbing side sends back of oblique waves what theory says of its dashpots",
    reference="Lysmer and Kuhlemeyer, J. Eng. Mech. Div. ASCE 95 (1969) 859, for the spectrum of each packet.",
    elements=SHAPES,
)
def absorbing_angles(setup: Setup) -> list[Row]:
    """Plane strain, nu = 0.25; packets of P and SV waves, one wavelength the standard deviation of their envelope."""
    angles, counts = setup.choose(((0.0, 45.0), (6, 9)), ((0.0, 30.0, 60.0), (8, 12)))
    why = f"dispersion of the mesh, with {counts[-1]} cells in the wavelength"
    sizes = tuple(1.0 / count for count in counts)
    order = setup.by_element(1.7, tet4=None)  # errors of either sign on coarse tetrahedra
    rows = []
    for wave, angle in ((wave, angle) for angle in angles for wave in "PS"):
        found = [sent_back(setup, wave, angle, count) for count in counts]
        what = f"share of the energy of {wave} waves at {angle:.0f} degrees that is sent back"
        limit = 0.01 if angle < 45.0 else setup.by_element(0.05, tet4=0.08)
        shares = [measured for _, measured in found]
        rows.append(Row(what, found[-1][0], shares, "-", limit, why, scale=1.0, sizes=sizes, least_order=order))
    return rows
