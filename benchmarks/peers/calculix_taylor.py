"""Runs Taylor's test with CalculiX: `python benchmarks/peers/calculix_taylor.py [C3D8R] MESH.npz`, `ccx` on the path.

`*DYNAMIC, EXPLICIT` with NLGEOM. Its processor time is that of a run less that of one with a tenth of the steps, so
that reading and setting up do not count.
"""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import taylor

CCX = shutil.which("ccx")
if CCX is None:
    raise SystemExit("ccx is not on the path")
taylor.one_thread()
os.environ["CCX_NPROC_EQUATION_SOLVER"] = os.environ["NUMBER_OF_PROCESSORS"] = "1"
kind = "C3D8R" if "C3D8R" in sys.argv else "C3D8"
points, bricks, foot = taylor.mesh()


def run(steps: int) -> tuple[float, np.ndarray]:
    """Processor time [s] and displacements [m]."""
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{k + 1}, " + ", ".join(f"{value:.12g}" for value in x) for k, x in enumerate(points)]
    lines.append(f"*ELEMENT, TYPE={kind}, ELSET=BAR")
    lines += [", ".join(str(n) for n in [k + 1, *(nodes + 1)]) for k, nodes in enumerate(bricks)]
    for name, nodes in (("FOOT", foot), ("MOVING", np.setdiff1d(np.arange(len(points)), foot))):
        lines += [f"*NSET, NSET={name}", *(f"{n + 1}," for n in nodes)]
    lines += ["*MATERIAL, NAME=COPPER", "*ELASTIC", f"{taylor.E}, {taylor.NU}", "*DENSITY", f"{taylor.RHO}"]
    lines += ["*PLASTIC", f"{taylor.YIELD}, 0.", f"{taylor.YIELD + 10.0 * taylor.HARDENING:.8g}, 10."]
    lines += ["*SOLID SECTION, ELSET=BAR, MATERIAL=COPPER", "*BOUNDARY", "FOOT, 1, 1"]
    lines += ["*INITIAL CONDITIONS, TYPE=VELOCITY", f"MOVING, 1, {taylor.SPEED}"]
    lines += [f"*STEP, NLGEOM, INC={10 * steps}", "*DYNAMIC, EXPLICIT"]
    lines += [f"{taylor.DT:.10g}, {taylor.DT * steps:.10g}, 1e-15, {taylor.DT:.10g}"]
    lines += [f"*NODE PRINT, NSET=ALL, FREQUENCY={10 * steps}", "U", "*END STEP"]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "bar.inp").write_text("\n".join(lines) + "\n")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([CCX, "bar"], cwd=folder, capture_output=True, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        text = (Path(folder) / "bar.dat").read_text()
    assert "Job finished" in done.stdout, done.stdout[-3000:]
    table = [line.split() for line in text.split("displacements")[-1].splitlines()[1:]]
    u = np.array([[float(value) for value in words[1:]] for words in table if len(words) == 4])
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, u


short, _ = run(taylor.STEPS // 10)
whole, u = run(taylor.STEPS)
version = subprocess.run([CCX, "-v"], capture_output=True, text=True).stdout.split()[-1]
taylor.say("CalculiX", version, kind, (whole - short) / 0.9, len(bricks), taylor.shape(points, u, foot))
