"""How far the time of a step moves with where its arrays lie: `python -m benchmarks.placement [--device cuda:0]`.

Times one row of the page on performance again and again, each time with another amount of memory allocated before the
solver. Checkouts are compared by what each one's own copy gives: a single placement may differ by 2 %.
"""

from __future__ import annotations

import argparse
import statistics

import warp as wp

from benchmarks.blocks import RATES, SIZES, Held, assemble
from benchmarks.rates import step_seconds
from benchmarks.timing import Care
from warp_mca.physics.elements import ELEMENTS

AMOUNTS = (0.0, 0.3, 0.7, 1.1, 1.9, 2.6, 3.3, 5.1, 7.7, 11.3)  # allocated before [MB]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.placement", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--element", default="tet4", choices=list(ELEMENTS))
    parser.add_argument("--size", default="159k", choices=list(SIZES))
    parser.add_argument("--case", default="plastic, all yield", choices=list(RATES))
    parser.add_argument("--precision", default="float64", choices=["mixed", "float64"])
    args = parser.parse_args()
    wp.config.quiet = True
    model, times = assemble(args.element, SIZES[args.size]), []
    for amount in AMOUNTS:
        before = wp.zeros(1 + int(1e6 * amount), dtype=wp.uint8, device=args.device)
        held = Held(model, RATES[args.case], args.device, args.precision)
        times.append(1e6 * step_seconds(held, Care(0.05, 5)))
        print(f"{amount:5.1f} MB before: {times[-1]:8.2f} us a step", flush=True)
        del before, held
    print(f"median {statistics.median(times):.2f}, {min(times):.2f} to {max(times):.2f} us")


if __name__ == "__main__":
    main()
