"""Owns the count of floating-point operations of a step: instructions in the kernels' PTX.

Element kernels have no inner loops once compiled, so that an instruction runs once for each element; of branches
(plastic flow) both sides count. A fused multiply-add counts as two, conversions as none. The gather is left out.
"""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import warp as wp

from warp_mca.physics.elements import ELEMENTS
from warp_mca.scene.materials import Elastic, J2Bilinear

INSTRUCTION = re.compile(r"^\s*(?:@\S+\s+)?([a-z]+)(?:\.(?!f32|f64)\w+)*\.(f32|f64)\b", re.MULTILINE)
WORTH = {
    "fma": 2,
    "mul": 1,
    "add": 1,
    "sub": 1,
    "div": 1,
    "rcp": 1,
    "sqrt": 1,
    "rsqrt": 1,
    "neg": 1,
    "min": 1,
    "max": 1,
}
ARCH = 80


def count(kernel: Any) -> dict[str, int]:
    """Operations of one thread in float32 and float64."""
    found: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        wp.compile_aot_module(kernel.module, arch=ARCH, module_dir=folder, use_ptx=True)
        for path in Path(folder).glob("*.ptx"):
            entries = path.read_text(encoding="utf-8").split(".entry")
            for text in (e for e in entries[1:] if "cuda_kernel_forward" in e[:200]):
                for name, kind in INSTRUCTION.findall(text):
                    found[kind] += WORTH.get(name, 0)
    return {"f32": found["f32"], "f64": found["f64"]}


def flops(element: str, precision: str, plastic: bool, patches: bool) -> dict[str, int]:
    """Operations for each element and step, in float32 and float64; with `patches`, of the kernels of a GPU."""
    import importlib

    patches = patches and ELEMENTS[element].patches
    module = element.removesuffix("_mean") + ("_patch" if patches else "")
    kernels = importlib.import_module(f"warp_mca.kernels.elements.{module}")
    if hasattr(kernels, "kernels"):  # of elements that share a module
        kernels = kernels.kernels(element, ELEMENTS[element].mean)
    law = J2Bilinear.law if plastic else Elastic.law
    total: Counter[str] = Counter(count(kernels.force_kernel(precision, law)))
    if element == "tet4":
        total.update(count(kernels.dilatation_kernel(precision, False)))
    return dict(total)
