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
# # A plant of your own
#
# `synth` and `mpc` know nothing of winches. Here they keep a ship upright: two fins below the
# waterline, turned against the roll. A linear controller is found with `synth.tune`, a predictive
# one with `mpc.Programme`, and both meet the same waves with fins that can only do so much. The
# notebook shows what has to be written down of a plant, and what comes back.

# %%
"""Imports, the numbers of the ship, and a sketch of it."""

import matplotlib.pyplot as plt
import numpy as np
import scipy.linalg
import scipy.signal
from looks import AFTER, BEFORE, HOOK, REFERENCE, say, table

import mpc
from models import LinearPlant
from synth import LowOrder, MaxSensitivity, Rms, White, tune

# %matplotlib inline
DEG = np.pi / 180.0
roll, damping = 0.62, 0.06  # natural frequency [rad/s] and damping ratio of the roll [-]
waves, width = 0.70, 0.15  # frequency [rad/s] and damping ratio of the waves' slope
slope = 2.5 * DEG  # standard deviation of the waves' slope [rad]
servo = 0.4  # time constant of the fins' drive [s]
heel = 0.3  # heel that a fin holds in still water, over its angle [-]
late = 0.1  # delay of the sensors [s]
MOST, FASTEST = 20.0 * DEG, 15.0 * DEG  # of the fins: angle [rad], rate [rad/s]

fig, axes = plt.subplots(1, 2, figsize=(9.5, 3.4))
hull = np.array([(-8, 4), (-8, -3), (-6, -5), (6, -5), (8, -3), (8, 4)]) @ np.array(
    [[np.cos(0.15), np.sin(0.15)], [-np.sin(0.15), np.cos(0.15)]]
)
axes[0].fill(*hull.T, color=HOOK, alpha=0.5)
across = np.linspace(-16, 16, 60)
axes[0].plot(across, 0.06 * across - 0.3, color=AFTER)
for side in (-1, 1):
    root = np.array([side * 6.6, -4.2 + side * 1.0])
    axes[0].plot(*np.array([root, root + np.array([side * 4.0, -1.6])]).T, color=BEFORE, lw=4)
axes[0].annotate("fin", (11.5, -5.6), color=BEFORE)
axes[0].annotate("slope of the wave", (-15.5, 1.0), color=AFTER)
axes[0].set(aspect="equal", xlim=(-17, 17), ylim=(-9, 8), title="Seen from astern")
axes[0].set_axis_off()
w = np.linspace(0.2, 1.6, 400)
density = np.abs(1j * w / (waves**2 - w**2 + 2j * width * waves * w)) ** 2
still = np.abs(roll**2 / (roll**2 - w**2 + 2j * damping * roll * w))
axes[1].plot(w, density / density.max(), color=AFTER, label="waves' slope, spectrum (largest 1)")
axes[1].plot(w, still / still.max(), color=BEFORE, label="roll over slope (largest 1)")
axes[1].set(xlabel="ω [rad/s]", title="The waves meet the roll's resonance", ylim=(0, 1.4))
axes[1].legend(loc="upper right", fontsize=8)
plt.show()

# %% [markdown]
# ## 1. The plant
#
# A `LinearPlant` is matrices with names. Five states: roll angle and rate, the fins' angle, and two
# that colour white noise so that the wave's slope has the spectrum above. Two sensors, late by a
# tenth of a second, with noise of their own.

