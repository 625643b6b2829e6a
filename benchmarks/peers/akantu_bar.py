"""Runs the bar with Akantu: `python benchmarks/peers/akantu_bar.py`, where `pip install akantu` was done."""

import tempfile
from pathlib import Path

import bar

bar.one_thread()

import akantu as aka  # noqa: E402

with tempfile.TemporaryDirectory() as folder:
    law = "plastic_linear_isotropic_hardening" if bar.PLASTIC else "elastic"
    more = f" sigma_y = {bar.YIELD}\n h = {bar.HARDENING}\n" if bar.PLASTIC else ""
    text = f"material {law} [\n name = steel\n rho = {bar.RHO}\n E = {bar.E}\n nu = {bar.NU}\n{more}]\n"
    (file := Path(folder) / "material.dat").write_text(text)
    aka.parseInput(str(file))
points, bricks, stopped, free = bar.mesh()
mesh = aka.Mesh(3)
access = aka.MeshAccessor(mesh)
access.resizeNodes(len(points))
mesh.getNodes()[:] = points
access.resizeConnectivity(len(bricks), aka._hexahedron_8)
mesh.getConnectivity(aka._hexahedron_8)[:] = bricks
access.makeReady()
model = aka.SolidMechanicsModel(mesh)
model.initFull(_analysis_method=aka._explicit_lumped_mass)
model.setTimeStep(bar.DT)
v = model.getVelocity()
v[:, 0] = -bar.SPEED
v[stopped, 0] = 0.0
model.getBlockedDOFs()[stopped, 0] = True
ends, wall = [], 0.0
for _ in bar.SAMPLES:
    begun = bar.clock()
    for _ in range(bar.STEPS // len(bar.SAMPLES)):
        model.solveStep()
    wall += bar.clock() - begun
    ends.append(float(model.getDisplacement()[free, 0].mean()))
bar.say("Akantu", aka.__version__, "hexahedron_8", wall, ends)
