"""Owns the command `tradeoff`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from warp_mca.base.errors import bad_value
from warp_mca.cli.request import read_request
from warp_mca.cli.warp_start import start_warp
from warp_mca.scene.model_file import SUFFIX

if TYPE_CHECKING:
    from warp_mca.accuracy.measure import Measured


def tradeoff(args: argparse.Namespace) -> None:
    """Run variants of a scene's model, and print what each costs in error."""
    from warp_mca.accuracy.files import FILES, as_json
    from warp_mca.accuracy.tradeoff import tradeoff as study
    from warp_mca.accuracy.worth import print_tradeoff

    if Path(args.scene).suffix == SUFFIX:
        raise bad_value("scene", args.scene, "a built model holds finished meshes; name a scene or a Python file")
    request = read_request(args)
    start_warp()
    found = study(
        request.scene,
        budget=args.budget,
        device=args.device,
        threads=args.threads,
        duration=args.duration,
        out=args.out,
        force=args.force,
        progress=_tell,
    )
    print_tradeoff(as_json(found))
    print("\nwrote " + ", ".join(str(args.out / name) for name in FILES))


def _tell(found: Measured, so_far: str) -> None:
    """A line for each run."""
    from warp_mca.accuracy.worth import words

    what = f"{found.trial.knob}: {words(found.trial.variant.knobs)}"
    figures = found.stopped or (
        f"{found.elements:,} elements, {found.steps:,} steps in {found.wall['fe']:.3g} s, "
        f"{found.wall['whole']:.3g} s in all"
    )
    print(f"[{so_far}] {what}: {figures}", flush=True)
