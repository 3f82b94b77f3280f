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
# # A vessel of your own
#
# You have a file with the RAOs of your ship, and the question whether the crane's winch can hold a
# load still. This notebook goes from the file to a report: read it, let it be checked, put the
# crane on the vessel, look at the hook's motion, design, find the seas in which the work can be
# done, write it down.
#
# The file here is written from the bundled vessel `osv-83m`, and then read as if it were yours. Put
# the name of your file in its place; WAMIT, OrcaFlex, ShipX, MSS and others are read too, and the
# contents tell which it is.

# %%
"""The file, read; and how high the hook goes in a wave of one metre, over period and heading."""

import tempfile
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from looks import AFTER, BEFORE, DRUM, HOOK, OTHERS, say, table

import stillhook as sh

# %matplotlib inline
folder = Path(tempfile.mkdtemp())
file = sh.write_raos(folder / "my-vessel.csv", sh.read_raos("osv-83m"))

vessel = sh.read_raos(file)
hook = (-32.0, 12.0, 20.0)  # forward, to port, up from the origin of the RAOs [m]

fig, ax = plt.subplots()
for heading, colour in ((90, BEFORE), (135, OTHERS[1]), (165, DRUM), (180, AFTER)):
    heave = np.abs(vessel.heave_at(hook, np.radians(heading)))
    ax.plot(2 * np.pi / vessel.omega, heave, color=colour, label=f"{heading}°")
ax.set(xlim=(4, 20), ylim=(0, None), xlabel="wave period [s]", ylabel="hook over wave [m/m]")
ax.set_title("Heave of the hook: 180° is head sea, 90° comes from starboard")
ax.legend(title="waves towards")
plt.show()

# %% [markdown]
# ## 1. Can the table be true?
#
# Every program has conventions of its own: which way a phase runs, where a heading points, what is
# up. Reading turns each into one, and then asks whether the vessel goes with the water in long
# waves, as every vessel does. Here is the same file with lag for lead, a usual slip. It is refused,
# with the slip's name:

# %%
wrong = sh.write_raos(folder / "lag.csv", replace(vessel, values=np.conj(vessel.values)))
try:
    sh.read_raos(wrong)
except sh.InputError as error:
    print(str(error).replace(str(folder), "."))

# %%
table(
    ["", ""],
    [
        ["frequencies", f"{len(vessel.omega)}, {vessel.omega[0]:g} to {vessel.omega[-1]:g} rad/s"],
        ["headings", f"{len(vessel.heading_deg)}, every {np.diff(vessel.heading_deg)[0]:g}°"],
        ["motions are those of", f"the point {vessel.origin} m"],
        ["made by", vessel.source],
    ],
    words=2,
)

# %% [markdown]
# ## 2. The case
#
# A case file names the vessel, the hook's place on it and where the waves go. Here the bundled
# crane is put on it, with everything else as it was; `stillhook new` writes a file to begin with.

# %%
case = sh.load_case("subsea-crane").replace(
    {
        "vessel.raos": str(file),
        "vessel.hook": {"x": hook[0], "y": hook[1], "z": hook[2]},
        "vessel.heading": "165 deg",
    }
)
facts = sh.system_facts(case)
table(
    ["follows from the case", ""],
    [
        ["rope's stiffness", f"{facts.rope.stiffness / 1e3:.0f} kN/m"],
        ["first axial mode", f"{facts.modes[0].period:.2f} s"],
        ["waves with most of the hook's motion", f"{2 * np.pi / facts.waves.peak:.1f} s"],
        ["hook", f"{1e3 * facts.held.hook_rms:.0f} mm rms"],
        ["load with the drum held", f"{1e3 * facts.held.payload_rms:.0f} mm rms"],
        ["motor's rating that holds the load", f"{100 * facts.winch.rating_share:.0f} %"],
    ],
    words=2,
)

# %% [markdown]
# ## 3. The hook in the sea
#
# The same wave height over heading and peak period, and the crane over either side: with the waves
# on the crane's own side heave and roll add up, on the other they cancel.

