"""Owns checks of the device that a run asks for: whether the machine has it, and whether it still takes work."""

from __future__ import annotations

from collections.abc import Sequence

import warp as wp

from warp_mca.base.errors import bad_value


def all_devices() -> list[str]:
    """Names of the devices of this machine."""
    wp.init()
    return [str(device) for device in wp.get_devices()]


def devices_named(name: str, known: Sequence[str] | None = None) -> list[str]:
    """The devices of that name: "cuda" stands for all GPUs.

    Args:
        name: as a user gives it.
        known: those of this machine, if another process has found them; None: this one starts the driver.

    Raises:
        RequestError: there is none.
    """
    known = known or all_devices()
    found = [device for device in known if device == name or (name == "cuda" and device.startswith("cuda:"))]
    if not found:
        raise bad_value("device", name, f"choose one of this machine: {', '.join(known)}")
    return found


def check_device(name: str) -> str:
    """The device of that name for work that takes one, the first of `devices_named`.

    Raises:
        RequestError: there is none.
    """
    return devices_named(name)[0]


def answers(name: str) -> bool:
    """Whether a device takes work: after a fault in a kernel or in the driver a GPU refuses all that a process asks."""
    try:
        wp.zeros(1, dtype=wp.int32, device=name).numpy()
    except Exception:
        return False
    return True
