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
# # Predictive control against linear feedback
#
# A motor that is too small for the sea loses a linear loop: the
# [notebook before](02-saturation.ipynb) shows how. This one gives the same winch, the same seas and
# the same sensors to a controller that knows the motor's limit and what the sea is about to do. It
# shows what that buys, how much of it is foresight, what it costs, and where it does not help.
#
# The case is the winch of 1975 on the thesis's own model: one spring, perfect payload sensors, a
# torque of at most twice the rating. The drive's voltage and speed are limited too. The motion
# reference unit has white noise of 1 % of the heave's rms, sampled at 4 Hz.
#
# Everything is computed here, from two seeds of three minutes: enough to see orders of magnitude,
# not enough for a table to be quoted. For that there is `stillhook compare` and
# `docs/compare.md`.

# %%
"""Imports, the case, and the picture to be explained: one sea, one motor, two controllers."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from foretelling import least_error
from looks import AFTER, BEFORE, DRUM, HOOK, OTHERS, REFERENCE, say, table

import stillhook as sh

# %matplotlib inline
HEIGHTS = (1.25, 1.9, 2.43, 3.75)  # significant wave heights [m]; 2.43 m is the thesis's sea
RUNS = {"seeds": 2, "duration": "3 min"}
SETTLE = 24.0  # when statistics of such a run begin [s]

unit = {"noise_floor": 0.0, "noise_fraction": 0.01, "noise_bandwidth": 11.31}
case = sh.load_case("thesis-1975").replace({"sensors.mru": unit})
seas = {h: case.replace({"sea.significant_height": h}) for h in HEIGHTS}


def gains(a, a1, a2):
    """Return gains with the thesis's A."""
    return {"A": 200.0, "a": a, "a1": a1, "a2": a2}


thesis = gains(50.0, 100.0, 100.0)
held = {"seeds": [1], "duration": "3 min"}
(fallen,) = sh.simulate(seas[1.25], sh.LinearFeedback(seas[1.25], thesis), **held)
weights = sh.tune_weights(seas[2.43])
(stilled,) = sh.simulate(seas[1.25], sh.LinearMPC(seas[1.25], weights=weights), **held)
t, payload = fallen.time, fallen["payload.displacement"]
fall = float(t[np.argmax(np.abs(payload) > 0.5)])
peak = case.winch.drive.torque_peak

fig, axes = plt.subplots(1, 2, figsize=(10, 3.6))
for run, colour, label in ((fallen, BEFORE, "the thesis's gains"), (stilled, AFTER, "MPC")):
    near = (run.time > fall - 25.0) & (run.time < fall + 12.0)
    at = run.time[near] - fall
    axes[0].plot(at, 1e3 * run["payload.displacement"][near], color=colour, lw=1.2, label=label)
    axes[1].plot(at, run["motor.torque"][near] / 1e3, color=colour, lw=1.2, label=label)
for limit in (-peak, peak):
    axes[1].axhline(limit / 1e3, color=REFERENCE, lw=0.8, ls="--")
axes[0].set(xlabel="time from the fall [s]", ylabel="payload [mm]", ylim=(-150, 150))
axes[0].set_title(f"Seed 1, $H_s$ = 1.25 m: lost at {fall:.0f} s")
axes[0].legend(loc="upper left")
axes[1].set(xlabel="time from the fall [s]", ylabel="motor torque [kN m]")
axes[1].set_title("The same motor, the same limits")
plt.show()

# %% [markdown]
# ## 1. What saturation does to a linear loop, and to one that knows the limit
#
# Orange: the thesis's gains in a sea of half its design height. The payload is held within
# millimetres, until one group of waves asks for more torque than there is. The loop needs its gain
# to be stable; with the torque at its limit it has less, and the payload is lost for good.
#
# Blue: `LinearMPC` estimates winch, payload and sea from all sensors, predicts the hook for the
# next eight seconds, and finds the torques that keep the payload stillest *within the limit*, anew
# every 50 ms. What it trusts how much (`Weights`) is tuned for the case on paper: no simulation is
# used. Its plans are made on a rope that is stiffer than it is, so that a drive at its limit can
# still hold a load or a rope that is off; who is told the future plans on the rope that is there.

