"""Changes meshes of the arms' scenes to tied ones: coarse rods with a fine end, a plate of nested boxes."""

from __future__ import annotations

from dataclasses import fields, replace

import warp_mca as mca
from warp_mca.base.errors import bad_value

RATIO = 3  # of cells from box to box of the plate


def _with_mesh(scene: mca.Scene, body: str, geometry: mca.Parts | mca.NestedPlate | mca.Rod) -> mca.Scene:
    bodies = tuple(replace(item, geometry=geometry) if item.name == body else item for item in scene.bodies)
    return replace(scene, bodies=bodies)


def _tied(scene: mca.Scene, body: str, slave: str, master: str) -> mca.Scene:
    tie = mca.Tie(slave=mca.Surface(body=body, nodes=slave), master=mca.Surface(body=body, nodes=master))
    return replace(scene, ties=(*scene.ties, tie))


def with_coarse_rods(scene: mca.Scene, fine_length: float, section: int, ring: int) -> mca.Scene:
    """The links with rods of a coarse section, the last one with its end, `fine_length` [m] long, as it was.

    Each coarse rod has the cells along it that it had in that length; those of the fine end are equal.
    """
    *inner, last = (body for body in scene.bodies if isinstance(body.geometry, mca.Rod))
    rod = last.geometry
    assert isinstance(rod, mca.Rod)
    if not rod.radius < fine_length < rod.length:
        remedy = f"give a length between the radius, {rod.radius:g} m, and that of the rod, {rod.length:g} m"
        raise bad_value("fine_length", fine_length, remedy)
    for body in inner:
        assert isinstance(body.geometry, mca.Rod)
        scene = _with_mesh(scene, body.name, replace(body.geometry, section=section, ring=ring))
    share = (fine_length - rod.radius) / (rod.length - rod.radius)
    fine = max(1, round(share * rod.axial))
    rest = rod.length - fine_length
    kind = mca.LugRod if isinstance(rod, mca.LugRod) else mca.Rod  # LugRod has its eye at the start
    coarse = kind(
        radius=rod.radius, length=rest, tip="flat", section=section, ring=ring, axial=max(1, rod.axial - fine)
    )
    plain = {field.name: getattr(rod, field.name) for field in fields(mca.Rod)}
    end = mca.Rod(**plain | {"length": fine_length, "axial": fine, "axial_ratio": 1.0})
    parts = (mca.Part(name="rod", geometry=coarse), mca.Part(name="fine", geometry=end, at=(rest, 0.0, 0.0)))
    return _tied(_with_mesh(scene, last.name, mca.Parts(parts=parts)), last.name, "fine.start", "rod.end")


def with_nested_plate(scene: mca.Scene) -> mca.Scene:
    """The plate of boxes within boxes, with a core no smaller than it was."""
    plate = scene.body("plate").geometry
    assert isinstance(plate, mca.Plate)
    *core, depth = (RATIO * -(-count // RATIO) for count in (*plate.core, plate.core_depth))
    nested = mca.NestedPlate(
        length=plate.length,
        width=plate.width,
        height=plate.height,
        core=(core[0], core[1]),
        core_depth=depth,
        core_size=plate.core_size,
        ratio=RATIO,
        extension=plate.extension,
    )
    scene = _with_mesh(scene, "plate", nested)
    for slave, master in nested.tied:
        scene = _tied(scene, "plate", slave, master)
    return scene
