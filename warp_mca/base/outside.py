"""Owns what this process has of the user's own: modules imported by name (`--import MODULE`), registered kinds."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

from warp_mca.base.errors import bad_value
from warp_mca.base.validate import call

_IMPORTED: dict[str, str] = {}  # folder that each module was looked for in, by its name
_REGISTERED: list[str] = []  # names of kinds, in turn


def import_named(field: str, name: str, folder: str | None = None) -> ModuleType:
    """The module `name`, looked for in the current folder too, behind all places where Python looks.

    Args:
        field: how the user named it, for errors.
        name: as in an import statement.
        folder: in place of the current one.

    Raises:
        RequestError: there is no such module, or reading it failed.
    """
    if not all(part.isidentifier() for part in name.split(".")):
        raise bad_value(field, name, "name a module as in an import statement, without .py")
    folder = folder or str(Path.cwd())
    if folder not in sys.path:
        sys.path.append(folder)
    try:
        module = call(field, name, "reading the module", import_module, name)
    except Exception as error:
        missing = error.__cause__
        if isinstance(missing, ModuleNotFoundError) and name.startswith(missing.name or " "):
            raise bad_value(field, name, f"there is no such module in {folder} or among those installed") from error
        raise
    _IMPORTED[name] = folder
    return module


def imported() -> dict[str, str]:
    """Modules imported so far by `import_named`, with their folders: another process must import them, too."""
    return dict(_IMPORTED)


def note_registered(name: str) -> None:
    """Tables of this process have a kind of this name that another process does not."""
    _REGISTERED.append(name)


def registered() -> bool:
    """Whether they have any."""
    return bool(_REGISTERED)


def file_of(module: ModuleType) -> Path | None:
    """The file that a module was read from; None if it has none."""
    return Path(module.__file__).resolve() if module.__file__ else None
