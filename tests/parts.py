"""A small bracket, drawn and meshed by gmsh's own CAD kernel, as tests of parts read it from files."""

from __future__ import annotations

import re
from pathlib import Path

VOLUME = 24.0e-6  # of the bracket [m^3]: 40 x 20 x 20 mm^3 and 20 x 20 x 20 mm^3 on top of its end at x = 0
LENGTH = 0.04  # m
CAD = ("step", "iges", "brep", "stl")
MESHES = ("msh", "unv", "bdf", "inp", "key")


def write_parts(folder: Path) -> None:
    """Write part.* in every format, in millimetres, with the surface "foot" at z = 0 and the volume "metal".

    quadratic.* are meshes with nodes within edges, ball.stl is a ball of 10 mm radius.
    """
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 12.0)
        model, shapes = gmsh.model, gmsh.model.occ
        foot, head = shapes.addBox(0, 0, 0, 40, 20, 20), shapes.addBox(0, 0, 20, 20, 20, 20)
        shapes.fuse([(3, foot)], [(3, head)])
        shapes.removeAllDuplicates()
        shapes.synchronize()
        for suffix in CAD[:3]:
            gmsh.write(str(folder / f"part.{suffix}"))
        model.mesh.generate(3)
        gmsh.write(str(folder / "part.stl"))
        (solid,) = model.getEntities(3)
        below = [t for d, t in model.getEntities(2) if abs(model.occ.getCenterOfMass(d, t)[2]) < 1e-6]
        model.addPhysicalGroup(2, below, name="foot")
        model.addPhysicalGroup(3, [solid[1]], name="metal")
        gmsh.option.setNumber("Mesh.SaveGroupsOfNodes", 1)
        for suffix in MESHES:
            gmsh.write(str(folder / f"part.{suffix}"))
        model.mesh.setOrder(2)
        for suffix in ("msh", "unv", "bdf", "inp", "key"):
            gmsh.write(str(folder / f"quadratic.{suffix}"))
        gmsh.clear()
        gmsh.option.setNumber("Mesh.ElementOrder", 1)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 3.0)
        shapes.addSphere(0, 0, 0, 10)
        shapes.synchronize()
        model.mesh.generate(2)
        gmsh.write(str(folder / "ball.stl"))
    finally:
        gmsh.finalize()


PHONE = {"shell": 496.0, "board": 192.0, "chip": 16.0, "chip_2": 16.0, "battery": 84.0, "glass": 240.0}  # mm^3
OVERLAP, GAP = 10e-6, 2e-6  # of the battery with the shell, of the glass from it [m]


def write_phone(folder: Path) -> Path:
    """Write phone.step, in millimetres: six solids, of which two are instances of the part "chip"."""
    import gmsh

    file = folder / "phone.step"
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        shapes = gmsh.model.occ
        shapes.cut([(3, shapes.addBox(0, 0, 0, 24, 10, 5))], [(3, shapes.addBox(1, 1, 1, 22, 8, 4))])
        shapes.addBox(1.5, 1, 1, 12, 8, 2)
        shapes.addBox(3, 3, 3, 4, 4, 1)
        shapes.addBox(15, 1.5, 0.99, 6, 7, 2)
        shapes.addBox(0, 0, 5.002, 24, 10, 1)
        shapes.synchronize()
        gmsh.write(str(file))
    finally:
        gmsh.finalize()
    text = file.read_text()
    for number, name in enumerate(("shell", "board", "chip", "battery", "glass"), start=1):
        text = re.sub(rf"Open CASCADE STEP translator [\d.]+ \d+\.{number}'", f"{name}'", text)
    file.write_text(with_instance(text, 3, (5.0, 0.0, 0.0)))
    return file


def with_instance(text: str, number: int, shift: tuple[float, float, float]) -> str:
    """The text of a STEP file that gmsh wrote, with a part of its assembly a second time, moved [mm]."""
    last = max(map(int, re.findall(r"^#(\d+) =", text, flags=re.M)))
    root, part = re.findall(r"NEXT_ASSEMBLY_USAGE_OCCURRENCE\('\d+','','',(#\d+),(#\d+),", text)[number - 1]
    (shape,) = re.findall(rf"(#\d+) = PRODUCT_DEFINITION_SHAPE\('','',{part}\)", text)
    (own,) = re.findall(rf"SHAPE_DEFINITION_REPRESENTATION\({shape},(#\d+)\)", text)
    (whole,) = re.findall(rf"REPRESENTATION_RELATIONSHIP\('','',{own},(#\d+)\)", text)
    ((first, z, x),) = re.findall(r"(#\d+) = AXIS2_PLACEMENT_3D\('',#12,(#\d+),(#\d+)\)", text)
    kind = "REPRESENTATION_RELATIONSHIP"
    relation = f"{kind}('','',{own},{whole})"
    lines = (
        f"CARTESIAN_POINT('',({shift[0]},{shift[1]},{shift[2]}))",
        f"AXIS2_PLACEMENT_3D('',#{last + 1},{z},{x})",
        f"ITEM_DEFINED_TRANSFORMATION('','',{first},#{last + 2})",
        f"({relation} {kind}_WITH_TRANSFORMATION(#{last + 3}) SHAPE_{kind}())",
        f"NEXT_ASSEMBLY_USAGE_OCCURRENCE('99','','',{root},{part},$)",
        f"PRODUCT_DEFINITION_SHAPE('','',#{last + 5})",
        f"CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#{last + 4},#{last + 6})",
    )
    more = "".join(f"#{last + k} = {line};\n" for k, line in enumerate(lines, start=1))
    head, end, tail = text.rpartition("ENDSEC;")
    return re.sub(rf"({whole} = SHAPE_REPRESENTATION\('',\({first})", rf"\1,#{last + 2}", head) + more + end + tail
