r"""The hook foretold by whoever of a bank of seas has foretold it best: `SeaBank`.

    hook, fused by the filter --> FIR of each sea --> errors made --> weights --> Forecast

What the filter knows of the hook now and has known over the last forty seconds is regressed on
what is to come.  The regression of a sea follows from its tabulated spectrum alone: with
covariances G of what is remembered, m, with the error that the filter holds possible, and g of it
with what is asked,

.. math::  \hat y(t + \ell) = g_\ell' G^{-1} m(t),

the Wiener forecast of finite memory (Hannan, *Multiple Time Series*, 1970, ch. 3).

Besides the sea that the case tells there are seas of one system, with peaks of 5 to 18 s, and of
two, and the autoregression that learns the record (`mpc.forecast.autoregressive`).  Each is judged
by what came of it one, two and four seconds later: errors of mean square e over a minute and a half
weigh a sea by e to the power of minus half the number of errors that are independent.  When next to
nothing is left of the sea that was told, it is not as told (`SeaBank.misfit`).
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from models.basics import FloatArray, ReadOnlyArrays, read_only
from models.case import Case
from models.hook import HookMotion
from models.sea import SeaSpectrum

from .autoregressive import AdaptiveAR, IndexArray, hermite_weights
from .forecast import Forecast, leads_of

_SPACING, _TAPS, _RATES = 0.2, 200, 20  # of what is remembered: [s], displacements, velocities
_LENGTHS = (1, 4, 12, 25, 50, 100, _TAPS)  # while the record is short
# Least error of theirs, of displacement and velocity, over their rms; how much of what the filter
# holds possible is white, and slow once it has settled; how slowly it is off before, over the
# hook's rms: in the sea of the case either, in others.
_LEAST, _DOUBTS, _OTHERS = (1e-3, 0.01), ((0.5, 0.1, 0.005), (1.0, 0.4, 0.015)), (0.5, 0.1, 0.005)
# A filter that has just begun, or whose sensors drift, is off slowly, below the waves' band: at a
# density exp(-(omega t)^2 / 2) with a time t [s].
_SLOWNESS = 6.0
_SETTLING = 60.0  # [s], after which it has settled; all taps are used when it has for as long
_PEAKS = np.geomspace(5.0, 18.0, 20)  # of seas of one system [s]
_GAMMAS = (1.0, 3.3)
_SWELLS, _WINDS, _SHARES = (10.0, 11.5, 13.0, 14.7, 16.5), (5.0, 5.8, 6.7, 7.8), (0.3, 0.6, 0.85)
_JUDGED, _EVERY = (1.0, 2.0, 4.0), 0.5  # leads, and from one judgement to the next [s]
# [s], of the errors, and before which nothing is judged: the filter has begun by then.
_MEMORY, _BEGIN = 90.0, 20.0
_INDEPENDENT = 1.0  # leads, after which an error is another
_LONG = 60.0  # [s], over which somebody has to have been judged who came later
_TOLD = 0.999  # share of the sea that is told before anything is known
_MISFIT, _FITS = 1e-5, 0.5  # share below which the sea is not as told, above which it is again
_FAINT, _MOVED = 2e-3, 0.02  # share that is left out; change for which the FIR is made anew
_NODES = np.concatenate([np.arange(0.01, 4.0, 0.01), np.arange(4.0, 60.0, 0.05)])  # [rad/s]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Tables(ReadOnlyArrays):
    """FIR of every sea, of each length of `_LENGTHS`; the first are those of the case."""

    rows: tuple[FloatArray, ...]  #: Knots' displacements and velocities (m, 2k, taps).
    judged: tuple[FloatArray, ...]  #: Displacements at the leads judged (3 m, taps).
    variance: tuple[FloatArray, ...]  #: Of the knots, over that of the hook (m, 2k) [-], [1/s2].
    power: float  #: Variance of the hook in the first sea [m2].


class SeaBank:
    """Wiener forecasts of a bank of seas and an autoregression, weighed by the errors they made.

    It is shown the hook as the filter has fused it (`fused`), not what the reference unit shows.

    Parameters
    ----------
    case
        Sea that is told, and the vessel.
    sample_time
        Time between samples and between leads [s].
    horizon
        Last lead [s].
    error
        Standard deviations of the hook as it is known, of displacement [m] and velocity [m/s].

    Attributes
    ----------
    shares
        Weight of each sea, that of the case first, at two errors, the autoregression last.
    misfit
        Whether the sea is not as told.
    """

    fused = True

    def __init__(
        self,
        case: Case,
        *,
        sample_time: float,
        horizon: float,
        error: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.leads = leads_of("sea bank", sample_time, horizon)
        self.sample_time = T = float(sample_time)
        self._step = max(1, round(_SPACING / T))
        self._tables = _tables(case, T, self.leads.size - 1, error)
        knots = _knots(self.leads.size - 1, T) * T
        self._hermite, self._knots = hermite_weights(knots, self.leads), knots
        self._every, self._ahead = _judgements(T)
        # The autoregression hears every so manieth sample; what it foretells is moved on between.
        sparse = self._step * T
        farthest = max(float(self.leads[-1]), max(_JUDGED)) + 2.0 * sparse
        wide = max(1.0, 4.0 * sparse)
        self._learnt = AdaptiveAR(sample_time=sparse, horizon=farthest, spacing=wide)
        own = self._learnt.leads
        self._moved = [hermite_weights(own, knots + k * T) for k in range(self._step)]
        to_judged = [np.array((self._ahead + k) * T) for k in range(self._step)]
        self._to_judged = [hermite_weights(own, at)[: at.size] for at in to_judged]
        members = len(self._tables.rows[0]) + 1
        told = len(_DOUBTS)
        self._prior = np.full(members, math.log((1.0 - _TOLD) / (members - told)))
        self._prior[:told] = math.log(_TOLD / told)
        self._span = (_TAPS - 1) * self._step + 1
        #: Ages at which the next of `_LENGTHS` is remembered well enough.
        spans = [(count - 1) * self._step + 1 for count in _LENGTHS]
        self._grows = {*spans[:-1], spans[-1] + round(_SETTLING / T)}
        self._depth = int(self._ahead.max()) // self._every + 1
        self.reset()

    @property
    def fit(self) -> float:
        """Weight of the sea that is told."""
        return float(self.shares[: len(_DOUBTS)].sum())

    def reset(self) -> None:
        """Forget every earlier sample."""
        self._learnt.reset()
        self._record = np.zeros((2, 8 * self._span))
        self._row = self._span - 1
        self._age, self._length, self._good = 0, -1, 0
        members = self._prior.size
        self._made = np.full((self._depth, members, len(_JUDGED)), np.nan)
        self._errors = np.zeros((members, len(_JUDGED)))
        self._judged = np.zeros((members, 1))  # seconds that the errors stand for
        self._since = np.zeros((members, len(_JUDGED)))  # errors since the last was judged
        self.shares = np.exp(self._prior)
        self._blended = np.zeros(members)
        self.misfit = False

    def update(self, heave: float, rate: float, valid: bool, time: float) -> None:
        """Take the hook's displacement [m] and velocity [m/s]; one not `valid` judges nobody."""
        if self._age % self._step == 0:
            self._learnt.update(heave, rate, valid, time)
        row = self._row + 1
        if row == self._record.shape[1]:
            self._record[:, : self._span] = self._record[:, -self._span :].copy()
            row = self._span
        self._record[:, row] = heave, rate
        self._row, self._age = row, self._age + 1
        self._good = self._good + 1 if valid else 0
        if self._age in self._grows:
            self._length += 1
            self._blend()
        if self._age % self._every == 0:
            self._judge(heave)

    def forecast(self) -> Forecast:
        """Return the motion now and at the leads."""
        at_knots = self._mixed @ self._seen()
        if (share := float(self._blended[-1])) > 0.0:
            moved = self._moved[(self._age - 1) % self._step] @ self._path()
            at_knots = at_knots + share * moved.reshape(2, -1).T.ravel()
        mean = (self._hermite @ at_knots).reshape(2, -1)
        return Forecast(mean[0], mean[1], *self._std)

    def _path(self) -> FloatArray:
        """Return what the autoregression foretold at its last sample, each lead's two in turn."""
        learnt = self._learnt.forecast()
        return np.stack([learnt.displacement, learnt.velocity], axis=1).ravel()

    def _seen(self) -> FloatArray:
        """Return what is remembered, velocities first, the oldest of each first."""
        count, step, row = _LENGTHS[self._length], self._step, self._row
        z, v = self._record
        first = row - step * (min(count, _RATES) - 1)
        return np.concatenate(
            [v[first : row + 1 : step], z[row - step * (count - 1) : row + 1 : step]]
        )

    def _judge(self, heave: float) -> None:
        """Weigh everybody by the errors that have come to light."""
        turn, ago = self._age // self._every, self._ahead // self._every
        made = self._made[(turn - ago) % self._depth, :, np.arange(ago.size)].T
        if self._good > self._ahead.max():
            known = np.isfinite(made)
            self._judged = np.minimum(self._judged + _EVERY * known[:, -1:], _MEMORY)
            share = _EVERY / np.maximum(self._judged, _EVERY)
            square = (made - heave) ** 2
            self._errors += share * np.where(known, square - self._errors, 0.0)
            both = known & known[-1]
            self._since += share[-1] * np.where(both, square - self._since, 0.0)
            if known[0, -1]:
                each = 1.0 / (_INDEPENDENT * np.array(_JUDGED))
                score = self._prior + float(self._judged[0, 0]) * _likelihood(self._errors) @ each
                # The autoregression came later: by how much it is better than the best since then,
                # as it was spared the errors of a filter that had just begun.
                if self._judged[-1, 0] < _LONG:
                    score[-1] = -np.inf
                else:
                    best = int(score[:-1].argmax())
                    better = _likelihood(self._since[-1]) - _likelihood(self._since[best])
                    more = self._prior[-1] - self._prior[best]
                    score[-1] = score[best] + more + float(self._judged[-1, 0]) * better @ each
                shares = np.exp(score - score.max())
                self.shares = shares / shares.sum()
                self.misfit = bool(self.fit < (_FITS if self.misfit else _MISFIT))
                if np.abs(self.shares - self._blended).sum() > _MOVED:
                    self._blend()
        now = self._made[turn % self._depth]
        now[:] = np.nan
        if self._age * self.sample_time > _BEGIN:
            now[:-1] = (self._tables.judged[self._length] @ self._seen()).reshape(-1, now.shape[1])
            if self._learnt.ready:
                now[-1] = self._to_judged[(self._age - 1) % self._step] @ self._path()

    def _blend(self) -> None:
        """Make one FIR of all that matter."""
        share = np.where(self.shares > _FAINT, self.shares, 0.0)
        self._blended = share = share / share.sum()
        at = np.flatnonzero(share[:-1])
        rows, own = self._tables.rows[self._length], share[:-1] + 1e-9
        self._mixed = np.ascontiguousarray(np.tensordot(share[at], rows[at], axes=1))
        spread = np.maximum(own @ self._tables.variance[self._length] / own.sum(), 0.0)
        judged = np.interp(_JUDGED, self._knots, spread[0::2])
        # Before anybody is judged the sea is as high as is told.
        scale = self._tables.power
        if self._judged[0, 0] > 0.0:
            made = self._errors[share > 0.0].mean(axis=0)
            scale = float(np.mean(made / np.maximum(judged, 1e-9)))
        z, v = (np.interp(self.leads, self._knots, scale * spread[k::2]) for k in (0, 1))
        self._std = (np.sqrt(z), np.sqrt(v))


