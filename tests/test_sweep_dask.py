"""Sweeps on a Dask cluster of worker processes, one of which is killed; skipped where `distributed` is missing."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from sweeping import SCENE, figures

from warp_mca.cli.main import main
from warp_mca.studies.sweep_lines import read_lines

distributed = pytest.importorskip("distributed", reason="the extra cluster is not installed")
COMMAND = ["sweep", "block.py", "--grid", "v=1,2,3", "--grid", "kills=nothing,worker", "--set", "duration=2e-6"]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "block.py").write_text(SCENE, encoding="utf-8")
    for flag in ("worker-1", "worker-3"):  # of three runs one kills its worker
        (tmp_path / flag).touch()
    return tmp_path


@pytest.fixture
def address(here: Path) -> Iterator[str]:
    """Of the scheduler of two worker processes."""
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "local_directory": str(here)}
    with distributed.LocalCluster(processes=True, **options) as cluster:
        yield cluster.scheduler_address.removeprefix("tcp://")


def test_a_killed_worker_of_a_cluster_loses_no_run(here: Path, address: str):
    assert main([*COMMAND, "--executor", f"dask://{address}", "--out", "all"]) == 0
    assert (here / "worker-2").exists()
    assert main([*COMMAND, "--workers", "1", "--out", "whole"]) == 0
    rows = read_lines(here / "all/sweep.csv")[0]
    assert [row["index"] for row in rows] == list(range(6))
    assert figures(rows) == figures(read_lines(here / "whole/sweep.csv")[0])


def test_a_scheduler_that_does_not_answer_is_named(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr("warp_mca.studies.sweep_workers.CONNECTING", "0.5s")
    assert main([*COMMAND, "--executor", "dask://127.0.0.1:9", "--out", "all"]) == 2
    assert "executor = 'dask://127.0.0.1:9': no Dask scheduler answers there" in capsys.readouterr().err
    assert not (here / "all").exists()
