"""What the winch does when the ground takes the load, as data.

The tension at the drum falls as the ground takes the load.  When it lacks a share of the load's
weight for some time, the winch stops doing what its controller wants.  `synth.controllers` has the
law (`touching_down`); here are its figures, of which a `Scenario` has one set.
"""

from dataclasses import dataclass

from ..basics import check_choice, check_range

MODES = ("release", "tension")


@dataclass(frozen=True, kw_only=True)
class TouchDown:
    """How a touch-down is noticed, and what follows.

    ``release`` pays out until the rope is slack enough for a drum that stands still, ``tension``
    keeps the rope taut for as long as the drive is engaged.

    Raises InputError if a figure is out of its range.
    """

    mode: str = "release"  #: ``release`` or ``tension``.
    #: Lack of tension that counts as a touch-down, over the load's weight [-].
    unloaded: float = 0.3
    unloaded_for: float = 0.2  #: For how long it must be lacking [s].
    kept_tension: float = (
        0.5  #: Tension that is kept, over the load's weight: as far from slack as from lifting [-].
    )
    slack: float = 2.0  #: Slack rope that is paid out [m].
    speed: float = 0.3  #: At which it is paid out [m/s].
    #: Set-point below which a lack of tension counts [m]: not before the load is to be landed.
    armed_below: float = 0.0

    def __post_init__(self) -> None:
        owner = "touch-down"
        check_choice(owner, "mode", self.mode, MODES)
        for name in ("unloaded", "kept_tension"):
            check_range(owner, name, getattr(self, name), low=0.0, high=1.0, open_low=True)
        check_range(owner, "unloaded_for", self.unloaded_for, low=0.0, high=60.0, unit="s")
        check_range(owner, "slack", self.slack, low=0.0, unit="m", open_low=True)
        check_range(owner, "speed", self.speed, low=0.0, high=20.0, unit="m/s", open_low=True)
        check_range(owner, "armed_below", self.armed_below, unit="m")
