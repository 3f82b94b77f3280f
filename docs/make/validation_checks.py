"""What `docs/make/validation.py` compares: a `Check` for each quantity reached in two ways."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import validation_routes as routes

#: How a row comes about: computed, read from a stored study, or by its test alone.
COMPUTED, STORED, TESTED = "computed", "stored", "tested"
RELATIVE, ABSOLUTE = "relative", "absolute"
_MOMENTS = "tests/project/test_validation.py::test_a_row_that_takes_moments_comes_out_again"


@dataclass(frozen=True, kw_only=True)
class Check:
    """A quantity that is reached in two ways."""

    subject: str
    quantity: str
    source: str  #: Of the other way.
    test: str  #: The test that holds it, ``path::name``.
    accepted: float  #: Largest difference, relative or in the unit.
    unit: str = ""
    measure: str = RELATIVE
    #: Returns both values, or the largest difference of many; None where its test alone has it.
    work: Callable[[], routes.Pair | float] | None = None
    quick: bool = True  #: Whether it takes less than a second or two.
    stored: bool = False  #: Whether it is read from the rows of a stored study.

    @property
    def how(self) -> str:
        """How the row comes about."""
        if self.work is None:
            return TESTED
        return STORED if self.stored else COMPUTED

    def row(self) -> dict[str, str]:
        """Return the row, computed anew."""
        ours = other = difference = ""
        if self.work is not None:
            found = self.work()
            if isinstance(found, tuple):
                ours, other = (f"{value:.8g}" for value in found)
                apart = abs(found[0] - found[1])
                found = apart / abs(found[1]) if self.measure == RELATIVE else apart
            difference = f"{found:.3g}"
        return {
            "subject": self.subject,
            "quantity": self.quantity,
            "unit": self.unit,
            "ours": ours,
            "other": other,
            "source": self.source,
            "measure": self.measure,
            "difference": difference,
            "accepted": f"{self.accepted:g}",
            "how": self.how,
            "test": self.test,
        }


def _pi_rows() -> list[Check]:
    rows = []
    for name, p in routes.published().PI_DESIGNS.items():
        both = ((0, "gain K", p.gain, ""), (1, "integral time T_i", p.integral_time, "s"))
        for k, what, printed, unit in both:
            rows.append(
                Check(
                    subject="Published problems: synthesis",
                    quantity=f"PI controller of {name}: {what}",
                    source="Astrom, Panagopoulos and Hagglund 1998, printed to 2 or 3 digits",
                    unit=unit,
                    accepted=0.01,
                    work=lambda n=name, i=k, value=printed: (routes.pi(n)[i], value),
                    test=_MOMENTS,
                    quick=name.startswith("three"),
                )
            )
    return rows


def _checks() -> tuple[Check, ...]:
    thesis, closed = "The thesis of 1975", "Closed forms"
    synthesis, control = "Published problems: synthesis", "Predictive control"
    vessels, in_time, designs = "Vessels", "Time domain", "Designs in simulation"
    of_thesis, printed = "tests/project/test_thesis.py::", "thesis, as printed"
    found_since = "found since by two independent codes"
    sea, margins = "tests/models/sea/test_sea.py::", "tests/synth/loop/test_margins.py::"
    files = "tests/models/vessel/test_rao_files.py::"
    studied = "tests/project/test_validation.py::test_the_study_in_simulation_is_told_as_it_is"

    def loop(name: str) -> Callable[[], float]:
        return lambda: float(getattr(routes.thesis()[2].margins, name))

    def pair(work: Callable[[], float], other: float) -> Callable[[], routes.Pair]:
        return lambda: (work(), other)

    return (
        # The thesis.
        Check(
            subject=thesis,
            quantity="heave of the hook, rms",
            unit="m",
            source=found_since,
            measure=ABSOLUTE,
            accepted=5e-4,
            work=lambda: (routes.thesis()[3].displacement.rms, 0.594),
            test=f"{of_thesis}test_table_5_heave",
        ),
        Check(
            subject=thesis,
            quantity="Table 5, spectrum of wave height, 14 of 17 rows (three are slips)",
            source=printed,
            accepted=0.0095,
            work=routes.spectrum_of_table_5,
            test=f"{of_thesis}test_table_5_in_its_own_convention",
        ),
        Check(
            subject=thesis,
            quantity="P/Z over 0.01 to 50 rad/s",
            source="thesis, eq. 32, as a closed form",
            accepted=1e-9,
            work=routes.equation_32,
            test=f"{of_thesis}test_the_plant_is_the_thesis_s",
        ),
        Check(
            subject=thesis,
            quantity="Table 7, |P/Z|, 17 frequencies",
            source=printed,
            accepted=0.07,
            work=routes.table_7,
            test=f"{of_thesis}test_table_7",
        ),
        Check(
            subject=thesis,
            quantity="Table 8, |G|^2 before compensation, all but two rows by the resonance",
            source=printed,
            accepted=0.06,
            work=routes.table_8,
            test=f"{of_thesis}test_table_8",
        ),
        Check(
            subject=thesis,
            quantity="Table 9, |T|^2 after compensation, above 0.43 rad/s",
            source=printed,
            accepted=0.10,
            work=routes.table_9,
            test=f"{of_thesis}test_table_9",
        ),
        Check(
            subject=thesis,
            quantity="payload before compensation, rms",
            unit="m",
            source=found_since,
            measure=ABSOLUTE,
            accepted=5e-3,
            work=lambda: (routes.thesis()[1].payload_rms_before, 5.99),
            test=f"{of_thesis}test_payload_motion_before_and_after",
        ),
        Check(
            subject=thesis,
            quantity="payload after compensation, rms",
            unit="m",
            source=found_since,
            measure=ABSOLUTE,
            accepted=5e-5,
            work=lambda: (routes.thesis()[2].sigma("payload.displacement"), 11.7e-3),
            test=f"{of_thesis}test_payload_motion_before_and_after",
        ),
        Check(
            subject=thesis,
            quantity="M_s of the thesis's gains",
            source=found_since,
            measure=ABSOLUTE,
            accepted=5e-3,
            work=pair(loop("max_sensitivity"), 5.15),
            test=f"{of_thesis}test_margins",
        ),
        Check(
            subject=thesis,
            quantity="delay margin of the thesis's gains",
            unit="s",
            source=found_since,
            measure=ABSOLUTE,
            accepted=5e-5,
            work=pair(loop("delay"), 25.7e-3),
            test=f"{of_thesis}test_margins",
        ),
        Check(
            subject=thesis,
            quantity="growth of these gains on a rope of 20 masses",
            unit="1/s",
            source=found_since,
            measure=ABSOLUTE,
            accepted=0.05,
            work=routes.growth_on_a_rope,
            test=f"{of_thesis}test_unstable_on_a_rope_with_axial_modes",
        ),
        # Closed forms.
        Check(
            subject=closed,
            quantity="axial modes of four ropes, eight each",
            source="nu tan nu = mL/M by bisection",
            accepted=1e-10,
            work=routes.rope_modes,
            test="tests/models/plant/test_rope.py::test_modes_solve_their_equation_one_in_each_interval",
        ),
        Check(
            subject=closed,
            quantity="first period of five steel wire ropes",
            unit="s",
            source="computed apart, with MoorPy's wire rope",
            measure=ABSOLUTE,
            accepted=0.006,
            work=routes.wire_ropes,
            test="tests/models/plant/test_rope.py::test_first_period_of_steel_wire_ropes",
        ),
        Check(
            subject=closed,
            quantity="error of the second mode, 20 masses over 40",
            source="falls as the square of the pieces",
            accepted=0.02,
            work=routes.lumped_rope,
            test="tests/models/plant/test_rope.py::test_frequencies_converge_with_the_square_of_the_piece",
        ),
        Check(
            subject=closed,
            quantity="responses of a rope of 40 masses up to 15 rad/s, ten winches",
            source="partial differential equation, solved in closed form",
            accepted=3e-3,
            test="tests/models/plant/test_line.py::test_lumped_plant_converges_with_the_square_of_the_piece",
        ),
        Check(
            subject=closed,
            quantity="moments m0, m1, m2 of Bretschneider's spectrum",
            source="incomplete gamma functions",
            accepted=1e-8,
            work=routes.bretschneider,
            test=f"{sea}test_moments_of_bretschneider",
        ),
        Check(
            subject=closed,
            quantity="JONSWAP's density, gamma 1 to 5",
            source="DNV-RP-C205, written out",
            accepted=1e-12,
            work=routes.jonswap,
            test=f"{sea}test_jonswap_as_dnv_writes_it",
        ),
        Check(
            subject=closed,
            quantity="significant height of JONSWAP by its integral, gamma 3.3",
            unit="m",
            source="what was asked for",
            accepted=2e-3,
            work=routes.jonswap_height,
            test=f"{sea}test_jonswap_as_dnv_writes_it",
        ),
        Check(
            subject=closed,
            quantity="TMA, over its peak, and Gaussian swell",
            source="wavespectra",
            accepted=4e-3,
            test=f"{sea}test_tma_and_gaussian_swell_as_wavespectra_has_them",
        ),
        Check(
            subject=closed,
            quantity="moments of a flat band",
            source="powers",
            accepted=1e-10,
            work=routes.flat_band,
            test="tests/models/basics/test_metrics.py::test_moments_of_a_flat_band",
        ),
        Check(
            subject=closed,
            quantity="crests above the most probable maximum in 3 h",
            source="Rayleigh",
            accepted=1e-9,
            work=routes.largest_of_a_time,
            test="tests/models/basics/test_metrics.py::test_one_crest_in_the_exposure_exceeds_the_most_probable_maximum",
        ),
        Check(
            subject=closed,
            quantity="gain, phase and delay margin of 4/(s + 1)^3",
            source="by hand",
            accepted=1e-9,
            work=routes.third_order_lag,
            test=f"{margins}test_third_order_lag_has_the_textbook_margins",
        ),
        Check(
            subject=closed,
            quantity="gain and delay margin of a late integrator",
            source="by hand",
            accepted=1e-9,
            work=routes.late_integrator,
            test=f"{margins}test_delayed_integrator_has_the_closed_form",
        ),
        Check(
            subject=closed,
            quantity="linear drag of a Gaussian velocity",
            source="Monte Carlo, 1e6 draws",
            unit="N s/m",
            accepted=5e-3,
            work=routes.drag,
            test="tests/models/plant/test_drag.py::test_the_equivalent_agrees_with_monte_carlo",
        ),
        Check(
            subject=closed,
            quantity="regulator of a double integrator",
            source="1/sqrt(rho), sqrt(2)/rho^(1/4)",
            accepted=1e-9,
            work=routes.regulator,
            test=_MOMENTS,
        ),
        Check(
            subject=closed,
            quantity="variance of a random walk foretold by a Kalman filter",
            source="(1 + sqrt(5))/2",
            accepted=1e-9,
            work=routes.random_walk,
            test=_MOMENTS,
        ),
        Check(
            subject=closed,
            quantity="best gain of a late integrator times its delay",
            source="cos u = u (Kuechler and Mensch 1992)",
            accepted=1e-6,
            work=routes.dottie,
            test="tests/synth/design/test_tune.py::test_delayed_integrator_has_the_dottie_number_for_its_best_gain",
        ),
        Check(
            subject=closed,
            quantity="Sobol's indices of Ishigami's function",
            source="Ishigami and Homma 1990",
            measure=ABSOLUTE,
            accepted=0.015,
            work=routes.ishigami,
            test="tests/synth/sensitivity/test_global_sensitivity.py::test_indices_of_ishigamis_function",
        ),
        Check(
            subject=closed,
            quantity="upper end of Clopper and Pearson's interval, no failure",
            source="1 - 0.025^(1/n)",
            accepted=1e-9,
            work=routes.clopper_pearson,
            test=_MOMENTS,
        ),
        Check(
            subject=closed,
            quantity="lines of a winch's capability over the period",
            source="the maker's sheet: H = vT/pi and others",
            accepted=1e-12,
            test="tests/synth/operability/test_operability.py::test_the_makers_lines_are_those_of_the_sheet",
        ),
        Check(
            subject=closed,
            quantity="weather windows and waits",
            source="counted hour by hour",
            accepted=1e-6,
            test="tests/synth/operability/test_windows.py::test_windows_and_waits_are_those_of_counting_by_hand",
        ),
        Check(
            subject=closed,
            quantity="gain margins of a sampled loop",
            source="the gain at which a pole is on the unit circle",
            accepted=1e-9,
            test="tests/synth/structures/test_sampled_margins.py::test_gain_margins_put_a_pole_on_the_unit_circle",
        ),
        # Synthesis.
        *_pi_rows(),
        Check(
            subject=synthesis,
            quantity="gains of regulator and observer of a position servo",
            source="Kwakernaak and Sivan 1972, examples 3.8 and 4.4, printed to 4 digits",
            accepted=1e-3,
            work=routes.servo_gains,
            test=_MOMENTS,
        ),
        Check(
            subject=synthesis,
            quantity="the servo's controller of second order, found by search: rms",
            source="the published gains, by a Lyapunov equation",
            accepted=1e-5,
            work=lambda: routes.lqg("position_servo"),
            test=_MOMENTS,
        ),
        Check(
            subject=synthesis,
            quantity="the LQG controller without margins: rms",
            source="Doyle 1978, gains in closed form, by a Lyapunov equation",
            accepted=1e-7,
            work=lambda: routes.lqg("no_margins"),
            test=_MOMENTS,
        ),
        Check(
            subject=synthesis,
            quantity="H2 example of an unstable plant, controller of third order",
            source="Zhou and Doyle, Essentials of Robust Control",
            accepted=1e-5,
            work=lambda: routes.h2("zhou"),
            test=_MOMENTS,
        ),
        Check(
            subject=synthesis,
            quantity="the same as a bound on every linear controller",
            source="Zhou and Doyle, Essentials of Robust Control",
            accepted=1e-5,
            work=routes.h2_bound,
            test="tests/synth/bound/test_bound.py::test_textbook_optima",
        ),
        Check(
            subject=synthesis,
            quantity="H2 optimum, two outputs",
            source="Scherer, Gahinet and Chilali 1997",
            accepted=1e-5,
            work=lambda: routes.h2("two outputs"),
            test=_MOMENTS,
            quick=False,
        ),
        Check(
            subject=synthesis,
            quantity="H2 optimum, three outputs",
            source="Scherer, Gahinet and Chilali 1997",
            accepted=1e-5,
            work=lambda: routes.h2("three outputs"),
            test=_MOMENTS,
            quick=False,
        ),
        Check(
            subject=synthesis,
            quantity="controllers of the plant's order, six plants: rms",
            source="Riccati equations",
            accepted=1e-8,
            test="tests/synth/design/test_tune.py::test_controller_of_the_plants_order_is_the_lqg_optimum",
        ),
        Check(
            subject=synthesis,
            quantity="two gains for an unstable helicopter (Keel, Bhattacharyya and Howze 1988)",
            source="a grid, refined by Nelder and Mead",
            accepted=1e-8,
            test="tests/synth/design/test_tune.py::test_helicopters_two_gains_are_the_best_of_a_grid",
        ),
        Check(
            subject=synthesis,
            quantity="accepted answers of 4000 random starts that are unstable",
            source="winding numbers, exact delays",
            measure=ABSOLUTE,
            accepted=0.0,
            stored=True,
            work=routes.random_starts,
            test="tests/project/test_studies.py::test_no_accepted_random_start_is_unstable",
        ),
        # Predictive control.
        *(
            Check(
                subject=control,
                quantity=f"{name}: cost of the first plan",
                source=f"{whose}, stated in CVXPY, by Clarabel",
                accepted=1e-9,
                work=lambda n=name: routes.mpc_cost(n),
                test="tests/mpc/programme/test_published.py::test_the_optimum_is_that_of_the_plain_statement",
            )
            for name, whose in (
                ("mass chain", "Wang and Boyd 2010, as in acados"),
                ("oscillating masses", "do-mpc"),
                ("quadcopter", "OSQP"),
            )
        ),
        Check(
            subject=control,
            quantity="first inputs of these problems",
            source="do-mpc with Ipopt",
            measure=ABSOLUTE,
            accepted=1e-6,
            test="tests/mpc/programme/test_published.py::test_do_mpc_answers_the_same",
        ),
        Check(
            subject=control,
            quantity="first inputs of two of them",
            source="acados with HPIPM",
            measure=ABSOLUTE,
            accepted=1e-6,
            test="tests/mpc/programme/test_published.py::test_acados_answers_the_same",
        ),
        Check(
            subject=control,
            quantity="moves of the winch's programme over the peak torque, a thousand states",
            source="stated in CVXPY",
            measure=ABSOLUTE,
            accepted=1e-6,
            test="tests/mpc/linear/test_linear_mpc.py::test_it_agrees_with_the_plain_statement_in_cvxpy_on_a_thousand_states",
        ),
        Check(
            subject=control,
            quantity="its command without active limits",
            source="linear-quadratic regulator with Kalman filter",
            accepted=1e-6,
            test="tests/mpc/linear/test_linear_mpc.py::test_without_active_limits_it_is_the_linear_quadratic_regulator",
        ),
        Check(
            subject=control,
            quantity="gain of the Kalman filter",
            source="SciPy's Riccati equation",
            accepted=1e-7,
            test="tests/mpc/programme/test_any_plant.py::test_the_gain_in_the_end_is_that_of_scipys_riccati_equation",
        ),
        Check(
            subject=control,
            quantity="clairvoyant floor of a saturated record",
            source="stated in CVXPY, by Clarabel",
            accepted=1e-5,
            test="tests/mpc/floor/test_clairvoyant.py::test_the_floor_is_that_of_a_brute_force_statement_of_the_same_problem",
        ),
        Check(
            subject=control,
            quantity="floor of the linear plant, payload's rms",
            unit="m",
            source="Ipopt on the nonlinear plant",
            measure=ABSOLUTE,
            accepted=1e-3,
            test="tests/mpc/floor/test_record_nlp.py::test_the_nonlinear_optimum_is_close_to_the_linear_floor",
        ),
        Check(
            subject=control,
            quantity="commands of predictive control in C over 20 000 samples, over the peak",
            source="the same in Python",
            measure=ABSOLUTE,
            accepted=1e-9,
            test="tests/mpc/codegen/test_native_mpc.py::test_20_000_samples_of_a_calm_run_agree_to_a_billionth_of_the_peak",
        ),
        # Vessels.
        Check(
            subject=vessels,
            quantity="hook of MSS's supply vessel: sigmas, period and extremes of 7 seas",
            source="computed by other code from the same file",
            accepted=5e-3,
            test="tests/models/vessel/test_supply_vessel.py::test_the_table_is_met_to_its_digits_with_its_interpolation",
        ),
        Check(
            subject=vessels,
            quantity="the same vessel read from ShipX and from Matlab",
            source="each other",
            measure=ABSOLUTE,
            accepted=1e-12,
            test=f"{files}test_the_supply_vessel_of_mss_and_of_shipx_is_one",
        ),
        Check(
            subject=vessels,
            quantity="a tanker of WAMIT in waves of 164 s: heave",
            source="the surface itself",
            measure=ABSOLUTE,
            accepted=2e-3,
            test=f"{files}test_the_tanker_of_wamit_keeps_the_limits_of_long_waves",
        ),
        Check(
            subject=vessels,
            quantity="loads on a barge of OrcaFlex, over the largest",
            source="the barge in Capytaine, another mesh",
            accepted=0.035,
            test=f"{files}test_the_barge_of_orcaflex_feels_the_loads_that_capytaine_computed",
        ),
        Check(
            subject=vessels,
            quantity="RAOs from a file that Capytaine wrote",
            source="Capytaine's own",
            accepted=1e-9,
            test="tests/models/vessel/test_capytaine_file.py::test_a_file_that_capytaine_wrote_gives_capytaines_rao",
        ),
        Check(
            subject=vessels,
            quantity="motions of that barge from another's coefficients, but roll",
            source="our own computation by Capytaine",
            accepted=0.02,
            test="tests/models/vessel/test_capytaine_file.py::test_the_barge_of_another_program_moves_as_our_own_computation_says",
        ),
        Check(
            subject=vessels,
            quantity="heave and pitch of the bundled osv-83m",
            source="MSS's supply vessel of the same size, strip theory",
            accepted=0.2,
            test="tests/models/vessel/test_osv.py::test_heave_and_pitch_are_those_of_another_ship_of_the_same_dimensions",
        ),
        Check(
            subject=vessels,
            quantity="heave of osv-83m in head waves of 42 s",
            source="the surface itself",
            accepted=0.05,
            work=routes.long_waves,
            test="tests/models/vessel/test_osv.py::test_the_bundled_vessel_keeps_the_limits_of_long_waves",
        ),
        Check(
            subject=vessels,
            quantity="all its motions in them, weighted mean",
            source="limits of long waves",
            measure=ABSOLUTE,
            accepted=0.05,
            work=routes.long_wave_error,
            test="tests/models/vessel/test_osv.py::test_the_bundled_vessel_keeps_the_limits_of_long_waves",
        ),
        Check(
            subject=vessels,
            quantity="volume, waterplane and metacentric radii of a box",
            source="by hand",
            accepted=1e-12,
            work=routes.box,
            test="tests/models/vessel/test_hull.py::test_a_box_floats_as_its_closed_form_says",
        ),
        # Time.
        Check(
            subject=in_time,
            quantity="nonlinear plant under a sine for a minute, any state",
            source="SciPy's solve_ivp (DOP853, 1e-11)",
            measure=ABSOLUTE,
            accepted=1e-8,
            work=routes.against_scipy,
            test="tests/models/simulation/test_integrate.py::test_whole_plant_with_quadratic_drag_agrees_with_scipy",
        ),
        Check(
            subject=in_time,
            quantity="order of the integration",
            source="four",
            measure=ABSOLUTE,
            accepted=0.1,
            test="tests/models/simulation/test_integrate.py::test_runge_kutta_has_order_four_on_the_plant_under_a_sine",
        ),
        Check(
            subject=in_time,
            quantity="variances of long simulations without limits, in standard errors",
            source="spectral integrals, sampled loop",
            measure=ABSOLUTE,
            accepted=3.0,
            test="tests/models/simulation/test_simulated_variance.py::test_simulated_variance_is_within_three_standard_errors_of_the_spectral_value",
        ),
        Check(
            subject=in_time,
            quantity="a loop in compiled C, every signal over its size",
            source="the same controller stepped in Python",
            measure=ABSOLUTE,
            accepted=1e-9,
            test="tests/models/simulation/test_simulate.py::test_a_controller_in_python_and_the_same_compiled_into_the_loop_agree",
        ),
        # Designs in simulation.
        *(
            Check(
                subject=designs,
                quantity=f"payload's rms as printed, {words} of all ok designs",
                source="3 h on the nonlinear plant, 3 runs or more",
                accepted=0.03,
                work=lambda q=level: routes.payload_deviation(q),
                stored=True,
                test=studied,
            )
            for words, level in (("median", 0.5), ("95 %", 0.95))
        ),
        *(
            Check(
                subject=designs,
                quantity=f"ok designs {words}",
                source=f"none was asked for, {note}" if note else "none was asked for",
                unit=f"of {len(routes.held())}",
                measure=ABSOLUTE,
                accepted=0.0,
                work=lambda b=broken: routes.count_of_held(b),
                stored=True,
                test=studied,
            )
            for words, note, broken in (
                ("with a standard deviation off by 3 % and 3 standard errors", "", routes.off),
                (
                    "with a dynamic part above 1.4 times the printed",
                    f"about {routes.by_chance():.0f} are there by chance alone",
                    routes.far,
                ),
                ("that grow at the least damping of their rope", "", routes.grows),
                ("that go slack", "", routes.slack),
            )
        ),
        *(
            Check(
                subject=designs,
                quantity=f"runs that exceed the most probable extreme: {kind}",
                source="1 - 1/e by theory, 55 to 70 % was asked for",
                measure=ABSOLUTE,
                accepted=0.082,
                work=lambda k=kind: routes.exceeded(k),
                stored=True,
                test=studied,
            )
            for kind in routes.kinds()
        ),
    )


CHECKS = _checks()


def computed(*, quick: bool) -> list[Check]:
    """Return the rows that this script computes, those that take moments alone if asked for."""
    return [one for one in CHECKS if one.how == COMPUTED and (one.quick or not quick)]
