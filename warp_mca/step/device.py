"""Owns checks of the device that a run asks for: whether the machine has it, and whether it still takes work."""

from __future__ import annotations

from collections.abc import Sequence

import warp as wp

from warp_mca.base.errors import bad_value


def all_devices() -> list[str]:
    """Names of the devices of this machine."""
    wp.init()
    return [str(device) for device in wp.get_devices()]


def check_device(name: str, known: Sequence[str] | None = None) -> str:
    """The name of a device that this machine has, of those that are `known` if another process has found them.

    Raises:
        RequestError: there is no such device.
    """
    known = known or all_devices()
    if name not in known:
        raise bad_value("device", name, f"this machine has {', '.join(known)}")
    return name


def answers(name: str) -> bool:
    """Whether a device takes work: after a fault in a kernel or in the driver a GPU refuses all that a process asks."""
    try:
        wp.zeros(1, dtype=wp.int32, device=name).numpy()
    except Exception:
        return False
    return True
