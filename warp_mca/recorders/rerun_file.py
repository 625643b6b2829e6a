"""Owns an .rrd file: its stream, what is written while a run goes on, and how it is closed."""

from __future__ import annotations

import atexit
import os
import shutil
import threading
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from warp_mca.base.errors import bad_value
from warp_mca.recorders.recorder import DISK_RESERVE, FULL, make_way

if TYPE_CHECKING:
    from uuid import UUID

    import rerun as rr

CLOSE_TIMEOUT = 10.0  # of the file at the end [s]
END = b"RRF2FOOT"  # 12 bytes before the end of a whole file


class RerunFile:
    """A file that rerun writes in a thread of its own.

    Attributes:
        path: of the file.
        stream: that it takes.
        reason: why it ends early; empty where it does not.
    """

    def __init__(self, path: Path, application: str, recording: UUID, layout: rr.blueprint.Blueprint) -> None:
        """Open it, and make the folders above it.

        Raises:
            RequestError: it cannot be made.
        """
        import rerun as rr

        self.path, self.reason = path, ""
        make_way(path)
        self.stream = rr.RecordingStream(application, recording_id=recording)
        try:
            self.stream.set_sinks(rr.FileSink(str(path)), default_blueprint=layout)
        except RuntimeError as error:
            raise bad_value("rrd", str(path), f"it cannot be written ({error}); name another file") from error
        # Once a write has failed, rerun 0.41 may never come back: not from this, nor when Python exits.
        self._closing = threading.Thread(target=lambda: self.stream.disconnect(), daemon=True)

    def flush(self) -> bool:
        """Start writing what was logged, without waiting for it; False if it cannot be written, then close it."""
        if shutil.disk_usage(self.path.parent).free < DISK_RESERVE:
            self.reason = FULL
            return False
        try:
            self.stream.flush(timeout_sec=0.0)
        except RuntimeError as error:
            self.reason = str(error)
        return not self.reason

    def begin_to_close(self) -> None:
        """Write the table of contents, in a thread; nothing is logged from here on."""
        if not self._closing.ident:
            self._closing.start()

    def close(self) -> None:
        """Wait until it is closed, and remove a file that takes no table of contents."""
        import rerun as rr

        self.begin_to_close()
        self._closing.join(CLOSE_TIMEOUT)
        if self._closing.is_alive():
            atexit.unregister(rr.rerun_shutdown)
        if self._closing.is_alive() or not _whole(self.path):
            self.path.unlink(missing_ok=True)
            self.reason = f"{self.reason or 'it could not be written'}; the broken file is removed"


def _whole(path: Path) -> bool:
    """Whether a recording is complete: it then ends with its table of contents."""
    with suppress(OSError), path.open("rb") as file:
        file.seek(-12, os.SEEK_END)
        return file.read(len(END)) == END
    return False
