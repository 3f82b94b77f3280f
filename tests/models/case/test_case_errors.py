"""Cases that are wrong: every message, with its file, line, path, range and what came."""

from __future__ import annotations

import math
import pickle
import re
import textwrap

import pytest

from models import Case, InputError, PhysicsWarning, load_case

CASE = textwrap.dedent(
    """\
    stillhook: 1
    name: test
    sea:
      spectrum: jonswap
      significant_height: 2 m
      peak_period: 9 s
    vessel:
      heave_rao:
        omega: [0.3, 0.6, 0.9, 1.2]
        amplitude: [1, 1, 0.8, 0.3]
    rope:
      diameter: 50 mm
      axial_stiffness: 242.8 MN
      mass_per_length: 13.23 kg/m
      length: 1000 m
      damping_law: hysteretic
    payload:
      mass: 50 t
      added_mass: 50 t
      area: 16 m2
      drag_coefficient: 1.8
      submerged_weight: 421.7 kN
      drag:
        method: stochastic
    winch:
      drum:
        radius: 1 m
      gearbox:
        ratio: 100
        efficiency: 0.925
      motor:
        type: ac
        torque_bandwidth: 150 rad/s
        inertia: 20 kg m2
        base_speed: 1000 rpm
        maximum_speed: 2000 rpm
        kind: induction
      drive:
        torque_continuous: 8 kN m
        torque_peak: 14.4 kN m
    """
)


@pytest.fixture
def check(tmp_path, monkeypatch):
    """Write the case with some lines changed, load it, and return the lines of the error."""
    monkeypatch.chdir(tmp_path)

    def run(*changes: tuple[str, str]) -> list[str]:
        text = CASE
        for old, new in changes:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        (tmp_path / "my.yaml").write_text(text)
        with pytest.raises(InputError) as caught:
            load_case("my.yaml")
        return str(caught.value).splitlines()

    return run


def test_the_case_itself_is_right(tmp_path):
    path = tmp_path / "my.yaml"
    path.write_text(CASE)
    assert load_case(path).payload.mass == 50e3


