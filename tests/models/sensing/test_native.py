"""A recursion as C: the same commands to the last bit, and nothing that is kept elsewhere."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from former_cases import load_case
from laws_in_c import Compiled, Spoken, measurements, needs_compiler, played

from models.basics import InputError
from models.plant import MEAN_LOSSES, build_plant
from models.sensing import WithC, function_as_c, native_of, recursion_as_c, recursion_of
from synth.controllers import ConstantTension, LinearFeedback, VelocityFeedForward, operated
from synth.structures import at_rest

MAKERS = {
    "feedback": lambda case: LinearFeedback(case, {"a": 1.0, "a1": 5.0, "a2": 3.0}),
    "feed-forward": VelocityFeedForward,
    "constant-tension": ConstantTension,
}


@needs_compiler
@pytest.mark.parametrize("name", ["thesis-1975", "subsea-crane"])
@pytest.mark.parametrize("kind", list(MAKERS))
def test_the_c_of_a_law_commands_the_same_to_the_last_bit(name: str, kind: str) -> None:
    case = load_case(name)
    law = operated(MAKERS[kind](case), case, rate=0.05, slew=500.0)
    native = native_of(law, "law")
    assert native is not None
    compiled = Compiled(native)
    rows = measurements(at_rest(build_plant(case).operating_point(MEAN_LOSSES)), 4000)
    commands, statuses = played(law, rows)
    found = np.array([(compiled.step(row), compiled.status) for row in rows], dtype=object)
    assert found[:, 0].astype(float).tobytes() == commands.tobytes()
    assert found[:, 1].tolist() == statuses
    assert {"limited", "blending", "held", "stopping", "braked"} <= set(statuses)
    assert len(np.unique(commands)) > 700


@needs_compiler
def test_the_memory_is_all_that_a_law_remembers() -> None:
    case = load_case("subsea-crane")
    law = operated(VelocityFeedForward(case), case)
    native = native_of(law, "law")
    assert native is not None
    compiled, rows = Compiled(native), measurements(at_rest(_rest(case)), 60)
    for row in rows[:30]:
        compiled.step(row)
    kept = compiled.memory.copy()
    first = [compiled.step(row) for row in rows[30:]]
    compiled.memory[:] = kept
    assert [compiled.step(row) for row in rows[30:]] == first
    compiled.reset()
    assert compiled.step(rows[0]) == played(law, rows[:1])[0][0]


@needs_compiler
def test_a_static_law_without_state_or_status_is_c_too() -> None:
    case = load_case("subsea-crane")
    law = LinearFeedback(case, {"a": 1.0, "a1": 5.0, "a2": 3.0})
    assert law.recursion.initial.size == 0
    compiled = Compiled(recursion_as_c(law.recursion, "bare"))
    rows = measurements(at_rest(_rest(case)), 50)
    found = np.array([compiled.step(row) for row in rows])
    assert found.tobytes() == played(law, rows)[0].tobytes()
    assert np.isnan(found).any()  # the law by itself has no guard against what is no number
    assert compiled.status == "engaged"


@pytest.mark.parametrize("prefix", ["Law", "1law", "a-b", "", "while", "é"])
def test_a_prefix_that_is_no_identifier_is_refused(prefix: str) -> None:
    law = LinearFeedback(load_case("subsea-crane"), {"a": 1.0, "a1": 5.0, "a2": 3.0})
    with pytest.raises(InputError, match="prefix must be up to 41 lower-case letters"):
        recursion_as_c(law.recursion, prefix)
    with pytest.raises(InputError, match="prefix must be"):
        native_of(Spoken(law), prefix)


def test_only_a_controller_that_knows_its_c_has_one() -> None:
    law = LinearFeedback(load_case("subsea-crane"), {"a": 1.0, "a1": 5.0, "a2": 3.0})

    class Silent(Spoken):
        as_c = None  # type: ignore[assignment]

    assert native_of(Silent(law), "law") is None
    with_c = WithC(Silent(law), lambda prefix: recursion_as_c(law.recursion, prefix))
    found = native_of(with_c, "other")
    assert found is not None
    assert found.prefix == "other"
    assert recursion_of(with_c) is None


def test_what_is_made_of_calls_is_not_written_out() -> None:
    x = ca.SX.sym("x", 3)
    once = ca.Function("once", [x], [ca.sin(x) + ca.cos(x) * ca.sin(2 * x)])
    y = ca.MX.sym("y", 3)
    many = y
    for _ in range(200):
        many = once(many)
    assert len(function_as_c(ca.Function("many", [y], [many]), "many").source) < 60_000


def _rest(case):  # type: ignore[no-untyped-def]
    return build_plant(case).operating_point(MEAN_LOSSES)
