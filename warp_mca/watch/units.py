"""Owns the rows about values that say that another unit was meant: stiffness, density, sizes, angles, speeds.

Bodies with E = rho = 1 are of a scene without units, and may have any size.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry import Cad, Mesh, MeshFile
from warp_mca.watch.row import Context, Kind, Values, When, row, sides_of

if TYPE_CHECKING:
    from warp_mca.scene import Body
    from warp_mca.scene.materials import Material

SLOWEST, FASTEST = 20.0, 3e4  # bar wave speed sqrt(E/rho) [m/s]; diamond has 18,000
SOFT, SLOWEST_SOFT = (800.0, 1400.0), 3.0  # kg/m^3, m/s; rubbers and gels have 10 kPa and more. Wood in MPa is lighter
LIGHTEST, DENSEST = 0.1, 3e4  # kg/m^3; aerogel has 1, osmium 22,600
LONGEST = 10.0  # of parts from files [m], which name no unit
HEAVIEST = 1e5  # of these [kg]
LONGEST_STEP = 1e-4  # s; sound crosses half a metre of steel meanwhile
MOST_MASS = 1e6  # of other bodies [kg]; a cube of steel of 5 m
NEVER = 1e6  # yield stress over E from which on it is meant never to yield
MILLI_GRAVITY = 9.75e3, 9.85e3  # 1 g in mm/s^2
MODULI = {"GPa": 1e9, "MPa": 1e6}  # units in which E and rho are often given
DENSITIES = {"g/cm^3": 1e3, "tonne/mm^3": 1e12, "kg/mm^3": 1e9, "lb/in^3": 27_680.0, "g/m^3": 1e-3}
SOLID, SOUND = (10.0, 2.5e4), (SLOWEST, 2e4)  # density [kg/m^3] and bar wave speed [m/s] that a guess must give
USUAL = 3000.0  # bar wave speed [m/s] near which most solids lie
_BODY = "body {body} is {size:.3g} m long and weighs {mass:.3g} kg"

advice = partial(row, kind=Kind.ADVICE, when=When.BEFORE)


@advice(
    "{who}: E = {E:.4g} Pa and rho = {rho:.4g} kg/m^3 give a bar wave speed of {speed:.3g} m/s; solids have "
    f"{SLOWEST:g} to {FASTEST:,.0f} m/s and {LIGHTEST:g} to {DENSEST:,.0f} kg/m^3:",
    "{likely}",
    SLOWEST,
    f"m/s at least ({SLOWEST_SOFT:g} m/s where rho is {SOFT[0]:g} to {SOFT[1]:,.0f} kg/m^3) and {FASTEST:,.0f} m/s at "
    f"most; {LIGHTEST:g} to {DENSEST:,.0f} kg/m^3",
)
def strange_material(c: Context, slowest: float) -> Iterator[Values]:
    """Bar wave speed sqrt(E / rho) and density of each material."""
    for material, rigid, who in _materials(c):
        if _strange(material, rigid, slowest):
            E, rho, speed = material.E, material.rho, material.wave_speeds["bar"]
            yield dict(who=who, E=E, rho=rho, speed=speed, likely=_likely(E, rho))


@advice(
    "{who}: sigma_y = {sigma_y:.4g} Pa is {share:.2g} of E:", "if it is in MPa, give it in Pa", 1e-7, "of E at least"
)
def low_yield_stress(c: Context, least: float) -> Iterator[Values]:
    """Yield stress of each material; a pure single crystal has 4e-6 of E."""
    return (values for share, values in _yield_stresses(c) if share < least)


@advice(
    "{who}: sigma_y = {sigma_y:.4g} Pa is {share:.3g} times E, so that it never yields:",
    "give sigma_y and E in Pa, or take an Elastic material",
    1.0,
    f"times E at most; from {NEVER:g} times E on it is meant never to yield",
)
def high_yield_stress(c: Context, most: float) -> Iterator[Values]:
    """Yield stress of each material."""
    return (values for share, values in _yield_stresses(c) if most < share < NEVER)


@advice(
    f"{_BODY}, and the stable step is {{step:.2g}} s:",
    "if its file counts in millimetres, give scale=1e-3, in inches scale=0.0254",
    LONGEST,
    f"m at most; {HEAVIEST:g} kg; a stable step of {LONGEST_STEP:g} s if it is longer than 1 m",
)
def large_part(c: Context, longest: float) -> Iterator[Values]:
    """Size, mass and stable step of parts from files, which name no unit."""
    for body, what in _sizes(c, from_file=True):
        explained = any(_strange(material, body.rigid) for material in _materials_of(body))
        slow = what["step"] > LONGEST_STEP and what["size"] > 1.0
        if what["size"] > longest or (not explained and (what["mass"] > HEAVIEST or slow)):
            yield dict(body=body.name, **what)


@advice(f"{_BODY}:", "its scale makes it smaller than a tenth of a millimetre; check it", 1e-4, "m at least")
def small_part(c: Context, shortest: float) -> Iterator[Values]:
    """Size of parts from files."""
    return (dict(body=body.name, **what) for body, what in _sizes(c, from_file=True) if what["size"] < shortest)


@advice(f"{_BODY}:", "if its sizes are in millimetres, give metres", 1e3, f"m at most; {MOST_MASS:g} kg")
def large_body(c: Context, largest: float) -> Iterator[Values]:
    """Size and mass of other bodies; those with absorbing boundaries stand for something larger."""
    absorbing = {item.body for item in c.scene.absorbing}
    for body, what in _sizes(c, from_file=False):
        if what["size"] > largest or (what["mass"] > MOST_MASS and body.name not in absorbing):
            yield dict(body=body.name, **what)


@advice(f"{_BODY}, smaller than a tenth of a micrometre:", "give sizes in metres", 1e-7, "m at least")
def small_body(c: Context, smallest: float) -> Iterator[Values]:
    """Size of other bodies."""
    return (dict(body=body.name, **what) for body, what in _sizes(c, from_file=False) if what["size"] < smallest)


@advice(
    "{name} = {angles} rad is more than a full turn:",
    "if it is in degrees, give {radians}",
    2.0 * math.pi,
    "rad at most",
)
def large_angle(c: Context, turn: float) -> Iterator[Values]:
    """Rotations of bodies and angles of links."""
    given: list[tuple[str, float, Sequence[float]]] = [
        (f"Body {b.name}.rotation", math.hypot(*b.rotation), b.rotation) for b in c.scene.bodies
    ]
    if c.scene.rigid:
        given.append(("RigidPhase.theta", max(map(abs, c.scene.rigid.theta)), c.scene.rigid.theta))
    for name, greatest, angles in given:
        if greatest > turn * (1.0 + 1e-9):
            yield dict(name=name, angles=_listed(angles), radians=_listed([math.radians(angle) for angle in angles]))


@advice(
    "Scene.gravity = {gravity} m/s^2 is 1000 g:",
    "if it is in mm/s^2, give 9.81 m/s^2",
    1.0,
    f"m at most, and no rigid phase, where gravity is {MILLI_GRAVITY[0]:,.0f} to {MILLI_GRAVITY[1]:,.0f} m/s^2",
)
def gravity_in_millimetres(c: Context, longest: float) -> Iterator[Values]:
    """Size of bodies under 1000 g, which only small ones may feel, in a shock."""
    g = math.hypot(*c.scene.gravity)
    if MILLI_GRAVITY[0] < g < MILLI_GRAVITY[1] and (c.scene.rigid or max(map(_extent, c.meshes.values())) > longest):
        yield dict(gravity=_listed(c.scene.gravity))


@advice(
    "the contact of {who} has penalty = {penalty:.3g}: it is a factor of the stiffness that the meshes give, not N/m;",
    "0.01 to 10 are usual, and None or auto choose it",
    1e6,
    "[-], less than that",
)
def penalty_in_newtons_per_metre(c: Context, most: float) -> Iterator[Values]:
    """Penalty of each contact."""
    for contact in c.scene.contacts:
        if not isinstance(contact.penalty, str | None) and contact.penalty >= most:
            yield dict(who=" and ".join(sides_of(contact)) or "all bodies", penalty=contact.penalty)


@advice(
    "{who} meet at {approach:.4g} m/s, faster than the {waves:.4g} m/s of bar waves in them, which crushes them "
    "whatever they are made of:",
    "give velocities in m/s, moduli in Pa and densities in kg/m^3",
    1.0,
    "times the sum of the bar wave speeds at most",
)
def supersonic_approach(c: Context, most: float) -> Iterator[Values]:
    """Speed at which the bodies of a contact approach each other."""
    for contact, (normal, _) in zip(c.scene.contacts, c.model.contact_axes, strict=True):
        if not (sides := sides_of(contact)):
            continue
        bodies = [c.scene.body(name) for name in sides]
        waves = sum(max(m.wave_speeds["bar"] for m in _materials_of(body)) for body in bodies if not body.rigid)
        velocity = [np.asarray(c.model.V[c.nodes(name)].mean(axis=0)) for name in sides]
        approach = float((velocity[1] - velocity[0] if len(sides) > 1 else -velocity[0]) @ normal)
        if approach > most * waves > 0.0:
            yield dict(who=" and ".join(sides), approach=approach, waves=waves)


def _yield_stresses(c: Context) -> Iterator[tuple[float, Values]]:
    """Share of yield stresses in E [-] where stiffness and density are those of a solid, and what to tell of them."""
    for material, rigid, who in _materials(c):
        if not rigid and not _unitless(material) and not _strange(material, rigid):
            share = material.yield_stress / material.E
            yield share, dict(who=who, sigma_y=material.yield_stress, share=share)


def _materials(c: Context) -> Iterator[tuple[Material, bool, str]]:
    """Each material, whether its bodies are rigid, and these."""
    owners: dict[tuple[Material, bool], list[str]] = {}
    for body in c.scene.bodies:
        for material in dict.fromkeys(_materials_of(body)):
            owners.setdefault((material, body.rigid), []).append(body.name)
    for (material, rigid), names in owners.items():
        yield material, rigid, f"{'body' if len(names) == 1 else 'bodies'} {', '.join(names)}"


def _strange(material: Material, rigid: bool, slowest: float = SLOWEST) -> bool:
    """Whether stiffness or density is beyond what solids have; a rigid body may be light for its stiffness."""
    if _unitless(material):
        return False
    fastest = math.inf if rigid else FASTEST
    slowest = min(slowest, SLOWEST_SOFT) if SOFT[0] < material.rho < SOFT[1] else slowest
    return not (slowest <= material.wave_speeds["bar"] <= fastest and LIGHTEST <= material.rho <= DENSEST)


def _likely(E: float, rho: float) -> str:
    """The units in which values of a solid give these numbers, and the remedy."""
    moduli, densities = {"": 1.0, **MODULI}, {"": 1.0, **DENSITIES}
    fits: list[tuple[int, float, str, str]] = []
    for (modulus, a), (density, b) in product(moduli.items(), densities.items()):
        speed = math.sqrt(a * E / (b * rho))
        if SOLID[0] <= b * rho <= SOLID[1] and SOUND[0] <= speed <= SOUND[1]:
            fits.append((bool(modulus) + bool(density), abs(math.log(speed / USUAL)), modulus, density))
    if not fits:
        return "check E [Pa] and rho [kg/m^3]"
    _, _, modulus, density = min(fits)
    if not density:
        others = [fit[2] for fit in sorted(fits) if fit[0] == 1 and not fit[3]]
        return f"if E is in {' or '.join(others)}, give it in Pa"
    if not modulus:
        return f"if rho is in {density}, give it in kg/m^3"
    return f"if E is in {modulus} and rho in {density}, give them in Pa and kg/m^3, and lengths in m"


def _sizes(c: Context, from_file: bool) -> Iterator[tuple[Body, dict[str, float]]]:
    """Bodies with units, from files or not, with their size [m], mass [kg] and the stable step [s]."""
    for body in c.scene.bodies:
        if isinstance(body.geometry, Cad | MeshFile) == from_file and not any(map(_unitless, _materials_of(body))):
            yield body, dict(size=_extent(c.meshes[body.name]), mass=_mass(c, body.name), step=c.model.stable.dt)


def _materials_of(body: Body) -> list[Material]:
    return list(body.material.values()) if isinstance(body.material, Mapping) else [body.material]


def _unitless(material: Material) -> bool:
    """Whether it is of a scene without units."""
    return material.E == material.rho == 1.0


def _extent(mesh: Mesh) -> float:
    """Greatest extent along an axis [m]."""
    return float(np.ptp(mesh.points, axis=0).max())


def _mass(c: Context, body: str) -> float:
    """Mass of a body without what mass scaling added [kg]; slaves of ties have none."""
    nodes, scaling = c.nodes(body), c.model.scaling
    return float(c.model.mass[nodes].sum() - (scaling.added[nodes].sum() if scaling else 0.0))


def _listed(values: Sequence[float] | NDArray[np.float64]) -> str:
    return f"({', '.join(f'{value:.4g}' for value in values)})"
