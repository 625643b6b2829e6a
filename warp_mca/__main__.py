"""Lets `python -m warp_mca` do what `warp-mca` does."""

import sys

from warp_mca.cli import main

sys.exit(main())
