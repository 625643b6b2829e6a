"""Owns the commands `build`, `scenes`, `view` and `verify`."""

from __future__ import annotations

import argparse
from pathlib import Path

import warp_mca as mca
from warp_mca.base.errors import bad_value
from warp_mca.cli.request import read_request
from warp_mca.cli.warp_start import start_warp
from warp_mca.scene import catalogue, model_file
from warp_mca.scene.model_file import SUFFIX


def build(args: argparse.Namespace) -> None:
    """Mesh a scene and store it as a model file."""
    from warp_mca.cli.console import print_quality

    target = model_file.check_path(args.output)
    if Path(args.scene).suffix == SUFFIX:
        raise bad_value("scene", args.scene, "this is a built model; name a built-in scene or a Python file")
    request = read_request(args)
    meshes = mca.mesh(request.scene)
    quality = mca.quality_table(request.scene, meshes)
    model_file.save(target, request.scene, meshes, request.origin)
    print_quality(quality)
    print(f"wrote {target}")


def scenes(args: argparse.Namespace) -> None:
    """List scenes with their presets and parameters."""
    from warp_mca.cli.console import print_scenes

    print_scenes([catalogue.load_source(name) for name in args.scene or catalogue.scene_names()])


def view(args: argparse.Namespace) -> None:
    """Open a recording in the rerun viewer."""
    from warp_mca.recorders import rerun_viewer

    rerun_viewer.view(args.recording)


def verify(args: argparse.Namespace) -> None:
    """Measure the engine against known answers."""
    from warp_mca.verify import runner

    start_warp()
    runner.verify(
        args.cases, device=args.device, precision=args.precision, element=args.element, level=args.level, out=args.out
    )
