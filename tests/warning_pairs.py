"""For each row of the table of warnings, what gives reason for it and what just does not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from impacts import prepared
from test_advice import SHORT, alone, cube, sliver, stacked
from test_contact import two_boxes
from test_flat_ends import bar as flat_bar
from test_flat_ends import cube as flat_cube
from test_inertia_warnings import ENOUGH, brick
from test_passing import ball, boxes
from test_run import crushed
from test_tie import bar as tied_bar
from test_unit_warnings import ON_PLANE, STEEL, block
from watched import history, ledger, of_contacts, told, told_of

import warp_mca as mca
from warp_mca.geometry import Mesh
from warp_mca.system.rigid import RigidExtremes
from warp_mca.verify.body_joints import pendulum_chain
from warp_mca.watch import (
    articulations,
    bending,
    bolts,
    contacts,
    elements,
    energy,
    folding,
    guards,
    histories,
    inertia,
    meshes,
    motion,
    passing,
    units,
    vibration,
)
from warp_mca.watch.bent_cells import COLUMNS, FLOWING, FOLDED, MISSED, RIGHT
from warp_mca.watch.row import Row, SpringShare

Pair = Callable[[bool], list[str]]
PAIRS: dict[str, Pair] = {}  # by the name of a row: what is said beyond its limit, and just within


def pair(row: Row) -> Callable[[Pair], Pair]:
    """Makes the pair of a row of the function that follows."""

    def add(found: Pair) -> Pair:
        assert row.name not in PAIRS
        PAIRS[row.name] = found
        return found

    return add


def run(scene: mca.Scene, **settings: Any) -> list[str]:
    """What a run says, or the guard that stops it."""
    try:
        return list(mca.run(scene, device="cpu", threads=1, **settings).warnings)
    except mca.GuardError as error:
        return [str(error)]


def over(row: Row, beyond: bool, share: float = 0.01) -> float:
    """A figure that is above the limit of a row, or just below."""
    return row.limit * (1.0 + share if beyond else 1.0 - share)


def under(row: Row, beyond: bool) -> float:
    """A figure that is below the limit of a row, or just above."""
    return over(row, not beyond)


# guards


def flagged(row: Row, index: int) -> None:
    """A guard that kernels raise; `tests/test_contact.py` has runs that they stop."""
    pair(row)(lambda beyond: told(row, flags=[beyond and k == index for k in range(3)], time=1.0))


flagged(guards.overflowed_list, 0)
flagged(guards.outrun_search, 1)


@pair(guards.sunken_node)
def _(beyond: bool) -> list[str]:
    return run(two_boxes(penalty=1e-7 if beyond else 1.0), duration=4e-3 if beyond else 1e-4)


@pair(guards.energy_imbalance)
def _(beyond: bool) -> list[str]:
    return run(flat_cube(penalty=30.0, scale=0.9 if beyond else 0.1))


@pair(guards.no_number_at_the_start)
def _(beyond: bool) -> list[str]:
    return run(alone(cube(1), velocity=(1e200 if beyond else 1e3, 0.0, 0.0)))


@pair(guards.no_number)
def _(beyond: bool) -> list[str]:
    sums = np.array([math.nan, 1.0]) if beyond else None
    return told(guards.no_number, ledger=ledger(), sums=sums, balance=None, time=1.0)


@pair(guards.inverted_element)
def _(beyond: bool) -> list[str]:
    return run(crushed(duration=2e-2 if beyond else 4e-3))


# elements


def small_strain(row: Row, **kept: float) -> list[str]:
    return told(row, scene=stacked(2, 2), ledger=ledger(kept), peaks={})


@pair(elements.scattered_pressure)
def _(beyond: bool) -> list[str]:
    scene = alone(cube(2))
    rubber = mca.Elastic(E=1e6, nu=0.451 if beyond else 0.4499, rho=1000.0)
    body = replace(scene.bodies[0], element="tet10", material=rubber)
    return told_of(elements.scattered_pressure, replace(scene, bodies=(body,)))


@pair(elements.enriched_rubber)
def _(beyond: bool) -> list[str]:
    scene = alone(cube(2))
    rubber = mca.NeoHookean(C10=1e6, nu=0.481 if beyond else 0.479, rho=1000.0)
    body = replace(scene.bodies[0], material=rubber, kinematics="finite")
    return told_of(elements.enriched_rubber, replace(scene, bodies=(body,)))


@pair(elements.single_layer)
def _(beyond: bool) -> list[str]:
    plate = mca.Box(size=(0.06, 0.06, 0.01), divisions=(6, 6, 1 if beyond else 2))
    return told_of(elements.single_layer, alone(plate, element="tet10_mean"))


@pair(elements.large_strain)
def _(beyond: bool) -> list[str]:
    return small_strain(elements.large_strain, max_strain=over(elements.large_strain, beyond))


@pair(elements.lost_volume)
def _(beyond: bool) -> list[str]:
    return small_strain(elements.lost_volume, min_jacobian=1.0 - over(elements.lost_volume, beyond))


@pair(elements.shaken_pressure)
def _(beyond: bool) -> list[str]:
    """3 G e of stress, K r e sqrt(n) of noise."""
    K, G = 1e9, 1e6
    steps = (over(elements.shaken_pressure, beyond) * 3.0 * G / K / elements.ROUNDING) ** 2
    model = SimpleNamespace(law=np.array([[K, G]]))
    return told(elements.shaken_pressure, ledger=ledger({"max_strain": 0.01}), steps_taken=round(steps), model=model)


@pair(inertia.raised_inertia)
def _(beyond: bool) -> list[str]:
    spun = brick((ENOUGH - 2 if beyond else ENOUGH,) * 3, angular_velocity=(0.0, 0.0, 50.0))
    return told_of(inertia.raised_inertia, mca.Scene(name="spun", bodies=(spun,), impact=SHORT))


def bent(row: Row, column: int, value: float, plastic: bool = False) -> list[str]:
    """A strip of one cell whose strain energy is 1 J, with this in a column of `bent_cells` and 1 in all others."""
    metal = mca.J2Bilinear(**STEEL, sigma_y=1e8, E_t=1e9) if plastic else mca.Elastic(**STEEL)
    strip = mca.Body(name="strip", geometry=cube(1), material=metal)
    sums = np.ones((1, COLUMNS))
    sums[0, [MISSED, column]] = 0.0, value
    return told_of(row, mca.Scene(name="strip", bodies=(strip,), impact=SHORT), bent=sums)


@pair(bending.bending)
def _(beyond: bool) -> list[str]:
    return bent(bending.bending, RIGHT, 1.0 + over(bending.bending, beyond))


@pair(bending.bending_flow)
def _(beyond: bool) -> list[str]:
    return bent(bending.bending_flow, FLOWING, 1.0 + over(bending.bending_flow, beyond), plastic=True)


@pair(bending.bending_without_flow)
def _(beyond: bool) -> list[str]:
    return bent(bending.bending_without_flow, MISSED, over(bending.bending_without_flow, beyond), plastic=True)


@pair(folding.folded_rubber)
def _(beyond: bool) -> list[str]:
    return bent(folding.folded_rubber, FOLDED, over(folding.folded_rubber, beyond))  # of one cell, itself all of them


# energy


@pair(energy.imbalance_of_exchange)
def _(beyond: bool) -> list[str]:
    scene = alone(cube(1))
    error = scene.impact.energy_tolerance * (1.01 if beyond else 0.99)
    return told(energy.imbalance_of_exchange, scene=scene, ledger=ledger(exchange_error=error))


@pair(energy.turned_edge)
def _(beyond: bool) -> list[str]:
    return told(energy.turned_edge, ledger=ledger({"turned": beyond}))


@pair(energy.soft_springs)
def _(beyond: bool) -> list[str]:
    scene = stacked(2, 2)
    given = replace(scene, contacts=tuple(replace(contact, penalty=1.0) for contact in scene.contacts))
    springs = SpringShare(share=0.2, loss=over(energy.soft_springs, beyond))
    return told_of(energy.soft_springs, given, shares={"c": springs})


@pair(energy.soft_preload)
def _(beyond: bool) -> list[str]:
    springs = SpringShare(share=0.2, loss=over(energy.soft_preload, beyond), rest=True)
    scene = stacked(2, 2)
    chosen = replace(scene, contacts=tuple(replace(contact, penalty="auto") for contact in scene.contacts))
    return told_of(energy.soft_preload, chosen, shares={"c": springs})


@pair(energy.lagging_vectors)
def _(beyond: bool) -> list[str]:
    model = SimpleNamespace(blocks=[SimpleNamespace(element="hex8i", plastic=True)])
    sums = {"hourglass": over(energy.lagging_vectors, beyond), "plastic": 1.0, "elastic": 1.0}
    return told(energy.lagging_vectors, model=model, ledger=ledger(energy=lambda: sums))


# contacts


def pressed(row: Row, scene: mca.Scene, count: float, depth: float = 0.0, **facts: Any) -> list[str]:
    """What a row says where so many nodes carried the contact, so deep [m]."""
    slave, sides = len(prepared(scene).model.passes[0].slave), prepared(scene).model.passes
    depths = [np.full(slave, depth) for _ in sides]
    return told_of(row, scene, ledger=ledger(nodes_at_peak=lambda k: count), depths=depths, **facts)


@pair(contacts.small_patch)
def _(beyond: bool) -> list[str]:
    return pressed(contacts.small_patch, ball("boundary"), under(contacts.small_patch, beyond))


@pair(contacts.driven_into_a_plane)
def _(beyond: bool) -> list[str]:
    drive = mca.Prescribed(body="a", nodes="ymin", axis="y", times=(0.0,), velocities=(-1.0 if beyond else 1.0,))
    scene = replace(block(contacts=(ON_PLANE,)), prescribed=(drive,))
    return pressed(contacts.driven_into_a_plane, scene, 9.0, depth=1e-6)


def arc(turn: float, *, inner: float, outer: float, **more: Any) -> mca.Body:
    """A part of a ring."""
    box = mca.Box(size=(outer - inner, turn, 0.002), divisions=(1, 24, 1), origin=(inner, 0.0, 0.0)).build()
    r, angle, z = box.points.T
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle), z])
    return mca.Body(
        geometry=replace(box, points=points, volume_ratio=np.zeros(0)), material=mca.Elastic(**STEEL), **more
    )


@pair(contacts.frictionless_fit)
def _(beyond: bool) -> list[str]:
    turn = (1.25 if beyond else 1.15) * math.pi
    bodies = arc(turn, name="hub", inner=0.01, outer=0.02), arc(turn, name="ring", inner=0.02, outer=0.03)
    sides = mca.Surface(body="ring", nodes="xmin"), mca.Surface(body="hub", nodes="xmax")
    contact = mca.Contact(slave=sides[0], master=sides[1])
    return told_of(
        contacts.frictionless_fit,
        mca.Scene(name="fit", bodies=bodies, contacts=(contact,), impact=mca.ImpactPhase(duration=1e-5)),
    )


@pair(contacts.deep_in_a_thin_body)
def _(beyond: bool) -> list[str]:
    depth = over(contacts.deep_in_a_thin_body, beyond) * 0.02
    return pressed(contacts.deep_in_a_thin_body, stacked(2, 2), 9.0, depth)


@pair(contacts.undented_master)
def _(beyond: bool) -> list[str]:
    """A ball on a block of cells of 30 mm."""
    row, scene = contacts.undented_master, ball("boundary")
    wide = mca.Box(size=(0.06, 0.02, 0.06), divisions=(2, 1, 2), origin=(-0.03, -0.02, -0.03))
    meet = replace(scene.contacts[0], master=mca.Surface(body="wide", nodes="ymax"))
    scene = replace(
        scene, bodies=(*scene.bodies, mca.Body(name="wide", geometry=wide, material=brick().material)), contacts=(meet,)
    )
    model = prepared(scene).model
    item = model.passes[0]
    touched = np.arange(len(item.slave)) == int(model.X[item.slave, 1].argmin())
    area = contacts._area_around(model.X, item, int(touched.argmax()))
    count = under(row, beyond) * 0.03**2 / area
    facts = {"ledger": ledger(nodes_at_peak=lambda k: count), "depths": [1e-6 * touched]}
    assert count > contacts.PATCH
    return told_of(row, scene, **facts)


# motion


@pair(motion.lost_velocity)
def _(beyond: bool) -> list[str]:
    cubes = stacked(2, 2, two_way=False)
    cubes = replace(
        cubes,
        bodies=tuple(replace(body, velocity=(1.0, 0.0, 0.0)) for body in cubes.bodies),
        joints=(mca.Weld(name="W", body="upper", nodes="ymin", other="lower", other_nodes="ymax"),),
        contacts=(),
    )
    given = 0.5 * prepared(cubes).model.mass.sum()
    kept = {"initial_kinetic": given * (1.0 - over(motion.lost_velocity, beyond))}
    return told_of(motion.lost_velocity, cubes, ledger=ledger(kept))


@pair(motion.stretched_set)
def _(beyond: bool) -> list[str]:
    """Ends of a line that turn by an angle a are sqrt(1 + a^2) times as far apart."""
    angle = math.sqrt(2.0 * over(motion.stretched_set, beyond))
    scene = alone(cube(2), angular_velocity=(0.0, angle, 0.0))
    scene = replace(scene, fixed=(mca.Fixed(body="it", nodes="ymin"),))
    return told_of(motion.stretched_set, scene, ledger=ledger(steps=SimpleNamespace(dt=1e-3)), steps_taken=1000)


@pair(articulations.start_beyond_limits)
def _(beyond: bool) -> list[str]:
    over_limit = over(articulations.start_beyond_limits, beyond) * 2.0
    freedom = mca.Freedom(limits=(-1.0, 1.0), position=1.0 + over_limit)
    joint = mca.Articulation(name="J", body="b0", freedoms=(freedom,))
    return told_of(articulations.start_beyond_limits, replace(pendulum_chain(1, 10), joints=(joint,)))


def turned(row: Row, **more: Any) -> list[str]:
    """What a row says of extremes of a body on a hinge."""
    own = {"dt": 1e-3, "turn": np.zeros(1), "alone": np.ones((1, 2)), "rank": np.ones((1, 4))} | more
    return told_of(row, pendulum_chain(1, 10), rigid=RigidExtremes(**own))


@pair(articulations.fast_turn)
def _(beyond: bool) -> list[str]:
    return turned(articulations.fast_turn, turn=np.array([over(articulations.fast_turn, beyond)]))


@pair(articulations.freedoms_alike)
def _(beyond: bool) -> list[str]:
    return turned(articulations.freedoms_alike, alone=np.array([[under(articulations.freedoms_alike, beyond), 3.0]]))


@pair(articulations.dead_point)
def _(beyond: bool) -> list[str]:
    return turned(articulations.dead_point, rank=np.array([[5.0, 0.1, under(articulations.dead_point, beyond), 3.0]]))


@pair(meshes.slender_rods)
def _(beyond: bool) -> list[str]:
    scene = mca.make_scene("two_link", rigid_inertia="slender" if beyond else "mesh")
    start = SimpleNamespace(energy_mismatch=0.01, momentum_mismatch=0.01)
    return told(meshes.slender_rods, scene=scene, start=start)


@pair(vibration.creep)
def _(beyond: bool) -> list[str]:
    """Rows of a contact that holds half of what it may and creeps at 1 mm/s; its body moved just so far, or further."""
    count, dt, interval, mu = 60, 1e-6, 1e-4, 0.4
    springs = np.zeros((count // 2, 1, 64))
    springs[:, 0, vibration.IMPULSE] = [0.5 * mu, 1.0, 0.0]
    springs[:, 0, vibration.NORMAL_IMPULSE] = 1.0
    springs[:, 0, vibration.STICK_IMPULSE] = 0.5
    springs[:, 0, vibration.FRICTION] = 1e-3 * 0.5 * mu * dt * np.arange(count // 2)
    springs[:, 0, vibration.SPRING_ENERGY] = 1e-12
    plane = mca.RigidPlane()
    item = SimpleNamespace(contact=0, mu=mu, sign=1.0, leads=True, plane=plane, slave=np.arange(3))
    model = SimpleNamespace(passes=[item], contact_axes=np.array([[[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]]))
    steps = SimpleNamespace(interval=interval)
    own = ledger({"count": count}, table=lambda first: springs, springs=lambda rows: rows, contact_dt=dt, steps=steps)
    way = under(vibration.creep, beyond) * 1e-3 * interval * (count - 1)
    u = np.tile([way, 0.0, 0.0], (3, 1))
    scene = SimpleNamespace(contacts=[SimpleNamespace(friction_laws=())])
    return told(vibration.creep, ledger=own, model=model, scene=scene, contacts=[history([1.0])], u=u)


# before the run


def joined_cubes(place: tuple[float, float, float]) -> Mesh:
    """Two cubes of one mesh, the second moved."""
    one = cube(2).build()
    points = np.concatenate([one.points, one.points + np.array(place)])
    return Mesh(points, np.concatenate([one.hexahedra, one.hexahedra + len(one.points)]))


@pair(meshes.note_of_a_reader)
def _(beyond: bool) -> list[str]:
    scene = alone(cube(2))
    mesh = replace(cube(2).build(), notes=("left out are 3 shells",) if beyond else ())
    return [w for w in told_of(meshes.note_of_a_reader, scene, {"it": mesh}) if w]


@pair(meshes.sliver)
def _(beyond: bool) -> list[str]:
    return told_of(meshes.sliver, alone(sliver() if beyond else cube(4)))


@pair(meshes.costly_damping)
def _(beyond: bool) -> list[str]:
    scene = alone(cube(4))
    step = prepared(scene).model.stable.dt  # sqrt(1 + xi^2) - xi = 2 / 3 where xi = beta / step is 5 / 12
    damping = mca.Damping(body=scene.bodies[0].name, stiffness=5.0 / 12.0 * step * (1.001 if beyond else 0.999))
    return told_of(meshes.costly_damping, replace(scene, loads=(damping,)))


@pair(meshes.doubled_node)
def _(beyond: bool) -> list[str]:
    return told_of(meshes.doubled_node, alone(joined_cubes((0.02 if beyond else 0.021, 0.0, 0.0))))


@pair(meshes.loose_pieces)
def _(beyond: bool) -> list[str]:
    return told_of(meshes.loose_pieces, alone(joined_cubes((0.015, 0.005, 0.005)) if beyond else cube(2).build()))


@pair(meshes.path_without_stress)
def _(beyond: bool) -> list[str]:
    return told_of(meshes.path_without_stress, mca.make_scene("two_link", rigid_bodies="OA" if beyond else "none"))


@pair(meshes.coarse_slave)
def _(beyond: bool) -> list[str]:
    return told_of(meshes.coarse_slave, stacked(8, 5 if beyond else 6, two_way=False))


@pair(meshes.coarse_shape)
def _(beyond: bool) -> list[str]:
    return told_of(meshes.coarse_shape, replace(alone(mca.Sphere(radius=0.01)), refine=1.0 if beyond else 2.0))


@pair(meshes.coarse_mass)
def _(beyond: bool) -> list[str]:
    scene = alone(mca.Sphere(radius=0.01), exact_mass=False)
    return told_of(meshes.coarse_mass, replace(scene, refine=1.0 if beyond else 2.0))


@pair(meshes.free_joint_node)
def _(beyond: bool) -> list[str]:
    weld = mca.Weld(name="w", body="upper", nodes="ymin", other="lower", other_nodes="ymax")
    return told_of(meshes.free_joint_node, replace(stacked(3, 4 if beyond else 3), contacts=(), joints=(weld,)))


@pair(meshes.coarse_tied_slave)
def _(beyond: bool) -> list[str]:
    return told_of(meshes.coarse_tied_slave, tied_bar(4, 3, swapped=beyond))


def metal(**changes: float) -> dict[str, float]:
    return {**STEEL, **changes}


@pair(units.strange_material)
def _(beyond: bool) -> list[str]:
    """Of a metal; rubber may be slower."""
    rubber = told_of(units.strange_material, block({"E": 2e5, "nu": 0.3, "rho": 1100.0}))
    return rubber + told_of(
        units.strange_material, block(metal(E=STEEL["rho"] * under(units.strange_material, beyond) ** 2))
    )


@pair(units.low_yield_stress)
def _(beyond: bool) -> list[str]:
    row = units.low_yield_stress
    return told_of(row, block(metal(sigma_y=STEEL["E"] * under(row, beyond), E_t=0.0)))


@pair(units.high_yield_stress)
def _(beyond: bool) -> list[str]:
    row = units.high_yield_stress
    never = told_of(row, block(metal(sigma_y=1.01 * units.NEVER * STEEL["E"], E_t=0.0)))
    return never + told_of(row, block(metal(sigma_y=STEEL["E"] * over(row, beyond), E_t=0.0)))


def part(row: Row, length: float) -> list[str]:
    """Of a light box that seems to come from a file."""
    scene = block(size=(length, 0.5 * length, 0.5 * length))
    ready = prepared(scene)
    geometry = object.__new__(mca.MeshFile)
    bodies = [SimpleNamespace(**{**vars(scene.bodies[0]), "geometry": geometry})]
    loose = SimpleNamespace(bodies=bodies)
    model = SimpleNamespace(
        **{**vars(ready.model), "mass": 1e-6 * ready.model.mass, "stable": SimpleNamespace(dt=1e-6)}
    )
    return told(row, scene=loose, meshes=ready.meshes, model=model, nodes=lambda name: slice(None))


@pair(units.large_part)
def _(beyond: bool) -> list[str]:
    return part(units.large_part, over(units.large_part, beyond))


@pair(units.small_part)
def _(beyond: bool) -> list[str]:
    return part(units.small_part, under(units.small_part, beyond))


@pair(units.large_body)
def _(beyond: bool) -> list[str]:
    return told_of(units.large_body, block(size=(over(units.large_body, beyond), 0.1, 0.1)))


@pair(units.small_body)
def _(beyond: bool) -> list[str]:
    length = under(units.small_body, beyond)
    return told_of(units.small_body, block(size=(length, 0.5 * length, 0.5 * length)))


@pair(units.large_angle)
def _(beyond: bool) -> list[str]:
    return told_of(units.large_angle, block(rotation=(0.0, 0.0, over(units.large_angle, beyond, share=1e-6))))


@pair(units.gravity_in_millimetres)
def _(beyond: bool) -> list[str]:
    long = over(units.gravity_in_millimetres, beyond)
    return told_of(units.gravity_in_millimetres, block(size=(long, 0.1, 0.1), gravity=(0.0, -9810.0, 0.0)))


@pair(units.penalty_in_newtons_per_metre)
def _(beyond: bool) -> list[str]:
    row = units.penalty_in_newtons_per_metre
    return told_of(row, block(contacts=(replace(ON_PLANE, penalty=over(row, beyond)),)))


@pair(units.supersonic_approach)
def _(beyond: bool) -> list[str]:
    row = units.supersonic_approach
    speed = over(row, beyond) * math.sqrt(STEEL["E"] / STEEL["rho"])
    return told_of(row, block(contacts=(ON_PLANE,), velocity=(0.0, -speed, 0.0)))


# events


@pair(passing.overlap_at_the_start)
def _(beyond: bool) -> list[str]:
    return run(boxes(gap=-0.01 if beyond else 0.0, speed=1.0), duration=2e-5)


@pair(passing.below_a_plane)
def _(beyond: bool) -> list[str]:
    return run(ball("pole" if beyond else "boundary", duration=4e-4))


@pair(passing.bodies_in_each_other)
def _(beyond: bool) -> list[str]:
    """The box arrives after 50 us."""
    return run(boxes(), duration=1.2e-4 if beyond else 4e-5)


@pair(passing.body_in_itself)
def _(beyond: bool) -> list[str]:
    case = object.__new__(passing.WithinItself)
    for name, value in {"skins": (SimpleNamespace(name="clip"),), "passes": ()}.items():
        object.__setattr__(case, name, value)
    kept = {"passed": np.array([[1e-3 if beyond else 0.0, 1e-4, 0.0, 0.0, 0.0, 0.0]])}
    return told(passing.body_in_itself, watch=SimpleNamespace(cases=[case]), ledger=ledger(kept), origin=0.0)


@pair(bolts.bolt_in_compression)
def bolt_in_compression(beyond: bool) -> list[str]:
    screw = mca.Bolt(name="screw", body="a", at=(0.0,) * 3, other="b", other_at=(0.0, 0.0, 1.0), diameter=1e-3)
    least = -100.0 * over(bolts.bolt_in_compression, beyond)
    columns = {"bolt_screw_N": np.array([0.0, 50.0, least]), "bolt_screw_shear_N": np.array([0.0, 100.0, 0.0])}
    return told(bolts.bolt_in_compression, scene=SimpleNamespace(loads=(screw,)), history=columns)


@pair(histories.no_contact)
def _(beyond: bool) -> list[str]:
    return of_contacts([history([0.0, 0.0 if beyond else 1.0, 0.0])])


@pair(histories.unfinished_contact)
def _(beyond: bool) -> list[str]:
    return of_contacts([history([0.0, 1.0, 1.0 if beyond else 0.0])])


@pair(histories.nearly_opened)
def _(beyond: bool) -> list[str]:
    return of_contacts([history([0.0, 1.0, under(histories.nearly_opened, beyond), 0.2, 0.0])])


@pair(histories.grazing_touch)
def _(beyond: bool) -> list[str]:
    return of_contacts([history([*[1.0] * 50, 0.0, 0.0, 0.0, under(histories.grazing_touch, beyond), 0.0])])


AXES = np.array([[[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]])


@pair(histories.normal_off_its_axis)
def _(beyond: bool) -> list[str]:
    angle = math.radians(over(histories.normal_off_its_axis, beyond))
    force = np.outer([0.0, 1.0, 0.0], [math.sin(angle), math.cos(angle), 0.0])
    return of_contacts([history([0.0, 1.0, 0.0], normal_force=force)], AXES)


@pair(histories.friction_across_the_tangent)
def _(beyond: bool) -> list[str]:
    across = over(histories.friction_across_the_tangent, beyond) * 0.2
    normal, force = (np.outer([0.0, 1.0, 0.0], vector) for vector in ([0.0, 1.0, 0.0], [0.2, 1.0, across]))
    return of_contacts([history([0.0, 1.0, 0.0], normal_force=normal, force=force)], AXES)


def vibrating(row: Row, column: str, beyond: bool) -> list[str]:
    """A target that vibrates with a period of two rows beside a speed of 1 m/s; the mean of five rows has a fifth."""
    count = 200
    still = np.zeros(count)
    columns = {f"{point}_v{axis}": still for point in ("tip", "plate") for axis in "xyz"}
    columns |= {"time_s": np.arange(count, dtype=float), "F_n_N": np.ones(count), "tip_vy": np.full(count, -1.0)}
    share = over(row, beyond) / math.sqrt(2.0) / 0.8
    columns[column] = share * (-1.0) ** np.arange(count)
    columns[column][0] = columns["F_n_N"][:5] = 0.0  # before they met
    model = SimpleNamespace(passes=[SimpleNamespace(contact=0, mu=0.4)], contact_axes=AXES)
    return told(row, history=columns, model=model)


@pair(vibration.flutter)
def _(beyond: bool) -> list[str]:
    return vibrating(vibration.flutter, "plate_vx", beyond)


@pair(vibration.vibration_aside)
def _(beyond: bool) -> list[str]:
    return vibrating(vibration.vibration_aside, "plate_vz", beyond)


@pair(vibration.ringing)
def _(beyond: bool) -> list[str]:
    """A flat bar on a wall: rho c A v."""
    scene = flat_bar()
    material = scene.bodies[0].material
    assert isinstance(material, mca.Elastic)
    most = material.rho * material.wave_speeds["dilatational"] * 0.01**2
    pressure, steps = [0.0, over(vibration.ringing, beyond) * most, 0.0], SimpleNamespace(interval=1e-6)
    return told_of(vibration.ringing, scene, contacts=[history(pressure)], ledger=ledger(steps=steps))
