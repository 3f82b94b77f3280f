"""The one warning category: input that is legal but physically doubtful.

A sea steeper than breaking, a phase that looks like degrees, a spectrum that reaches beyond the
vessel's table: the run goes on, and the user is told.  A file of its own, so that every module
may import it at no cost and a user can filter on it.
"""

from __future__ import annotations


class PhysicsWarning(UserWarning):
    """The input is allowed but physically implausible, or a result leans on an assumption."""
