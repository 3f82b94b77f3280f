# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Ten lines
#
# A winch on a ship's crane holds a load far below still, although the ship heaves. This notebook
# goes the whole way once: read a case, find the gains, simulate them against a drum that is held,
# and look. The next cell is all of it.

# %%
"""The whole way: a case, its gains, two simulations, a figure."""

import matplotlib.pyplot as plt
import numpy as np
from looks import AFTER, BEFORE, HOOK, say, table

import stillhook as sh

# %matplotlib inline
case = sh.load_case("subsea-crane")
design = sh.optimise_gains(case, "combined", starts=2)
(held,), (run,) = (sh.simulate(case, c, seeds=[1], duration="5 min") for c in ("none", design))

plt.plot(run.time, 1e3 * run["hook.heave"], color=HOOK, label="hook")
plt.plot(held.time, 1e3 * held["payload.displacement"], color=BEFORE, label="load, drum held")
plt.plot(run.time, 1e3 * run["payload.displacement"], color=AFTER, label="load, with the design")
plt.gca().set(xlim=(120, 200), xlabel="time [s]", ylabel="[mm]", title="Hook and load in one sea")
plt.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
plt.show()

# %% [markdown]
# `load_case` reads one vessel, one sea, one rope, one load and one winch: here a bundled case, or a
# file of yours. `optimise_gains` finds the gains of a structure (`combined` hears the load, the
# drum and the motion reference unit) that hold the load stillest within the case's limits, and
# checks them by code that the search did not use. `simulate` runs them on the nonlinear plant, and
# "none" the drum on its brake.

# %% tags=["hide-input"]
say(
    f"In a sea of $H_s$ {case.sea.significant_height:g} m the hook of this crane moves by "
    f"{1e3 * design.hook_rms:.0f} mm rms. With the drum held the load moves by "
    f"{1e3 * design.payload_rms_before:.0f} mm rms, as the rope's resonance is near the waves; "
    f"with the design by {1e3 * design.payload_rms:.1f} mm. The design is *{design.status}*."
)

# %% [markdown]
# ## What came back
#
# A design prints as a summary: the load's motion first, then the parameters with their units, the
# margins, and how much of each limit is used.

# %%
print(design)

# %% [markdown]
# Its numbers are attributes, in SI. The limits that are used up are those to talk about with
# whoever set them.

# %%
table(
    ["limit", "value", "bound", "used [%]"],
    [
        [u.name, f"{u.value:.4g} {u.unit}", f"{u.bound:.4g} {u.unit}", 100 * u.use]
        for u in design.limits.values()
        if u.use > 0.6
    ],
    digits=3,
)

# %% [markdown]
# And the two runs: the design's figure is that of a linear model in all seas of this spectrum, a
# run is the nonlinear plant in one.

# %%
rows = []
for name, one in (("drum held", held), ("design", run)):
    settled = one.time > 60.0
    power = np.abs(one["motor.power"][settled]).max() / 1e3
    rows.append([name, 1e3 * one["payload.displacement"][settled].std(), power])
table(["simulated, seed 1", "load [mm rms]", "largest power of the motor [kW]"], rows)

# %% [markdown]
# ## Where to go next
#
# * [The 1975 thesis](01-thesis-1975.ipynb): the loop, its margins, and what a rope does to them.
# * [A vessel of your own](05-vessel-of-your-own.ipynb): the same way with the RAOs of your ship.
# * `stillhook new my-winch.yaml` writes a case file with a comment on every field.
