"""Lets `python -m warp_mca` do what `warp-mca` does."""

import sys

from warp_mca.cli.main import main

sys.exit(main())
