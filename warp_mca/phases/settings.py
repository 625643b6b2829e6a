"""Owns how scenes are run: device, precision, threads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from warp_mca.phases.rate_groups import MultiRate, check_multi_rate


@dataclass(frozen=True)
class Settings:
    """How scenes are run.

    Attributes:
        device: "cpu" or a CUDA device.
        precision: "mixed" or "float64".
        threads: CPU threads to use.
        multi_rate: groups of elements with steps of their own, see `runs.rate_groups`; None for one rate.
    """

    device: str
    precision: str
    threads: int
    multi_rate: MultiRate = None

    @property
    def solver(self) -> dict[str, Any]:
        """Arguments that an `Impact` takes."""
        return {"device": self.device, "precision": self.precision, "threads": self.threads}


def settings_of(device: str, precision: str, threads: int | None, multi_rate: object = None) -> Settings:
    """Settings as the user gave them; all cores if `threads` is None.

    Raises:
        RequestError: there is no such device, or no such number of threads or rates.
    """
    from warp_mca.step.device import check_device
    from warp_mca.system.threads import thread_count

    return Settings(check_device(device), precision, thread_count(threads), check_multi_rate(multi_rate))
