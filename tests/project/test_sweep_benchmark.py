"""The benchmark of sweeps compares like with like: its peer's loops are ours."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from models import load_case
from synth import evaluate_gains
from synth.sweeps import FrequencyEngine

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def benchmark_of_sweeps() -> ModuleType:
    pytest.importorskip("control")
    sys.path.insert(0, str(FOLDER))
    try:
        import sweep

        return sweep
    finally:
        sys.path.remove(str(FOLDER))


def test_python_control_finds_the_same_numbers(benchmark_of_sweeps: ModuleType) -> None:
    module = benchmark_of_sweeps
    design = evaluate_gains(load_case("thesis-1975"), module.THESIS)
    engine = FrequencyEngine(design, module.SPRING, metrics=["payload_rms"])
    peer = module.PythonControl(engine)
    rows = engine.spread.sample(12, seed=1)
    found = engine.evaluate(rows)
    for k, row in enumerate(rows):
        stable, rms = peer.written_out(row)
        assert stable == bool(found["stable"][k])
        assert found["payload_rms"][k] == pytest.approx(rms, rel=1e-10)
    assert module.disagreement(engine, peer, rows) < module.AGREE
    # It would tell if they were not the same.
    peer.weight = 1.001 * peer.weight
    assert module.disagreement(engine, peer, rows) == pytest.approx(0.0005, rel=0.01)


def test_table_goes_into_the_page_and_the_file(
    benchmark_of_sweeps: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = benchmark_of_sweeps
    page, data = tmp_path / "page.md", tmp_path / "sweep.csv"
    page.write_text(f"before\n{module.BEGIN}\nold\n{module.END}\nafter\n", encoding="utf-8")
    monkeypatch.setattr(module, "PAGE", page)
    monkeypatch.setattr(module, "DATA", data)
    rows = [module.Row(what="one", cases=1000, seconds=2.5, runs=3)]
    told = {"faster": 600.0, "faster_written_out": 9.0, "disagreement": 1e-9, "memory_10": 3.0}
    module.write(rows, {**told, "nodes": 200, "combined": 1.5})
    text = page.read_text(encoding="utf-8")
    assert "| one | 1,000 | 2.5 | 2,500 |" in text
    assert "old" not in text
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert data.read_text(encoding="utf-8").splitlines()[2] == "one,1000,3,2.5,2500"
    assert np.isfinite(rows[0].each)
