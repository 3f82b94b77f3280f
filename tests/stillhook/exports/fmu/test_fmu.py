"""The FMU of a controller: valid, bit-equal to the simulation, with a clock that does not drift."""

from __future__ import annotations

import ctypes
import io
import subprocess
import xml.etree.ElementTree as Xml
import zipfile
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from former_cases import load_case

from models.basics import InputError, SolverError
from models.sensing import HEARD, STATUSES, NativeLaw, interface_header
from models.simulation import find_compiler
from stillhook.exports.fmu import package as fmu_package
from stillhook.exports.fmu.check import Slave, check_valid, replayed
from stillhook.exports.fmu.controller import COMMAND, STATUS, _compared, as_fmu, fmu_model
from stillhook.exports.fmu.package import NO_FMPY, make_fmu
from stillhook.exports.law import law_of
from stillhook.exports.recording import record

pytest.importorskip("fmpy", reason="fmpy is not installed: make export")
pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

CRANE = load_case("subsea-crane")
T = 0.02
OSP = "{https://open-simulation-platform.com/OspModelDescription/1.0.0}"
COUNTING = """\
#include "counting.h"
void counting_reset(counting_memory *memory) { memory->samples = 0; memory->heave = 0.0; }
double counting_step(counting_memory *memory, const double *measured) {
  memory->heave = measured[5];
  return ++memory->samples + 1e-3 * memory->heave;
}
int counting_status(const counting_memory *memory) { return memory->samples == 0; }
"""


@cache
def law():
    return law_of(CRANE, controller="feed-forward")


@cache
def recording():
    return record(law())


@cache
def exported():
    return as_fmu(law(), recording(), communication_step=0.01)


@cache
def fmu():
    return make_fmu(fmu_model(law()))


@cache
def counting():
    """A law whose command is the number of samples taken, and a thousandth of the last heave."""
    memory = "typedef struct { long samples; double heave; } counting_memory;"
    files = {"counting.h": interface_header("counting", memory), "counting.c": COUNTING}
    native = NativeLaw(prefix="counting", files=files)
    return make_fmu(fmu_model(replace(law(), name="counting", native=native)))


def parts(content):
    return zipfile.ZipFile(io.BytesIO(content))


def description(content):
    return Xml.fromstring(parts(content).read("modelDescription.xml"))


def test_export_says_what_it_is_and_how_it_was_proved():
    made = exported()
    assert (made.kind, made.proved) == ("fmu", True)
    assert set(made.files) == {"feed_forward.fmu", "feed_forward_OspModelDescription.xml"}
    assert "to the last bit, and the same statuses." in made.proof
    assert f"{len(recording().commands)} samples" in made.proof
    for said in ("without added delay", "Sequential", "Parallel", "has `h` more delay"):
        assert said in made.about
    assert "At the step that was asked for, 10 ms, that is 10 ms" in made.about


def test_same_export_is_the_same_bytes_and_another_law_has_another_guid(monkeypatch):
    assert fmu().content == exported().files["feed_forward.fmu"]
    monkeypatch.setenv("STILLHOOK_COMPILE", "0")
    other = make_fmu(fmu_model(replace(law(), rate=1.0, highest=2.0)))
    assert description(other.content).get("guid") != description(fmu().content).get("guid")


def test_variables_have_units_starts_and_structured_names():
    root = description(fmu().content)
    assert root.get("variableNamingConvention") == "structured"
    assert "A sequential master" in root.get("description")
    found = {v.get("name"): v for v in root.iter("ScalarVariable")}
    assert [name for name, v in found.items() if v.get("causality") == "input"] == list(HEARD)
    defined = {unit.get("name"): unit.find("BaseUnit").attrib for unit in root.iter("Unit")}
    assert defined["N.m"] == {"kg": "1", "m": "2", "s": "-2"}
    assert defined["1"] == {}
    for name in HEARD:
        real = found[name].find("Real")
        assert float(real.get("start")) == law().rest[name]
        assert real.get("unit") in defined
    assert found["motor.torque"].find("Real").get("unit") == "N.m"
    assert found["operator.enable"].find("Real").get("start") == "1.0"
    assert found["payload.valid"].get("variability") == "discrete"
    assert found[COMMAND].find("Real").get("unit") == "rad/s"
    assert float(found[COMMAND].find("Real").get("start")) == law().rest["drive.applied"]
    assert found["status"].find("Integer").get("declaredType") == "Status"
    (status,) = root.iter("SimpleType")
    assert [text.split(":")[0] for text in status.get("description").split("; ")] == [
        f"{i} {name}" for i, name in enumerate(STATUSES)
    ]


