"""Owns folders of results: one run holds a folder at a time, and its files replace those of another run together."""

from __future__ import annotations

import errno
import fcntl
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from warp_mca.base.errors import bad_value
from warp_mca.base.files import clear_leftovers, temporary_folder

ATTEMPTS = 100  # attempts to open a folder that other runs may remove


class Folder:
    """A folder that one run holds until `release`; a second run that asks for it is refused.

    The lock is flock(2) on the folder itself: the kernel releases it when the process ends, however it ends, and no
    lock file is left. On file systems without such locks the folder is not protected.

    Attributes:
        path: of the folder.
        made: folders that did not exist before, from the outermost on; `release` removes them if they are empty.
    """

    def __init__(self, path: Path) -> None:
        """Make the folder if need be, lock it, and remove what killed processes left in it and beside it.

        Raises:
            RequestError: another run holds it, or it cannot be made.
        """
        self.path = path
        self.made: list[Path] = []
        self._lock: int | None = None
        try:
            self._acquire()
        except BaseException:
            self.release()
            raise

    def renew(self) -> None:
        """Lock the folder again if it was removed or replaced since.

        Raises:
            RequestError: as in the constructor.
        """
        if self._lock is None or not self._is_locked():
            self._unlock()
            self._acquire()

    def release(self) -> None:
        """Let other runs have the folder."""
        if self._lock is None or self._is_locked():
            for folder in reversed(self.made):
                with suppress(OSError):  # it holds files, or is gone
                    folder.rmdir()
        self._unlock()

    def put(self, written: Path, names: Sequence[str]) -> None:
        """Move the files of the folder `written` here, in place of all files of these names.

        The first name marks the others as complete: it is removed first and comes last. A new folder that is still
        empty is replaced at once. If a move fails or is interrupted, the old files return.

        Args:
            written: a folder in one that `staging` gave.
            names: of all files that results may have.
        """
        if self.path in self.made:
            with suppress(OSError):  # there are other files in it
                written.rename(self.path)
                return
        for name in names:
            if (self.path / name).is_dir():
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(self.path / name))
        old = written.parent / "old"
        old.mkdir()
        placed: list[str] = []
        try:
            for name in names:
                with suppress(FileNotFoundError):
                    (self.path / name).replace(old / name)
            for name in reversed(names):
                if (written / name).exists():
                    placed.append(name)
                    (written / name).replace(self.path / name)
        except BaseException:
            for name in reversed(placed):
                (self.path / name).unlink(missing_ok=True)
            for name in reversed(names):
                with suppress(FileNotFoundError):
                    (old / name).replace(self.path / name)
            raise

    @contextmanager
    def staging(self) -> Iterator[Path]:
        """A hidden folder on the same disk, which is removed at the end."""
        with temporary_folder(self.path.parent if self.path in self.made else self.path) as staging:
            yield staging

    def _acquire(self) -> None:
        for _ in range(ATTEMPTS):
            try:
                self._make()
                descriptor = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY)
            except FileNotFoundError:  # another run removed it between the two calls
                continue
            except PermissionError:  # the folder is writable but not readable
                return
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                os.close(descriptor)
                remedy = "another run is writing to this folder; wait until it has ended, or name another folder"
                raise bad_value("out", str(self.path), remedy) from error
            except OSError:  # a file system without locks
                os.close(descriptor)
                return
            self._lock = descriptor
            if self._is_locked():
                for folder in (self.path, self.path.parent):
                    clear_leftovers(folder)
                return
            self._unlock()
        raise bad_value("out", str(self.path), "other runs keep removing this folder; name another")

    def _make(self) -> None:
        missing = [folder for folder in (self.path, *self.path.absolute().parents) if not folder.exists()]
        for folder in reversed(missing):
            try:
                folder.mkdir()
            except FileExistsError as error:
                if folder.is_symlink() and not folder.exists():
                    remedy = f"{folder} is a link to a folder that does not exist; name another folder"
                    raise bad_value("out", str(self.path), remedy) from error
            except FileNotFoundError:
                raise
            except OSError as error:
                raise bad_value("out", str(self.path), f"{error.strerror or error}; name another folder") from error
            else:
                self.made.append(folder)

    def _is_locked(self) -> bool:
        """Whether the path still names the folder that is locked."""
        assert self._lock is not None
        try:
            return os.path.samestat(os.fstat(self._lock), self.path.stat())
        except OSError:
            return False

    def _unlock(self) -> None:
        if self._lock is not None:
            fcntl.flock(self._lock, fcntl.LOCK_UN)  # also for children that were forked meanwhile
            os.close(self._lock)
            self._lock = None


@contextmanager
def held(path: Path) -> Iterator[Folder]:
    """Hold a folder.

    Raises:
        RequestError: another run holds it, or it cannot be made.
    """
    folder = Folder(path)
    try:
        yield folder
    finally:
        folder.release()
