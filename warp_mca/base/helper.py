"""Owns the program of a helper: a process that carries out functions of the package for the process that started it.

`helpers.py` starts it by its path. It ends when that process has closed the pipe or is gone, also while it computes,
and when it had nothing to do for a minute.
"""

from __future__ import annotations

import os
import pickle
import sys
import threading
from importlib import import_module
from queue import Empty, SimpleQueue
from typing import BinaryIO

IDLE = 60.0  # longest time without a job [s]


def main() -> None:
    """Look for modules where the other process does, say so, then carry out jobs: (module, name, pickled args)."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    sys.path[:] = pickle.load(sys.stdin.buffer)
    for name in pickle.load(sys.stdin.buffer):
        import_module(name)
    answers.write(pickle.dumps(None))
    answers.flush()
    jobs: SimpleQueue[tuple[str, str, bytes]] = SimpleQueue()
    threading.Thread(target=_listen, args=(sys.stdin.buffer, jobs), daemon=True).start()
    while True:
        try:
            module, name, data = jobs.get(timeout=IDLE)
        except Empty:
            return
        try:
            found = getattr(import_module(module), name)(*pickle.loads(data))
            answer = pickle.dumps((True, found), protocol=pickle.HIGHEST_PROTOCOL)
        except Exception:  # the other process does it, and meets the same error
            answer = pickle.dumps((False, None))
        answers.write(answer)
        answers.flush()


def _listen(source: BinaryIO, jobs: SimpleQueue[tuple[str, str, bytes]]) -> None:
    """Queue jobs; end this process when the other one has closed the pipe, or is gone."""
    try:
        while True:
            jobs.put(pickle.load(source))
    finally:
        os._exit(0)


if __name__ == "__main__":
    main()
