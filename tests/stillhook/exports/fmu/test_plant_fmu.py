"""The FMU of the plant: the simulation's own numbers, alone, in a loop, and in another master."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from former_cases import load_case
from one_run import simulate
from still_motion import StillMotion

from models.basics import InputError, SolverError
from models.operation import Move, Profile, Schedule, SineMotion, scenario_named
from models.sensing import HEARD
from models.simulation import find_compiler
from stillhook.exports.fmu.check import Slave
from stillhook.exports.fmu.controller import COMMAND, fmu_model
from stillhook.exports.fmu.package import make_fmu
from stillhook.exports.fmu.plant import (
    _proof,
    plant_as_fmu,
    plant_model,
    plant_recursion,
)
from stillhook.exports.law import law_of

pytest.importorskip("fmpy", reason="fmpy is not installed: make export")
pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

# Perfect sensors: what a controller hears is what the plant's FMU gives.
THESIS = load_case("thesis-1975")
GAINS = {"A": 200.0, "a": 0.5, "a1": 2.0, "a2": 2.0}
T = 0.02
HEARD_FROM = {
    "payload.acceleration": "measured.acceleration",
    "payload.velocity": "measured.velocity",
    "payload.displacement": "measured.displacement",
    "drum.haul": "drum.haul",
    "motor.speed": "motor.speed",
    "rope.tension": "measured.tension",
    "motor.torque": "motor.torque",
    "drive.applied": "drive.applied",
}
# The motor's torque is left out: a run logs what it becomes with the command of the sample.
COMPARED = (
    "payload.displacement",
    "payload.acceleration",
    "motor.speed",
    "rope.tension",
    "drum.haul",
)


@cache
def plant(step=T, case=THESIS):
    return make_fmu(plant_model(case, plant_recursion(case, step), step))


@cache
def law(sample_time=T):
    return law_of(THESIS, controller="feedback", gains=GAINS, sample_time=sample_time)


@cache
def controller(sample_time=T):
    return make_fmu(fmu_model(law(sample_time)))


@cache
def moved(duration=12.0):
    """The load is moved by the set point."""
    profile = Profile(moves=(Move(start=1.0, distance=0.3, speed=0.1, acceleration=0.1),))
    return replace(scenario_named("hold", THESIS), profile=profile, duration=duration)


def sequential(hook, scenario, parts=1, duration=12.0, case=THESIS):
    """The loop of both FMUs: the controller's step first, then the plant's, in so many parts."""
    count, step = round(duration / T), T
    schedule = Schedule(scenario=scenario, sample_time=step).block(0, count)
    z, v, _ = hook.block(0, count * parts + 1)
    logged = np.empty((count, 1 + len(COMPARED)))
    start = {"hook.heave": z[0], "hook.heave_rate": v[0]}
    with Slave(controller(step)) as law, Slave(plant(step / parts, case), start=start) as rig:
        for k in range(count):
            now = k * parts
            heard = dict(zip(HEARD_FROM, rig.get(*HEARD_FROM.values()), strict=True))
            reference = schedule.reference[k].tolist()
            heard |= dict(zip(HEARD[13:16], reference, strict=True))
            law.set({**heard, "mru.heave": z[now], "mru.heave_rate": v[now]})
            law.step(k * step, step)
            (command,) = law.get(COMMAND)
            logged[k] = [command, *rig.get(*COMPARED)]
            for j in range(parts):
                at = {"hook.heave": z[now + j], "hook.heave_rate": v[now + j]}
                rig.set({**at, "drive.command": command})
                rig.step((now + j) * step / parts, step / parts)
    return logged


def simulated(hook, scenario, case=THESIS, **options):
    run = simulate(case, law().controller, scenario=scenario, hook=hook, store_step=T, **options)
    return np.column_stack([run[name] for name in ("drive.command", *COMPARED)])


def test_export_says_what_it_is_and_how_it_was_proved():
    made = plant_as_fmu(load_case("landing"), sample_time=0.01, name="rig")
    assert (made.kind, made.proved) == ("plant", True)
    assert set(made.files) == {"rig.fmu", "rig_OspModelDescription.xml"}
    assert "every output was the same to the last bit" in made.proof
    assert "| `hook.heave_rate` | m/s | its rate, up positive |" in made.about
    assert "| `motor.power` | W |" in made.about
    assert "whole number of integration steps of 5 ms; 10 ms is the one" in made.about


def test_plant_without_compiler_has_sources_alone(monkeypatch):
    monkeypatch.setenv("STILLHOOK_COMPILE", "0")
    made = plant_as_fmu(THESIS, sample_time=T)
    assert (made.proved, next(iter(made.files))) == (False, "thesis_1975_plant.fmu")
    assert "sources alone" in made.about


@pytest.mark.parametrize("step", [0.0, 2.0])
def test_sample_time_out_of_range_is_an_error(step):
    with pytest.raises(InputError, match="export: plant: sample_time must be"):
        plant_as_fmu(THESIS, sample_time=step)


def test_plant_that_is_other_than_its_functions_is_an_error():
    recursion = plant_recursion(THESIS, T)
    model = plant_model(THESIS, recursion, T)
    source = model.sources["model.c"].replace("0.5 * a * t1 * t1", "0.6 * a * t1 * t1")
    spoilt = make_fmu(replace(model, sources={**model.sources, "model.c": source}))
    with pytest.raises(SolverError, match="the FMU's outputs are other ones, by up to"):
        _proof(spoilt, recursion, T)


def test_it_starts_at_rest_with_the_hook():
    rest = plant_recursion(THESIS, T).made.rest
    with Slave(plant(), start={"hook.heave": 0.7, "hook.heave_rate": -0.2}) as rig:
        shown = rig.get("payload.displacement", "payload.velocity", "drum.haul", "rope.tension")
        assert shown == pytest.approx([0.7, -0.2, 0.0, rest.tension], rel=1e-9)
        assert rig.get("drive.command", "drive.applied") == pytest.approx([rest.command] * 2)
        rig.set({"hook.heave": 0.7, "hook.heave_rate": 0.0})
    with Slave(plant()) as rig:
        for k in range(50):
            rig.step(k * T, T)
        assert abs(rig.get("payload.displacement")[0]) < 1e-9


def test_step_that_is_no_whole_number_of_its_own_is_refused(capfd):
    with Slave(plant()) as rig:
        rig.step(0.0, 3 * T)
        for step in (0.4 * T, 1.5 * T):
            with pytest.raises(Exception, match="fmi2DoStep"):
                rig.step(3 * T, step)
    assert "must be a whole number of integration steps of 20 ms" in capfd.readouterr().out


def test_brake_holds_the_drum():
    for brake, held in ((1.0, True), (0.0, False)):
        with Slave(plant(), start={"hook.heave_rate": 0.1}) as rig:
            rig.set({"brake.on": brake, "drive.command": 0.0})
            for k in range(20):
                rig.step(k * T, T)
            assert (rig.get("drum.haul", "motor.speed") == [0.0, 0.0]) == held


@pytest.mark.parametrize(
    ("heave", "said"), [(math.nan, "an input is no number"), (1e305, "the plant diverged")]
)
def test_what_no_plant_does_is_told(heave, said, capfd):
    with Slave(plant()) as rig:
        rig.set({"hook.heave": heave})
        with pytest.raises(Exception, match="fmi2DoStep"):
            rig.step(0.0, T)
    assert said in capfd.readouterr().out


@pytest.mark.parametrize("delay", [0.0, 0.5 * T, 2 * T])
def test_loop_with_a_still_hook_is_the_simulation_to_the_last_bit(delay):
    hook, case = StillMotion(), THESIS.replace({"winch.drive.command_delay": delay})
    want = simulated(hook, moved(), case)
    found = sequential(hook.motion(12.5, T, 0), moved(), case=case)
    assert np.ptp(want[:, 1]) > 0.25
    # A run logs the command that acts, and that as a difference from the one at rest.
    assert np.array_equal(found[:, 1:], want[: len(found), 1:])
    if not delay:
        assert found[:, 0] == pytest.approx(want[: len(found), 0], rel=1e-15)


def in_waves(parts):
    """The payload's largest difference, relative, of the loop in so many parts of a sample."""
    hook, step = SineMotion(amplitude=1.0, period=8.0), T / parts
    # The integration step of all is the communication step.
    want = simulated(hook, moved(24.0), **{"step": step, "duration": 24.0})
    eased = hook.motion(24.5, step, 0).eased(30.0)
    found = sequential(eased, moved(24.0), parts=parts, duration=24.0)
    off = np.abs(found - want[: len(found)]) / np.abs(want).std(axis=0)
    return off.max(axis=0)


