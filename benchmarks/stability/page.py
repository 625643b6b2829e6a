"""Owns the page."""

from __future__ import annotations
from benchmarks.stability.measure import wrong


def line(found):
    where = f"{found['axis']} {found['value']} {found['element']} {found['precision']}"
    if "error" in found:
        mark = "WRONG " if wrong(found) else "" if found["within"] else "out "
        said = " | ".join(text[:70] for text in found["said"])
        return f"{where}: {found['status']} {mark}{found['figure']} {found['error']:.2%} (of {found['tolerance']:.2%}) {found['steps']} {found['wall']} s {said}"
    return f"{where}: {found['status']} {found['wall']} s {found['said'][0][:120]}"


def write_page(a, b):
    pass
