"""Runs Taylor's test with Akantu: `python benchmarks/peers/akantu_taylor.py MESH.npz`, after `pip install akantu`."""

import tempfile
from pathlib import Path

import numpy as np
import taylor

taylor.one_thread()

import akantu as aka  # noqa: E402

with tempfile.TemporaryDirectory() as folder:
    law = "material plastic_linear_isotropic_hardening [\n name = copper\n finite_deformation = true\n"
    law += f" rho = {taylor.RHO}\n E = {taylor.E}\n nu = {taylor.NU}\n"
    (file := Path(folder) / "material.dat").write_text(f"{law} sigma_y = {taylor.YIELD}\n h = {taylor.HARDENING}\n]\n")
    aka.parseInput(str(file))
points, bricks, foot = taylor.mesh()
mesh = aka.Mesh(3)
access = aka.MeshAccessor(mesh)
access.resizeNodes(len(points))
mesh.getNodes()[:] = points
access.resizeConnectivity(len(bricks), aka._hexahedron_8)
mesh.getConnectivity(aka._hexahedron_8)[:] = bricks
access.makeReady()
model = aka.SolidMechanicsModel(mesh)
model.initFull(_analysis_method=aka._explicit_lumped_mass)
model.setTimeStep(taylor.DT)
v = model.getVelocity()
v[:, 0] = taylor.SPEED
v[foot, 0] = 0.0
model.getBlockedDOFs()[foot, 0] = True
begun = taylor.clock()
for n in range(taylor.STEPS):
    model.solveStep()
    if n % 100 == 0 and not np.isfinite(model.getDisplacement()).all():
        raise SystemExit(f"Akantu with finite_deformation: not a number at {1e6 * n * taylor.DT:.0f} us")
wall = taylor.clock() - begun
final = taylor.shape(points, model.getDisplacement(), foot)
taylor.say("Akantu", aka.__version__, "hexahedron_8", wall, len(bricks), final)
