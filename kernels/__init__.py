"""Warp kernels: thin wrappers over pure functions. Nothing here allocates; the host decides what to launch."""

import warp as wp

wp.config.log_level = wp.LOG_ERROR  # Warp's notes on devices and compilation would bury the run's own report
