"""What each limit is, in a sentence, for the page's list of limits.

Labels and the fields of the case file are those of every report (`stillhook.designs`).
"""

from __future__ import annotations

import html
from collections.abc import Mapping

from ..designs import LIMITS

#: By name of the limit.
WHAT_LIMITS_ARE: Mapping[str, str] = {
    "max_sensitivity": "The largest peak of 1/(1 + L): how much the loop makes of what disturbs it "
    "at its worst frequency. The Nyquist curve stays 1/M_s away from -1.",
    "gain_margin_up": "By what factor the loop's gain may rise before it is unstable.",
    "gain_margin_down": "To what share the loop's gain may fall, as in saturation, before it is "
    "unstable.",
    "delay_margin": "How much later everything may come before the loop is unstable.",
    "low_frequency": "How much of a slow motion of the hook the load may follow: slow drift is "
    "left to the operator, and what is slower than the waves must not be amplified.",
    "roll_off": "How small the loop's gain has to be beyond the rope's modes that the model holds.",
    "motor.torque.peak": "The largest torque at the motor in the exposure time: static load, "
    "losses, and the most probable maximum of what the waves ask for.",
    "motor.torque.continuous": "The torque that heats the motor: the root mean square of static "
    "load, losses and waves.",
    "motor.speed.peak": "The largest speed of the motor in the exposure time.",
    "motor.voltage.peak": "The largest armature voltage in the exposure time.",
    "motor.current.peak": "The largest armature current in the exposure time.",
    "motor.current.continuous": "The armature current that heats the motor, root mean square.",
    "motor.torque.breakdown": "The torque beyond which an induction motor in field weakening "
    "falls out of step, at its largest speed.",
    "motor.power.peak": "The largest power of the drive in the exposure time.",
    "rope.tension.peak": "The largest tension of the rope in the exposure time.",
    "rope.tension.least": "The least tension of the rope at the drum: a slack rope snaps taut.",
    "rope.lower_tension.least": "The least tension of the rope at the load: a slack rope snaps "
    "taut.",
}


def explained() -> str:
    """Return the limits with what they are, as an HTML list whose items can be linked to."""
    items = []
    for name, words in WHAT_LIMITS_ARE.items():
        label, field = LIMITS[name]
        items.append(
            f'<dt id="limit-{name}" tabindex="-1">{html.escape(label)} '
            f"<code>{field}</code></dt><dd>{html.escape(words)}</dd>"
        )
    return f'<dl class="explained">{"".join(items)}</dl>'
