"""Owns how threads of a CPU compute a program together: stages of captured graphs, each after the one before it.

The graphs of a stage are shared out: each thread takes its own first, whose data its cache may hold, then those of
others ("work stealing"; Blumofe and Leiserson 1999). No stage waits for a thread that computes nothing at present, so
that one that the system holds up delays no more than the graph that it is in. All is done without the interpreter: a
stage of a small model takes less time than to pass one task between Python's threads.

The board is an int64 array of what threads tell each other, each number in a line of the cache of its own. Its counts
only grow, so that a thread that comes late sees that a stage is over.
"""

import warp as wp

from warp_mca.kernels.hardware.subnormals import flush, set_mode

LINE = 16  # numbers from one entry of the board to the next; the cache fetches lines in pairs
STAGE, DONE, JOB, PROGRAM, FIRST, END, BASE, READY, STOPPED, FAILED, CLAIMS = (LINE * k for k in range(11))

_TURNS, _YIELDS = 200, 8000  # waits that keep the core, and those that leave it to others, before a thread sleeps
_LONGEST = 400  # sleeps that grow, up to 10 ms
_PART = wp.constant(wp.int64(1 << 20))  # of a claim: the stage is above it, the number of graphs taken below


@wp.func_native("return __atomic_load_n(&board.data[place], __ATOMIC_ACQUIRE);")
def load(board: wp.array(dtype=wp.int64), place: wp.int32) -> wp.int64:
    """The number at a place of the board."""
    ...


@wp.func_native("__atomic_store_n(&board_out.data[place], value, __ATOMIC_RELEASE);")
def store(board_out: wp.array(dtype=wp.int64), place: wp.int32, value: wp.int64):
    """Write to a place of the board."""
    ...


@wp.func_native("return __atomic_add_fetch(&board_out.data[place], value, __ATOMIC_ACQ_REL);")
def add(board_out: wp.array(dtype=wp.int64), place: wp.int32, value: wp.int64) -> wp.int64:
    """The sum, which is written to the board."""
    ...


@wp.func_native("""
    return __atomic_compare_exchange_n(&board_out.data[place], &old, value, false, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE);
""")
def replace(board_out: wp.array(dtype=wp.int64), place: wp.int32, old: wp.int64, value: wp.int64) -> bool:
    """Write to a place of the board that holds `old`. Returns whether it did."""
    ...


@wp.func_native("return ((const wp::int64*)address)[index];")
def entry(address: wp.int64, index: wp.int64) -> wp.int64:
    """Number of an int64 array at an address."""
    ...


@wp.func_native("return ((bool (*)(void*))function)((void*)graph);")
def replay(function: wp.int64, graph: wp.int64) -> bool:
    """Replay a captured graph by Warp's function for it. Returns whether that succeeded."""
    ...


@wp.func_native(f"""
    extern int yield_core() __asm__("sched_yield");
    extern int sleep_for(unsigned) __asm__("usleep");
    if (waited < {_TURNS}) {{
    #if defined(__x86_64__)
        __builtin_ia32_pause();
    #endif
    }} else if (waited < {_YIELDS})
        yield_core();
    else {{
        const unsigned sleeps = waited - {_YIELDS} < {_LONGEST} ? waited - {_YIELDS} : {_LONGEST};
        sleep_for(sleeps * sleeps / 16);  // microseconds
    }}
""")
def wait(waited: wp.int32):
    """Wait for others once more, after so many times."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return atomicAdd(&count_out.data[f], 1);
#else
    return __atomic_fetch_add(&count_out.data[f], 1, __ATOMIC_RELAXED);
#endif
""")
def count_one(f: wp.int32, count_out: wp.array(dtype=wp.int32)) -> wp.int32:
    """Add 1 to entry f, which other threads of any device may do at the same time; returns what it was."""
    ...