# %%
exact = replace(weights, stiffness=1.0)
calm = (t > SETTLE) & (t < fall - 10.0)
after = stilled.time > SETTLE
limited = 100 * stilled["drive.saturated"][after].mean()
say(
    f"* The thesis's gains: {1e3 * payload[calm].std():.1f} mm rms before the fall, "
    f"{payload[t > fall + 30].std():.2f} m after it.\n"
    f"* MPC: {1e3 * stilled['payload.displacement'][after].std():.1f} mm rms in the same three "
    f"minutes, at the limit {limited:.0f} % of the time.\n"
    f"* $M_s$ of its unsaturated loop is {weights.max_sensitivity:.2f}, and it plans on a rope "
    f"{weights.stiffness:.2g} times as stiff as the rope is."
)

# %% [markdown]
# The motor is at its limit before the fall with both. The difference is what follows: MPC reckons
# with the torque that it will not have, gives way by some millimetres in time, and takes the
# payload back. A saturated step is a plan like any other.
#
# ## 2. What foresight buys
#
# Left: $H_s$ = 2.43 m, where the motor is often at its limit. The controller is told the hook's
# motion as it will be (no sensor can do that), for as many seconds as its horizon has; and, as it
# is in earnest, has to predict it. Each mark is a seed.
#
# A horizon of one second is worse than a linear law: beyond it the controller reckons with a motor
# without a limit, and the more so the better it knows the next second. From three seconds on it
# does not lose the payload. Perfect preview goes on paying up to some eight seconds. A prediction
# has said all it knows after four; a longer horizon of it is no gain.
#
# Right: how well the hook can be foretold, from the noisy unit, over ten minutes. Marks are
# measured errors, the line is the least that any linear predictor leaves that hears this unit alone
# (Wiener, from the true spectrum). MPC's own filter hears more and yet foretells a little worse: it
# allows for a slow error that this unit does not have.

# %%
ahead, horizons = {}, (1.0, 2.0, 3.0, 4.0, 8.0, 14.0)
for horizon in horizons:
    for kind in ("kalman", "preview"):
        name, own = ("predicted", weights) if kind == "kalman" else ("told", exact)
        control = sh.LinearMPC(seas[2.43], weights=own, horizon=horizon, predictor=kind)
        runs = sh.simulate(seas[2.43], control, **RUNS)
        ahead[name, horizon] = [1e3 * run["payload.displacement"][480:].std() for run in runs]


last = 160  # samples ahead


class Listening(sh.LinearMPC):
    """Keeps at every step what the controller foretells of the hook, for eight seconds."""

    def reset(self):
        """Forget."""
        super().reset()
        self.foretold = []

    def step(self, measurement, time):
        """Do as always, and take notes."""
        command = super().step(measurement, time)
        if self.predictor is None:  # the filter's own sea, left to itself
            self.foretold.append(ahead_of_sea @ self.estimator.state[self.model.sea_at])
        else:
            self.foretold.append(self.predictor.forecast().displacement.copy())
        return command


own, learning = (
    Listening(seas[1.25], weights=weights, predictor=kind, horizon=8.0) for kind in ("kalman", "ar")
)
at = own.model.sea_at  # the states of a sea, and how it goes on over a sample
one, shown = own.model.A[at, at], own.model.hook[0, at]
ahead_of_sea = np.array([shown @ np.linalg.matrix_power(one, k) for k in range(last + 1)])
forecasts = {}
for name, control in (("MPC's own, all sensors", own), ("AR model, learns on line", learning)):
    (run,) = sh.simulate(seas[1.25], control, seeds=1, duration="10 min", compiled=False)
    forecasts[name] = np.array(control.foretold)
