"""What the filter, its gate and the drive's window know, as tables for the C."""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from models.basics import FloatArray
from models.plant import MEASUREMENTS
from models.sensing import HEARD, MEASURED

from ..linear import LinearMPC
from ..winch import WinchEstimator
from .tables import Tables


def add_estimator(tables: Tables, controller: LinearMPC) -> None:
    """Add estimator, filter and gate."""
    e = controller.estimator
    model, winch = e.model, e.model.winch
    for name in HEARD:
        tables.size(name.upper().replace(".", "_"), HEARD.index(name))
    tables.size("N", model.size)
    tables.size("NX", winch.size)
    tables.size("NY", len(MEASURED))
    tables.size("NS", model.sea.order)
    tables.size("SEA", model.sea_at.start)
    tables.size("WAITING", winch.waiting)
    tables.constant("SAMPLE_TIME", winch.sample_time)
    for name in ("gain", "back", "rest_command", "rest_torque", "rest_tension"):
        tables.constant(name.upper(), getattr(winch, name))
    quadratic = winch.data.quadratic_drag
    tables.constant("QUADRATIC_DRAG", quadratic)
    tables.constant("LINEAR_DRAG", winch.drag)
    tables.constant("HIGHEST_VELOCITY", math.sqrt(winch.data.hung_weight / max(quadratic, 1.0)))
    tables.constant("USUAL_AGE", e._usual)
    tables.constant("AGE_SLACK", e._slack)
    tables.constant("OLDEST", e._oldest)
    for name, values in {
        "rows": e._rows,
        "B": e._B,
        "force": e._force,
        "cut": e._cut,
        "velocity": e._velocity,
        "reckoned": e._speed,
        "rest": e._rest,
        "felt": e._felt,
        "usual_share": e._usual_share,
        "delays": e._delays,
        "now": model.now[: len(MEASUREMENTS)],
        "hook": controller._shows,
    }.items():
        tables.array(name, values)
    tables.whole("register_at", [model.first[name] for name in MEASUREMENTS])
    tables.whole("register_depth", [model.depth[name] for name in MEASUREMENTS])
    _add_filter(tables, e)
    gate = e.gate
    tables.constant("GATE_ROW", gate._row)
    for name, values in {
        "per_drum": gate._per_drum,
        "per_rate": gate._per_rate,
        "gate_values": gate._values,
        "gate_rates": gate._rates,
        "gate_bent": gate._bent,
        "held": gate._held,
    }.items():
        tables.array(name, values)


def _add_filter(tables: Tables, e: WinchEstimator) -> None:
    """Add gains and covariances; sets of signals are numbers with a bit for each signal."""
    for name, values in {
        "unit_A": e._A,
        "unit_C": e._C,
        "unit": e._unit,
        "back": e._back,
        "Q": e._Q,
        "P0": e._P0,
        "start": e._start,
        "R": e._R,
        "first_gains": np.array(e._first),
    }.items():
        tables.array(name, values)
    tables.size("FIRST", len(e._first))
    sets = list(e._added)
    noises: list[FloatArray] = [e._Q]
    noise_of = []
    for key in sets:
        same = [k for k, noise in enumerate(noises) if np.array_equal(noise, e._added[key])]
        if not same:
            noises.append(e._added[key])
        noise_of.append(same[0] if same else len(noises) - 1)
    steady = [key for key in sets if key in e._steady]
    of = {key: k for k, key in enumerate(sets)}
    every = product((False, True), repeat=len(MEASURED))  # the last signal changes first
    tables.whole("set_of", [of.get(np.array(bits[::-1]).tobytes(), -1) for bits in every])
    tables.whole("noise_of", noise_of)
    tables.whole("steady_of", [steady.index(key) if key in e._steady else -1 for key in sets])
    tables.array("noise", np.array(noises))
    tables.array("steady_P", np.array([e._steady[key][0] for key in steady]))
    tables.array("steady_gain", np.array([e._steady[key][1] for key in steady]))


def add_drive(tables: Tables, controller: LinearMPC) -> None:
    """Add the drive's window, the motor's inertia and its temperature."""
    window, inertia = controller.window, controller.inertia
    told = window._told
    for name, value in {
        "UNIT": controller.programme.unit,
        "TOLD_PEAK": window._peak,
        "TOLD_POWER": told.power,
        "TOLD_BREAKDOWN": told.breakdown,
        "TOLD_SPEED": told.speed,
        "FULL_POWER": window._full,
        "VOLTAGE": window.voltage,
        "FALL": window.fall,
        "KEPT": inertia._kept,
        "SMOOTH": inertia._new,
        "BY_CHANGE": inertia._by_change,
        "BY_RISE": inertia._by_rise,
        "PRIOR": inertia._prior,
        "INERTIA": inertia._winch.data.inertia,
    }.items():
        tables.constant(name, value)
    budget = controller._budget
    tables.size("THERMAL", budget is not None)
    for name, value in {
        "RATED": 1.0 if budget is None else budget._rated,
        "THERMAL_SHARE": 1.0 if budget is None else budget._share,
        "THERMAL_AHEAD": 1.0 if budget is None else budget._ahead,
        "THERMAL_LEAST": 1.0 if budget is None else budget._least,
    }.items():
        tables.constant(name, value)
