"""Owns how commands of pages are carried out: by forks of one process, which has imported what they import.

Bash finds `warp-mca`, `python` and others in a folder of stand-ins. These hand their words, folder, variables and
streams to this process over a socket, and end with the status that it sends back. With processes of their own, each
command would take 2 s of a core until Warp is imported and a first figure drawn.
"""

from __future__ import annotations

import importlib
import json
import os
import runpy
import signal
import socket
import sys
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest
from undrawn import draw_nothing

IMPORTED = """
    gmsh h5py matplotlib.backends.backend_agg matplotlib.figure PIL.Image pxr.UsdGeom pxr.UsdLux pxr.UsdShade
    scipy.integrate scipy.signal scipy.sparse.csgraph warp warp_mca.accuracy.tradeoff warp_mca.cli.main
    warp_mca.paper.report warp_mca.recorders warp_mca.recorders.rerun_blueprint warp_mca.results.energy_figure
    warp_mca.results.force_figure warp_mca.results.path_figures warp_mca.phases.impact warp_mca.phases.simulate
    warp_mca.accuracy.simulation warp_mca.verify.runner
""".split()
STAND_IN = """\
#!{python} -IS
import json, os, socket, sys
words = [os.path.basename(sys.argv[0]), *sys.argv[1:]]
with socket.socket(socket.AF_UNIX) as server:
    server.connect({address!r})
    request = json.dumps([words, os.getcwd(), dict(os.environ)]).encode()
    socket.send_fds(server, [len(request).to_bytes(8, "big")], [0, 1, 2])
    server.sendall(request)
    status = server.recv(1)
sys.exit(status[0] if status else 70)
"""
Plan = Callable[[list[str]], tuple[list[str] | None, int]]


def write_stand_ins(folder: Path, names: Iterable[str], address: str) -> None:
    """Write the programs `names` into a new folder, for the server at `address`."""
    folder.mkdir()
    for name in names:
        file = folder / name
        file.write_text(STAND_IN.format(python=sys.executable, address=address), encoding="utf-8")
        file.chmod(0o755)


def serve(address: str, plan: Plan) -> None:
    """Carry out commands until this process is ended; prints a line when it is ready.

    Args:
        address: of the socket, a path.
        plan: gives for a command's words those to carry out, None for nothing, and the status that counts as success.
    """
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # so that nobody need wait for children
    _prepare()
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(address)
        listener.listen()
        print("ready", flush=True)
        while True:
            client, _ = listener.accept()
            if os.fork() == 0:
                listener.close()
                _answer(client, plan)
            client.close()


def _prepare() -> None:
    """Do what commands begin with; what they would wait for must not run in a thread, which a fork does not have."""
    for name in IMPORTED:
        importlib.import_module(name)
    import warp

    import warp_mca as mca
    from warp_mca.accuracy.knobs import one_at_a_time
    from warp_mca.recorders.rerun_viewer import load_rerun

    load_rerun()
    warp.config.log_level = warp.LOG_WARNING
    mca.run(mca.make_scene("two_link"), refine=0.35, duration=1e-6, device="cpu", threads=1)  # loads its kernels
    draw_nothing(pytest.MonkeyPatch())
    tradeoff = sys.modules["warp_mca.accuracy.tradeoff"]
    tradeoff.one_at_a_time = lambda scene: one_at_a_time(scene)[:2]  # variants


def _answer(client: socket.socket, plan: Plan) -> None:
    """Carry out the command of a client in this process, which ends with it."""
    head, streams, _, _ = socket.recv_fds(client, 8, 3)
    size, request = int.from_bytes(head, "big"), b""
    while len(request) < size:
        request += client.recv(size - len(request))
    words, folder, variables = json.loads(request)
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    sys.stdin, sys.stdout, sys.stderr = (open(k, "w" if k else "r", closefd=False) for k in range(3))  # noqa: SIM115
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(variables)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    status = 1
    try:
        asked, expected = plan(words)
        status = 0 if asked is None else _carry_out(asked)
        status = status if expected == 0 else int(status != expected)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        client.sendall(bytes([status]))
        os._exit(status)


def _carry_out(words: list[str]) -> int:
    """Carry out a command; its exit status."""
    try:
        if words[0] == "warp-mca":
            from warp_mca.cli.main import main

            sys.argv = words
            return main()
        if words[:2] == ["python", "-m"]:
            sys.argv = words[2:]
            runpy.run_module(words[2], run_name="__main__", alter_sys=True)
            return 0
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    print(f"{' '.join(words)}: tests cannot run this; list it in tests/page_commands.py", file=sys.stderr)
    return 127
