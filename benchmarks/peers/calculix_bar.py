"""Runs the bar with CalculiX: `python benchmarks/peers/calculix_bar.py`, where `ccx` is on the path.

`*DYNAMIC, EXPLICIT` with C3D8; it chooses its own time step, which is about a third longer. Its processor time is that
of a run less that of one with a tenth of the steps, so that reading and setting up do not count.
"""

import os
import re
import resource
import shutil
import subprocess
import tempfile
from pathlib import Path

import bar
import numpy as np

CCX = shutil.which("ccx")
if CCX is None:
    raise SystemExit("ccx is not on the path")
bar.one_thread()
os.environ["CCX_NPROC_EQUATION_SOLVER"] = os.environ["NUMBER_OF_PROCESSORS"] = "1"
points, bricks, stopped, free = bar.mesh()


def run(steps: int) -> tuple[float, dict[float, float]]:
    """Processor time [s], and the mean displacement of the free end [m] by time, after each step that was taken."""
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{k + 1}, " + ", ".join(f"{value:.12g}" for value in x) for k, x in enumerate(points)]
    lines.append("*ELEMENT, TYPE=C3D8, ELSET=BAR")
    lines += [", ".join(str(n) for n in [k + 1, *(nodes + 1)]) for k, nodes in enumerate(bricks)]
    moving = np.setdiff1d(np.arange(len(points)), stopped)
    for name, nodes in (("STOPPED", stopped), ("FREE", free), ("MOVING", moving)):
        lines += [f"*NSET, NSET={name}", *(f"{n + 1}," for n in nodes)]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{bar.E}, {bar.NU}", "*DENSITY", f"{bar.RHO}"]
    if bar.PLASTIC:
        lines += ["*PLASTIC", f"{bar.YIELD}, 0.", f"{bar.YIELD + bar.HARDENING:.8g}, 1."]
    lines += ["*SOLID SECTION, ELSET=BAR, MATERIAL=STEEL", "*BOUNDARY", "STOPPED, 1, 1"]
    lines += ["*INITIAL CONDITIONS, TYPE=VELOCITY", f"MOVING, 1, {-bar.SPEED}"]
    lines += [f"*STEP, NLGEOM, INC={10 * steps}", "*DYNAMIC, EXPLICIT", f"{bar.DT:.10g}, {bar.DT * steps:.10g}"]
    lines += ["*NODE PRINT, NSET=FREE, FREQUENCY=1", "U", "*END STEP"]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "bar.inp").write_text("\n".join(lines) + "\n")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([CCX, "bar"], cwd=folder, capture_output=True, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        text = (Path(folder) / "bar.dat").read_text()
    assert "Job finished" in done.stdout, done.stdout[-3000:]
    found = {}
    for part in text.split("displacements")[1:]:
        time = float(re.search(r"time\s+(\S+)", part)[1])
        values = [float(line.split()[1]) for line in part.splitlines()[1:] if len(line.split()) == 4]
        found[time] = float(np.mean(values))
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, found


short, few = run(bar.STEPS // 10)
whole, found = run(bar.STEPS)
ends = [float(np.interp(s * bar.PASSAGE, list(found), list(found.values()))) for s in bar.SAMPLES]
taken = len(found)
seconds = (whole - short) * taken / (taken - len(few))
version = subprocess.run([CCX, "-v"], capture_output=True, text=True).stdout.split()[-1]
bar.say("CalculiX", version, "C3D8", seconds, ends, dt=bar.DT * bar.STEPS / taken, steps=taken)
