"""Owns the start of Warp: without its messages, and with other modules imported meanwhile."""

from __future__ import annotations

import os
import sys
import threading
from contextlib import suppress
from importlib import import_module

from warp_mca.base.errors import bad_value

RUN = (  # what every run imports, from the first to the last
    "warp_mca.accuracy.plan",
    "warp_mca.phases.prepare",
    "warp_mca.phases.simulate",
    "warp_mca.phases.impact",
    "warp_mca.recorders.frames",
    "scipy.spatial.transform",
    "scipy.ndimage",
)


def _import(*names: str) -> None:
    with suppress(Exception):  # a module that fails to import raises again where it is used
        for name in names:
            import_module(name)


def start_warp(*needed: str) -> None:
    """Initialise Warp, and import the modules `needed` later in another thread while a GPU's driver starts.

    Standard error is closed meanwhile, because Warp's native code warns there when it finds no GPU.
    """
    import warp

    meanwhile = threading.Thread(target=_import, args=needed, daemon=True)
    meanwhile.start()
    sys.stderr.flush()
    stderr, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        warp.config.log_level = warp.LOG_WARNING
        warp.init()
    except OSError as error:
        what = f"kernels cannot be kept there ({error.strerror or error}); set WARP_CACHE_PATH to another folder"
        raise bad_value("WARP_CACHE_PATH", str(error.filename), what) from error
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(null)
    meanwhile.join()  # imports would slow down the meshing that follows
