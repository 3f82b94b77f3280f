"""`Verification` and its `Check`s: each claimed figure beside the one found.

`synth.verify.verify` makes these; a `Design` and a `Tuning` hand them to the user.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Check:
    """One figure, looked at a second time."""

    name: str  #: What was checked, as a dotted path.
    ok: bool  #: Whether it holds.
    #: The figure that was claimed and the one found; None where there is no such figure.
    claimed: float | None = None
    found: float | None = None
    tolerance: float = 0.0  #: Allowed relative difference, or excess over a bound.
    note: str = ""  #: By which route, and what else there is to say.
    #: Whether `Verification.ok` hangs on it; a check that does not is for information.
    counts: bool = True

    def __str__(self) -> str:
        """Return one line."""
        mark = "ok " if self.ok else ("BAD" if self.counts else "but")
        parts = [f"{mark} {self.name}"]
        if self.claimed is not None:
            parts.append(f"claimed {self.claimed:.6g}")
        if self.found is not None:
            parts.append(f"found {self.found:.6g}")
        line = ", ".join(parts) if len(parts) == 1 else f"{parts[0]}: {', '.join(parts[1:])}"
        return f"{line} ({self.note})" if self.note else line


@dataclass(frozen=True, kw_only=True)
class Verification:
    """The outcome of all checks."""

    ok: bool  #: Whether every check that counts holds.
    status: str  #: The sentence for the user.
    checks: tuple[Check, ...]  #: The checks in the order they were made.

    @classmethod
    def of(cls, checks: Sequence[Check], praise: str) -> Verification:
        """Return the verification that checks amount to; `praise` is its status if all hold."""
        broken = [check for check in checks if check.counts and not check.ok]
        remarks = [check.note for check in checks if not check.counts and not check.ok]
        if not checks:
            status = "nothing was checked"
        elif broken:
            first = broken[0]
            figures = [
                f"{label} {value:.6g}"
                for label, value in (("claimed", first.claimed), ("found", first.found))
                if value is not None
            ]
            said = "; ".join([", ".join(figures), first.note] if first.note else figures)
            status = f"the check of {first.name} failed: {said.removeprefix('; ')}"
            if len(broken) > 1:
                status += f" (and {len(broken) - 1} more: {', '.join(c.name for c in broken[1:])})"
        else:
            status = "; ".join([praise, *remarks])
        return cls(ok=bool(checks) and not broken, status=status, checks=tuple(checks))

    def __getitem__(self, name: str) -> Check:
        """Return the check of that name.

        Raises KeyError if there is none.
        """
        for check in self.checks:
            if check.name == name:
                return check
        raise KeyError(name)

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the checks that count and do not hold."""
        return tuple(check.name for check in self.checks if check.counts and not check.ok)

    def __str__(self) -> str:
        """Return a small tree."""
        lines = [f"Verification: {self.status}"]
        for check in self.checks:
            lines.append(f"{'└' if check is self.checks[-1] else '├'} {check}")
        return "\n".join(lines)


def agreement(
    name: str, claimed: float, found: float, tolerance: float, note: str = "", scale: float = 0.0
) -> Check:
    """Return the check that two figures agree to a relative tolerance; infinities may match.

    `scale` is a size below which differences are measured against it instead.
    """
    if math.isinf(claimed) or math.isinf(found):
        same = claimed == found
    else:
        same = abs(found - claimed) <= tolerance * max(abs(claimed), scale)
    return Check(
        name=name, ok=bool(same), claimed=claimed, found=found, tolerance=tolerance, note=note
    )


def bounded(
    name: str, bound: float, found: float, tolerance: float, note: str = "", at_least: bool = False
) -> Check:
    """Return the check that a figure keeps a bound, to a relative tolerance."""
    room = tolerance * abs(bound) if math.isfinite(bound) else 0.0
    keeps = found >= bound - room if at_least else found <= bound + room
    return Check(
        name=name, ok=bool(keeps), claimed=bound, found=found, tolerance=tolerance, note=note
    )


def failure(name: str, note: str) -> Check:
    """Return a failed check without figures."""
    return Check(name=name, ok=False, note=note)
