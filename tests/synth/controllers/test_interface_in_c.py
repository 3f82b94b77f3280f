"""The operator's interface around a law in C: as it is around the same law in Python."""

from __future__ import annotations

import numpy as np
import pytest
from former_cases import load_case
from laws_in_c import Compiled, Counter, Spoken, measurements, needs_compiler, played

from models.plant import MEAN_LOSSES, build_plant
from models.sensing import native_of
from synth.controllers import LinearFeedback, operated
from synth.structures import at_rest


@needs_compiler
@pytest.mark.parametrize("name", ["thesis-1975", "subsea-crane"])
def test_it_does_the_same_around_a_law_with_status_and_memory(name: str) -> None:
    case = load_case(name)
    rest = at_rest(build_plant(case).operating_point(MEAN_LOSSES))
    law = operated(Counter(rest["drive.applied"]), case, ramp=0.5, rate=0.2, slew=1e4)
    native = native_of(law, "outer")
    assert native is not None
    assert not native.commanded
    compiled, rows = Compiled(native), measurements(rest, 3000)
    commands, statuses = played(law, rows)
    found = np.array([(compiled.step(row), compiled.status) for row in rows], dtype=object)
    assert found[:, 0].astype(float).tobytes() == commands.tobytes()
    assert found[:, 1].tolist() == statuses
    assert {"limited", "blind", "blending", "held", "fallback", "stopping"} <= set(statuses)


def test_it_has_no_c_where_the_law_has_none() -> None:
    case = load_case("subsea-crane")

    class Silent(Spoken):
        as_c = None  # type: ignore[assignment]

    law = Silent(LinearFeedback(case, {"a": 1.0, "a1": 5.0, "a2": 3.0}))
    assert native_of(operated(law, case), "law") is None