# %%
A = np.zeros((5, 5))
A[0, 1] = 1.0
A[1] = [-(roll**2), -2 * damping * roll, heel * roll**2, 0.0, roll**2]
A[2, 2] = -1.0 / servo
A[3, 4] = 1.0
A[4, 3:] = [-(waves**2), -2 * width * waves]
B = np.array([[0.0], [0.0], [1.0 / servo], [0.0], [0.0]])
E = np.zeros((5, 3))
E[4, 0] = 1.0
ship = LinearPlant(
    A=A,
    B=B,
    E=E,
    C=np.eye(5)[:2],
    F=[[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    Cz=[*np.eye(5)[[0, 2]], A[2]],
    Dz=[[0.0], [0.0], B[2]],
    inputs=("fin.command",),
    disturbances=("waves", "angle.noise", "rate.noise"),
    measurements=("angle", "rate"),
    outputs=("roll", "fin", "fin.rate"),
    delays=(late, late),
)
strength = slope**2 * 4 * width * waves / np.pi  # one-sided density of the white noise
spectrum = {
    "waves": White(strength),
    "angle.noise": White(2e-7),
    "rate.noise": White(2e-7),
}

# %% [markdown]
# ## 2. A linear controller, within limits
#
# Nothing is told of how fins work, only what may not be exceeded: the fins' angle and rate, as
# standard deviations that leave room for peaks, and a sensitivity peak of 1.8. The structure is a
# free controller of second order, $u = C(s)\,y$.

# %%
limits = [
    Rms(output="fin", bound=7.0 * DEG, unit="rad"),
    Rms(output="fin.rate", bound=6.0 * DEG, unit="rad/s"),
    MaxSensitivity(bound=1.8),
]
design = tune(
    ship,
    LowOrder(2),
    spectrum=spectrum,
    minimise={"roll": 1.0, "fin.rate": 1e-3},
    limits=limits,
    starts=4,
)
print(design)
print(design.verify().status)

# %%
rest = still * np.sqrt(strength * density)
free = np.sqrt(np.trapezoid(rest**2, w)) / DEG
closed = design.assessment.sigma("roll") / DEG
fig, ax = plt.subplots()
ax.semilogy(w, still, color=BEFORE, label="fins at rest")
shaped = np.abs(1j * w / (waves**2 - w**2 + 2j * width * waves * w))
response = np.abs(design.assessment.response("roll", "waves", w)) / shaped
ax.semilogy(w, response, color=AFTER, label="with the controller")
ax.set(xlabel="ω [rad/s]", ylabel="roll over slope [-]", title="The resonance is gone")
ax.legend()
plt.show()
say(
    f"With fins at rest the ship rolls by {free:.1f}° rms, with the controller by {closed:.2f}°, "
    f"as long as the fins do what they are told. {design.status.capitalize()}."
)

# %% [markdown]
# ## 3. A predictive controller
#
# `mpc.Programme` gets the plant, what costs, and limits that are kept always: the fins' angle and
# the rate of their command. `mpc.KalmanFilter` estimates the states, those of the wave among them,
# so that the next waves are foreseen as far as their spectrum allows. The noise of the waves is
# held over a sample here, which is why its size knows the sample time.

# %%
period = 0.2  # [s]
motion = LinearPlant(
    A=A,
    B=B,
    E=E[:, :1],
    C=ship.C,
    Cz=ship.Cz[:2],
    inputs=ship.inputs,
    disturbances=("waves",),
    measurements=ship.measurements,
    outputs=("roll", "fin"),
    delays=(late, late),
)
programme = mpc.Programme(
    motion,
    period=period,
    horizon=20.0,
    costs={"roll": 1.0, "fin.command": 1e-3, "rate of fin.command": 1e-3},
    constraints=[
        mpc.Constraint(signal="fin.command", low=-MOST, high=MOST),
        mpc.Constraint(signal="rate of fin.command", low=-FASTEST, high=FASTEST),
    ],
    blocking=(1,) * 20 + (2,) * 20 + (4,) * 10,
)
sensor = 0.1 * DEG
gust = np.sqrt(np.pi * strength / period)
kalman = mpc.KalmanFilter(
    motion, period=period, noise={"angle": sensor, "rate": sensor, "waves": gust}
)
controller = mpc.PredictiveController(programme, kalman)
print(controller.programme.solve([10 * DEG, 0.0, 0.0, 0.0, 0.0]).status)

# %% [markdown]
# ## 4. The same waves for all
#
# The plant's exact step, with fins that keep their angle and rate whatever is asked for. The linear
# controller is sampled by Tustin's rule.

# %%
joint = np.zeros((7, 7))
joint[:5, :5], joint[:5, 5:6], joint[:5, 6:] = A, B, E[:, :1]
joint = scipy.linalg.expm(period * joint)
over, held = joint[:5, :5], joint[:5, 5:]
law = design.controller
law = scipy.signal.cont2discrete((law.A, law.B, law.C, law.D), period, "bilinear")[:4]


def sail(kind, height, seconds=600.0):
    """Return roll and fin angle [deg] over time, in waves so many times as high."""
    rng, x, before, u = np.random.default_rng(1), np.zeros(5), np.zeros(2), 0.0
    state, shown = np.zeros(len(law[0])), []
    controller.reset()
    for k in range(round(seconds / period)):
        noise, white = sensor * rng.normal(size=2), height * gust * rng.normal()
        y = 0.5 * (x[:2] + before) + noise  # half a sample late
        wanted = 0.0
        if kind == "linear":
            wanted = float((law[2] @ state + law[3] @ y)[0])
            state = law[0] @ state + law[1] @ y
        elif kind == "predictive":
            signals = {"angle": y[0], "rate": y[1], "fin.command": u}
            wanted = float(controller.step(signals, k * period))
        step = period * FASTEST
        u = float(np.clip(np.clip(wanted, -MOST, MOST), u - step, u + step))
        shown.append(x[[0, 2]] / DEG)
        before, x = x[:2], over @ x + held @ np.array([u, white])
    return np.array(shown)


KINDS = {"fins at rest": HOOK, "linear": BEFORE, "predictive": AFTER}
HEIGHTS = (0.5, 1.0, 1.5, 2.0)
runs = {(kind, h): sail(kind, h) for kind in KINDS for h in HEIGHTS}
time = period * np.arange(len(runs["linear", 1.0]))
fig, axes = plt.subplots(2, 1, figsize=(9.0, 5.0), sharex=True)
for kind, colour in KINDS.items():
    found = runs[kind, 1.5]
    axes[0].plot(time, found[:, 0], color=colour, label=kind)
    if kind != "fins at rest":
        axes[1].plot(time, found[:, 1], color=colour)
axes[0].set(
    xlim=(200, 300),
    ylim=(-25, 32),
    ylabel="roll [deg]",
    title="Waves half as high again as designed for",
)
axes[1].set(xlabel="time [s]", ylabel="fins [deg]")
for limit in (-20, 20):
    axes[1].axhline(limit, color=REFERENCE, lw=0.8, ls="--")
axes[0].legend(loc="upper left", ncols=3)
plt.show()

# %%
rms = {key: found[100:, 0].std() for key, found in runs.items()}
table(
    ["roll [deg rms] in waves of", *(f"{h:g} times" for h in HEIGHTS)],
    [[kind, *(rms[kind, h] for h in HEIGHTS)] for kind in KINDS],
    digits=3,
)

# %%
table(
    ["largest fin angle [deg] in waves of", *(f"{h:g} times" for h in HEIGHTS)],
    [[kind, *(np.abs(runs[kind, h][:, 1]).max() for h in HEIGHTS)] for kind in list(KINDS)[1:]],
    digits=3,
)

# %% tags=["hide-input"]
ratio = {h: rms["linear", h] / rms["predictive", h] for h in HEIGHTS}
say(
    f"In waves of half the height the predictive controller leaves {ratio[0.5]:.1f} times less "
    "roll: it had more freedom, and no bound on $M_s$. In waves as designed for, the fins come to "
    f"their limits; the law that does not know them leaves {ratio[1.0]:.1f} times more, in waves "
    f"half as high again {ratio[1.5]:.1f} times, and in the highest, where there is not enough fin "
    f"for anybody, {ratio[2.0]:.1f} times. The price is a quadratic programme every {period:g} s."
)

# %% [markdown]
# ## Where to go next
#
# * `docs/examples/tune_any_plant`: structures of your own, more limits, several plants at once.
# * `docs/examples/control_any_plant`: references, disturbances that are told ahead, soft limits.
# * [Predictive control against linear feedback](03-mpc-versus-linear.ipynb): the same on a winch,
#   with the floor that no controller can undercut.
