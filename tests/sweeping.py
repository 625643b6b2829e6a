"""A scene file of a small block for sweeps, whose runs may kill processes, and rows without what clocks decide."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from warp_mca.studies.worker_process import DeviceLost

SCENE = '''
"""A block falls on a rough plane."""
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import warp_mca as mca
from warp_mca import Param

BLOCK = mca.Box(size=(0.02, 0.01, 0.01), divisions=(2, 1, 1))


@dataclass(frozen=True)
class Deadly:
    """A recipe of the block that kills a process the first time that it is used."""

    whom: str
    flag: str

    def build(self) -> mca.Mesh:
        """The block, if `flag` exists."""
        if not Path(self.flag).exists():
            Path(self.flag).touch()
            os.kill(os.getpid() if self.whom == "worker" else os.getppid(), signal.SIGKILL)
            time.sleep(10.0)  # a worker ends with the process that started it
            Path(self.flag).unlink()
        return BLOCK.build()


def build(
    *,
    v: Annotated[float, Param("speed", unit="m/s")] = 1.0,
    mu: Annotated[float, Param("friction")] = 0.2,
    tolerance: Annotated[float, Param("of the energy")] = 0.01,
    duration: Annotated[float, Param("of the run", unit="s")] = 4e-6,
    kills: Annotated[str, Param("what the run kills: worker, main or nothing")] = "nothing",
) -> mca.Scene:
    """A block with two elements."""
    deadly = Deadly(whom=kills, flag=str(Path(__file__).parent / f"{kills}-{v:g}"))
    steel = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
    geometry = BLOCK if kills == "nothing" else deadly
    return mca.Scene(
        name="block",
        bodies=(mca.Body(name="block", geometry=geometry, material=steel, velocity=(v, -v, 0.0)),),
        contacts=(mca.Contact(slave=mca.Surface(body="block", nodes="ymin"), master=mca.RigidPlane(), mu=mu),),
        impact=mca.ImpactPhase(duration=duration, energy_tolerance=tolerance),
    )
'''
TIMED = {"wall", "element_steps_per_s", "threads"}  # columns that differ from run to run


def figures(rows: Iterable[Mapping[str, object]]) -> list[dict[str, str]]:
    """The rows without what clocks and cores decide, each value by the digits that give its bits."""
    return [{name: repr(value) for name, value in row.items() if name not in TIMED} for row in rows]


@dataclass(frozen=True)
class Losing:
    """A job whose device takes no more work the first time; then it tells its process."""

    flag: Path
    device: str = "cpu"

    def on(self, device: str) -> Losing:
        """The same job on a device."""
        return replace(self, device=device)


def lose_device(job: Losing) -> tuple[str, int]:
    """Device and number of the process.

    Raises:
        DeviceLost: `flag` does not exist; then it has the number of the process.
    """
    if not job.flag.exists():
        job.flag.write_text(str(os.getpid()))
        raise DeviceLost(f"{job.device} takes no more work of its process (a fault)")
    return job.device, os.getpid()
