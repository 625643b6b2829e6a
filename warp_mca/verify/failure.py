"""Owns the cases of failure: energy to failure of a bar, damage beside its integral, a cracked plate on two meshes."""

from __future__ import annotations

import math

import numpy as np

import warp_mca as mca
from warp_mca.base.arrays import Array
from warp_mca.verify.case import Row, Setup, case
from warp_mca.verify.metals import STEEL, static_stress

LENGTH, WIDTH = 8e-3, 2e-3  # of the bar [m]
JC = mca.JohnsonCookFailure(D1=0.02, D2=0.1, D3=-2.12, D4=0.05, D5=0.61)
CRACKED = (40e-3, 10e-3, 4e-3)  # length and width of the plate, length of the crack [m]


def pulled(material: mca.Elastic, speed: float, duration: float, cells: tuple[int, int, int] = (8, 2, 2)) -> mca.Scene:
    """A bar that is pulled at both ends with this speed [m/s] and free to narrow, so slowly that strain is uniform."""
    bar = mca.Box(size=(LENGTH, WIDTH, WIDTH), divisions=cells)
    times, rise = (0.0, 0.05 * duration), (0.0, 0.5 * speed)
    ends = zip(("xmin", "xmax"), (-1.0, 1.0), strict=True)
    return mca.Scene(
        name="pulled",
        bodies=(mca.Body(name="bar", geometry=bar, material=material, kinematics="finite"),),
        prescribed=tuple(
            mca.Prescribed(body="bar", nodes=end, axis="x", times=times, velocities=tuple(sign * v for v in rise))
            for end, sign in ends
        ),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 200.0),
    )


@case(
    group="material",
    title="A uniform bar takes the energy to failure of its material, and breaks",
    reference="The area under the uniaxial curve of stress over strain up to the plastic strain or stress at failure.",
    elements=("hex8i", "hex8r", "tet10"),
)
def broken_bar(setup: Setup) -> list[Row]:
    """External work over the volume, of a ductile and of a brittle bar."""
    strain, stress, E = 0.05, 1e9, STEEL["E"]
    ductile = mca.J2Bilinear(**STEEL, sigma_y=400e6, E_t=1e9, beta=1.0, failure=mca.PlasticStrainFailure(strain=strain))
    brittle = mca.Elastic(**STEEL, failure=mca.PrincipalStressFailure(stress=stress))
    top = ductile.sigma_y + ductile.hardening_modulus * strain
    exact = {"ductile": 0.5 * (ductile.sigma_y + top) * strain + 0.5 * top**2 / E, "brittle": 0.5 * stress**2 / E}
    rows = []
    for name, material, speed in (("ductile", ductile, 2.0), ("brittle", brittle, 0.4)):
        end = 1.3 * (math.expm1(strain + top / E) if name == "ductile" else stress / E) * LENGTH / speed
        result = setup.run(pulled(material, speed, end))
        work = result.summary["energy"]["external_work"] / (LENGTH * WIDTH**2)
        why = "the ends narrow less, and set off waves"
        rows.append(Row(f"energy to failure, {name}", exact[name], [work], "J/m^3", 0.01, why))
        rows.append(
            Row(f"energy error, {name}", 0.0, [result.summary["energy_error"]], "-", 2e-3, "of the work", scale=1.0)
        )
    return rows


def damage_time(metal: mca.JohnsonCook, failure: mca.JohnsonCookFailure, strain: Array, time: Array) -> float:
    """When Johnson and Cook's damage reaches 1 in uniaxial stress [s]: rates of p, work and damage, integrated.

    Args:
        metal, failure: the laws.
        strain: axial logarithmic strain, shape (row_count,), rising.
        time: of the rows [s].
    """
    from scipy.integrate import solve_ivp
    from scipy.interpolate import CubicSpline

    along = CubicSpline(time, strain)

    def rates(t: float, state: Array) -> list[float]:
        """Of p, plastic work over 1 GJ/m^3, and damage."""
        p, work, _ = state
        q, rest = metal.E * (float(along(t)) - p), static_stress(metal, p, 1e9 * work)[0]
        rate = metal.rate_0 * math.exp(min((q / rest - 1.0) / metal.C, 50.0)) if q > rest else 0.0
        T = metal.beta * 1e9 * work / (metal.rho * metal.c_p * (metal.T_melt - metal.T_room))
        limit = failure.D1 + failure.D2 * math.exp(failure.D3 / 3.0)
        limit *= 1.0 + failure.D4 * math.log(max(rate / failure.rate_0, 1.0))
        return [rate, rate * q / 1e9, rate / (limit * (1.0 + failure.D5 * T))]

    found = solve_ivp(rates, (0.0, time[-1]), np.zeros(3), t_eval=time, method="LSODA", rtol=1e-6, atol=1e-9)
    return float(np.interp(1.0, found.y[2], found.t))