def test_loop_in_waves_differs_by_the_hooks_extrapolation_alone():
    # This rope has no damping, so that the heave counts alone: that falls with the cube.
    coarse, fine = in_waves(1), in_waves(2)
    assert 0.0 < coarse[1] < 2e-6
    assert coarse[1] / fine[1] == pytest.approx(8.0, rel=0.05)


@pytest.mark.ci
def test_rope_with_damping_differs_by_less_than_the_square_of_the_communication_step():
    """The hook's rate counts: open loop, the drum held by the command."""
    case, worst = load_case("subsea-crane"), []
    recursion = plant_recursion(case, 0.0025)
    values = np.array(list(recursion.parameters.values()))
    hook = SineMotion(amplitude=1.0, period=8.0).motion(8.0, recursion.step, 0)
    z, v, a = hook.block(0, hook.rows)
    x = np.array(recursion.made.start)
    displaced, moved = recursion.with_hook()
    x[moved] += v[0]
    x[displaced] += z[0]
    exact = []
    for k in range(2400):
        ends = [w[k + i] for i in (0, 1) for w in (z, v, a)]
        x = np.asarray(recursion.advance(x, recursion.made.rest.command, ends, 0.0, values)).ravel()
        exact.append(x[recursion.made.plant.states.index("payload.displacement")])
    rig = make_fmu(plant_model(case, recursion, 0.0025))
    for every in (32, 16, 8):
        start = {"hook.heave": z[0], "hook.heave_rate": v[0]}
        with Slave(rig, start=start) as slave:
            off = 0.0
            for k in range(0, 2400, every):
                slave.set({"hook.heave": z[k], "hook.heave_rate": v[k]})
                slave.step(k * recursion.step, every * recursion.step)
                off = max(off, abs(slave.get("payload.displacement")[0] - exact[k + every - 1]))
        worst.append(off)
    assert np.ptp(exact) > 2.0
    assert worst[0] < 1e-4
    assert worst[0] > 4.0 * worst[1] > 16.0 * worst[2]


