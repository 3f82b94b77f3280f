"""A free controller of low order on the payload's motion, as a structure with a name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from models.plant import LinearPlant

from ..loop import Controller
from .low_order import LowOrder
from .low_order import _LowOrderLaw as LowOrderLaw
from .structure import PAYLOAD_MEASUREMENTS, Bounds, Law, Structure


@dataclass(frozen=True, kw_only=True)
class LowOrderFeedback(Structure):
    """`LowOrder` on the payload's motion.

    Attributes
    ----------
    order
        Number of states.
    """

    order: int
    hears_payload: bool = True

    @property
    def name(self) -> str:
        """What it is called."""
        return f"low-order-{self.order}"

    @property
    def measurements(self) -> tuple[str, ...]:
        """Names of what it hears."""
        return PAYLOAD_MEASUREMENTS

    def bind(self, plant: LinearPlant, response_scale: Bounds | None = None) -> Law:
        """Return the law; see `Structure.bind`."""
        return LowOrder(self.order).bind(plant, response_scale)

    @staticmethod
    def start(law: Law, found: Mapping[str, float], controller: Controller) -> list[float]:
        """Return the parameters of rolled-off payload feedback, and set the sizes by it.

        Parameters
        ----------
        law
            The law of this structure; its parameters get the sizes that go with the answer.
        found, controller
            Parameters and controller of ``payload-feedback-rolloff``, of order two.
        """
        assert isinstance(law, LowOrderLaw)
        corner = found["rolloff.corner"]
        static = np.abs(controller.D - controller.C @ np.linalg.solve(controller.A, controller.B))
        size = dict(zip(controller.measurements, static[0], strict=True))
        sizes = []
        for p in law.parameters:
            head, _, rest = p.name.partition("[")
            block, _, measured = rest.rstrip("]").partition(",")
            if head.startswith("alpha"):
                sizes.append(corner if head == "alpha1" else corner**2)
            else:
                sizes.append(size[measured] * corner ** int(block.partition(".")[2]))
        law.parameters = tuple(
            replace(p, scale=scale) for p, scale in zip(law.parameters, sizes, strict=True)
        )
        return [float(v) for v in law.values(controller)]
