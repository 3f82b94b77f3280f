"""Predictive controllers that know their C (`with_c`), for exports and the compiled simulation."""

from __future__ import annotations

import functools

from models.sensing import Controller, WithC


def with_c(controller: Controller) -> Controller:
    """Return linear predictive control that knows its C; any other controller as it is.

    What of its options has no C shows when that is asked for (`mpc.codegen.native_mpc`).
    """
    from mpc.linear import LinearMPC

    if not isinstance(controller, LinearMPC):
        return controller
    from mpc.codegen import native_mpc

    return WithC(controller, functools.partial(native_mpc, controller))
