"""The loop around a controller's C: every number as with the same controller in Python."""

from __future__ import annotations

import copy
import math
import pickle

import numpy as np
import pytest
from former_cases import load_case
from laws_in_c import Counter, Spoken, needs_compiler

from models.operation import Scenario
from models.sensing import Controller, Measurement
from models.simulation import Simulation, SimulationOptions, prepare, run_simulation
from models.simulation.native_loop import NativeLoop
from synth.controllers import LinearFeedback, operated

CASE = load_case("subsea-crane").replace({"limits.stroke": [-8.0, 8.0]})
pytestmark = needs_compiler


class FromPython(Spoken):
    as_c = None  # type: ignore[assignment]


def gains() -> LinearFeedback:
    return LinearFeedback(CASE, {"A": 1.0, "a": 16.0, "a1": 44.0, "a2": 6.4})


def prepared(
    controller: Controller, scenario: Scenario | str = "hold", **options: object
) -> Simulation:
    return prepare(CASE, controller, scenario, SimulationOptions(duration=60.0, **options))  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", [0, 1])
def test_a_run_is_the_same_to_the_last_bit(seed: int) -> None:
    runs = [
        run_simulation(prepared(kind(gains())), seed=seed)
        for kind in (lambda c: c, FromPython, Spoken)
    ]
    for run in runs[1:]:
        assert run.values.tobytes() == runs[0].values.tobytes()
        assert run.statistics.value("payload rms") == runs[0].statistics.value("payload rms")
    assert math.isnan(runs[0].timings.controller_median)
    assert runs[2].timings.controller_median > 0.0


def test_statuses_events_and_commands_that_are_no_numbers_are_told_alike() -> None:
    scenario = Scenario(
        name="tried",
        description="in and out",
        duration=60.0,
        enabled=((2.0, 20.0), (22.0, math.inf)),
        resets=(30.0,),
        encoder_outages=((40.0, 40.3),),
    )
    static = prepared(gains()).rest.command
    in_c, in_python = Counter(static), Counter(static)
    in_python.as_c = None  # type: ignore[assignment, method-assign]
    runs = [run_simulation(prepared(operated(law, CASE), scenario)) for law in (in_c, in_python)]
    assert runs[0].values.tobytes() == runs[1].values.tobytes()
    assert runs[0].timings.statuses == runs[1].timings.statuses
    assert [str(e) for e in runs[0].events] == [str(e) for e in runs[1].events]
    bare = [run_simulation(prepared(law)) for law in (in_c, in_python)]
    assert bare[0].values.tobytes() == bare[1].values.tobytes()
    assert bare[0].timings.fallbacks == bare[1].timings.fallbacks == {"not a number": 28}
    assert [str(e) for e in bare[0].events] == [str(e) for e in bare[1].events]


def test_a_trip_ends_it_at_the_same_sample() -> None:
    class Runaway(Counter):
        def step(self, measurement: Measurement, time: float) -> float:
            return 5.0 * self._static

        def as_c(self, prefix: str):  # type: ignore[no-untyped-def]
            law = super().as_c(prefix)
            body = f"{{ (void)memory; (void)measured; return 5.0 * {self._static!r}; }}"
            name = f"double {prefix}_step({prefix}_memory *memory, const double *measured) "
            text = law.files[f"{prefix}.c"]
            start, end = text.index(name), text.index(f"int {prefix}_status")
            files = {**law.files, f"{prefix}.c": text[:start] + name + body + text[end:]}
            return copy.replace(law, files=files) if hasattr(copy, "replace") else _with(law, files)

    static = prepared(gains()).rest.command
    in_c, in_python = Runaway(static), Runaway(static)
    in_python.as_c = None  # type: ignore[assignment, method-assign]
    runs = [run_simulation(prepared(law)) for law in (in_c, in_python)]
    assert "stroke" in {event.kind for event in runs[0].events}
    assert runs[0].values.tobytes() == runs[1].values.tobytes()
    assert [str(e) for e in runs[0].events] == [str(e) for e in runs[1].events]


def test_python_is_asked_where_c_cannot_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(prepared(Spoken(gains())).kernels[0], NativeLoop)
    assert prepared(Spoken(gains())).fused
    assert not prepared(Spoken(gains()), compiled=False).fused
    assert not prepared(Spoken(gains()), deadline=1.0).fused
    monkeypatch.setenv("STILLHOOK_COMPILE", "0")
    assert not prepared(Spoken(gains())).fused


def test_a_prepared_simulation_runs_in_another_process() -> None:
    simulation = prepared(Spoken(gains()))
    again = pickle.loads(pickle.dumps(simulation.kernels[0]))
    state, rows = simulation.loop.initial, np.zeros((5, again._rows))
    p = np.array(list(simulation.loop.parameters.values()))
    for one, other in zip(
        again.run(state, rows, p), simulation.kernels[0].run(state, rows, p), strict=True
    ):
        assert one[..., :-1].tobytes() == other[..., :-1].tobytes()


def _with(law, files):  # type: ignore[no-untyped-def]
    from dataclasses import replace

    return replace(law, files=files)
