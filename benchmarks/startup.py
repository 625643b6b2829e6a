"""Owns the time from starting Python to the first step's end, with an empty kernel cache and with a filled one."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parent.parent
SCRIPT = """
import sys, time
begun = time.perf_counter()
import warp as wp
wp.config.quiet = True
import warp_mca as mca
from warp_mca.model.build import build_model
from warp_mca.step.solver import Solver
imported = time.perf_counter()
scene = mca.make_scene("rod_on_wall")
meshes = mca.mesh(scene)
X = {k: m.points for k, m in meshes.items()}
model = build_model(scene, meshes, X, {k: 0.0 * x + [1.5, 0.0, 0.0] for k, x in X.items()})
built = time.perf_counter()
solver = Solver(model, device=sys.argv[1], precision="mixed", dt=model.stable.dt)
solver.compile()
state = solver.new_state()
solver.begin(state)
solver.start(state)
compiled = time.perf_counter()
solver.record_and_step(state, 1)
wp.synchronize_device(sys.argv[1])
print(imported - begun, built - imported, compiled - built, time.perf_counter() - compiled)
"""
PARTS = ("imports", "model", "compile", "first step")


def startup(device: str) -> dict[str, dict[str, float]]:
    """Seconds of each part, and of the whole process, with a cold cache and a warm one; scene rod_on_wall."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"WARP_CACHE_PATH": folder}
        for name in ("cold", "warm"):
            begun = time.perf_counter()
            command = [sys.executable, "-c", SCRIPT, device]
            done = subprocess.run(command, cwd=ROOT, env=environment, check=True, capture_output=True, text=True)
            whole = time.perf_counter() - begun
            seconds = [float(word) for word in done.stdout.split()[-len(PARTS) :]]
            found[name] = dict(zip(PARTS, seconds, strict=True)) | {"process": whole}
            print("startup", name, ", ".join(f"{k} {v:.2f} s" for k, v in found[name].items()), flush=True)
    return found