def test_capabilities_and_sources_are_those_that_are_there():
    root, archive = description(fmu().content), parts(fmu().content)
    simulated = root.find("CoSimulation").attrib
    for name in ("canGetAndSetFMUstate", "canSerializeFMUstate"):
        assert simulated[name] == "true"
    assert simulated["canHandleVariableCommunicationStepSize"] == "true"
    assert simulated["canBeInstantiatedOnlyOncePerProcess"] == "false"
    named = {f"sources/{file.get('name')}" for file in root.iter("File")}
    names = set(archive.namelist())
    assert named == {name for name in names if name.endswith(".c")}
    assert {"sources/fmi2Functions.h", "sources/model.h"} <= names
    assert f"binaries/{fmu().platform}/feed_forward.so" in names or fmu().platform != "linux64"
    assert b"2-Clause BSD" in archive.read("sources/fmi2Functions.h")


def test_osp_description_refers_to_what_is_there():
    root = Xml.fromstring(exported().files["feed_forward_OspModelDescription.xml"])
    assert (root.tag, root.get("version")) == (f"{OSP}OspModelDescription", "1.0")
    assert [child.tag for child in root] == [f"{OSP}UnitDefinitions", f"{OSP}VariableGroups"]
    units = {unit.get("name") for unit in root.iter(f"{OSP}Unit")}
    groups = root.findall(f"{OSP}VariableGroups/{OSP}Generic")
    names = [group.get("name") for group in groups]
    assert len(names) == len(set(names))
    told = [v for group in groups for v in group.findall(f"{OSP}Variable")]
    assert {v.get("unit") for v in told} <= units
    assert sorted(v.get("ref") for v in told) == sorted([*HEARD, COMMAND])


@pytest.mark.parametrize(
    ("step", "count"),
    [
        (T / 10, 1000),
        (T / 3, 300),
        (T / 7, 70),
        (T, 100),
        (3 * T, 40),
        (2.5 * T, 40),
        (T / 1e3, 5000),
    ],
)
def test_samples_are_taken_in_the_step_that_holds_them(step, count):
    with Slave(counting(), at=3.0) as slave:
        for k in range(count):
            slave.step(3.0 + k * step, step)
            # The samples n T in [0, (k + 1) h), the first at the start.
            assert slave.get(COMMAND)[0] == np.ceil((k + 1) * step / T - 1e-6)


def test_samples_of_irregular_steps():
    steps = np.random.default_rng(5).uniform(0.05 * T, 2.5 * T, 2000)
    at = 0.0
    with Slave(counting()) as slave:
        for step in steps:
            slave.step(at, step)
            at += step
            assert slave.get(COMMAND)[0] == np.ceil(at / T)


def test_inputs_are_those_at_the_sample_and_the_first_command_is_there_after_a_step():
    with Slave(counting()) as slave:
        assert slave.get(COMMAND)[0] == law().rest["drive.applied"]
        for k, heave in enumerate((1.0, 2.0, 3.0)):  # the sample is taken in the first of them
            slave.set({"mru.heave": heave})
            slave.step(k * T / 3, T / 3)
            assert slave.get(COMMAND)[0] == 1.001
        slave.set({"mru.heave": 4.0})
        slave.step(T, T / 3)
        assert slave.get(COMMAND)[0] == pytest.approx(2.004, abs=1e-15)


def test_clock_does_not_drift_over_ten_million_steps(tmp_path):
    sources = parts(counting().content)
    for name in sources.namelist():
        if name.startswith("sources/"):
            (tmp_path / name[len("sources/") :]).write_bytes(sources.read(name))
    (tmp_path / "main.c").write_text(
        """
#include <stdio.h>
#include "fmi2Functions.h"
#include "model.h"
int main(void) {
  int part;
  for (part = 3; part <= 10; part += 7) {
    fmi2Component c = fmi2Instantiate("c", fmi2CoSimulation, MODEL_GUID, "", 0, 0, 0);
    fmi2ValueReference command = 21;
    double at = 0.0, h = 0.02 / part, samples;
    long k;
    fmi2EnterInitializationMode(c);
    fmi2ExitInitializationMode(c);
    for (k = 0; k < 10000000; k++) {
      if (fmi2DoStep(c, at, h, 0) != fmi2OK) return 1;
      at += h; /* as a careless master adds up its time */
      if (k < 9999999 - 4 * part) continue;
      fmi2GetReal(c, &command, 1, &samples);
      if (samples != k / part + 1) { printf("%d %ld %.17g", part, k, samples); return 2; }
    }
    fmi2FreeInstance(c);
  }
  return 0;
}
"""
    )
    files = ("main.c", "model.c", "counting.c", "slave.c")
    flags = ("-O2", "-Wall", "-Wextra", "-Werror", "-Wno-unused-variable")
    build = [*find_compiler().command, *flags, "-o", "run", *files, "-lm"]
    subprocess.run(build, cwd=tmp_path, check=True)
    run = subprocess.run([tmp_path / "run"], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout) == (0, "")


