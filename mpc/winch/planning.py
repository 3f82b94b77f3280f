r"""The planning model: the estimator's winch on a rope that is stiffer than it is.

    PredictionModel, stiffness --> plan_model --> PredictionModel of the regulator and the programme

A drive at its limit gives less than the loop asks for, and what is left of the loop has to get
along with that.  How little is enough depends on the resonance of load and rope: with a load
lighter, or a rope stiffer, than the plan's, sixty per cent of the torque was too little, and what
the plan put right too late went on as an oscillation of metres.  A plan that reckons with a stiffer
rope errs to the other side, which is the harmless one.  `Unsaturated.growth` tells how far it is
from instability; `docs/mpc.md` has the limit cycles that it ends.
Where the drive seldom saturates the tuner chooses how stiff, as the doubts about the plant ask for.

Only the plan is different.  The filter believes the case; what it finds at rest under a constant
force is at rest for the plan too, so that nothing is left over.
"""

from dataclasses import replace

import numpy as np

from .prediction import PredictionModel, prediction_model


def plan_model(model: PredictionModel, stiffness: float) -> PredictionModel:
    """Return the estimator's model on a rope of another axial stiffness, over the case's own.

    Raises InputError if the stiffness is not above zero.
    """
    if stiffness == 1.0:
        return model
    here = model.winch
    other = prediction_model(here.off(axial_stiffness=stiffness), swell=model.swell)
    stiff = other.winch
    # A constant force stretches this rope by less.  Seen from where the estimator finds the drum,
    # all that is at rest is to stay there; the tension is that of the real rope, for the same sake.
    shift = stiff.resting - here.resting
    winch = replace(
        stiff,
        from_constants=stiff.from_constants + (stiff.A - np.eye(stiff.size)) @ shift,
        tension=here.tension,
        tension_from_hook=here.tension_from_hook,
        tension_from_constants=here.tension_from_constants,
    )
    A = np.array(other.A)
    at = model.constants_at.start
    A[: winch.size, at : at + 2] = winch.from_constants
    return replace(other, winch=winch, A=A, R=model.R)
