"""`stillhook check`: its tables are written from the facts, and its JSON holds them."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from functools import cache

import pytest

import stillhook as sh
from models.hook import HookMotion
from stillhook.cli import main
from stillhook.commands.world.check import check_report
from stillhook.text import json_data


@cache
def known(name: str = "subsea-crane"):
    case = sh.load_case(name)
    hook = HookMotion.from_case(case)
    return case, hook, sh.system_facts(case, hook)


def rows(facts, name: str = "subsea-crane") -> dict[str, tuple[str, str]]:
    """Return figure and remark of every row by its label."""
    case, hook, _ = known(name)
    (section,) = check_report(case, hook, facts).sections
    return {label: rest for table in section.items for label, *rest in table.rows}


#: Part and field of the facts, another value, the row that shows it, and what it says then.
SHOWN = [
    ("rope", "stiffness", 77e3, "stiffness K = EA/L", "77.0 kN/m"),
    ("rope", "axial_stiffness", 77e6, "stiffness K = EA/L", "EA 77.0 MN"),
    ("rope", "falls", 3, "stiffness K = EA/L", "3 falls"),
    ("rope", "tip_stiffness", 7e6, "... crane's tip", "7.00 MN/m"),
    ("rope", "tip_share", 0.77, "... crane's tip", "77.0 % of the stretch"),
    ("rope", "sling_stiffness", 7e6, "... slings", "7.00 MN/m"),
    ("rope", "series_stiffness", 77e3, "... in series", "77.0 kN/m"),
    ("rope", "moving_mass", 77e3, "mass that moves, M", "77.0 t"),
    ("rope", "payload_mass", 77e3, "mass that moves, M", "payload 77.0 t"),
    ("rope", "added_mass", 77e3, "mass that moves, M", "added 77.0 t"),
    ("rope", "rope_mass", 77e3, "mass that moves, M", "rope 77.0 t"),
    ("rope", "block_mass", 7e3, "mass that moves, M", "hook block 7.00 t"),
    ("rope", "stretch", 7.7, "stretch at rest", "7.70 m"),
    ("rope", "travel_time", 7.7, "stretch at rest", "7.70 s"),
    ("held", "drag", 77e3, "linear drag", "77.0 kN s/m"),
    ("held", "payload_rms", 7.7, "payload, rms", "7.70 m"),
    ("held", "payload_rms", math.inf, "payload, rms", "nothing damps it"),
    ("held", "factor", 7.7, "payload, rms", "7.70 times the hook's"),
    ("waves", "low", 1.0, "hook, band", "to 6.28 s"),
    ("waves", "high", 1.0, "hook, band", "from 6.28 s"),
    ("waves", "peak", 1.0, "hook, band", "peak 6.28 s"),
    ("winch", "drum_radius", 7.7, "drum radius", "7.70 m"),
    ("winch", "drum_tension_hauling", 77e3, "static rope tension", "77.0 kN"),
    ("winch", "tension_share", 0.77, "static rope tension", "77.0 % of what it may"),
    ("winch", "load_tension_least", 77e3, "... at the load, least", "77.0 kN"),
    ("winch", "tension_to_stay", 77e3, "... at the load, least", "77.0 kN are to stay"),
    ("winch", "static_torque", 7.7e3, "static motor torque", "7.70 kN m"),
    ("winch", "rating_share", 0.77, "static motor torque", "77.0 % of the rating"),
    ("winch", "peak_share", 0.77, "static motor torque", "77.0 % of the peak"),
    ("winch", "rope_speed", 7.7, "fastest rope", "7.70 m/s"),
    ("winch", "speed_share", 0.77, "fastest rope", "77.0 % of it"),
    ("winch", "inertia", 77.0, "inertia", "77.0 kg m2"),
    ("winch", "equivalent_mass", 77e3, "inertia", "77.0 t at the rope"),
    ("winch", "following_power", 77e3, "power to follow the hook", "77.0 kW"),
]


@pytest.mark.parametrize(("part", "field", "value", "label", "text"), SHOWN)
def test_a_figure_is_that_of_the_facts(part, field, value, label, text):
    _, _, facts = known()
    assert text not in " ".join(rows(facts).get(label, ()))
    changed = dataclasses.replace(getattr(facts, part), **{field: value})
    told = rows(dataclasses.replace(facts, **{part: changed}))
    assert text in " ".join(told[label])


@pytest.mark.parametrize(
    ("place", "text"),
    [("below", "longer than the hook's band"), ("in", "in the hook's band"),
     ("above", "shorter than the hook's band")],
)  # fmt: skip
def test_a_mode_is_told_by_its_period(place, text):
    _, _, facts = known()
    first, *others = facts.modes
    mode = dataclasses.replace(first, period=7.7, place=place, relative_density=0.77)
    told = rows(dataclasses.replace(facts, modes=(mode, *others)))
    assert told["natural period"] == ["7.70 s", "drum held; next 662 ms, 334 ms"]
    words = " ".join(told["... in the waves"])
    assert words == f"{text}, at 77.0 % of its peak; next shorter, shorter"


def test_one_spring_has_no_next_mode():
    told = rows(known("thesis-1975")[2], "thesis-1975")
    assert told["natural period"] == ["6.66 s", "drum held, one spring"]
    assert told["... in the waves"] == ["in", "the hook's band, at 29.1 % of its peak"]


def test_the_hash_of_the_case_is_told(capsys):
    case, *_ = known()
    assert main(["check", "subsea-crane"]) == 0
    assert (
        f"  hash  {case.digest[:12]}  of its contents: 12 digits of 64" in capsys.readouterr().out
    )
    assert main(["check", "subsea-crane", "--set", "rope.length=999"]) == 0
    assert case.digest[:12] not in capsys.readouterr().out


def test_json_holds_the_hash_and_the_facts(capsys):
    case, _, facts = known()
    assert main(["check", "subsea-crane", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)["result"]
    assert result["digest"] == case.digest
    assert result["system"] == json_data(dataclasses.asdict(facts))
    assert result["system"]["modes"][0]["place"] == "above"
    assert result["system"]["rope"]["sling_stiffness"] is None  # rigid


def test_a_hook_that_stands_is_told(capsys):
    still = ["--set", "vessel.below=zero"]
    for k in range(18):
        still += ["--set", f"vessel.heave_rao.amplitude.{k}=0"]
    assert main(["check", "thesis-1975", *still]) == 0
    out = capsys.readouterr().out
    assert re.search(r"payload, rms +0 m  with the drum held +\n", out)
    assert "hook, band" not in out
    assert "in the waves" not in out
    assert "nan" not in out