hook = run["hook.heave"]  # the same in both
now = np.arange(2400, hook.size - last)  # from two minutes on: the AR model has learnt by then
leads = np.arange(0, last + 1, 10)
share = {
    name: np.array([(found[now, k] - hook[now + k]).std() for k in leads]) / hook.std()
    for name, found in forecasts.items()
}

fig, axes = plt.subplots(1, 2, figsize=(10.5, 4))
for name, colour, mark in (("predicted", AFTER, "o"), ("told", DRUM, "s")):
    values = np.array([ahead[name, h] for h in horizons])
    axes[0].plot(horizons, values, mark, color=colour, ms=4, alpha=0.7)
    axes[0].plot(horizons, values.mean(axis=1), color=colour, lw=1.4)
axes[0].text(9.5, 135, "predicted", color=AFTER)
axes[0].text(10.5, 15, "told", color=DRUM)
axes[0].set(yscale="log", ylim=(6, 5e3), xlabel="horizon [s]", ylabel="payload [mm rms]")
axes[0].set_title("Seconds of foresight, $H_s$ = 2.43 m")
best = least_error(seas[1.25], 0.05 * leads)
axes[1].plot(0.05 * leads, best, color=AFTER, lw=1.2, label="best from the unit")
for (name, found), colour, mark in zip(share.items(), (DRUM, BEFORE), "s^", strict=True):
    axes[1].plot(0.05 * leads, found, mark, color=colour, ms=4, label=name)
axes[1].set(xlabel="lead [s]", ylabel="error over the hook's rms", ylim=(0, 0.9))
axes[1].set_title("The hook, foretold")
axes[1].legend(loc="upper left")
plt.show()
table(
    ["horizon [s]", "predicted [mm rms]", "told [mm rms]"],
    [[h, *(float(np.mean(ahead[name, h])) for name in ("predicted", "told"))] for h in horizons],
)

# %% [markdown]
# ## 3. Over the seas
#
# All contenders meet the same seas on the same nonlinear plant (`sh.compare`). The linear laws
# have to be chosen with care, or the comparison is rigged: a law that is designed for a motor
# without limits is lost at once, one that never meets them is slow. So a family of them takes part:
#
# * *feed-forward*: the drum pays out 0.9 of the hook's speed, the usual compensator; and 0.7, 0.5;
# * *feedback* with the gains that `sh.optimise_gains` finds within the drive's limits
#   (`limits.drive: enforce`) for each sea; and, bolder, with those for seas of 0.8 and 1.0 m;
# * feedback with a lower gain margin of 0.25, from the notebook before, and the thesis's gains;
# * *combined*: feedback and feed-forward, `sh.optimise_gains` for 1.0 m within the limits.
#
# *Best linear* is the least of all of these, chosen afterwards, in hindsight and for each height:
# more than anyone can have at sea. MPC has one set of weights for all heights.
#
# The *floor* is `sh.clairvoyant`: the least that any command within the drive's limits leaves on
# the linear plant, with the whole record known.

# %%
WITHIN = {  # what `sh.optimise_gains` finds with limits.drive: enforce, by the sea's height
    0.8: gains(7.6928, 3.9541, 0.25253),
    1.0: gains(3.1135, 1.3764, 0.25741),
    1.25: gains(1.5707, 0.61148, 0.25832),
    1.9: gains(0.72666, 0.29234, 0.25861),
    2.43: gains(0.54273, 0.24808, 0.25864),
    3.75: gains(0.36826, 0.18835, 0.25869),
}
COMBINED = {  # `sh.optimise_gains(..., "combined")`, the same, for 1.0 m
    "payload.acceleration_gain": 1.06790,
    "payload.velocity_gain": 0.800938,
    "payload.position_gain": 0.0936789,
    "drum.speed_gain": 32.46987,
    "drum.position_gain": 0.002565565,
    "heave.gain": 0.04798933,
    "rolloff.corner": 500.0,
    "rolloff.damping": 0.2,
    "heave.lead": 7.0114e-07,
    "heave.bandwidth": 1.590743,
}
combined = sh.evaluate_gains(case, COMBINED, "combined").controller


