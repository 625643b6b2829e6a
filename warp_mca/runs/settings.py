"""Owns how scenes are run: device, precision, threads."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """How scenes are run.

    Attributes:
        device: "cpu" or a CUDA device.
        precision: "mixed" or "float64".
        threads: of a run on the CPU.
    """

    device: str
    precision: str
    threads: int


def settings_of(device: str, precision: str, threads: int | None) -> Settings:
    """Settings as the user gave them; all cores if `threads` is None.

    Raises:
        RequestError: there is no such device, or no such number of threads.
    """
    from warp_mca.solve.device import check_device
    from warp_mca.solve.threads import thread_count

    return Settings(check_device(device), precision, thread_count(threads))