@wp.func
def claim(board_out: wp.array(dtype=wp.int64), stage: wp.int64, owner: int, count: wp.int64) -> wp.int64:
    """Which of the `count` graphs of an owner in this stage is this thread's to replay; -1 if none is left."""
    found = wp.int64(-1)
    place = CLAIMS + LINE * owner
    tries = count > wp.int64(0)
    while tries:
        old = load(board_out, place)
        claimed = wp.where(old / _PART == stage, old % _PART, wp.int64(0))
        tries = old / _PART <= stage and claimed < count
        if tries:
            if replace(board_out, place, old, stage * _PART + claimed + wp.int64(1)):
                found = claimed
                tries = bool(False)
    return found


@wp.func
def take_part(
    me: int,
    threads: int,
    function: wp.int64,
    program: wp.int64,
    first: wp.int64,
    end: wp.int64,
    base: wp.int64,
    board_out: wp.array(dtype=wp.int64),
):
    """Compute a program's stages from number `first` of all to `end`, when `base` graphs had been replayed before."""
    stages, one, all_threads = entry(program, wp.int64(0)), wp.int64(1), wp.int64(threads)
    stage = load(board_out, STAGE)
    while stage < end:
        turn, k = (stage - first) / stages, (stage - first) % stages
        begin = entry(program, one + k)
        count = entry(program, wp.int64(2) + k) - begin
        found = wp.int64(-1)
        for j in range(threads):
            if found < wp.int64(0):
                owner = (me + j) % threads
                low = count * wp.int64(owner) / all_threads
                own = claim(board_out, stage, owner, count * wp.int64(owner + 1) / all_threads - low)
                found = wp.where(own < wp.int64(0), own, low + own)
        if found >= wp.int64(0):
            if not replay(function, entry(program, wp.int64(2) + stages + begin + found)):
                store(board_out, FAILED, one)
            done = base + turn * entry(program, one + stages) + begin + count
            if add(board_out, DONE, one) == done:
                store(board_out, STAGE, stage + one)
        else:
            waited = int(0)
            while load(board_out, STAGE) == stage and load(board_out, STOPPED) == wp.int64(0):
                wait(waited)
                waited += 1
        stage = wp.where(load(board_out, STOPPED) == wp.int64(0), load(board_out, STAGE), end)


@wp.kernel(enable_backward=False, grid_stride=False)
def lead(threads: int, function: wp.int64, program: wp.int64, repeats: wp.int64, board_out: wp.array(dtype=wp.int64)):
    """Compute a program so many times, with the threads that `serve`; subnormal numbers count as zero meanwhile."""
    first, base = load(board_out, STAGE), load(board_out, DONE)
    end = first + repeats * entry(program, wp.int64(0))
    job = add(board_out, JOB, wp.int64(1))  # odd while the rest is written
    store(board_out, PROGRAM, program)
    store(board_out, FIRST, first)
    store(board_out, END, end)
    store(board_out, BASE, base)
    store(board_out, JOB, job + wp.int64(1))
    before = flush()
    take_part(0, threads, function, program, first, end, base, board_out)
    set_mode(before)


@wp.kernel(enable_backward=False, grid_stride=False)
def serve(me: int, threads: int, function: wp.int64, board_out: wp.array(dtype=wp.int64)):
    """Help the thread that leads until the board says that it is over."""
    flush()
    known, waited = wp.int64(0), int(0)
    add(board_out, READY, wp.int64(1))
    while load(board_out, STOPPED) == wp.int64(0):
        job = load(board_out, JOB)
        if job == known or job % wp.int64(2) == wp.int64(1):
            wait(waited)
            waited += 1
        else:
            program, first = load(board_out, PROGRAM), load(board_out, FIRST)
            end, base = load(board_out, END), load(board_out, BASE)
            if load(board_out, JOB) == job:  # else it is another one by now
                take_part(me, threads, function, program, first, end, base, board_out)
                known = job
                waited = int(0)
