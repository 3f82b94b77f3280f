"""Figures of a sweep: what they show is what the dataset holds."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from designs import thesis_design, unstable_design

from models.basics import InputError
from models.spread import Spread
from stillhook.sweeps import sweep_figures
from stillhook.sweeps.figures import cumulative_share, nyquist_cloud, scatter_matrix, violins
from stillhook.text import picture
from synth.sweeps import frequency_sweep

SPREAD = Spread(
    {
        "payload.mass": "20 %",
        "stiffness": "20 %",
        "gains.a": "45 %",
        "gains.a1": "45 %",
        "gains.a2": "45 %",
    }
)


@pytest.fixture(scope="module")
def result() -> xr.Dataset:
    return frequency_sweep(thesis_design(), SPREAD, samples=600)


def test_every_figure_is_made_and_drawn_the_same_twice(result: xr.Dataset) -> None:
    figures = sweep_figures(result, thesis_design())
    assert sorted(figures) == ["nyquist", "scatter", "share", "violins"]
    again = cumulative_share(result, design=thesis_design())
    assert picture(figures["share"], "svg") == picture(again, "svg")


def test_without_a_design_the_cloud_is_missing(result: xr.Dataset) -> None:
    assert sorted(sweep_figures(result)) == ["scatter", "share", "violins"]


def test_share_ends_at_that_of_the_stable_cases(result: xr.Dataset) -> None:
    axes = cumulative_share(result, design=thesis_design()).axes[0]
    steps = axes.lines[0]
    x, y = np.asarray(steps.get_xdata()), np.asarray(steps.get_ydata())
    stable = result["stable"].values
    assert y[-1] == pytest.approx(100.0 * stable.mean())
    assert x[-1] == pytest.approx(1e3 * float(result["payload_rms"].max()))
    nominal = next(line for line in axes.lines if line.get_label() == "nominal")
    assert np.asarray(nominal.get_xdata())[0] == pytest.approx(
        1e3 * thesis_design().payload_rms, rel=1e-6
    )


def test_scatter_shows_every_pair_and_marks_unstable_cases(result: xr.Dataset) -> None:
    names = ["payload.mass", "gains.a1", "payload_rms"]
    figure = scatter_matrix(result, names)
    assert len(figure.axes) == 9
    below = figure.axes[3]  # gains.a1 over payload.mass
    good, bad = below.collections
    stable = result["stable"].values
    assert len(np.asarray(good.get_offsets())) == stable.sum()
    assert len(np.asarray(bad.get_offsets())) == (~stable).sum() > 0
    masses = np.asarray(good.get_offsets())[:, 0]
    np.testing.assert_allclose(np.sort(masses), np.sort(result["payload.mass"][stable]) / 1e3)


def test_violins_stand_over_the_nominal_values(result: xr.Dataset) -> None:
    axes = violins(result, thesis_design(), ["payload_rms"]).axes[0]
    bar = np.asarray(axes.lines[0].get_ydata())
    stable = result["payload_rms"].values[result["stable"].values]
    np.testing.assert_allclose(
        bar, np.quantile(stable, [0.05, 0.95]) / thesis_design().payload_rms, rtol=1e-6
    )


def test_cloud_holds_the_designs_own_curve(result: xr.Dataset) -> None:
    axes = nyquist_cloud(result, thesis_design()).axes[0]
    own = next(line for line in axes.lines if line.get_label() == "the design")
    curve = np.asarray(own.get_xdata()) + 1j * np.asarray(own.get_ydata())
    omega = np.geomspace(0.02, 200.0, 5000)
    gain = thesis_design().assessment.loop_gain(omega)
    seen = np.isfinite(curve)
    np.testing.assert_allclose(curve[seen], gain[seen], rtol=1e-9)


def test_nothing_stable_leaves_only_what_can_be_shown() -> None:
    nothing = frequency_sweep(unstable_design(), Spread({"payload.mass": "5 %"}), samples=16)
    assert sorted(sweep_figures(nothing)) == ["scatter"]
    with pytest.raises(InputError, match="no case is stable"):
        violins(nothing)
    with pytest.raises(InputError, match="no case is stable"):
        cumulative_share(nothing)


def test_unknown_names_are_refused(result: xr.Dataset) -> None:
    with pytest.raises(InputError, match="there is no 'mass'"):
        scatter_matrix(result, ["mass"])
    with pytest.raises(InputError, match="there is no 'height'"):
        cumulative_share(result, "height")
