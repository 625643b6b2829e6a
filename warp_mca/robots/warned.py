"""Owns what MuJoCo warns of: it goes to the log of warnings, not to a file in the current folder."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from warp_mca.base.log import warn


@contextmanager
def warnings_logged() -> Iterator[None]:
    """Log what MuJoCo warns of in the block, each sentence once; it then writes no MUJOCO_LOG.TXT."""
    try:
        mujoco: Any = import_module("mujoco")
    except ImportError:  # which is said where it is needed
        yield
        return
    said: list[str] = []
    before, handler = mujoco.MjLogConfig.get(), mujoco.get_mju_user_warning()
    ours = mujoco.MjLogConfig.get()
    ours.logto_file = ours.logto_console = False
    ours.set()
    mujoco.set_mju_user_warning(said.append)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(handler)
        before.set()
        warn(f"MuJoCo says: {' '.join(sentence.split())}" for sentence in said)