def _likelihood(errors: FloatArray) -> FloatArray:
    """Return the logarithm of how likely an error is with its mean square, but for a constant."""
    return np.asarray(-0.5 * np.log(np.maximum(errors, 1e-300)))


def _knots(steps: int, T: float) -> FloatArray:
    """Return the samples between which a forecast is a cubic, (k,): dense at first."""
    near, far = max(1, round(0.2 / T)), max(1, round(0.4 / T))
    dense = np.arange(0, min(steps, round(2.0 / T)) + 1, near)
    return np.unique(np.concatenate([dense, np.arange(dense[-1], steps, far), [steps]]))


def _judgements(T: float) -> tuple[int, IndexArray]:
    """Return how often forecasts are judged, and at which leads [samples], multiples of that."""
    every = max(1, round(_EVERY / T))
    return every, every * np.array([max(1, round(lead / T / every)) for lead in _JUDGED])


@lru_cache(maxsize=8)
def _tables(case: Case, T: float, steps: int, error: tuple[float, float]) -> _Tables:
    """Return the FIR of each sea of the bank."""
    step, knots = max(1, round(_SPACING / T)), _knots(steps, T)
    asked = np.concatenate([knots, _judgements(T)[1]])
    lags = T * np.arange(int(asked.max()) + step * _TAPS + 1)
    phase = np.outer(_NODES, lags)
    cosine, sine = np.cos(phase), np.sin(phase)
    width = np.gradient(_NODES)
    seas = _densities(case) * width
    power = float(seas[0].sum())
    faster = float(seas[0] @ _NODES**2)
    known = np.maximum(_LEAST, np.array(error) / np.sqrt((power, faster)))
    doubts = [*_DOUBTS, *[_OTHERS] * (len(seas) - len(_DOUBTS))]
    seas /= seas.sum(axis=1, keepdims=True)
    off = np.exp(-0.5 * (_SLOWNESS * _NODES) ** 2) * width
    all_of = np.vstack([seas, off / off.sum()])
    r, q, s = all_of @ cosine, (all_of * _NODES) @ sine, (all_of * _NODES**2) @ cosine
    back = np.arange(_TAPS)[::-1] * step
    apart = back[:, None] - back[None, :]  # negative: the first is later
    odd = np.sign(-apart)
    ahead = asked[:, None] + back
    found: list[list[FloatArray]] = [[], [], []]
    for count in _LENGTHS:
        rates = min(count, _RATES)
        zz, vv = slice(_TAPS - count, None), slice(_TAPS - rates, None)
        rows, judged, variance = [], [], []
        for R, Q, S, (white, settled, begun) in zip(r[:-1], q[:-1], s[:-1], doubts, strict=True):
            slow = (settled * known[0] if count == _TAPS else begun) ** 2
            both = (R + slow * r[-1], Q + slow * q[-1], S + slow * s[-1])
            G = np.empty((rates + count,) * 2)
            G[:rates, :rates] = both[2][np.abs(apart[vv, vv])]
            G[rates:, rates:] = both[0][np.abs(apart[zz, zz])]
            G[rates:, :rates] = (odd * both[1][np.abs(apart)])[zz, vv]
            G[:rates, rates:] = G[rates:, :rates].T
            floor = np.full(rates + count, (white * known[0]) ** 2)
            floor[:rates] = (white * known[1]) ** 2 * S[0]
            G.flat[:: len(G) + 1] += floor
            to_z = np.hstack([Q[ahead[:, vv]], R[ahead[:, zz]]])
            to_v = np.hstack([S[ahead[:, vv]], -Q[ahead[:, zz]]])
            wanted = np.stack([to_z, to_v], axis=1).reshape(-1, len(G))
            fir = np.linalg.solve(G, wanted.T).T
            left = np.tile((1.0, S[0]), asked.size) - (fir * wanted).sum(axis=1)
            rows.append(fir[: 2 * knots.size])
            judged.append(fir[2 * knots.size :: 2])
            variance.append(left[: 2 * knots.size])
        for part, own in zip(found, (rows, judged, variance), strict=True):
            part.append(read_only(np.array(own)))
    return _Tables(
        rows=tuple(found[0]),
        judged=tuple(part.reshape(-1, part.shape[-1]) for part in found[1]),
        variance=tuple(found[2]),
        power=power,
    )


def _densities(case: Case) -> FloatArray:
    """Return the hook's density in each sea at the nodes, over its variance, (m, k)."""
    told = HookMotion.from_case(case, warn=False)

    def hook(peak: float, gamma: float) -> FloatArray:
        sea = SeaSpectrum(kind="jonswap", significant_height=1.0, peak_period=peak, gamma=gamma)
        density = HookMotion(sea=sea, rao=told.rao, encounter=told.encounter).density(_NODES)
        return density / float(density @ np.gradient(_NODES))

    found = [told.density(_NODES)] * len(_DOUBTS)
    found += [hook(peak, gamma) for gamma in _GAMMAS for peak in _PEAKS.tolist()]
    for swell in _SWELLS:
        for wind in _WINDS:
            long, short = hook(swell, 3.3), hook(wind, 2.0)
            found += [share * long + (1.0 - share) * short for share in _SHARES]
    return np.array(found)