def test_two_instances_live_side_by_side():
    with Slave(counting()) as one, Slave(counting()) as other:
        for k in range(5):
            one.step(k * T, T)
        other.step(0.0, T)
        assert (one.get(COMMAND), other.get(COMMAND)) == ([5.0], [1.0])


def test_nothing_but_the_interface_is_seen_from_outside(tmp_path):
    (name,) = [name for name in parts(fmu().content).namelist() if name.startswith("binaries/")]
    library = ctypes.CDLL(parts(fmu().content).extract(name, tmp_path))
    assert library.fmi2DoStep
    for hidden in ("feed_forward_step", "feed_forward_law", "model_step"):
        assert not hasattr(library, hidden)


def test_state_is_restored_serialised_and_reset():
    rows = recording().measured[150:450]

    def commands(slave, first, last):
        found = []
        for k in range(first, last):
            slave.set(dict(zip(HEARD, rows[k].tolist(), strict=True)))
            slave.step(k * T, T)
            found.append(slave.get(COMMAND)[0])
        return found

    with Slave(fmu()) as slave, Slave(fmu()) as other:
        before = commands(slave, 0, 100)
        kept = slave.made.getFMUstate()
        after = commands(slave, 100, 200)
        assert len(set(after)) > 50
        slave.made.setFMUstate(kept)
        assert commands(slave, 100, 200) == after
        packed = slave.made.serializeFMUstate(kept)
        unpacked = other.made.deSerializeFMUstate(packed)
        other.made.setFMUstate(unpacked)
        assert commands(other, 100, 200) == after
        slave.made.reset()
        slave.begin()
        assert commands(slave, 0, 100) == before
        spoilt = bytes([packed[0] ^ 1]) + packed[1:]
        for bad in (spoilt, packed[:-1]):
            with pytest.raises(Exception, match="DeSerialize"):
                other.made.deSerializeFMUstate(bad)
        for one, state in ((slave, kept), (other, unpacked)):
            one.made.freeFMUstate(state)


def test_another_guid_is_refused(capfd):
    with pytest.raises(SolverError, match="feed_forward cannot be instantiated"):
        Slave(fmu(), guid="{00000000-0000-0000-0000-000000000000}")
    assert "the guid is another" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("at", "step", "said"),
    [
        (0.0, 0.0, "communication step above zero"),
        (0.0, float("nan"), "time must be finite"),
        (5 * T, T, "does not begin where the last one ended"),
    ],
)
def test_steps_that_cannot_be_are_refused(at, step, said, capfd):
    with Slave(counting()) as slave:
        slave.step(0.0, T)
        with pytest.raises(Exception, match="fmi2DoStep failed"):
            slave.step(at, step)
        assert said in capfd.readouterr().out
        slave.step(T, T)
        assert slave.get(COMMAND) == [2.0]


def test_what_only_describes_cannot_be_set(capfd):
    with Slave(fmu()) as slave:
        assert slave.get("law.sample_time", "law.highest") == [T, law().highest]
        told = slave.made.getString([slave.reference["law.name"], slave.reference["law.case"]])
        assert told == [b"feed-forward", CRANE.digest.encode()]
        for name in (COMMAND, "law.sample_time"):
            with pytest.raises(Exception, match="fmi2SetReal"):
                slave.set({name: 1.0})
    assert "there is no Real input with the value reference 21" in capfd.readouterr().out


def test_replay_that_finds_other_commands_is_an_error():
    seen = recording()
    spoilt, statuses = seen.commands.copy(), seen.statuses.copy()
    spoilt[77] = np.nextafter(spoilt[77], np.inf)
    statuses[3] += 1.0
    assert "to the last bit" in _compared(law(), seen, seen.commands, seen.statuses)
    with pytest.raises(SolverError, match=r"other commands, by up to .* \(allowed 0\), and 0"):
        _compared(law(), seen, spoilt, seen.statuses)
    with pytest.raises(SolverError, match="and 1 other statuses"):
        _compared(law(), seen, seen.commands, statuses)


