"""Owns the cases of loads: pressure on bars and spheres, forces on beams and bodies, thermal strains, press fits."""

from __future__ import annotations

import math

import numpy as np

import warp_mca as mca
from warp_mca.base.arrays import Array
from warp_mca.verify.case import EPSILON, SHAPES, Row, Setup, case
from warp_mca.verify.round_meshes import hollow_octant, quarter_ring

E, NU, RHO = 200e9, 0.3, 7800.0
STEEL = mca.Elastic(E=E, nu=NU, rho=RHO)
SOLIDS = ("hex8i", "hex8", "tet4", "tet10")


def _planes(body: str, *axes: str) -> tuple[mca.Fixed, ...]:
    """Planes of symmetry of a round body."""
    return tuple(mca.Fixed(body=body, nodes=f"{axis}0", axes=axis) for axis in axes)


def _radius(result: mca.Result, probe: int) -> Array:
    """Distance of a probe from the origin over time [m]."""
    return np.linalg.norm(result.probes[probe].position, axis=1)


def _lame_sphere(a: float, b: float, p: float, r: float) -> float:
    """Displacement at the radius r of a hollow sphere under a pressure within [m]."""
    return p * a**3 / (E * (b**3 - a**3)) * ((1.0 - 2.0 * NU) * r + (1.0 + NU) * b**3 / (2.0 * r * r))


@case(
    group="loads",
    title="A pulse of pressure on the end of a bar runs along it as the stress p, and moves the end by impulse / rho c",
    reference="One-dimensional wave theory: Graff, Wave Motion in Elastic Solids (1975), chapter 2.",
    elements=SHAPES,
)
def pressure_pulse(setup: Setup) -> list[Row]:
    """Square bar, 2 mm wide, without Poisson effect; half a sine of 20 us, 10 MPa."""
    length, p, pulse, c = 0.25, 10e6, 20e-6, math.sqrt(E / RHO)
    counts = setup.choose((125, 250), (125, 250, 500))
    peak, way = [], []
    for count in counts:
        bar = mca.Box(size=(length, 0.002, 0.002), divisions=(count, 1, 1))
        material = mca.Elastic(E=E, nu=0.0, rho=RHO)
        line = mca.Line(body="bar", start=(0.0, 0.001, 0.001), end=(length, 0.001, 0.001))
        scene = mca.Scene(
            name="pressure_pulse",
            bodies=(mca.Body(name="bar", geometry=bar, material=material),),
            loads=(mca.Pressure(body="bar", nodes="xmin", pressure=p, amplitude=mca.Amplitude.half_sine(pulse)),),
            paths=(mca.Path(name="axis", lines=(line,), spacing=length / 10.0),),
            probes=(mca.Probe(name="end", body="bar", nodes="xmin"),),
            impact=mca.ImpactPhase(duration=40e-6, output_interval=2e-7),
        )
        result = setup.run(scene)
        stress = -result.paths[0].stress[:, 5, 0].astype(float)
        top = int(np.argmax(stress))
        near = np.arange(-5, 6)
        a, b, d = np.polyfit(near, stress[top + near], 2)
        peak.append(float(d - 0.25 * b * b / a))
        way.append(float(np.diff(result.probes[0].position[[0, -1], 0])[0]))
    sizes = tuple(1.0 / count for count in counts)
    travelled = p * 2.0 * pulse / math.pi / (RHO * c)
    why = "dispersion of the mesh with 50 cells in the pulse or more; the pulse is of 100 straight pieces"
    return [
        Row("greatest stress p at 0.125 m", p, peak, "Pa", 5e-3, why, sizes=sizes),
        Row("way of the end, impulse / (rho c)", travelled, way, "m", 2e-3, why, sizes=sizes),
    ]


