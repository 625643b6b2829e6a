"""Renders a recorded USD file with Blender: `python -m benchmarks.blender FILE.usdc PICTURE.png [--frame N]`.

Needs bpy, Blender as a Python module, in an environment of its own (`pip install bpy`): it asks for another numpy.
Nothing is changed after the import: colours, edges, planes, camera, sun and sky are those of the file.
"""

from __future__ import annotations

import argparse
import os


def render(source: str, picture: str, frame: int, width: int, samples: int) -> None:
    """Import `source` and write what its camera sees at time code `frame` to `picture`, `width` pixels wide."""
    import bpy  # pyright: ignore[reportMissingImports]

    bpy.ops.wm.read_factory_settings()
    for item in list(bpy.data.objects):  # a cube, a camera and a light, which Blender starts with; its world stays
        bpy.data.objects.remove(item)
    bpy.ops.wm.usd_import(filepath=os.path.abspath(source))  # noqa: PTH100
    scene = bpy.context.scene
    scene.camera = next(item for item in bpy.data.objects if item.type == "CAMERA")
    scene.frame_set(frame)
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", samples
    scene.render.resolution_x, scene.render.resolution_y = width, width * 9 // 16
    scene.view_settings.view_transform = "Standard"  # colours as they are
    scene.render.filepath = os.path.abspath(picture)  # noqa: PTH100
    bpy.ops.render.render(write_still=True)


def main() -> None:
    """Render one picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source")
    parser.add_argument("picture")
    parser.add_argument("--frame", type=int, default=0)
    parser.add_argument("--width", type=int, default=960)
    parser.add_argument("--samples", type=int, default=32)
    args = parser.parse_args()
    render(args.source, args.picture, args.frame, args.width, args.samples)


if __name__ == "__main__":
    main()
