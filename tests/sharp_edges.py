"""Scenes whose masters have sharp edges and folds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import warp_mca as mca

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
SOFT, HARD = mca.Elastic(E=1e9, nu=0.3, rho=1e3), mca.Elastic(E=1e12, nu=0.3, rho=1e6)
H = 0.005  # cells [m]


def kept(mesh: mca.Mesh, keep: np.ndarray, **sets: np.ndarray) -> mca.Mesh:
    """Some of a mesh's hexahedra; `sets` hold for each node whether it is in."""
    used, cells = np.unique(mesh.hexahedra[keep], return_inverse=True)
    names = {name: np.flatnonzero(inside[used]).astype(np.int32) for name, inside in sets.items()}
    return mca.Mesh(mesh.points[used], cells.reshape(-1, 8).astype(np.int32), names)


def frame(kind: str) -> mca.Mesh:
    """A corner of two ("L") or three walls ("C") or a slot of four cells ("U"), held at its foot.

    Node sets are its sides, and all of them.
    """
    block = mca.Box(size=(12 * H, 12 * H, 4 * H), divisions=(12, 12, 4), origin=(-6 * H, -6 * H, -2 * H)).build()
    (x, y, z), (p, q, r) = block.points[block.hexahedra].mean(axis=1).T, block.points.T
    at, left = (2 * H, -2 * H) if kind == "U" else (0.0, 0.0)
    floor = np.isclose(q, left) & (p > left - 1e-9) & (p < at + 1e-9 if kind == "U" else True)
    walls = {"left": np.isclose(p, left) & (q > left - 1e-9)}
    keep = (x < left) | (y < left)
    if kind == "U":
        walls["right"] = np.isclose(p, at) & (q > left - 1e-9)
        keep |= x > at
    if kind == "C":
        keep |= z < 0.0
        floor &= r > -1e-9
        walls["left"] &= r > -1e-9
        walls["back"] = np.isclose(r, 0.0) & (p > -1e-9) & (q > -1e-9)
    every = np.any([floor, *walls.values()], axis=0)
    return kept(block, keep, floor=floor, **walls, every=every, foot=np.isclose(q, -6 * H))


def in_frame(kind: str, masters: tuple[str, ...], velocity: tuple, **contact) -> mca.Scene:
    """A block of 20 mm falls into a frame that it fits exactly."""
    origin = {"L": (0.0, 0.0, -H), "C": (0.0, 0.0, 0.0), "U": (-2 * H, -2 * H, -H)}[kind]
    block = mca.Box(size=(4 * H, 4 * H, 2 * H), divisions=(8, 8, 4), origin=origin)
    at = tuple(1e-5 if v else 0.0 for v in velocity)
    bodies = (
        mca.Body(name="block", geometry=block, material=SOFT, position=at, velocity=velocity),
        mca.Body(name="frame", geometry=frame(kind), material=HARD),
    )
    slave = mca.Surface(body="block", nodes="boundary")
    contact = {"two_way": False} | contact
    contacts = tuple(mca.Contact(slave=slave, master=mca.Surface(body="frame", nodes=m), **contact) for m in masters)
    held, impact = mca.Fixed(body="frame", nodes="foot"), mca.ImpactPhase(duration=2e-4, output_interval=2e-6)
    return mca.Scene(name="frame", bodies=bodies, contacts=contacts, fixed=(held,), impact=impact)


def uneven(scene: mca.Scene) -> mca.Scene:
    """The scene with each node of its first body moved by about 1 nm, so that none lies in the plane of a face."""
    body, *others = scene.bodies
    mesh = body.geometry if isinstance(body.geometry, mca.Mesh) else body.geometry.build()
    moved = mesh.points + 1e-9 * np.random.default_rng(0).standard_normal(mesh.points.shape)
    return replace(scene, bodies=(replace(body, geometry=replace(mesh, points=moved)), *others))


def bars(
    closed: bool, *, cells: int = 4, aside: float = 0.0, along: float = 0.0, width: float = 0.01, **contact
) -> mca.Scene:
    """Two bars of cubes, 40 x 10 x 10 mm or as wide as `width`, meet end on at 10 m/s."""
    bodies = tuple(
        mca.Body(
            name=name,
            geometry=mca.Box(
                size=(0.04, w, w), divisions=(4 * cells, *2 * (round(cells * w / 0.01),)), origin=(x, -w / 2, -w / 2)
            ),
            material=STEEL,
            velocity=velocity,
            position=(0.0, shift, 0.0),
        )
        for name, w, x, velocity, shift in (
            ("one", 0.01, -0.04, (10.0, along, 0.0), aside),
            ("other", width, 0.0, (0.0, 0.0, 0.0), 0.0),
        )
    )
    slave, master = ("boundary", "boundary") if closed else ("xmax", "xmin")
    meet = mca.Contact(
        slave=mca.Surface(body="one", nodes=slave), master=mca.Surface(body="other", nodes=master), **contact
    )
    # closed bars have edges that may cross, which shorten the stable step: all take the same one
    scale = 0.6 if closed or "penalty" in contact else 0.5
    impact = mca.ImpactPhase(duration=3e-5, output_interval=1e-6, time_step_scale=scale)
    return mca.Scene(name="bars", bodies=bodies, contacts=(meet,), impact=impact)


def roof(degrees: float, *, position: tuple, velocity: tuple, rotation: float = 0.0, **contact) -> mca.Scene:
    """A block above a stump whose sides slope, so that normals differ by so many degrees across its upper edges."""
    box = mca.Box(size=(0.04, 0.02, 0.02), divisions=(8, 4, 4), origin=(-0.02, -0.02, -0.01)).build()
    spread = 1.0 - box.points[:, 1] / 0.02 * np.tan(np.radians(90.0 - degrees))
    stump = replace(box, points=box.points * np.column_stack([spread, np.ones((len(spread), 2))]))
    block = mca.Box(size=(0.02, 0.02, 0.01), divisions=(8, 8, 4), origin=(-0.01, 0.0, -0.005))
    bodies = (
        mca.Body(
            name="block",
            geometry=block,
            material=SOFT,
            position=position,
            velocity=velocity,
            rotation=(0.0, 0.0, rotation),
        ),
        mca.Body(name="stump", geometry=stump, material=HARD),
    )
    surfaces = {"slave": "block", "master": "stump"}
    meet = mca.Contact(**{k: mca.Surface(body=body, nodes="boundary") for k, body in surfaces.items()}, **contact)
    held, impact = mca.Fixed(body="stump", nodes="ymin"), mca.ImpactPhase(duration=6e-4, output_interval=4e-6)
    return mca.Scene(name="roof", bodies=bodies, contacts=(meet,), fixed=(held,), impact=impact)