WRONG = {
    "wrong dimension": (
        ("diameter: 50 mm", "diameter: 44 kg"),
        "my.yaml:12: rope.diameter: must be a length in [0.005, 0.3] m, got '44 kg', which is a "
        "mass",
    ),
    "millimetres without unit": (
        ("diameter: 50 mm", "diameter: 50"),
        "my.yaml:12: rope.diameter: must be a length in [0.005, 0.3] m, got 50",
    ),
    "kilonewtons as knots": (
        ("421.7 kN", "421.7 kn"),
        "my.yaml:22: payload.submerged_weight: must be a force in [1, 1e+09] N, got '421.7 kn', "
        "which is a speed (kn is knots; did you mean kN?)",
    ),
    "metric tonnes": (
        ("  mass: 50 t", "  mass: 50 mt"),
        "my.yaml:18: payload.mass: must be a mass in [1, 1e+08] kg, got '50 mt': mt is ambiguous "
        "(metric tonne, millitonne or megatonne?); write t for 1000 kg",
    ),
    "negative mass": (
        ("  mass: 50 t", "  mass: -5 t"),
        "my.yaml:18: payload.mass: must be a mass in [1, 1e+08] kg, got '-5 t' (-5000 kg)",
    ),
    "zero peak period": (
        ("peak_period: 9 s", "peak_period: 0"),
        "my.yaml:6: sea.peak_period: must be a time in [0.5, 60] s, got 0",
    ),
    "not a number": (
        ("significant_height: 2 m", "significant_height: .nan"),
        "my.yaml:5: sea.significant_height: must be a length in [0.001, 30] m, got nan, which is "
        "not finite",
    ),
    "infinite": (
        ("length: 1000 m", "length: .inf"),
        "my.yaml:15: rope.length: must be a length in [1, 12000] m, got inf, which is not finite",
    ),
    "yes and no": (
        ("area: 16 m2", "area: true"),
        "my.yaml:20: payload.area: must be an area in [0, 10000] m2, got True",
    ),
    "empty value": (
        ("ratio: 100", "ratio:"),
        "my.yaml:29: winch.gearbox.ratio: must be a ratio in [0.1, 10000], got nothing",
    ),
    "unknown key": (
        ("diameter: 50 mm", "diameter: 50 mm\n  mases: 3"),
        "my.yaml:13: rope.mases: unknown key; did you mean 'masses'?",
    ),
    "unknown key, nothing near": (
        ("radius: 1 m", "radius: 1 m\n    colour: red"),
        "my.yaml:28: winch.drum.colour: unknown key; known here: radius, layers, geometry, "
        "rope_on_drum_total, inertia",
    ),
    "unknown section": (
        ("sea:", "limit: {}\nsea:"),
        "my.yaml:3: limit: unknown key; did you mean 'limits'?",
    ),
    "key that is a number": (
        ("sea:", "7: {}\nsea:"),
        "my.yaml:3: 7: unknown key; known here: stillhook, name, description, sources, sea, "
        "vessel, rope, crane, rigging, payload, winch, sensors, limits, gains, gain_bounds",
    ),
    "unknown key in a motor": (
        ("type: ac", "type: ac\n    resistance: 3"),
        "my.yaml:33: winch.motor.resistance: unknown key; known here: inertia, "
        "viscous_friction, coulomb_friction, friction_speed, thermal_time_constant, "
        "temperature_rise, type, torque_bandwidth, speed_gain, base_speed, maximum_speed, kind",
    ),
    "missing field": (
        ("  length: 1000 m\n", ""),
        "my.yaml:11: rope.length: is missing; it must be a length in [1, 12000] m",
    ),
    "missing section": (
        ("  gearbox:\n    ratio: 100\n    efficiency: 0.925\n", ""),
        "my.yaml:25: winch.gearbox: is missing",
    ),
    "missing motor": (
        (CASE[CASE.index("  motor:") : CASE.index("  drive:")], ""),
        "my.yaml:25: winch.motor: is missing; its type must be 'dc' or 'ac'",
    ),
    "missing field in a motor": (
        ("    inertia: 20 kg m2\n", ""),
        "my.yaml:31: winch.motor.inertia: is missing; it must be a moment of inertia in "
        "[1e-06, 1e+06] kg m2",
    ),
    "bad field in a motor": (
        ("inertia: 20 kg m2", "inertia: 0"),
        "my.yaml:34: winch.motor.inertia: must be a moment of inertia in [1e-06, 1e+06] kg m2, "
        "got 0",
    ),
    "unknown motor": (
        ("type: ac", "type: hydraulic"),
        "my.yaml:32: winch.motor.type: must be 'dc' or 'ac', got 'hydraulic'",
    ),
    "no motor type": (
        ("    type: ac\n", ""),
        "my.yaml:31: winch.motor.type: is missing; must be 'dc' or 'ac'",
    ),
    "unknown drag method": (
        ("method: stochastic", "method: linear"),
        "my.yaml:24: payload.drag.method: must be 'given' or 'energy' or 'stochastic', "
        "got 'linear'",
    ),
    "bad drag coefficient": (
        ("method: stochastic", "method: given\n    coefficient: 5 N/m"),
        "my.yaml:25: payload.drag.coefficient: must be a damping in [0, 1e+09] N s/m, "
        "got '5 N/m', which is a force per length or a stiffness",
    ),
    "a section that is a number": (
        ("  drum:\n    radius: 1 m\n", "  drum: 1 m\n"),
        "my.yaml:26: winch.drum: must be a section with keys of its own, got '1 m'",
    ),
    "a number that is a section": (
        ("  length: 1000 m", "  length: {value: 1000 m}"),
        "my.yaml:15: rope.length: must be a length in [1, 12000] m, got {'value': '1000 m'}",
    ),
    "a list that is a number": (
        ("[0.3, 0.6, 0.9, 1.2]", "0.3"),
        "my.yaml:9: vessel.heave_rao.omega: must be a list, got 0.3",
    ),
    "bad entry of a list": (
        ("[1, 1, 0.8, 0.3]", "[1, 1, -0.8, 0.3]"),
        "my.yaml:10: vessel.heave_rao.amplitude[2]: must be a ratio in [0, 50] m/m, got -0.8",
    ),
    "unsorted RAO": (
        ("[0.3, 0.6, 0.9, 1.2]", "[0.3, 0.9, 0.6, 1.2]"),
        "my.yaml:9: vessel.heave_rao.omega: must be strictly ascending, got 0.9 followed by 0.6 "
        "(out of order, index 2)",
    ),
    "repeated RAO frequency": (
        ("[0.3, 0.6, 0.9, 1.2]", "[0.3, 0.6, 0.6, 1.2]"),
        "my.yaml:9: vessel.heave_rao.omega: must be strictly ascending, got 0.6 followed by 0.6 "
        "(repeated, index 2)",
    ),
    "RAO columns of different length": (
        ("[1, 1, 0.8, 0.3]", "[1, 1, 0.8]"),
        "my.yaml:10: vessel.heave_rao.amplitude: must have as many entries as omega, 4, got 3",
    ),
    "RAO with one row": (
        ("[0.3, 0.6, 0.9, 1.2]", "[0.3]"),
        "my.yaml:9: vessel.heave_rao.omega: must have at least 2 entries, got 1",
    ),
    "unknown spectrum": (
        ("spectrum: jonswap", "spectrum: jonswop"),
        "my.yaml:4: sea.spectrum: must be 'bretschneider-1975', 'bretschneider', 'jonswap', "
        "'torsethaugen', 'ochi-hubble', 'pierson-moskowitz', 'tma', 'gaussian-swell', "
        "'measured' or 'sum', got 'jonswop'; did you mean 'jonswap'?",
    ),
    "future format": (
        ("stillhook: 1", "stillhook: 2"),
        "my.yaml:1: stillhook: must be 1, got 2",
    ),
    "a long name": (
        ("name: test", f"name: {'x' * 101}"),
        f"my.yaml:2: name: must have at most 100 characters, got '{'x' * 56}...",
    ),
    "a name that is a number": (
        ("name: test", "name: 12"),
        "my.yaml:2: name: must be text, got 12",
    ),
    "a name that steers the terminal": (
        ("name: test", r'name: "te\e[31mst"'),
        "my.yaml:2: name: must be a line of text without control characters, got U+001B",
    ),
    "a name of two lines": (
        ("name: test", r'name: "te\nst"'),
        "my.yaml:2: name: must be a line of text without control characters, got U+000A",
    ),
    "a description that steers the terminal": (
        ("name: test", 'name: test\ndescription: "two\\nlines,\\tand \\u009b2J"'),
        "my.yaml:3: description: must be text without control characters, got U+009B",
    ),
    "a source that rings": (
        ("name: test", 'name: test\nsources:\n  rope: "a\\ab"'),
        "my.yaml:4: sources.rope: must be text without control characters, got U+0007",
    ),
    "a source under a key that steers": (
        ("name: test", 'name: test\nsources:\n  "ro\\bpe": a maker'),
        "my.yaml:4: sources.ro\\x08pe: must be a line of text without control characters, "
        "got U+0008",
    ),
    "an unknown key that steers": (
        ("name: test", 'name: test\n"s\\e[2Jea": 1'),
        "my.yaml:3: s\\x1b[2Jea: unknown key; did you mean 'sea'?",
    ),
    "modulus and stiffness": (
        ("diameter: 50 mm", "diameter: 50 mm\n  modulus: 124 GPa"),
        "my.yaml:11: rope: give either modulus or axial_stiffness, got both",
    ),
    "continuous torque below the static load": (
        ("torque_continuous: 8 kN m", "torque_continuous: 4 kN m"),
        "my.yaml:39: winch.drive.torque_continuous: must be at least the static motor torque, "
        "5.778 kN m (rope tension 534.5 kN on a drum radius of 1 m through a gear of 100 and "
        "efficiency 0.925), got 4 kN m",
    ),
    "more rope paid out than there is": (
        ("radius: 1 m", "layers: american-hoist-1000\n    rope_on_drum_total: 800 m"),
        "my.yaml:26: winch.drum: the drum holds 800 m of rope, less than the 1000 m paid out",
    ),
    "tension limit below the static load": (
        ("sea:", "limits: {rope_tension_peak: 500 kN}\nsea:"),
        "my.yaml:3: limits.rope_tension_peak: must be at least the static rope tension at the "
        "winch, 534.5 kN, got 500 kN",
    ),
    "slack limit above the static load": (
        ("sea:", "limits:\n  minimum_tension: 430 kN\nsea:"),
        "my.yaml:4: limits.minimum_tension: must be at most the least static tension at the "
        "payload, 400.6 kN, got 430 kN",
    ),
    "stroke without the place where the load hangs": (
        ("sea:", "limits:\n  stroke: [1 m, 3 m]\nsea:"),
        "my.yaml:4: limits.stroke: must be [low, high] with low < high and 0 within, got [1, 3] m",
    ),
    "every message lost": (
        ("sea:", "sensors:\n  telemetry:\n    dropout: 100 %\nsea:"),
        "my.yaml:5: sensors.telemetry.dropout: must be a ratio in [0, 1), got '100 %' (1)",
    ),
    "noise as if it were no density": (
        ("sea:", "sensors:\n  payload:\n    velocity_noise: 1 mm/s\nsea:"),
        "my.yaml:5: sensors.payload.velocity_noise: must be a velocity noise density in "
        "[0, 10] m/s/sqrt(Hz), got '1 mm/s', which is a speed",
    ),
    "sensitivity that no loop has": (
        ("sea:", "limits:\n  max_sensitivity: 0.9\nsea:"),
        "my.yaml:4: limits.max_sensitivity: must be a gain in (1, 100], got 0.9",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_one_error_one_line(check, name):
    change, message = WRONG[name]
    assert check(change) == [message]


def test_every_error_at_once_in_the_order_of_the_file(check):
    lines = check(
        ("peak_period: 9 s", "peak_period: 0 s"),
        ("diameter: 50 mm", "diameter: 44 kg\n  colour: red"),
        ("  mass: 50 t\n", ""),
        ("type: ac", "type: ac\n    speed_gain: 5 N m"),
        ("name: test", "name: test\nlimits: {drive: maybe}"),
    )
    assert [
        line.partition(": must")[0].partition(": unk")[0].partition(": is")[0] for line in lines
    ] == [
        "my.yaml:3: limits.drive",
        "my.yaml:7: sea.peak_period",
        "my.yaml:13: rope.diameter",
        "my.yaml:14: rope.colour",
        "my.yaml:19: payload.mass",
        "my.yaml:34: winch.motor.speed_gain",
    ]


def test_several_findings_of_one_section(check):
    lines = check(
        ("[0.3, 0.6, 0.9, 1.2]", "[0.3, 0.6, 0.5, 1.2]"),
        ("[1, 1, 0.8, 0.3]", "[1, 1]\n    phase: [1]"),
    )
    assert [line.partition(": must")[0] for line in lines] == [
        "my.yaml:9: vessel.heave_rao.omega",
        "my.yaml:10: vessel.heave_rao.amplitude",
        "my.yaml:11: vessel.heave_rao.phase",
    ]


@pytest.mark.parametrize(
    ("name", "field", "value", "message"),
    [
        ("thesis-1975", "sea.significant_period", "6e-9 s", "must be a time in [0.5, 60] s"),
        ("subsea-crane", "sea.peak_period", "0.4 s", "must be a time in [0.5, 60] s"),
        ("subsea-crane", "sea.significant_height", "1e-9 m", "must be a length in [0.001, 30] m"),
        ("subsea-crane", "winch.motor.inertia", 1e-12, "moment of inertia in [1e-06, 1e+06] kg m2"),
        ("subsea-crane", "winch.motor.thermal_time_constant", 0.1, "time in [1, 1e+06] s"),
    ],
)
def test_ranges_begin_at_what_means_something(name, field, value, message):
    with pytest.raises(InputError, match=re.escape(message)):
        load_case(name).replace({field: value})


def test_both_ratings_below_the_static_load(check):
    lines = check(("8 kN m", "4 kN m"), ("14.4 kN m", "5 kN m"))
    assert len(lines) == 2
    assert lines[1].startswith("my.yaml:40: winch.drive.torque_peak: must be at least the static")
    assert lines[1].endswith("got 5 kN m")


class TestPhysics:
    """What is allowed, and warned about."""

    def warned(self, changes, name="thesis-1975"):
        with pytest.warns(PhysicsWarning) as caught:
            case = load_case(name).replace(changes)
        assert isinstance(case, Case)
        assert len(caught) == 1
        return str(caught[0].message)

    def test_sea_steeper_than_breaking(self):
        assert self.warned({"sea.peak_period": 4}, "subsea-crane") == (
            "subsea-crane: sea.significant_height: 2 m with a peak period of 4 s is steeper than "
            "breaking: steepness 2 pi H_s/(g T_p^2) is 0.080, seas stay below 0.067 "
            "(DNV-RP-C205)"
        )
        load_case("subsea-crane").replace({"sea.peak_period": 5})

    def test_long_delay(self):
        assert self.warned({"sensors.telemetry.delay": 2.5}) == (
            "thesis-1975: sensors.telemetry.delay: 2.5 s is more than a quarter of the sea's peak "
            "period, 8.5 s: feedback cannot act on the waves"
        )

    def test_degrees_for_radians(self):
        phase = [-30.0 * i for i in range(18)]
        assert self.warned({"vessel.heave_rao.phase": phase}) == (
            "thesis-1975: vessel.heave_rao.phase: -510 rad is more than a turn: numbers are in "
            "radians, write '-510 deg' for degrees"
        )
        degrees = [f"{-2 * i} deg" for i in range(18)]
        load_case("thesis-1975").replace({"vessel.heave_rao.phase": degrees})

    def test_a_rope_that_is_stretched_beyond_what_holds(self):
        assert self.warned({"rope.axial_stiffness": "2 MN"}, "thesis-1975") == (
            "thesis-1975: rope.axial_stiffness: the load at rest stretches the rope by 19 % of its "
            "length: wire parts at 2 %, fibre ropes work below 5 %"
        )

    def test_voltage_below_the_back_emf(self):
        assert self.warned({"winch.drive.voltage": 700}) == (
            "thesis-1975: winch.drive.voltage: 700 V is below the back-EMF at the highest speed, "
            "728.8 V: the motor cannot reach it"
        )

    def test_static_load_above_reported_limits(self):
        message = self.warned({"winch.drive.torque_continuous": 5000})
        assert message.startswith(
            "thesis-1975: winch.drive.torque_continuous: 5 kN m is below the static motor torque, "
            "5.048 kN m (rope tension 452.2 kN"
        )
        # 800 A of 5.8 N m each.
        message = self.warned({"winch.drive.current_continuous": 800})
        assert "current_continuous: 800 A is below the static motor current, 870.3 A" in message

    def test_its_user_is_told_once(self):
        with pytest.warns(PhysicsWarning, match=r"sea\.significant_height: 2 m"):
            steep = load_case("subsea-crane").replace({"sea.peak_period": 4})
        # Warnings are errors here: neither a change of something else, nor more of the same.
        assert steep.replace({"rope.length": "900 m"}).sea == steep.sea
        steeper = steep.replace({"sea.significant_height": 2.5})
        assert Case.from_dict(steeper.to_dict()) == steeper
        with pytest.warns(PhysicsWarning, match=r"sensors\.telemetry\.delay: 1\.5 s is more"):
            steep.replace({"sensors.telemetry.delay": 1.5})

    def test_of_the_cases_of_a_study_nobody_is_told(self):
        crane = load_case("subsea-crane")
        steep = crane.variant({"sea.peak_period": 4})
        assert steep.quiet
        assert not crane.quiet
        again = pickle.loads(pickle.dumps(steep.variant({})))
        assert again == steep
        assert again.replace({"sensors.telemetry.delay": 1.5}).quiet

    def test_warnings_have_their_line(self, tmp_path):
        path = tmp_path / "my.yaml"
        path.write_text(CASE.replace("peak_period: 9 s", "peak_period: 4 s"))
        with pytest.warns(PhysicsWarning, match=r"my\.yaml:5: sea\.significant_height: 2 m with"):
            load_case(path)


class TestDirectConstruction:
    def test_case_from_keywords(self):
        with pytest.raises(InputError, match="Case: name: is missing"):
            Case(stillhook=1)

    def test_any_mapping_is_checked(self):
        with pytest.raises(InputError) as caught:
            Case.from_dict({"stillhook": 1, "name": "", 3: 4}, source="here")
        assert "here: name: must not be empty" in str(caught.value)
        assert "here: 3: unknown key" in str(caught.value)
        assert "here: sea: is missing" in str(caught.value)


def test_not_a_number_is_refused_everywhere():
    tree = load_case("thesis-1975").to_dict()
    count = 0

    def poisoned(section, path):
        nonlocal count
        for key, value in section.items():
            if isinstance(value, dict):
                poisoned(value, (*path, key))
            elif isinstance(value, float):
                section[key] = math.nan
                with pytest.raises(InputError, match=f"{key}: must be .* got nan"):
                    Case.from_dict(tree)
                section[key] = value
                count += 1

    poisoned(tree, ())
    assert count > 30