@case(
    group="loads",
    title="A hollow sphere under slowly rising inner pressure expands as Lame has it",
    reference="Timoshenko and Goodier, Theory of Elasticity (1970), section 136.",
    elements=SOLIDS,
)
def pressed_sphere(setup: Setup) -> list[Row]:
    """An eighth, radii 20 and 40 mm; 100 MPa within 100 us, five times the period of breathing."""
    a, b, p = 0.02, 0.04, 100e6
    counts = setup.choose((4, 8), (4, 8, 16))
    inner, outer = [], []
    for count in counts:
        scene = mca.Scene(
            name="pressed_sphere",
            bodies=(mca.Body(name="ball", geometry=hollow_octant(a, b, count, count), material=STEEL),),
            fixed=_planes("ball", "x", "y", "z"),
            loads=(mca.Pressure(body="ball", nodes="inner", pressure=p, amplitude=mca.Amplitude.smooth_step(100e-6)),),
            probes=tuple(mca.Probe(name=f"{x}", body="ball", at=(x, 0.0, 0.0)) for x in (a, b)),
            impact=mca.ImpactPhase(duration=140e-6, output_interval=1e-6),
        )
        result = setup.run(scene)
        late = result.time > 100e-6
        inner.append(float(_radius(result, 0)[late].mean() - a))
        outer.append(float(_radius(result, 1)[late].mean() - b))
    exact = [_lame_sphere(a, b, p, r) for r in (a, b)]
    why = "the mesh; what vibrates after the rise averages out; displacements of 1e-3 of the radius, whose area grows"
    sizes = tuple(1.0 / count for count in counts)
    tolerance = setup.by_element(0.01, tet4=0.03)
    return [
        Row("displacement at the inner radius", exact[0], inner, "m", tolerance, why, sizes=sizes),
        Row("displacement at the outer radius", exact[1], outer, "m", tolerance, why, sizes=sizes),
    ]


@case(
    group="loads",
    title="A thin shell breathes about its static radius under a pressure that acts at once",
    reference="omega^2 = 2 E / ((1 - nu) rho R^2): Lamb, Proc. London Math. Soc. 14 (1882) 50.",
    elements=("hex8i",),
)
def breathing_shell(setup: Setup) -> list[Row]:
    """An eighth, radius 50 mm, wall of 1 mm in one layer; 1 MPa."""
    R, h, p = 0.05, 0.001, 1e6
    omega = math.sqrt(2.0 * E / ((1.0 - NU) * RHO)) / R
    a, period = R - 0.5 * h, 2.0 * math.pi / omega
    counts = setup.choose((6, 12), (6, 12, 24))
    mean, time = [], []
    for count in counts:
        scene = mca.Scene(
            name="breathing_shell",
            bodies=(mca.Body(name="shell", geometry=hollow_octant(a, R + 0.5 * h, 1, count), material=STEEL),),
            fixed=_planes("shell", "x", "y", "z"),
            loads=(mca.Pressure(body="shell", nodes="inner", pressure=p),),
            probes=(mca.Probe(name="all", body="shell", at=(a, 0.0, 0.0)),),
            impact=mca.ImpactPhase(duration=3.0 * period, output_interval=period / 100.0),
        )
        result = setup.run(scene)
        energy = result["E_kinetic"]  # of all of the shell: zero twice a period
        slow = np.fft.rfft(energy[:-1] - energy[:-1].mean(), 2**16)
        frequency = np.fft.rfftfreq(2**16, period / 100.0)[int(np.abs(slow).argmax())]
        time.append(float(2.0 / frequency))
        mean.append(float(_radius(result, 0)[:-1].mean() - a))
    static = _lame_sphere(a, a + h, p, a)
    sizes = tuple(1.0 / count for count in counts)
    why = "h / R = 0.02 of a wall that is thin but no surface, and the mesh"
    return [
        Row("mean displacement", static, mean, "m", 0.005, why, sizes=sizes),
        Row("period of breathing", period, time, "s", 0.01, why, sizes=sizes),
    ]


