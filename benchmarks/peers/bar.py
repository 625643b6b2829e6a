"""Owns the problems that every code solves: a bar flies at some speed, and its end is stopped from t = 0 on.

It stays elastic at 1 m/s; with the word `plastic` on the command line it flies at 20 m/s and yields.

Needs NumPy only, because other codes' interpreters import it.
"""

from __future__ import annotations

import json
import os
import sys
import time

import numpy as np

E, NU, RHO = 210e9, 0.3, 7850.0
SIZE = (1.0, 0.1, 0.1)  # [m]
DIVISIONS = (64, 8, 8)
PLASTIC = "plastic" in sys.argv
YIELD, E_T = 400e6, 2e9  # [Pa]; hardening is isotropic
HARDENING = E * E_T / (E - E_T)
SPEED = 20.0 if PLASTIC else 1.0  # [m/s], along -x onto the stopped end
PASSAGE = SIZE[0] / (E / RHO) ** 0.5  # of a wave along the bar [s]
SAMPLES = (0.5, 1.0, 1.5, 2.0)  # in passages
STEPS = 320
DT = 2.0 * PASSAGE / STEPS  # about 0.9 of the stable step of a fully integrated brick of 12.5 mm


def mesh() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points [m], bricks in VTK's order, nodes of the stopped end and of the free end."""
    nx, ny, nz = DIVISIONS
    axes = [s * np.arange(n + 1) / n for s, n in zip(SIZE, DIVISIONS, strict=True)]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    index = np.arange(x.size).reshape(nz + 1, ny + 1, nx + 1)
    dy, dz = nx + 1, (nx + 1) * (ny + 1)
    bricks = index[:-1, :-1, :-1].reshape(-1, 1) + np.array([0, 1, dy + 1, dy, dz, dz + 1, dz + dy + 1, dz + dy])
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    return points, bricks, index[:, :, 0].ravel(), index[:, :, -1].ravel()


def exact(passages: float) -> float:
    """Displacement of the free end [m] of a bar without width: at speed until the elastic wave comes, then back.

    Beyond yield that wave carries the yield stress and only slows the end; what follows it at the plastic speed comes
    after two passages.
    """
    change = 2.0 * min(SPEED, YIELD / (E * RHO) ** 0.5)
    return -PASSAGE * (SPEED * passages - change * max(0.0, passages - 1.0))


def error(found: list[float]) -> float:
    """Largest error of the free end's displacement at SAMPLES, as a share of its greatest."""
    return max(abs(u - exact(s)) for u, s in zip(found, SAMPLES, strict=True)) / (SPEED * PASSAGE)


def clock() -> float:
    """Processor time of this process [s], which others on the machine cannot lengthen."""
    return time.process_time()


def one_thread() -> None:
    """Ask libraries for one thread; call before importing them."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"


def say(
    code: str, version: str, element: str, wall: float, ends: list[float], dt: float = DT, steps: int = STEPS
) -> None:
    """The line of JSON."""
    count = int(np.prod(DIVISIONS))
    row = {
        "problem": "plastic" if PLASTIC else "elastic",
        "code": code,
        "version": version,
        "element": element,
        "n_elements": count,
        "n_steps": steps,
        "dt": dt,
    }
    print(json.dumps(row | {"wall": wall, "rate": count * steps / wall, "error": error(ends), "ends": ends}))