@case(
    group="material",
    title="Johnson and Cook's damage with rate and heat reaches 1 when its integral does",
    reference="Rates of plastic strain, heat and damage in uniaxial stress, integrated by SciPy.",
    elements=("hex8i", "hex8r", "tet10"),
)
def johnson_cook_damage(setup: Setup) -> list[Row]:
    """Time of failure of a bar whose strain is uniform."""
    metal = mca.JohnsonCook(**STEEL, A=792e6, B=510e6, n=0.26, C=0.014, m=1.03, T_melt=1793.0, c_p=477.0, failure=JC)
    speed, duration = 2.0, 5.6e-4  # before the bar necks
    result = setup.run(pulled(metal, speed, duration, (2, 1, 1)))
    time, rise = np.linspace(0.0, duration, 4001), 0.05 * duration
    way = speed * np.where(time < rise, 0.5 * time**2 / rise, time - 0.5 * rise)
    exact = damage_time(metal, JC, np.log1p(way / LENGTH), time)
    found = result.summary["failure"]["bar"]["time"]
    return [Row("time of failure", exact, [math.nan if found is None else found], "s", 1e-3, "waves, and the step")]


def cracked_plate(h: float, failure: mca.Elastic, end: float) -> mca.Scene:
    """A plate in plane strain with a crack from one edge, of one layer of cubes of edge h [m], pulled at both ends."""
    length, width, crack = CRACKED
    cells = (round(length / h), round(width / h), 1)
    mesh = mca.Box(size=(length, width, h), divisions=cells, origin=(-0.5 * length, 0.0, 0.0)).build()
    x, conn = mesh.points, mesh.hexahedra.copy()
    cut = np.flatnonzero((np.abs(x[:, 0]) < 1e-9) & (x[:, 1] < crack - 1e-9))
    twin = np.arange(len(x), dtype=np.int32)
    twin[cut] = len(x) + np.arange(len(cut))
    left = x[conn].mean(axis=1)[:, 0] < 0.0
    conn[left] = twin[conn[left]]
    points = np.concatenate([x, x[cut]])
    sets = {"all": np.arange(len(points), dtype=np.int32)}
    sets |= {
        name: np.flatnonzero(sign * points[:, 0] > 0.5 * length - 1e-9).astype(np.int32)
        for name, sign in (("left", -1.0), ("right", 1.0))
    }
    return mca.Scene(
        name="cracked_plate",
        bodies=(mca.Body(name="plate", geometry=mca.Mesh(points, conn, sets), material=failure),),
        fixed=(mca.Fixed(body="plate", nodes="all", axes="z"),),
        prescribed=tuple(
            mca.Prescribed(body="plate", nodes=name, axis="x", times=(0.0, 1e-5), velocities=(0.0, sign * 6.0))
            for name, sign in (("left", -1.0), ("right", 1.0))
        ),
        impact=mca.ImpactPhase(duration=end, output_interval=1e-6),
    )


@case(
    group="material",
    title="A cracked plate takes as much force and work to pull apart on a mesh half as wide",
    reference="The same plate on the coarser mesh, with the strain at failure scaled by the length of cells.",
    elements=("hex8i", "hex8"),
)
def torn_plate(setup: Setup) -> list[Row]:
    """Greatest force and work for each metre of thickness."""
    failure = mca.PlasticStrainFailure(strain=0.05, reference_length=1e-3)
    metal = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=200e6, E_t=200e6, beta=1.0, failure=failure)
    sizes = setup.choose((1e-3, 0.5e-3), (0.5e-3, 0.25e-3))
    force, work = [], []
    for h in sizes:
        result = setup.run(cracked_plate(h, metal, 1.2e-4))
        way = 12.0 * np.maximum(result.time - 0.5e-5, 0.0)
        spent = result["E_kinetic"] + result["E_internal"] + result["E_failure"] - result["E_total_error"]
        late = slice(20, None)  # after the waves of the start
        force.append(float(np.convolve(np.gradient(spent[late], way[late]), np.ones(21) / 21.0, "valid").max()) / h)
        work.append(float(result.summary["energy"]["external_work"]) / h)
    why = "strain ahead of the crack spreads with the mesh"
    return [
        Row("greatest force over the thickness", force[0], force[1:], "N/m", 0.1, why),
        Row("work over the thickness", work[0], work[1:], "J/m", 0.1, why),
    ]