@case(
    group="loads",
    title="A cantilever under a tip force that rises slowly bends as Timoshenko has it",
    reference="Timoshenko, Phil. Mag. 41 (1921) 744; shear coefficient 5/6.",
    elements=("hex8i", "tet10"),
)
def tip_force(setup: Setup) -> list[Row]:
    """100 x 5 x 10 mm, clamped but for Poisson's effect; 100 N over the end face within 3 ms, 2.4 periods."""
    L, W, H, F, rise = 0.1, 0.005, 0.01, 100.0, 3e-3
    counts = setup.choose((20, 40), (20, 40, 80))
    found = []
    for count in counts:
        bar = mca.Box(size=(L, W, H), divisions=(count, 1, 2))
        load = {"force": (0.0, 0.0, -F), "spread": "area", "amplitude": mca.Amplitude.smooth_step(rise)}
        scene = mca.Scene(
            name="tip_force",
            bodies=(mca.Body(name="bar", geometry=bar, material=STEEL),),
            fixed=(mca.Fixed(body="bar", nodes="xmin"),),
            loads=(mca.Force(body="bar", nodes="xmax", **load),),
            probes=(mca.Probe(name="tip", body="bar", nodes="xmax"),),
            impact=mca.ImpactPhase(duration=rise + 1.24e-3, output_interval=4e-5),
        )
        result = setup.run(scene)
        z = result.probes[0].position[:, 2]
        found.append(float(z[0] - z[result.time > rise].mean()))
    area, inertia, G = W * H, W * H**3 / 12.0, E / (2.0 * (1.0 + NU))
    exact = F * L**3 / (3.0 * E * inertia) + F * L / (5.0 / 6.0 * G * area)
    why = "the mesh, the clamp that keeps the section as it is, and what vibrates after the rise"
    return [Row("deflection of the tip", exact, found, "m", 0.01, why, sizes=tuple(1.0 / count for count in counts))]


@case(
    group="loads",
    title="A free body gains the impulse of what acts on it, to rounding",
    reference="Newton's second law.",
    elements=SHAPES,
)
def impulse_of_a_table(setup: Setup) -> list[Row]:
    """Times between steps; the force on one face, the field on all of the body, for 30 us."""
    size, m = 0.01, RHO * 1e-6
    table = mca.Amplitude(times=(1.3e-6, 7.9e-6, 8.1e-6, 29e-6), values=(0.0, 1.0, -0.3, 0.0))
    impulse = 1e4 * float(np.trapezoid(table.values, table.times))
    mesh = mca.Box(size=(size, size, size), divisions=(2, 2, 2)).build()
    mesh.node_sets["all"] = np.arange(len(mesh.points), dtype=np.int32)
    found = []
    for load in (
        mca.Force(body="cube", nodes="xmin", force=(1e4, 0.0, 0.0), amplitude=table),
        mca.BodyForce(body="cube", acceleration=(1e4 / m, 0.0, 0.0), amplitude=table),
    ):
        scene = mca.Scene(
            name="impulse_of_a_table",
            bodies=(mca.Body(name="cube", geometry=mesh, material=STEEL),),
            loads=(load,),
            probes=(mca.Probe(name="centre", body="cube", nodes="all"),),
            impact=mca.ImpactPhase(duration=32e-6, output_interval=1e-6),
        )
        found.append(m * float(setup.run(scene).probes[0].velocity[-1, 0]))
    why = "rounding; elements give no impulse"
    tolerance = 2e4 * EPSILON["float64"] if setup.precision == "float64" else 1e-6
    return [
        Row("impulse of a force", impulse, found[:1], "N s", tolerance, why),
        Row("impulse of a body force", impulse, found[1:], "N s", tolerance, why),
    ]


@case(
    group="loads",
    title="A clamped bar that is cooled has the stress E alpha dT, a free one none",
    reference="Timoshenko and Goodier, Theory of Elasticity (1970), section 150.",
    elements=SOLIDS,
)
def cooled_bar(setup: Setup) -> list[Row]:
    """20 x 10 x 10 mm, 100 K within 40 us, 12e-6 / K; means from then on to 80 us."""
    strain, stress, ends = 12e-6 * 100.0, [], []
    line = mca.Line(body="bar", start=(0.0, 0.005, 0.005), end=(0.02, 0.005, 0.005))
    for fixed in (("xmin", "xmax"), ()):
        bar = mca.Box(size=(0.02, 0.01, 0.01), divisions=(4, 2, 2))
        cold = mca.ThermalStrain(
            body="bar", expansion=12e-6, temperature=-100.0, amplitude=mca.Amplitude.smooth_step(40e-6)
        )
        scene = mca.Scene(
            name="cooled_bar",
            bodies=(mca.Body(name="bar", geometry=bar, material=STEEL),),
            fixed=tuple(mca.Fixed(body="bar", nodes=name, axes="x") for name in fixed),
            loads=(cold,),
            paths=(mca.Path(name="axis", lines=(line,), spacing=0.01),),
            probes=tuple(mca.Probe(name=name, body="bar", nodes=name) for name in ("xmin", "xmax")),
            impact=mca.ImpactPhase(duration=80e-6, output_interval=1e-6),
        )
        result = setup.run(scene)
        late = result.time > 40e-6
        stress.append(float(result.paths[0].stress[late, 1, 0].mean()))
        length = result.probes[1].position[:, 0] - result.probes[0].position[:, 0]
        ends.append(float(length[late].mean() - length[0]))
    why = "what vibrates after the cooling averages out"
    exact = E * strain
    return [
        Row("stress of the clamped bar", exact, stress[:1], "Pa", 2e-3, why),
        Row("stress of the free bar, over E alpha dT", 0.0, stress[1:], "Pa", 2e-3, why, scale=exact),
        Row("shortening of the free bar", 0.02 * strain, [-ends[1]], "m", 1e-3, why),
    ]


