"""A small bracket, drawn and meshed by gmsh's own CAD kernel, as tests of parts read it from files."""

from __future__ import annotations

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
