"""Recorders: what shows or writes a run while it goes on. `from warp_mca.recorders import UsdFile, Cadence`."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

from warp_mca.recorders.recorder import Cadence, Recorder

if TYPE_CHECKING:
    from warp_mca.pictures.setting import View
    from warp_mca.recorders.animation_file import AnimationFile
    from warp_mca.recorders.mesh_file import FinalState
    from warp_mca.recorders.rerun_stream import RerunStream
    from warp_mca.recorders.snapshot_file import SnapshotFile
    from warp_mca.recorders.usd_file import UsdFile
    from warp_mca.recorders.vtkhdf_file import VtkHdfFile


class Kind(NamedTuple):
    """A recorder that writes a file: its module, its class, and the help of its option on the command line.

    Its class is called with the file and, where it takes `frames` during the run, with `cadence`; `pictures` are drawn
    with `field`, `magnify` and `view`, too.
    """

    module: str
    name: str
    help: str
    frames: bool = True
    pictures: bool = False

    def make(self, *args: object, **options: object) -> Recorder:
        """The recorder; its module is imported only now."""
        return getattr(import_module(self.module), self.name)(*args, **options)


# Classes from outside the package, by the name that `--recorder NAME` gives; `warp_mca.register` fills it.
RECORDERS: dict[str, Any] = {}

# By option of the command line: --rrd FILE, and so on.
FILES = {
    "rrd": Kind("warp_mca.recorders.rerun_stream", "RerunStream", "record for the rerun viewer (.rrd)"),
    "usd": Kind("warp_mca.recorders.usd_file", "UsdFile", "write deformed skins as USD (.usdc, .usda)"),
    "vtkhdf": Kind("warp_mca.recorders.vtkhdf_file", "VtkHdfFile", "write all fields for ParaView (.vtkhdf)"),
    "final": Kind(
        "warp_mca.recorders.mesh_file", "FinalState", "write the last state in a format of meshio (.vtu, …)", False
    ),
    "animate": Kind(
        "warp_mca.recorders.animation_file", "AnimationFile", "draw a film of the bodies (.gif, .mp4)", pictures=True
    ),
}
_MODULES = {kind.name: kind.module for kind in FILES.values()} | {
    "SnapshotFile": "warp_mca.recorders.snapshot_file",
    "View": "warp_mca.pictures.setting",
}

__all__ = [
    "Cadence",
    "Recorder",
    "RerunStream",
    "UsdFile",
    "VtkHdfFile",
    "FinalState",
    "SnapshotFile",
    "AnimationFile",
    "View",
]


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module 'warp_mca.recorders' has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)
