"""Owns the check for the device that a run asks for."""

from __future__ import annotations

import warp as wp

from warp_mca.base.errors import bad_value


def check_device(name: str) -> str:
    """The name of a device that this machine has.

    Raises:
        RequestError: there is no such device.
    """
    wp.init()
    known = [str(device) for device in wp.get_devices()]
    if name not in known:
        raise bad_value("device", name, f"this machine has {', '.join(known)}")
    return name
