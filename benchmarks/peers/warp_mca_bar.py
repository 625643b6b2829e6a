"""Runs the bar with warp_mca: `python benchmarks/peers/warp_mca_bar.py [hex8r] [mixed] [plastic]`."""

import sys

import bar
import warp as wp

wp.config.quiet = True
import warp_mca as mca  # noqa: E402
from warp_mca.model.build import build_model  # noqa: E402
from warp_mca.step.solver import Solver  # noqa: E402

element = "hex8r" if "hex8r" in sys.argv else "hex8"
precision = "mixed" if "mixed" in sys.argv else "float64"
box = mca.Box(size=bar.SIZE, divisions=bar.DIVISIONS)
steel: mca.Elastic = mca.Elastic(E=bar.E, nu=bar.NU, rho=bar.RHO)
if bar.PLASTIC:
    steel = mca.J2Bilinear(E=bar.E, nu=bar.NU, rho=bar.RHO, sigma_y=bar.YIELD, E_t=bar.E_T, beta=1.0)
scene = mca.Scene(
    name="bar",
    bodies=(mca.Body(name="bar", geometry=box, material=steel, element=element),),
    fixed=(mca.Fixed(body="bar", nodes="xmin", axes="x"),),
    impact=mca.ImpactPhase(duration=1e-3),
)
meshes = mca.mesh(scene)
points, _, stopped, free = bar.mesh()
v = 0.0 * points
v[:, 0] = -bar.SPEED
v[stopped, 0] = 0.0
model = build_model(scene, meshes, {"bar": meshes["bar"].points}, {"bar": v})
assert model.stable.dt > bar.DT, model.stable.dt
solver = Solver(model, device="cpu", precision=precision, dt=bar.DT)
solver.compile()
state = solver.new_state()
solver.start(state)
steps = bar.STEPS // len(bar.SAMPLES)
ends, wall = [], 0.0
for _ in bar.SAMPLES:
    begun = bar.clock()
    solver.step(state, steps)
    wall += bar.clock() - begun
    ends.append(float(state.u.numpy()[free, 0].mean()))
bar.say("warp_mca", mca.__version__, f"{element} {precision}", wall, ends)