@case(
    group="loads",
    title="A ring that is shrunk onto another presses on it as Lame has it",
    reference="Timoshenko and Goodier, Theory of Elasticity (1970), section 28; plane strain.",
    elements=("hex8i", "hex8"),
)
def press_fit(setup: Setup) -> list[Row]:
    """A quarter of both, radii 20, 30 and 40 mm; the outer one shrinks by 1e-3 within 200 us, five periods."""
    a, b, c, strain, height, rise = 0.02, 0.03, 0.04, 1e-3, 0.002, 200e-6
    counts = setup.choose((4, 8), (4, 8, 16))
    pressure, hoop, slope = [], [], np.full(2, math.sqrt(0.5))
    for count in counts:
        rings = {"hub": (a, b), "ring": (b, c)}
        bodies = tuple(
            mca.Body(name=name, geometry=quarter_ring(*radii, count, 3 * count, height), material=STEEL)
            for name, radii in rings.items()
        )
        fixed = tuple(item for name in rings for item in _planes(name, "x", "y", "z"))
        fixed += tuple(mca.Fixed(body=name, nodes="z1", axes="z") for name in rings)
        start, end = (tuple((r * slope).tolist()) for r in (a, b))
        line = mca.Line(body="hub", start=(*start, 0.001), end=(*end, 0.001))
        slowly = mca.Amplitude.smooth_step(rise)
        cold = mca.ThermalStrain(body="ring", expansion=1e-5, temperature=-strain / 1e-5, amplitude=slowly)
        contact = mca.Contact(
            slave=mca.Surface(body="ring", nodes="inner"), master=mca.Surface(body="hub", nodes="outer")
        )
        scene = mca.Scene(
            name="press_fit",
            bodies=bodies,
            fixed=fixed,
            loads=(cold,),
            contacts=(contact,),
            paths=(mca.Path(name="hub", lines=(line,), spacing=0.25 * (b - a)),),
            impact=mca.ImpactPhase(duration=1.5 * rise, output_interval=1e-6),
        )
        result = setup.run(scene)
        stress = result.paths[0].stress[result.time > rise, 2].mean(axis=0)
        hoop.append(float(0.5 * (stress[0] + stress[1]) - stress[3]))  # along 45 degrees
        pressure.append(float(-0.5 * (stress[0] + stress[1]) - stress[3]))
    plane, nu = E / (1.0 - NU**2), NU / (1.0 - NU)
    gap = (1.0 + NU) * strain * b
    compliance = ((c * c + b * b) / (c * c - b * b) + nu + (b * b + a * a) / (b * b - a * a) - nu) * b / plane
    p, r = gap / compliance, 0.5 * (a + b)
    factor = p * b * b / (b * b - a * a)
    why = "the mesh, and the depth of contact springs"
    sizes = tuple(1.0 / count for count in counts)
    return [
        Row("radial stress in the middle of the hub", factor * (1.0 - (a / r) ** 2), pressure, "Pa", 0.01, why, sizes),
        Row("hoop stress there", -factor * (1.0 + (a / r) ** 2), hoop, "Pa", 0.01, why, sizes),
    ]
