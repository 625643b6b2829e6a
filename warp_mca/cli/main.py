"""Owns the entry point of the command line, its exit status, and how signals and errors end a command.

Exit status: 0 done, 1 a guard stopped the run, 2 the request cannot be carried out, 3 a criterion does not hold, 129
the terminal is gone, 130 interrupted, 141 nobody reads what is printed, 143 terminated.
"""

from __future__ import annotations

import atexit
import gc
import logging
import os
import signal
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from typing import NoReturn

from warp_mca.base.errors import McaError
from warp_mca.base.garbage import few_collections
from warp_mca.base.log import LOGGER
from warp_mca.base.stdio import drop_output, open_streams, what_failed
from warp_mca.cli import completion
from warp_mca.cli.parser import make_parser


class _Warnings(logging.Handler):
    """Prints warnings, and what a run chose, on standard error; `sys.stderr` may differ from command to command.

    A warning is printed once: what a reader of mesh files left out is told when it reads, and by the run.
    """

    def __init__(self) -> None:
        super().__init__()
        self._printed: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        """Print one line."""
        text = record.getMessage()
        with suppress(OSError):  # a closed standard error does not stop the run
            if record.levelno < logging.WARNING:
                print(text, file=sys.stderr, flush=True)
            elif text not in self._printed:
                self._printed.add(text)
                print(f"warning: {text}", file=sys.stderr, flush=True)


class _Terminated(KeyboardInterrupt):
    """SIGTERM or SIGHUP, handled as an interrupt from the keyboard is: files are closed, unfinished ones removed."""


def main(argv: Sequence[str] | None = None) -> int:
    """Carry out one command.

    Args:
        argv: without the program's name; the process's own if None.

    Returns:
        The exit status.
    """
    if argv is None:  # the process ends with this command: freeing its objects one by one would take 0.5 s
        atexit.register(gc.freeze)
        os.environ["MPLBACKEND"] = "agg"  # a notebook's backend may be missing in this environment
        open_streams()
    main_thread = threading.current_thread() is threading.main_thread()  # no other may take signals
    signals = (signal.SIGTERM, signal.SIGHUP) if main_thread else ()
    before = {number: signal.getsignal(number) for number in signals}
    for number in signals:
        if before[number] is not signal.SIG_IGN:  # as nohup has it
            signal.signal(number, _terminate)
    warnings = _Warnings()
    logger = logging.getLogger(LOGGER)
    level = logger.level  # which commands may change
    logger.addHandler(warnings)
    try:
        with few_collections():
            return _carry_out(argv)
    except McaError as error:
        return _fail(str(error), error.exit_status)
    except BrokenPipeError:
        drop_output()
        return 128 + signal.SIGPIPE
    except OSError as error:
        drop_output()
        return _fail(what_failed(error), 2)
    except MemoryError:
        return _fail("the model does not fit into this machine's memory: take fewer elements", 2)
    except Exception as error:
        if "Error while parsing function" in str(error):  # Warp compiles kinds from outside, too
            return _fail(f"Warp cannot compile a function, mend it or leave out what needs it: {error}", 2)
        if not (isinstance(error, RuntimeError) and "CUDA error" in str(error)):  # Warp's words for a GPU's answer
            raise
        remedy = "where processes share the device, take fewer, or start NVIDIA's Multi-Process Service before them"
        return _fail(f"the GPU failed ({error}): try again; {remedy}", 1)
    except KeyboardInterrupt as stop:
        what, number = ("terminated", stop.args[0]) if isinstance(stop, _Terminated) else ("interrupted", signal.SIGINT)
        print("; ".join([f"warp-mca: {what} before it was done", *getattr(stop, "__notes__", ())]), file=sys.stderr)
        return 128 + number
    finally:
        logger.removeHandler(warnings)
        logger.setLevel(level)
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)


def _carry_out(argv: Sequence[str] | None) -> int:
    """Carry out one command; what it printed has left the process when it returns."""
    status = 0
    try:
        parser = make_parser()
        completion.answer(parser)
        args = parser.parse_args(argv)
        args.command(args)
    except SystemExit as stop:  # argparse's way of answering --help, --version and bad commands
        status = stop.code if isinstance(stop.code, int) else 2
    sys.stdout.flush()
    return status


def _fail(why: str, status: int) -> int:
    print("warp-mca: error:", " ".join(why.split()), file=sys.stderr)
    return status


def _terminate(number: int, frame: object) -> NoReturn:
    raise _Terminated(number)
