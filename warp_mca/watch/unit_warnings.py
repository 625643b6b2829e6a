"""Owns the warnings about values that say that another unit was meant: stiffness, density, sizes, angles, speeds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry import Cad, Mesh, MeshFile
from warp_mca.scene import RigidPlane

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.scene import Body, Scene
    from warp_mca.scene.materials import Material

SLOWEST, FASTEST = 20.0, 3e4  # bar wave speed sqrt(E/rho) [m/s]; soft rubber has 30, diamond 18,000
LIGHTEST, DENSEST = 0.1, 3e4  # kg/m^3; aerogel has 1, osmium 22,600
LONGEST, SHORTEST = 10.0, 1e-4  # of parts from files [m], which name no unit
HEAVIEST = 1e5  # of these [kg]
LONGEST_STEP = 1e-4  # s; sound crosses half a metre of steel meanwhile
LARGEST, SMALLEST, MOST_MASS = 1e3, 1e-7, 1e6  # of other bodies [m], [m], [kg]; the mass is a cube of steel of 5 m
PENALTY = 1e6  # factor of the contact stiffness [-] that only a stiffness in N/m reaches
YIELDING = 1e-7  # yield stress over E; a pure single crystal has 4e-6
MILLI_GRAVITY = 9.75e3, 9.85e3  # 1 g in mm/s^2
MODULI = {"GPa": 1e9, "MPa": 1e6}  # units in which E and rho are often given
DENSITIES = {"g/cm^3": 1e3, "tonne/mm^3": 1e12, "kg/mm^3": 1e9, "lb/in^3": 27_680.0, "g/m^3": 1e-3}
SOLID, SOUND = (10.0, 2.5e4), (SLOWEST, 2e4)  # density [kg/m^3] and bar wave speed [m/s] that a guess must give
FULL_TURN = 2.0 * math.pi * (1.0 + 1e-9)  # rad
USUAL = 3000.0  # bar wave speed [m/s] near which most solids lie


def unit_warnings(scene: Scene, meshes: Mapping[str, Mesh], model: Model) -> list[str]:
    """One sentence for each value that says another unit than metre, kilogram, second, pascal or radian.

    Bodies with E = rho = 1 are of a scene without units, and may have any size.

    Args:
        scene: the scene.
        meshes: of its bodies, by name.
        model: assembled of them.
    """
    return [*_materials(scene), *_sizes(scene, meshes, model), *_angles(scene), *_loads(scene, meshes, model)]


def _materials(scene: Scene) -> Iterator[str]:
    """What stiffness, density and yield stress say, once for all bodies of a material."""
    owners: dict[tuple[Material, bool], list[str]] = {}
    for body in scene.bodies:
        for material in dict.fromkeys(_materials_of(body)):
            owners.setdefault((material, body.rigid), []).append(body.name)
    for (material, rigid), names in owners.items():
        who = f"{'body' if len(names) == 1 else 'bodies'} {', '.join(names)}"
        E, rho, speed, sigma_y = material.E, material.rho, material.wave_speeds["bar"], material.yield_stress
        if _strange(material, rigid):
            what = f"{who}: E = {E:.4g} Pa and rho = {rho:.4g} kg/m^3 give a bar wave speed of {speed:.3g} m/s"
            yield (
                f"{what}; solids have {SLOWEST:g} to {FASTEST:,.0f} m/s and {LIGHTEST:g} to {DENSEST:,.0f} kg/m^3: "
                f"{_likely(E, rho)}"
            )
        elif not rigid and not _unitless(material) and sigma_y < YIELDING * E:
            yield f"{who}: sigma_y = {sigma_y:.4g} Pa is {sigma_y / E:.2g} of E: if it is in MPa, give it in Pa"


def _strange(material: Material, rigid: bool) -> bool:
    """Whether stiffness or density is beyond what solids have; a rigid body may be light for its stiffness."""
    if _unitless(material):
        return False
    fastest = math.inf if rigid else FASTEST
    return not (SLOWEST <= material.wave_speeds["bar"] <= fastest and LIGHTEST <= material.rho <= DENSEST)


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


def _sizes(scene: Scene, meshes: Mapping[str, Mesh], model: Model) -> Iterator[str]:
    """What extents and masses say. Parts from files name no unit; others may well be bars of 10 m."""
    slow = model.stable.dt > LONGEST_STEP
    absorbing = {item.body for item in scene.absorbing}
    for body in scene.bodies:
        materials = _materials_of(body)
        if any(map(_unitless, materials)):
            continue
        size, mass = _extent(meshes[body.name]), _mass(model, body.name)
        what = f"body {body.name} is {size:.3g} m long and weighs {mass:.3g} kg"
        if isinstance(body.geometry, Cad | MeshFile):
            explained = any(_strange(material, body.rigid) for material in materials)
            if size > LONGEST or (not explained and (mass > HEAVIEST or (slow and size > 1.0))):
                step = f"the stable step is {model.stable.dt:.2g} s"
                yield f"{what}, and {step}: if its file counts in millimetres, give scale=1e-3"
            elif size < SHORTEST:
                yield f"{what}: its scale makes it smaller than a tenth of a millimetre; check it"
        elif size > LARGEST or (mass > MOST_MASS and body.name not in absorbing):
            yield f"{what}: if its sizes are in millimetres, give metres"
        elif size < SMALLEST:
            yield f"{what}, smaller than a tenth of a micrometre: give sizes in metres"


def _angles(scene: Scene) -> Iterator[str]:
    """Angles beyond a turn, which degrees soon are."""
    given: list[tuple[str, Sequence[float]]] = [(f"Body {b.name}.rotation", b.rotation) for b in scene.bodies]
    given = [(name, angles) for name, angles in given if math.hypot(*angles) > FULL_TURN]
    if scene.rigid and max(map(abs, scene.rigid.theta)) > FULL_TURN:
        given.append(("RigidPhase.theta", scene.rigid.theta))
    for name, angles in given:
        yield (
            f"{name} = {_listed(angles)} rad is more than a full turn: if it is in degrees, give "
            f"{_listed([math.radians(angle) for angle in angles])}"
        )


def _loads(scene: Scene, meshes: Mapping[str, Mesh], model: Model) -> Iterator[str]:
    """What gravity, contact stiffness and approach speeds say."""
    g = math.hypot(*scene.gravity)
    if MILLI_GRAVITY[0] < g < MILLI_GRAVITY[1] and (scene.rigid or max(map(_extent, meshes.values())) > 1.0):
        yield f"Scene.gravity = {_listed(scene.gravity)} m/s^2 is 1000 g: if it is in mm/s^2, give 9.81 m/s^2"
    names = [body.name for body in scene.bodies]
    for contact, (normal, _) in zip(scene.contacts, model.contact_axes, strict=True):
        sides = [contact.slave.body, *([] if isinstance(contact.master, RigidPlane) else [contact.master.body])]
        who = " and ".join(sides)
        if not isinstance(contact.penalty, str | None) and contact.penalty >= PENALTY:
            yield (
                f"the contact of {who} has penalty = {contact.penalty:.3g}: it is a factor of the stiffness that the "
                "meshes give, not N/m; 0.01 to 10 are usual, and None or auto choose it"
            )
        bodies = [scene.bodies[names.index(name)] for name in sides]
        waves = sum(max(m.wave_speeds["bar"] for m in _materials_of(body)) for body in bodies if not body.rigid)
        velocity = [_velocity(model, name) for name in sides]
        approach = float((velocity[1] - velocity[0] if len(sides) > 1 else -velocity[0]) @ normal)
        if approach > waves > 0.0:
            yield (
                f"{who} meet at {approach:.4g} m/s, faster than the {waves:.4g} m/s of bar waves in them, which "
                "crushes them whatever they are made of: give velocities in m/s, moduli in Pa and densities in kg/m^3"
            )


def _materials_of(body: Body) -> list[Material]:
    return list(body.material.values()) if isinstance(body.material, Mapping) else [body.material]


def _unitless(material: Material) -> bool:
    """Whether it is of a scene without units."""
    return material.E == material.rho == 1.0


def _extent(mesh: Mesh) -> float:
    """Greatest extent along an axis [m]."""
    return float(np.ptp(mesh.points, axis=0).max())


def _nodes(model: Model, name: str) -> slice:
    """Nodes of a body in the model."""
    start = model.node_start[name]
    return slice(start, min((other for other in model.node_start.values() if other > start), default=model.node_count))


def _mass(model: Model, name: str) -> float:
    """Mass of a body without what mass scaling added [kg]; slaves of ties have none."""
    nodes = _nodes(model, name)
    return float(model.mass[nodes].sum() - (model.scaling.added[nodes].sum() if model.scaling else 0.0))


def _velocity(model: Model, name: str) -> NDArray[np.float64]:
    """Mean velocity of the nodes of a body at the start [m/s], shape (3,)."""
    return np.asarray(model.V[_nodes(model, name)].mean(axis=0))


def _listed(values: Sequence[float]) -> str:
    return f"({', '.join(f'{value:.4g}' for value in values)})"