def feedback(fixed=None):
    """Return a function of the case: gains that are given, or those for its own sea."""
    return lambda c: sh.LinearFeedback(c, fixed or WITHIN[c.sea.significant_height])


linear = {
    "feed-forward 0.9": lambda c: sh.VelocityFeedForward(c, share=0.9),
    "feed-forward 0.7": lambda c: sh.VelocityFeedForward(c, share=0.7),
    "feed-forward 0.5": lambda c: sh.VelocityFeedForward(c, share=0.5),
    "thesis's gains": feedback(thesis),
    "feedback, gain margin 0.25": feedback(gains(20.86, 11.87, 33.87)),
    "feedback within the limits": feedback(),
    "feedback for 1.0 m": feedback(WITHIN[1.0]),
    "feedback for 0.8 m": feedback(WITHIN[0.8]),
    "combined for 1.0 m": lambda c: sh.LinearFeedback(c, combined),
}
predictive = {
    "MPC": lambda c: sh.LinearMPC(c, weights=weights),
    "MPC, told the future": lambda c: sh.LinearMPC(c, weights=exact, predictor="preview"),
}
found = sh.compare(
    case,
    ["none", *linear.items(), *predictive.items()],
    heights=HEIGHTS,
    settle=SETTLE,
    jobs=1,
    traces=False,
    **RUNS,
)
floors = {}
for h in HEIGHTS:
    moved = sh.simulate(seas[h], "none", seeds=found.seeds, duration="3 min", store_step=0.05)
    series = [[run[f"hook.{n}"] for n in ("heave", "heave_rate")] for run in moved]
    records = [
        sh.RecordMotion.from_arrays(moved[0].time, *one, detrend="none").motion(180.0, 0.05, 0)
        for one in series
    ]
    floors[h] = [sh.clairvoyant(seas[h], r, sample_time=0.1, settle=SETTLE) for r in records]

pooled = {(c.name, h): 1e3 * found.pooled(c.name, h) for c in found.contenders for h in HEIGHTS}
for h in HEIGHTS:
    pooled["floor", h] = 1e3 * np.sqrt(np.mean([f.payload_rms**2 for f in floors[h]]))
    pooled["best linear", h] = min(pooled[name, h] for name in linear)
names = [c.name for c in found.contenders]
rows = []
for name in [*names[: 1 + len(linear)], "best linear", *predictive, "floor"]:
    lost = [found.lost(name, h) if name in names else 0 for h in HEIGHTS]
    cells = [f"{pooled[name, h]:.3g}{' *' * bool(n)}" for h, n in zip(HEIGHTS, lost, strict=True)]
    rows.append(["drum held" if name == "none" else name, *cells])
table(["payload [mm rms]", *(f"{h:.4g} m" for h in HEIGHTS)], rows)

# %% [markdown]
# A star: in one seed or both the payload was off by more than the hook's significant height.

# %%
fig, ax = plt.subplots(figsize=(8.5, 4.6))
SHOWN = {
    "none": ("drum held", HOOK, "o-"),
    "thesis's gains": ("the thesis's gains", BEFORE, "v-"),
    "feed-forward 0.9": ("feed-forward 0.9", OTHERS[1], "P-"),
    "feedback within the limits": ("feedback within the limits", OTHERS[0], "x-"),
    "combined for 1.0 m": ("combined for 1.0 m", OTHERS[2], "D-"),
    "best linear": ("best linear, in hindsight", REFERENCE, "o--"),
    "MPC": ("MPC", AFTER, "s-"),
    "MPC, told the future": ("MPC, told the future", DRUM, "^-"),
}
for name, (label, colour, style) in SHOWN.items():
    ax.plot(HEIGHTS, [pooled[name, h] for h in HEIGHTS], style, color=colour, ms=5, label=label)
