"""What every structure promises the search: one controller, said three times, with exact slopes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pytest
from designs import PERFECT_CELL, PERFECT_MRU
from former_cases import load_case
from loop_numbers import FloatArray, double_integrator, two_carts, with_full_state
from scipy.stats import qmc

from models.plant import LinearPlant
from synth.loop import Dual, closed_loop_matrix
from synth.question import pose
from synth.structures import (
    Fixed,
    LowOrder,
    ParametrisedController,
    PayloadFeedback,
    StaticGain,
    structure_names,
)

OMEGA = np.geomspace(0.05, 30.0, 11)
DIRECT = double_integrator(C=[[0.0, -0.1]], D=[[1.0]])  # a direct term, as of an accelerometer


def payload_plant() -> LinearPlant:
    """Order of the measurements is not the structure's."""
    return LinearPlant(
        A=[[0.0, 1.0], [-1.0, -0.1]],
        B=[[0.0], [1.0]],
        E=[[0.0], [1.0]],
        C=[[1.0, 0.0], [-1.0, -0.1], [0.0, 1.0]],
        D=[[0.0], [1.0], [0.0]],
        measurements=("payload.displacement", "payload.acceleration", "payload.velocity"),
        inputs=("drive.command",),
    )


PLAIN = {
    "static gain": (StaticGain(), with_full_state(two_carts(2))),
    "masked": (StaticGain(mask=((True, False), (True, True))), two_carts(2)),
    "direct": (StaticGain(), DIRECT),
    "payload feedback": (PayloadFeedback(amplifier=7.0), payload_plant()),
    "order 1": (LowOrder(1), two_carts()),
    "order 2": (LowOrder(2, proper=True), DIRECT),
    "order 3": (LowOrder(3, stable=True), two_carts(2)),
    "order 4": (LowOrder(4, proper=True), two_carts(2)),
    "held": (
        Fixed(structure=LowOrder(3, proper=True), values={"alpha1[1]": 0.7, "D[u2,y1]": 0.0}),
        two_carts(2),
    ),
}
WINCH = [(name, case) for name in structure_names() for case in ("subsea-crane", "thesis-1975")]


def draws(law: ParametrisedController, plant: LinearPlant) -> Iterator[FloatArray]:
    points = qmc.Sobol(law.dimensions, seed=3).random_base2(3)
    yield from law.draw(points, OMEGA, plant.response_at((1e-3 + 1j) * OMEGA).yu)[2:6]


def entries(law: ParametrisedController, values: Sequence[object], s: np.ndarray) -> list[object]:
    found = law.response(values, s)
    names = law.controller([float(np.ravel(getattr(v, "value", v))[0]) for v in values])
    assert [len(found), len(found[0])] == [len(names.inputs), len(names.measurements)]
    return [entry for line in found for entry in line]


def keeps_the_contract(law: ParametrisedController, plant: LinearPlant) -> None:
    s, unit = 1j * OMEGA, np.eye(len(law.parameters))
    scales = np.array([p.scale for p in law.parameters])
    for values in draws(law, plant):
        controller = law.controller(list(values))
        exact = controller.response_at(s).reshape(OMEGA.size, -1).T
        size = np.abs(exact).max(axis=1) + 1e-300
        for entry, wanted, most in zip(entries(law, list(values), s), exact, size, strict=True):
            assert np.broadcast_to(entry, OMEGA.shape) == pytest.approx(wanted, abs=1e-9 * most)
        # many candidates at once, as the screening has them
        many = law.response([np.array([[v], [v]]) for v in values], s)
        flat = [np.broadcast_to(entry, (2, OMEGA.size)) for line in many for entry in line]
        assert np.array(flat)[:, 1] == pytest.approx(exact, abs=1e-9 * size.max())
        # slopes against central differences of the state space
        duals = [Dual(np.array([v]), unit[:, [k]]) for k, v in enumerate(values)]
        found = entries(law, duals, s)
        for k in range(len(values)):
            step = 1e-5 * max(abs(values[k]), 1e-3 * scales[k])
            ends = [
                law.controller(list(values + sign * step * unit[k])).response_at(s)
                for sign in (1.0, -1.0)
            ]
            slopes = ((ends[0] - ends[1]) / (2.0 * step)).reshape(OMEGA.size, -1).T
            for entry, wanted, most in zip(found, slopes, size, strict=True):
                mine = entry.slope[k] if isinstance(entry, Dual) else 0.0
                tolerance = 1e-6 * np.abs(wanted).max() + 1e-9 * most / step
                assert np.broadcast_to(mine, OMEGA.shape) == pytest.approx(wanted, abs=tolerance)
        # A quick matrix may leave out what no loop goes through, but no pole that is unstable.
        rational = plant.without_delays(4)
        whole = closed_loop_matrix(rational, controller)
        quick = law.closed_loop_matrix(rational, list(values))
        general, found_poles = np.linalg.eigvals(whole), np.linalg.eigvals(quick)
        near = 1e-4 * np.abs(general) + 1e-8 * np.abs(general).max() + 1e-9
        apart = np.abs(general[:, None] - found_poles)
        assert np.all(apart.min(axis=0) <= near[apart.argmin(axis=0)])
        assert np.all(apart.min(axis=1)[general.real > near] <= near[general.real > near])
        if quick.shape == whole.shape:
            size = np.linalg.norm(whole)
            assert np.trace(quick) == pytest.approx(np.trace(whole), abs=1e-9 * size)
            squares = np.trace(quick @ quick), np.trace(whole @ whole)
            assert squares[0] == pytest.approx(squares[1], abs=1e-9 * size**2)


@pytest.mark.parametrize("name", PLAIN)
def test_plain_structure_keeps_the_contract(name: str) -> None:
    structure, plant = PLAIN[name]
    keeps_the_contract(structure.bind(plant), plant)


@pytest.mark.parametrize(("name", "case"), WINCH)
def test_winch_structure_keeps_the_contract(name: str, case: str) -> None:
    sensors = {**PERFECT_MRU, **PERFECT_CELL} if case == "thesis-1975" else {}
    posed = pose(load_case(case).replace(sensors), name)
    keeps_the_contract(posed.law, posed.plant)


def test_broken_structure_is_found() -> None:
    class Wrong(type(StaticGain().bind(DIRECT))):  # type: ignore[misc]
        def response(self, values, s):
            return [[value * 1.001 for value in line] for line in super().response(values, s)]

    law = StaticGain().bind(DIRECT)
    law.__class__ = Wrong
    with pytest.raises(AssertionError):
        keeps_the_contract(law, DIRECT)
