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
# # Robustness and operability
#
# A design review asks three things of a set of gains: what matters most, what can go wrong, and in
# which seas the work can be done. This notebook asks them of two designs for the winch of 1975 on
# the thesis's own model, one spring and a fixed drag: the gains that the thesis chose by hand, and
# the stillest ones whose sensitivity stays below 2.

# %%
"""Imports, and the two designs."""

import matplotlib.pyplot as plt
import numpy as np
from looks import AFTER, BEFORE, HOOK, OTHERS, REFERENCE, say, table

import stillhook as sh

# %matplotlib inline
case = sh.load_case("thesis-1975")
designs = {
    "the thesis's gains": sh.evaluate_gains(case, {"A": 200, "a": 50, "a1": 100, "a2": 100}),
    "optimised, $M_s$ at most 2": sh.optimise_gains(case, "payload-feedback", starts=8),
}
COLOURS = dict(zip(designs, (BEFORE, AFTER), strict=True))

circle = np.exp(1j * np.linspace(0, 2 * np.pi, 300))
w = np.geomspace(0.3, 400.0, 6000)
fig, ax = plt.subplots(figsize=(8.0, 4.0))
for name, design in designs.items():
    L = design.assessment.loop_gain(w)
    ax.plot(L.real, L.imag, color=COLOURS[name], label=name)
ax.plot(*(circle.real / 2 - 1, circle.imag / 2), color=HOOK, lw=1.0, label="$M_s$ = 2")
ax.plot(-1, 0, "+", color=REFERENCE, ms=9)
ax.set(xlim=(-3, 1.5), ylim=(-1.5, 1.0), xlabel="Re L", ylabel="Im L", aspect="equal")
ax.set_title("How near the two loops come to -1")
ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
plt.show()

# %%
table(
    ["design", "payload rms [mm]", "M_s", "delay margin [ms]"],
    [
        (name, 1e3 * d.payload_rms, d.margins.max_sensitivity, 1e3 * d.margins.delay)
        for name, d in designs.items()
    ],
    digits=3,
)

# %% [markdown]
# ## 1. What matters most
#
# An elasticity is what one per cent more of a number does to a figure, in per cent. All of them
# come from one evaluation of the closed loop, by automatic differentiation.

# %%
studies = {name: sh.sensitivity(d) for name, d in designs.items()}
shown = [
    "winch.gearbox.ratio",
    "winch.motor.resistance",
    "winch.motor.inertia",
    "rope.axial_stiffness",
    "payload.mass",
    "gains.a1",
]
fig, axes = plt.subplots(1, 2, figsize=(10, 3.6), sharey=True)
place = np.arange(len(shown))
for k, (name, study) in enumerate(studies.items()):
    for ax, figure in zip(axes, ("payload_rms", "max_sensitivity"), strict=True):
        values = [getattr(study[path], figure) for path in shown]
        ax.barh(place + 0.2 - 0.4 * k, values, height=0.4, color=COLOURS[name], label=name)
axes[0].set_yticks(place, shown)
axes[0].set(xlabel="% for one per cent more", title="Payload rms")
axes[1].set(xlabel="% for one per cent more", title="$M_s$")
axes[1].legend(fontsize=8)
plt.show()

# %% [markdown]
# The thesis's test, its Figure 32, moved each gain by ten per cent and saw that the response hardly
# changes. So it does; the stability margin, which the test did not look at, does not stay.

# %%
moved = studies["the thesis's gains"].moved(0.10)
table(
    ["10 % more", "payload rms [mm]", "M_s"],
    [(m.path, 1e3 * m.payload_rms, m.max_sensitivity) for m in moved],
    digits=3,
)

# %% [markdown]
# ## 2. What can go wrong
#
# Nobody knows the load's added mass to ten per cent, nor the telemetry's delay to a millisecond. A
# sweep draws four thousand worlds and evaluates the loop in each: stability exactly, the payload's
# rms by the same quadrature as the design.

# %%
spread = sh.Spread(
    {
        "payload.mass": sh.Uniform("30 %"),
        "rope.axial_stiffness": sh.Uniform("20 %"),
        "winch.motor.resistance": sh.Normal(sd="10 %"),
        "sensors.telemetry.delay": sh.Uniform("0 ms", "40 ms"),
    }
)
worlds = {name: sh.sweep(d, spread, samples=4096) for name, d in designs.items()}
rows = []
for name, found in worlds.items():
    stable = found.stable.values
    rms = 1e3 * found.payload_rms.values[stable]
    rows.append((name, f"{100 * stable.mean():.1f} %", *np.quantile(rms, [0.05, 0.5, 0.95])))
table(["design", "stable", "5 % [mm]", "median [mm]", "95 % [mm]"], rows, digits=3)