least = [pooled["floor", h] for h in HEIGHTS]
ax.fill_between(HEIGHTS, 1e-3, least, color=REFERENCE, alpha=0.12, lw=0, label="below the floor")
ax.set(yscale="log", ylim=(0.1, 2e4), xlabel="$H_s$ [m]", ylabel="payload [mm rms]")
ax.set_title("Two seeds of three minutes")
ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
plt.show()

# %% [markdown]
# ## 4. What it costs
#
# *Computing.* A step in Python takes a small part of the 50 ms there are (here on whatever machine
# this is; `benchmarks/mpc_solvers.py` measures it with care). Compiled linear laws take none to
# speak of.
#
# *Torque and heat.* A still payload has its price whoever holds it: the drum has to undo the
# hook's whole motion. Where the torque's rms is above the motor's rating, its windings reach their
# rated rise after the time in the last column, and the work has to
# end. MPC does not spare the motor: it works it harder than feed-forward in high seas.
# `LinearMPC(..., thermal=True)` cuts the torque back in time, for a load that moves more. Told the
# future it needs less torque: some of it goes into correcting forecasts.

# %%
rating, warming = case.winch.drive.torque_continuous, case.winch.motor.thermal_time_constant
rows = []
for h in HEIGHTS:
    for name in ("feed-forward 0.9", *predictive):
        line = found.table[(found.table.contender == name) & (found.table.height == h)].iloc[0]
        over = rating / line["torque rms"]
        lasts = f"{-warming * np.log(1.0 - over**2) / 60.0:.0f}" if over < 1.0 else "for good"
        step = "-" if np.isnan(line["step median"]) else f"{1e6 * line['step median']:.0f}"
        rows.append(
            [f"{h:.4g} m: {name}", step, line["torque rms"] / 1e3, line["saturated"], lasts]
        )
head = ["", "step, median [us]", "torque [kN m rms]", "at the limit [%]"]
print(f"rating {rating / 1e3:.2f} kN m, time constant of the windings {warming / 60:.0f} min")
table([*head, "can go on for [min]"], rows)

# %% [markdown]
# *Knowledge.* MPC believes a model: of the winch, the rope, the load, and the sea. Below, the plant
# is not what it believes, in $H_s$ = 1.25 m. The controller is never told, and keeps its weights.
# With `predictor="ar"` it knows nothing of the sea and learns it, which takes a minute: counted
# is from 90 s on. One seed.
#
# Load, rope and delay may be off by that much. A slow error of the unit is not taken for waves: the
# filter reckons with one of 5 % of the hook's rms that the case does not speak of, and the search
# for weights with loads and ropes that are off. Told the truth about its unit (`sensors.mru` in the
# case), the controller weighs it as it deserves: the last bars.

# %%
settled = {"seeds": [1], "duration": "3 min", "settle": 90.0}
believed = seas[1.25]
truths = {
    "as believed": {},
    "payload 30 % heavier": {
        f"payload.{m}": 1.3 * case.payload.mass for m in ("mass", "added_mass")
    },
    "rope 30 % softer": {"rope.axial_stiffness": 0.7 * case.rope.axial_stiffness},
    "payload's signals 50 ms late": {"sensors.telemetry.delay": 0.05},
    "waves of 11 s, not 8.1 s": {"sea.significant_period": 11.0},
    "waves of 6.5 s": {"sea.significant_period": 6.5},
    "unit errs by 5 cm, not by 1 %": {"sensors.mru": {}},
}
off = {}
for what, changes in truths.items():
    truth = believed.replace(changes)
    for kind in ("kalman", "ar"):
        control = sh.LinearMPC(believed, weights=weights, predictor=kind)
        runs = sh.simulate(truth, control, **settled)
        off[what, kind] = 1e3 * runs.summary["payload rms"].mean
