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
# # Export
#
# A law is worth something on a drive, in a PLC, or in somebody else's simulation. This notebook
# writes one as C, as structured text (IEC 61131-3) and as matrices, compiles the C and replays it,
# and shows what a sample time costs. The goal: a folder that can be handed over, with the proof
# inside.
#
# **No export is a safety function**: it holds a load still, and protects nobody.

# %%
"""A design, exported; and what its test vector holds."""

import json
import shutil
import subprocess
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from looks import AFTER, BEFORE, HOOK, REFERENCE, say, table

import stillhook as sh

# %matplotlib inline
folder = Path(tempfile.mkdtemp())
case = sh.load_case("landing")
design = sh.optimise_gains(case, "combined", starts=1)
done = sh.export(design, folder / "law", to="c,st,json")

vector = pd.read_csv(next((folder / "law" / "c").glob("vector.csv")))
fig, axes = plt.subplots(2, 1, figsize=(9.0, 4.4), sharex=True)
axes[0].plot(vector.time, 1e3 * vector.mru_heave, color=HOOK, label="heave of the hook")
axes[0].plot(vector.time, 1e3 * vector.payload_displacement, color=AFTER, label="load")
axes[0].set(ylabel="[mm]", title="The test vector: what goes into the law, and what comes out")
axes[0].legend(loc="lower left", ncols=2)
axes[1].plot(vector.time, vector.command, color=BEFORE)
axes[1].set(xlabel="time [s]", ylabel="command [rad/s]")
plt.show()

# %% [markdown]
# The vector is a minute in which all happens that the law has an answer to: the take-over, sensors
# that are lost and come back, a set point that moves, a reset, a command at its limit. So the load
# does not stay still in it, and is not meant to.
#
# ## 1. What was written, and how it was proved
#
# Nothing is written that was not compared with the controller that was simulated, and each folder's
# README says how. The law has what an operated law needs: it is enabled, takes over without a step,
# keeps its command within the drive's limits, and says in a status what each step was.

# %%
for one in done.exported:
    print(f"{one.kind}: {', '.join(sorted(one.files))}\n   {one.proof}\n")

# %%
table(["told of the law", ""], [list(fact) for fact in done.facts if fact[0] != "case"], words=2)

# %% [markdown]
# ## 2. Build it, and replay it
#
# `make check` builds the sources and replays the vector; anybody with a compiler can do it. Without
# one the cell says so.

# %%
built = folder / "law" / "c"
if shutil.which("cc") and shutil.which("make"):
    said = subprocess.run(["make", "check"], cwd=built, capture_output=True, text=True)
    print(said.stdout.strip().splitlines()[-1])
else:
    print("no C compiler here: the sources are written, and not compared")

# %%
header = next(built.glob("*.h")).read_text()
print("\n".join(header.splitlines()[:30]))

# %% [markdown]
# ## 3. The same law as matrices
#
# `json` holds law and plant as matrices, continuous and sampled, with names and units: for a tool
# of your own.

# %%
stored = json.loads(next((folder / "law" / "json").glob("*.json")).read_text())
print("holds:", ", ".join(stored))
for name, value in stored["controller"].items():
    shape = np.shape(value)
    print(f"controller.{name}: {f'matrix {shape}' if len(shape) == 2 else value}")

# %% [markdown]
# ## 4. What the sample time costs
#
# A command is held for a sample, and is late by half of it on average. The loop is looked at as it
# is sampled, with its delays exact. A sample time that takes too much of the distance to -1 is
# refused, with the longest that would do.

# %%
times, peaks, lags, refused = [], [], [], []
for T in (0.002, 0.007, 0.012, 0.020):
    try:
        sampled = sh.export(design, folder / f"at-{1e3 * T:g}", to="json", sample_time=T)
    except sh.InputError as error:
        refused.append(str(error))
        continue
    words = next(text for name, text in sampled.facts if name.startswith("margins as sampled"))
    numbers = dict(part.rsplit(" ", 1) for part in words.replace(" ms", "").split(", ") if part)
    times.append(1e3 * T)
    peaks.append(float(numbers["M_s"]))
    lags.append(float(numbers["delay"]))
fig, axes = plt.subplots(1, 2, figsize=(9.5, 3.4))
axes[0].plot(times, peaks, "o-", color=AFTER)
axes[0].axhline(design.margins.max_sensitivity, color=REFERENCE, ls="--", lw=0.8)
axes[0].set(xlabel="sample time [ms]", ylabel="$M_s$ [-]", title="Sensitivity peak as sampled")
axes[1].plot(times, lags, "o-", color=AFTER)
axes[1].axhline(1e3 * design.margins.delay, color=REFERENCE, ls="--", lw=0.8)
axes[1].set(xlabel="sample time [ms]", ylabel="delay margin [ms]", title="Dashed: continuous")
axes[1].set_ylim(0, None)
plt.show()
print("\n".join(refused))

# %% tags=["hide-input"]
lost = 1e3 * design.margins.delay - lags[-1]
say(
    f"At {times[-1]:g} ms the delay margin is {lags[-1]:.1f} ms of "
    f"{1e3 * design.margins.delay:.1f} ms: half a sample of {times[-1] / 2:g} ms is what a command "
    f"is late, and {lost:.1f} ms are gone."
)

# %% [markdown]
# ## 5. An FMU, where there is FMPy
#
# With the extra `export` the controller also becomes an FMU for co-simulation, validated and
# replayed by FMPy before it is written.

# %%
try:
    import fmpy
except ImportError:
    print("FMPy is not installed: `make export` brings it")
else:
    unit = sh.export(design, folder / "fmu", to="fmu")
    print(unit.exported[0].proof)
    about = fmpy.read_model_description(str(next((folder / "fmu").rglob("*.fmu"))))
    inputs = sum(v.causality == "input" for v in about.modelVariables)
    print(f"FMI {about.fmiVersion}, {about.modelName}: {inputs} inputs")

# %% [markdown]
# ## Where to go next
#
# * `stillhook export --help` lists all kinds: `plant` for controllers of others, `orcaflex`,
#   `moordyn` and `csv` for a run in the case's sea.
# * Predictive control goes to C and FMU too: `sh.export(case, folder, controller="mpc")`.
# * [A plant of your own](06-plant-of-your-own.ipynb): what else the toolkit controls.