def test_late_command_is_the_simulations():
    case = THESIS.replace({"winch.drive.command_delay": 0.05})
    recursion = plant_recursion(case, T)
    assert (recursion.waiting, recursion.share) == (3, pytest.approx(0.5))
    rest = recursion.made.rest.command
    with Slave(plant(T, case)) as rig:
        applied = []
        for k in range(5):
            rig.set({"drive.command": rest + 1.0})
            rig.step(k * T, T)
            applied += rig.get("motor.speed", "drive.applied")
        assert np.abs(applied[0:4:2]).max() < 1e-9 < 1e-4 < applied[4] < applied[6]
        assert applied[1::2] == pytest.approx([rest + 1.0] * 5)
    assert "to the last bit" in _proof(plant(T, case), recursion, T)


def connected(groups, variables):
    """The description of a system for masters of OSP: both FMUs, connected."""

    def ends(kind, pair):
        inner = "".join(f'<{kind} simulator="{who}" name="{name}"/>' for who, name in pair)
        return f"<{kind}Connection>{inner}</{kind}Connection>"

    simulators = "".join(
        f'<Simulator name="{name}" source="{name}.fmu" stepSize="0.01"/>'
        for name in ("feedback", "thesis_1975_plant")
    )
    return f"""\
<?xml version="1.0" encoding="utf-8"?>
<OspSystemStructure version="0.1"
    xmlns="http://opensimulationplatform.com/MSMI/OSPSystemStructure">
  <StartTime>0.0</StartTime>
  <BaseStepSize>0.01</BaseStepSize>
  <Algorithm>fixedStep</Algorithm>
  <Simulators>{simulators}</Simulators>
  <Connections>
    {"".join(ends("Variable", pair) for pair in variables)}
    {"".join(ends("VariableGroup", pair) for pair in groups)}
  </Connections>
</OspSystemStructure>
"""