told = "the same unit, and it is told"
for kind in ("kalman", "ar"):
    control = sh.LinearMPC(truth, weights=sh.tune_weights(truth), predictor=kind)
    runs = sh.simulate(truth, control, **settled)
    off[told, kind] = 1e3 * runs.summary["payload rms"].mean
small = case.replace({"sea.significant_height": 0.6})
in_small = {
    name: 1e3 * sh.simulate(small, control, **settled).summary["payload rms"].mean
    for name, control in {
        "thesis's gains": sh.LinearFeedback(small, thesis),
        "MPC": sh.LinearMPC(small, weights=weights),
        "MPC, AR": sh.LinearMPC(small, weights=weights, predictor="ar"),
    }.items()
}
fig, ax = plt.subplots(figsize=(8.5, 4.2))
truths[told] = {}
place = np.arange(len(truths))
for shift, kind, colour, label in (
    (-0.19, "kalman", AFTER, "believes the spectrum (kalman)"),
    (0.19, "ar", BEFORE, "learns the sea (ar)"),
):
    values = [off[what, kind] for what in truths]
    bars = ax.barh(place + shift, values, height=0.36, color=colour, label=label)
    ax.bar_label(bars, [f"{v:.1f}" for v in values], padding=3, fontsize=8)
ax.set_axisbelow(True)
ax.set_yticks(place, list(truths))
ax.invert_yaxis()
ax.set(xscale="log", xlim=(0.5, 150.0), xlabel="payload [mm rms]")
ax.set_title("The plant or the sea is not what MPC believes, $H_s$ = 1.25 m")
ax.legend(loc="upper right")
plt.show()
print("H_s = 0.6 m:", ", ".join(f"{name} {v:.2g} mm" for name, v in in_small.items()))

# %% [markdown]
# ## 5. In short
#
# Said by the numbers above.

# %%
THESIS = "thesis's gains"
lines = []
for h in HEIGHTS:
    best = min(linear, key=lambda name: pooled[name, h])
    gain, told = pooled[best, h] / pooled["MPC", h], pooled["MPC, told the future", h]
    lines.append(
        f"* $H_s$ {h:.4g} m: MPC leaves {pooled['MPC', h]:.3g} mm of {pooled['none', h]:.0f} mm, "
        f"{gain:.2g} times less than the best of {len(linear)} linear laws in hindsight ({best}), "
        f"with the future told {told:.3g} mm, over a floor of {pooled['floor', h]:.3g} mm."
    )
lost = {name: sum(found.lost(name, h) for h in HEIGHTS) for name in (*linear, *predictive)}
of_all = f"{lost[THESIS]} of {len(HEIGHTS) * len(found.seeds)} runs"
lines.append(f"* The thesis's gains lose the load in {of_all}, MPC in {lost['MPC']}.")
worst = max((off[what, "kalman"], what) for what in truths)
told_future = pooled["MPC, told the future", 2.43]
lines += [
    f"* At 2.43 m the programme itself is next to optimal ({told_future:.0f} mm told the future, "
    f"over {pooled['floor', 2.43]:.0f} mm). What is missing, up to {pooled['MPC', 2.43]:.0f} mm, "
    "is the forecast's error.",
    f"* In a calm sea ($H_s$ 0.6 m) the thesis's gains leave {in_small[THESIS]:.2g} mm and lose "
    f"nothing; MPC leaves {in_small['MPC']:.2g} mm, and {in_small['MPC, AR']:.2g} mm without "
    "knowledge of the spectrum.",
    f"* What had better be right: '{worst[1]}' costs {worst[0] / off['as believed', 'kalman']:.0f} "
    "times the rms.",
]
say("\n".join(lines))

# %% [markdown]
# ## Where to go next
#
# * [Robustness and operability](04-robustness-and-operability.ipynb): what may be off, and which
#   seas.
# * [A plant of your own](06-plant-of-your-own.ipynb): the programme behind `LinearMPC`, for
#   anything.
# * [Export](07-export.ipynb): predictive control as C for a drive.
