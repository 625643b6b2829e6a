"""Runs Taylor's test with warp_mca: `python benchmarks/peers/warp_mca_taylor.py [hex8r] MESH.npz`."""

import sys

import taylor
import warp as wp

wp.config.quiet = True
import warp_mca as mca  # noqa: E402
from warp_mca.model.build import build_model  # noqa: E402
from warp_mca.step.solver import Solver  # noqa: E402

element = "hex8r" if "hex8r" in sys.argv else "hex8"
points, bricks, foot = taylor.mesh()
rod = mca.Rod(radius=taylor.RADIUS, length=taylor.LENGTH, tip="flat", **taylor.CELLS)
copper = mca.J2Bilinear(E=taylor.E, nu=taylor.NU, rho=taylor.RHO, sigma_y=taylor.YIELD, E_t=taylor.E_T, beta=1.0)
scene = mca.Scene(
    name="taylor",
    bodies=(
        mca.Body(name="bar", geometry=rod, material=copper, element=element, kinematics="finite", exact_mass=False),
    ),
    fixed=(mca.Fixed(body="bar", nodes="end", axes="x"),),
    impact=mca.ImpactPhase(duration=taylor.DURATION),
)
meshes = mca.mesh(scene)
v = 0.0 * points
v[:, 0] = taylor.SPEED
v[foot, 0] = 0.0
solver = Solver(
    build_model(scene, meshes, {"bar": points}, {"bar": v}), device="cpu", precision="float64", dt=taylor.DT
)
solver.compile()
state = solver.new_state()
solver.start(state)
begun = taylor.clock()
solver.step(state, taylor.STEPS)
wall = taylor.clock() - begun
u = state.u.numpy()
taylor.say("warp_mca", mca.__version__, f"{element} float64", wall, len(bricks), taylor.shape(points, u, foot))
