"""Owns what the device can do at best: kernels that only copy, or only multiply and add."""

from typing import Any

import warp as wp

from benchmarks.timing import Care, seconds_per_call

wp.set_module_options({"enable_backward": False})
CHAINS = 32  # sums that do not wait for each other; a vector, so that a CPU may use its wide registers
ROUNDS = 256


@wp.kernel(enable_backward=False)
def copy_floats(source: wp.array(dtype=wp.float32), target_out: wp.array(dtype=wp.float32)):
    i = wp.tid()
    target_out[i] = source[i]


@wp.kernel(enable_backward=False, grid_stride=False)
def copy_fours(source: wp.array(dtype=wp.vec4f), target_out: wp.array(dtype=wp.vec4f)):
    i = wp.tid()
    target_out[i] = source[i]


def fma_kernel(kind: Any) -> Any:
    """Kernel: ROUNDS times CHAINS multiply-adds in each thread."""
    chain = wp.types.vector(length=CHAINS, dtype=kind)

    @wp.kernel(enable_backward=False, module="unique")
    def multiply_add(factor: kind, rounds: int, sum_out: wp.array(dtype=kind)):
        i = wp.tid()
        sums = chain(kind(i))
        more = chain(factor)
        for _ in range(rounds):
            sums = factor * sums + more
        sum_out[i] = wp.dot(sums, more)

    return multiply_add


def ceilings(device: str, care: Care, small: bool = False) -> dict[str, float]:
    """Bytes copied each second, read and written ones counted, in the best of three ways, and operations each second
    in float32 and float64."""
    cuda = wp.get_device(device).is_cuda
    size = (1 << 28 if cuda else 1 << 25) >> (6 if small else 0)
    threads = (1 << 21 if cuda else 1 << 14) >> (6 if small else 0)
    found = {}
    with wp.ScopedDevice(device):
        source, target = wp.zeros(size, dtype=wp.float32), wp.zeros(size, dtype=wp.float32)

        fours = [wp.array(ptr=a.ptr, shape=size // 4, dtype=wp.vec4f, device=device) for a in (source, target)]
        ways = (
            lambda: wp.launch(copy_floats, size, inputs=[source], outputs=[target], device=device),
            lambda: wp.launch(copy_fours, size // 4, inputs=fours[:1], outputs=fours[1:], device=device),
            lambda: wp.copy(target, source),
        )
        found["bytes"] = 8.0 * size / min(seconds_per_call(copy, device, care) for copy in ways)
        for name, kind in (("f32", wp.float32), ("f64", wp.float64)):
            kernel, out = fma_kernel(kind), wp.zeros(threads, dtype=kind)

            def compute(kernel: Any = kernel, kind: Any = kind, out: wp.array = out) -> None:
                wp.launch(kernel, threads, inputs=[kind(0.5), ROUNDS], outputs=[out], device=device)

            found[name] = 2.0 * CHAINS * ROUNDS * threads / seconds_per_call(compute, device, care)
    line = ", ".join(f"{k} {v / 1e9:.1f} G/s" for k, v in found.items())
    print("ceiling", line, flush=True)
    return found
