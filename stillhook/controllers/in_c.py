"""Predictive controllers that know their C (`with_c`), for exports and the compiled simulation."""

from __future__ import annotations

import functools

from models.basics import InputError
from models.sensing import Controller, WithC, native_of


def with_c(controller: Controller) -> Controller:
    """Return linear predictive control that knows its C; any other controller as it is.

    What of its options has no C shows when that is asked for (`mpc.codegen.native_mpc`).
    """
    from mpc.linear import LinearMPC

    if not isinstance(controller, LinearMPC):
        return controller
    from mpc.codegen import native_mpc

    return WithC(controller, functools.partial(native_mpc, controller))


def with_c_if_any(controller: Controller) -> Controller:
    """Return `with_c`, but a controller whose options have no C as it is."""
    known = with_c(controller)
    if known is controller:
        return controller
    try:
        native_of(known, "law")
    except InputError:
        return controller
    return known
