"""Owns the rerun viewer as a process: starting it, sending to it without ever waiting for it, reopening recordings.

The viewer holds the server, on the loopback address and a free port, and the run is its client: so a flush tells what
has arrived, and the end of the run takes nothing away. (A server in the run's process dies with it: of 300 frames
logged in 0.4 s the viewer then had 209.)
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from warp_mca.base.errors import McaError, bad_value

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

LOOPBACK = "127.0.0.1"
START_TIMEOUT = 30.0  # time limit for the viewer to open [s]
FLUSH_TIMEOUT = 10.0  # time limit for the viewer to receive the rest at the end [s]
BACKLOG = 256 << 20  # largest amount of data not yet received by the viewer [byte]
SUFFIX = ".rrd"


def load_rerun() -> ModuleType:
    """The rerun module with its own log on stderr off: recorders tell what failed in a warning."""
    if "rerun" in sys.modules or "RUST_LOG" in os.environ:
        return import_module("rerun")
    os.environ["RUST_LOG"] = "off"  # read at import only
    try:
        return import_module("rerun")
    finally:
        del os.environ["RUST_LOG"]


def command(*arguments: str) -> list[str]:
    """The command that runs rerun's own program, which comes with rerun-sdk."""
    # `python -m rerun_cli` would lose the exit status.
    return [sys.executable, "-c", "import sys; from rerun_cli.__main__ import main; sys.exit(main())", *arguments]


def free_port() -> int:
    """A port of the loopback address that nobody uses."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]


class Viewer:
    """A viewer in a process of its own, and the stream to it.

    A thread waits for the viewer to open, connects, and keeps asking how much has arrived; the run's own thread only
    ever appends. A viewer that is closed, never opens or stops answering is given up.

    Attributes:
        problem: why the viewer was given up, or None.
        port: that it listens on, on the loopback address.
    """

    def __init__(self, stream: rr.RecordingStream, blueprint: rrb.Blueprint, options: Sequence[str] = ()) -> None:
        """Start it; `options` are those of rerun's program, such as --headless."""
        self.stream, self.blueprint = stream, blueprint
        self.port = free_port()
        self.problem: str | None = None
        self._sent = self._arrived = 0
        self._closing = threading.Event()
        listen = ("--bind", LOOPBACK, "--port", str(self.port), "--expect-data-soon")
        self.process = subprocess.Popen(
            command(*listen, *options),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # an interrupt of the run leaves the viewer open
        )
        self._thread = threading.Thread(target=self._serve, name="rerun viewer", daemon=True)
        self._thread.start()

    @property
    def open(self) -> bool:
        """Whether it is worth sending to."""
        return self.problem is None

    def sent(self, size: int) -> None:
        """Count `size` more bytes on their way; give up a viewer that leaves too many of them unread."""
        self._sent += size
        if self.open and self._sent - self._arrived > BACKLOG:
            self.problem = "the rerun viewer does not answer; the run goes on without it"

    def finish(self) -> None:
        """Wait until everything has arrived, though at most FLUSH_TIMEOUT."""
        self._closing.set()
        if self.open:
            self._thread.join(FLUSH_TIMEOUT)
        if self.open and self._thread.is_alive():
            self.problem = f"the rerun viewer took nothing for {FLUSH_TIMEOUT:g} s; it may lack the last frames"

    def _serve(self) -> None:
        try:
            if self._wait_until_open():
                self._stream()
        except Exception as error:  # nobody else would hear of it
            self.problem = f"the rerun viewer could not be reached ({error})"

    def _stream(self) -> None:
        import rerun as rr

        sink = rr.GrpcSink(f"rerun+http://{LOOPBACK}:{self.port}/proxy")
        self.stream.set_sinks(sink, default_blueprint=self.blueprint)
        while self.open and not self._pass_on():
            time.sleep(0.0 if self._closing.is_set() else 0.5)

    def _wait_until_open(self) -> bool:
        end = time.monotonic() + START_TIMEOUT
        while time.monotonic() < end:
            if self._ended():
                return False
            with socket.socket() as probe:
                probe.settimeout(1.0)
                if probe.connect_ex((LOOPBACK, self.port)) == 0:
                    return True
            time.sleep(0.1)
        self.problem = f"the rerun viewer did not open within {START_TIMEOUT:g} s"
        return False

    def _pass_on(self) -> bool:
        """Push what was sent so far; whether all has arrived and nothing more will come."""
        last, target = self._closing.is_set(), self._sent
        try:
            self.stream.flush(timeout_sec=2.0)
        except RuntimeError:
            self._ended()
            return False
        self._arrived = target
        return last

    def _ended(self) -> bool:
        """Whether the viewer's process has ended, which is then the problem."""
        status = self.process.poll()
        if status is not None and status > 0:
            self.problem = "the rerun viewer did not open (it needs a display; --rrd FILE records without one)"
        elif status is not None:
            self.problem = "the rerun viewer was closed; the run goes on without it"
        return status is not None


def recording_in(path: Path) -> Path:
    """The recording that `path` is, or the newest one in the folder `path`.

    Raises:
        RequestError: the folder holds no recording.
    """
    if path.is_file():
        return path
    found = sorted(path.glob(f"*{SUFFIX}"), key=lambda file: file.stat().st_mtime)
    if not found:
        raise bad_value(
            "view", str(path), f"no recording there; record one with: warp-mca run SCENE --rrd FILE{SUFFIX}"
        )
    return found[-1]


def view(path: Path, options: Sequence[str] = ()) -> None:
    """Open a recording, or the newest one of a folder, in the rerun viewer until it is closed.

    Raises:
        RequestError: there is no recording at `path`.
        McaError: the viewer could not open.
    """
    file = recording_in(path)
    listen = ("--bind", LOOPBACK, "--port", str(free_port()))
    done = subprocess.run(command(*listen, *options, str(file)), stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        reason = next((line.strip() for line in reversed(done.stderr.splitlines()) if "rror" in line), "it stopped")
        reason = "it needs a display" if "DISPLAY" in reason else reason
        raise McaError(f"the rerun viewer could not show {file}: {reason}")