# %%
fig, axes = plt.subplots(1, 2, figsize=(10, 3.6))
for name, found in worlds.items():
    stable = found.stable.values
    rms = 1e3 * found.payload_rms.values[stable]
    axes[0].plot(np.sort(rms), np.arange(1, rms.size + 1) / stable.size, color=COLOURS[name])
    delay = 1e3 * found["sensors.telemetry.delay"].values
    edges = np.linspace(0.0, 40.0, 17)
    bins = np.digitize(delay, edges) - 1
    share = [100 * stable[bins == k].mean() for k in range(16)]
    axes[1].stairs(share, edges, color=COLOURS[name], lw=1.8, label=name)
axes[0].set(xscale="log", xlabel="payload rms [mm]", ylabel="share of all worlds", ylim=(0, 1.02))
axes[0].set_title("A curve that ends below 1 is unstable in the rest")
axes[1].set(xlabel="delay of the telemetry [ms]", ylabel="stable [%]", ylim=(0, 103))
axes[1].set_title("The delay breaks one of them")
axes[1].legend(fontsize=8)
plt.show()

# %% tags=["hide-input"]
unstable = [100 - 100 * found.stable.values.mean() for found in worlds.values()]
soft = studies["optimised, $M_s$ at most 2"]["rope.axial_stiffness"].max_sensitivity
say(
    "The thesis's gains are very still where they are stable, and that is a matter of the "
    f"telemetry: {unstable[0]:.0f} % of these worlds are lost to its delay. The gains with $M_s$ "
    f"at most 2 do not mind the delay and lose {unstable[1]:.0f} % to something else: their $M_s$ "
    f"moves by {abs(soft):.0f} % for a per cent of the rope's stiffness."
)

# %% [markdown]
# What breaks the second design in some of these worlds? The tornado above says what its $M_s$ moves
# with. A bound on $M_s$ is a bound where one stands, not thirty per cent away; gains for a whole
# range are what `stillhook robust` finds.
#
# Sobol's indices share out the variance of the loop's distance to instability, $1/M_s$, among the
# four. What is unstable has none: it is left out, counted.

# %%
robust = designs["optimised, $M_s$ at most 2"]
print(sh.sobol_indices(robust, spread, samples=512, figure="modulus_margin"))

# %% [markdown]
# ## 3. In which seas the work can be done
#
# For each peak period there is a wave height at which the first limit breaks: of the drive, or of
# what the work allows the payload to do. The contour of these heights, against how often the seas
# occur, is the share of the year in which the winch can work.

# %%
periods = np.arange(5.0, 14.1, 0.75)
limits = {
    name: sh.operability(d, periods=periods, payload_rms="100 mm", scatter="example")
    for name, d in designs.items()
}
for name, found in limits.items():
    print(f"{name}\n{found}\n")

# %%
best = limits["optimised, $M_s$ at most 2"].dataset
fig, ax = plt.subplots(figsize=(8.0, 4.0))
for name, found in limits.items():
    height = np.ravel(found.dataset.height.values)
    ax.plot(periods, height, "o-", color=COLOURS[name], ms=4, label=name)
perfect = np.ravel(best.height_perfect.values)
ax.plot(periods, perfect, color=OTHERS[2], label="any winch of this size that follows the hook")
ax.plot(periods, np.ravel(best.height_held.values), "--", color=HOOK, label="drum held")
ax.axhline(case.sea.significant_height, color=REFERENCE, lw=0.8, ls=":")
ax.text(5.1, case.sea.significant_height - 0.12, "the thesis's design sea", fontsize=8)
ax.set(xlabel="peak period [s]", ylabel="limiting $H_s$ [m]", ylim=(0, 2.6))
ax.set_title("The highest sea in which everything holds")
ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
plt.show()

# %% tags=["hide-input"]
shares = {name: 100 * float(found.dataset.workable) for name, found in limits.items()}
named = dict(zip(("thesis", "own"), shares.values(), strict=True))
binds = sorted({str(name) for name in np.ravel(best.binding.values)})
say(
    f"The optimised gains ask less of the motor, and can work in {named['own']:.0f} % of this "
    f"made-up year against the thesis's {named['thesis']:.0f} %. Neither comes near the sea that "
    f"the thesis designed for, $H_s$ = {case.sea.significant_height:.1f} m. What binds is "
    f"{' or '.join(f'`{n}`' for n in binds)}, and so it would for a winch that follows the hook "
    "perfectly: the drive limits this winch, not its gains. With the drum held, a tenth of a "
    "metre of payload motion is too much in nearly every sea: that is the resonance of the rope."
)

# %% [markdown]
# The same for a vessel with six RAOs, over headings, with the scatter diagram of a real site:
#
# ```
# stillhook operability subsea-crane --payload-rms "50 mm" --scatter site.csv
# ```
#
# ## Where to go next
#
# * [A vessel of your own](05-vessel-of-your-own.ipynb): from a file of RAOs to a report.
# * `sh.optimise_robust` finds one set of gains for a family of plants and seas, and `sh.robustness`
#   says how far the numbers may be off together.
