"""Shows pyright where warp_mca.kernels and warp_mca.scenes are, by links: it does not know setuptools' package-dir."""
