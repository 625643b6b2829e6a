"""Owns the program of the process in which gmsh reads and meshes files: it carries out calls of gmsh's functions.

`gmsh_session.py` starts it by its path. It imports nothing of warp_mca, and ends when nobody holds the other end of its
standard input any more, also while gmsh computes, or when its processor time is used up: then by SIGPROF, which nothing
in gmsh handles.
"""

from __future__ import annotations

import os
import pickle
import resource
import signal
import sys
import threading
from functools import reduce
from queue import SimpleQueue
from typing import Any, BinaryIO


def main() -> None:
    """Import gmsh from where the other process would, then carry out calls: (name, args, kwargs).

    A number between them is the processor time that may be used from now on [s].
    """
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # a crash leaves no file
    answers = os.fdopen(os.dup(1), "wb")
    null = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):  # libraries in gmsh write there what they transferred, and which edges cross
        os.dup2(null, stream)
    sys.path[:] = pickle.load(sys.stdin.buffer)
    signal.signal(signal.SIGPROF, signal.SIG_DFL)  # the other process may ignore it
    calls: SimpleQueue[Any] = SimpleQueue()
    threading.Thread(target=_listen, args=(sys.stdin.buffer, calls), daemon=True).start()
    gmsh: Any = None
    while True:
        call = calls.get()
        if isinstance(call, float):
            signal.setitimer(signal.ITIMER_PROF, max(call, 1e-3))  # 0 would be no limit
            continue
        name, args, kwargs = call
        try:
            if gmsh is None:
                import gmsh
            answer = True, reduce(getattr, name.split("."), gmsh)(*args, **kwargs)
        except Exception as error:
            answer = False, (type(error).__name__, str(error))
        pickle.dump(answer, answers, protocol=pickle.HIGHEST_PROTOCOL)
        answers.flush()


def _listen(source: BinaryIO, calls: SimpleQueue[Any]) -> None:
    """Queue calls; end this process when the other one has closed the pipe, or is gone."""
    try:
        while True:
            calls.put(pickle.load(source))
    finally:
        os._exit(0)


if __name__ == "__main__":
    main()