class Execution:
    """libcosim, the master of the Open Simulation Platform: parallel, its time in nanoseconds."""

    def __init__(self, folder, system):
        from libcosimpy.CosimExecution import CosimExecution
        from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
        from libcosimpy.CosimManipulator import CosimManipulator
        from libcosimpy.CosimObserver import CosimObserver

        log_output_level(CosimLogLevel.WARNING)
        (folder / "OspSystemStructure.xml").write_text(system)
        self.made = CosimExecution.from_osp_config_file(str(folder / "OspSystemStructure.xml"))
        self.observer = CosimObserver.create_last_value()
        self.made.add_observer(self.observer)
        self.hand = CosimManipulator.create_override()
        self.made.add_manipulator(self.hand)

    def at(self, slave, names):
        index = self.made.slave_index_from_instance_name(slave)
        known = {v.name.decode(): v.reference for v in self.made.slave_variables(index)}
        return index, [known[name] for name in names]

    def set(self, slave, values):
        self.hand.slave_real_values(*self.at(slave, values), list(values.values()))

    def get(self, slave, *names):
        return self.observer.last_real_values(*self.at(slave, names))


def test_both_run_in_the_open_simulation_platform(tmp_path):
    pytest.importorskip("libcosimpy", reason="libcosimpy is not installed")
    step, duration = 0.01, 6.0
    scenario = moved(duration)
    # A parallel master hands each command on one communication step late.
    late = THESIS.replace({"winch.drive.command_delay": step})
    run = simulate(
        late, law(step).controller, scenario=scenario, hook=StillMotion(), store_step=step
    )
    want = np.column_stack([run[name] for name in ("drive.command", *COMPARED)])
    mine, rig = controller(step), plant(step)
    for name, content in {**mine.files, **rig.files}.items():
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    # A group is connected as a whole: that needs the description beside each FMU.
    groups = [((mine.name, "drive_output"), (rig.name, "drive_input"))]
    variables = [
        ((rig.name, output), (mine.name, name))
        for name, output in HEARD_FROM.items()
        if name != "drive.applied"
    ]
    variables.append(((mine.name, COMMAND), (mine.name, "drive.applied")))
    world = Execution(tmp_path, connected(groups, variables))
    count = round(duration / step)
    reference = Schedule(scenario=scenario, sample_time=step).block(0, count).reference
    found = np.empty((count + 1, 1 + len(COMPARED)))
    found[0] = want[0]
    for k in range(count):
        world.set(mine.name, dict(zip(HEARD[13:16], reference[k].tolist(), strict=True)))
        assert world.made.step()
        # The command of a sample acts from the next one on, where a run logs it.
        found[k + 1] = world.get(mine.name, COMMAND) + world.get(rig.name, *COMPARED)
    off = np.abs(found - want[: count + 1]) / np.abs(want).max(axis=0)
    assert np.ptp(want[:, 1]) > 0.2
    assert off.max() < 1e-14