def test_without_compiler_there_are_sources_alone(monkeypatch):
    monkeypatch.setenv("STILLHOOK_COMPILE", "0")
    made = as_fmu(law(), recording())
    assert not made.proved
    assert made.proof.startswith("It was not compiled")
    assert "sources alone" in made.about
    assert "asked for" not in made.about
    names = parts(made.files["feed_forward.fmu"]).namelist()
    assert not any(name.startswith("binaries/") for name in names)
    check_valid(replace(fmu(), content=made.files["feed_forward.fmu"]))


def test_without_fmpy_it_is_said_how_to_get_it(monkeypatch):
    monkeypatch.setattr(fmu_package, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="it needs fmpy: run `make export`") as found:
        make_fmu(fmu_model(law()))
    assert str(found.value) == NO_FMPY


def test_sources_that_do_not_compile_are_an_error():
    model = fmu_model(law())
    spoilt = replace(model, sources={**model.sources, "model.c": "not C"})
    with pytest.raises(SolverError, match=r"fmu: it cannot be compiled: model\.c"):
        make_fmu(spoilt)


def test_unit_without_base_units_is_an_error():
    with pytest.raises(InputError, match="the base units of 'furlong' are not known"):
        make_fmu(fmu_model(replace(law(), unit="furlong")))


def test_problem_that_fmpy_finds_is_an_error():
    spoilt = io.BytesIO()
    with zipfile.ZipFile(spoilt, "w") as archive:
        text = parts(fmu().content).read("modelDescription.xml").decode()
        archive.writestr("modelDescription.xml", text.replace('unit="rad/s"', 'unit="turns"'))
    with pytest.raises(SolverError, match='not valid: The unit "turns"'):
        check_valid(replace(fmu(), content=spoilt.getvalue()))


@pytest.mark.ci
@pytest.mark.parametrize(
    ("case", "name", "sample_time"),
    [
        ("thesis-1975-rope", "constant-tension", 0.01),
        ("thesis-1975-rope", "feedback", 0.02),
        ("landing", "feed-forward", 0.005),
    ],
)
def test_every_recursive_law_is_replayed_to_the_last_bit(case, name, sample_time):
    gains = {"A": 200.0, "a": 0.5, "a1": 2.0, "a2": 2.0} if name == "feedback" else None
    one = law_of(load_case(case), controller=name, gains=gains, sample_time=sample_time)
    assert "to the last bit" in as_fmu(one, record(one)).proof


@pytest.mark.ci
def test_library_that_is_linked_lies_beside_ours(tmp_path):
    (tmp_path / "helper.c").write_text("double helped(double x) { return 2.0 * x; }\n")
    compiler = find_compiler()
    build = [*compiler.command, "-shared", "-fPIC", "-o", "libhelper.so", "helper.c"]
    subprocess.run(build, cwd=tmp_path, check=True)
    files = {
        "linked.h": interface_header("linked", "typedef struct { double x; } linked_memory;"),
        "linked.c": '#include "linked.h"\ndouble helped(double);\n'
        "void linked_reset(linked_memory *m) { m->x = 0.0; }\n"
        "double linked_step(linked_memory *m, const double *y) {\n"
        "  return helped(y[5] + m->x);\n}\n"
        "int linked_status(const linked_memory *m) { return (int)m->x; }\n",
    }
    native = NativeLaw(
        prefix="linked",
        files=files,
        copied={"lib/libhelper.so": tmp_path / "libhelper.so"},
        links=("lib/libhelper.so",),
    )
    made = make_fmu(fmu_model(replace(law(), name="linked", native=native)))
    (tmp_path / "libhelper.so").unlink()
    check_valid(made)
    with Slave(made, start={"mru.heave": 1.5}) as slave:
        slave.step(0.0, T)
        assert slave.get(COMMAND) == [3.0]


@pytest.mark.ci
def test_predictive_control_is_replayed():
    one = law_of(load_case("thesis-1975"), controller="mpc")
    seen = record(one)
    made = make_fmu(fmu_model(one))
    found = replayed(made, HEARD, seen.measured, seen.sample_time, COMMAND, STATUS)
    assert np.max(np.abs(found[0] - seen.commands)) <= 1e-9 * one.span
    proof = _compared(one, seen, *found)
    assert "of their range, and the same statuses, limited or not aside." in proof
    assert "sources/daqp/LICENSE" in parts(made.content).namelist()
