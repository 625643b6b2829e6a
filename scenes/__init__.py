"""Built-in scenes, imported as `warp_mca.scenes`: one module each, with `PRESETS`, `build` and `check`."""
