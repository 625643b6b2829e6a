"""Owns the options `--accuracy` and `--model` of the command `run`."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from warp_mca.base.errors import bad_value
from warp_mca.cli.request import SCALE, Request
from warp_mca.scene.catalogue import parse_overrides

if TYPE_CHECKING:
    from warp_mca.accuracy.request import Accuracy


def add_accuracy(parser: argparse._ArgumentGroup) -> None:
    """Add the options."""
    parser.add_argument(
        "--accuracy",
        metavar="SHARE",
        help="choose mesh, step and springs for this error, as 2%%, of first peak, impulse and duration",
    )
    parser.add_argument(
        "--model",
        choices=("auto", "full"),
        help="with --accuracy, full: bodies keep their masses and are modelled in full (default: auto)",
    )


def accuracy_asked(args: argparse.Namespace, request: Request) -> Accuracy | None:
    """The accuracy that the command asks for, with the values that it sets itself; None without `--accuracy`.

    Raises:
        RequestError: it is no share, or options contradict each other.
    """
    from warp_mca.accuracy.request import Accuracy, accuracy_of

    if args.accuracy is None:
        if args.model is not None:
            raise bad_value("--model", args.model, "it says what --accuracy may choose; give both")
        return None
    if request.meshes is not None:
        raise bad_value("--accuracy", args.accuracy, "a model file holds finished meshes; name the scene itself")
    given = parse_overrides(args.settings)
    typed = {name: request.scene.parameters[name] for name in given}
    options = {"refine": args.refine, "mass_scaling": args.mass_scaling, "multi_rate": args.multi_rate}
    options["element"], options[SCALE] = args.element, args.time_step_scale
    asked = Accuracy(share=accuracy_of(args.accuracy).share, typed=typed, full=args.model == "full")
    return asked.keeping(**options)