# %%
headings, periods = np.arange(0, 360, 15), [6.0, 8.0, 10.0, 12.0]
survey = sh.hook_motion(case, headings=headings, peak_periods=periods)
motion = survey.rms("displacement")[0]  # this side of the ship: (headings, periods)
fig, ax = plt.subplots(figsize=(8.0, 3.8), subplot_kw={"projection": "polar"})
closed = np.radians([*headings, 360])
for k, colour in enumerate((AFTER, DRUM, OTHERS[1], BEFORE)):
    ring = 1e3 * np.append(motion[:, k], motion[0, k])
    ax.plot(closed, ring, color=colour, label=f"$T_p$ {periods[k]:g} s")
ax.set_theta_zero_location("S")  # a head sea, towards 180 degrees, at the top
ax.set_title("Hook [mm rms] over where the waves go, $H_s$ 2 m, bow up")
ax.legend(loc="upper left", bbox_to_anchor=(1.15, 1.0))
plt.show()
worst = np.unravel_index(np.argmax(motion), motion.shape)
best = np.unravel_index(np.argmin(motion[:, worst[1]]), motion[:, worst[1]].shape)[0]
say(
    f"The hook moves most, {1e3 * motion[worst]:.0f} mm rms, with the waves towards "
    f"{headings[worst[0]]}° and $T_p$ {periods[worst[1]]:g} s. At the same period it is "
    f"{1e3 * motion[best, worst[1]]:.0f} mm towards {headings[best]}°: a ship that can choose its "
    "heading has won most of it already."
)

# %% [markdown]
# ## 4. The design

# %%
design = sh.optimise_gains(case, "combined", starts=1)
print(design)

# %% [markdown]
# ## 5. In which seas can the work be done?
#
# For each period and heading there is a wave height at which the first limit breaks: the load moves
# by more than the work allows (here 50 mm rms), or the drive is used up. `scatter` says how often
# each sea occurs; `example` is a made-up site, in the place of yours.

# %%
periods = [6.0, 8.0, 10.0, 13.0]
angles = (135, 165, 180)
study = sh.operability(
    design,
    periods=periods,
    headings=np.radians(angles),
    payload_rms="50 mm",
    scatter="example",
)
limits = study.dataset
fig, ax = plt.subplots()
for k, (heading, colour) in enumerate(zip(angles, (OTHERS[1], DRUM, AFTER), strict=True)):
    ax.plot(periods, limits.height[k], "o-", color=colour, ms=4, label=f"{heading}°, design")
    ax.plot(periods, limits.height_held[k], "--", color=colour, lw=1.0)
ax.plot([], [], "--", color=HOOK, label="drum held")
ax.set(xlabel="peak period [s]", ylabel="$H_s$ [m]", ylim=(0, 5))
ax.set_title("Highest sea at which every limit holds")
ax.legend(title="waves towards")
plt.show()
say(
    f"Of this made-up year {100 * float(limits.workable):.0f} % can be worked on the case's own "
    f"heading, {100 * float(limits.workable_best_heading):.0f} % on the best of these headings in "
    f"each sea, and {100 * float(limits.workable_held):.1f} % with the drum held. A winch of this "
    f"size that followed the hook perfectly would have {100 * float(limits.workable_perfect):.0f} "
    "%. What binds here is "
    f"{' or '.join(f'`{n}`' for n in sorted({str(n) for n in np.ravel(limits.binding.values)}))}."
)

# %% [markdown]
# ## 6. The report
#
# One document for a client or a surveyor, with the origin of every number: HTML, and PDF where the
# extra `report` is installed. `stillhook report` runs the studies that are left out here, too.

# %%
written = sh.write_report(
    folder / "report",
    design=design,
    operability=study,
    requirement={"payload_rms": "50 mm"},
    bound=False,
    block=sh.TitleBlock(title="Winch on my vessel", client="A client", document="LA-001"),
)
kinds = sorted({path.suffix for path in written})
say(f"{len(written)} files were written: {', '.join(kinds)}. The document is `report.html`.")

# %% [markdown]
# ## Where to go next
#
# * A site of your own: `scatter="site.csv"`, or records over years with `sh.read_seas` and
#   `sh.weather_windows` for operations that need their time without a break.
# * No RAO file at all: `sh.vessel_from_hull(sh.box_hull(...))` computes one, with the extra `bem`.
# * [Robustness](04-robustness-and-operability.ipynb): how far the numbers may be off.
# * [Export](07-export.ipynb): the design on a drive.
