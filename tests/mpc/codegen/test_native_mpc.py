"""The C of predictive control against its Python, sample by sample, on what a loop has shown it."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from former_cases import load_case as former_case
from mpc_cases import WEIGHTS, case_of

import stillhook as sh
from models import Case
from models.basics import InputError, SolverError
from models.operation import Scenario, scenario_named
from models.plant import DriveLimits
from models.sensing import HEARD, MEASURED, STATUSES, ControllerAround, Measurement, NativeLaw
from models.simulation import find_compiler
from mpc.codegen import export, native_mpc
from mpc.forecast import AdaptiveAR
from mpc.linear import ClippedMPC, LinearMPC
from mpc.winch import ProcessNoise, Weights
from synth.controllers import operated

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
FloatArray = npt.NDArray[np.float64]
STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-O2", "-ffp-contract=off")
#: All samples of a record in one call: rows, and what is told after each step (NaN: nothing).
PLAYED = """
#include <math.h>
#include <string.h>
#include "{p}.h"
long {p}_bytes(void);
void {p}_play({p}_memory *memory, const double *rows, const double *told, const int *resets,
              long count, double *commands, int *statuses);
long {p}_bytes(void) {{ return (long)sizeof({p}_memory); }}
void {p}_play({p}_memory *memory, const double *rows, const double *told, const int *resets,
              long count, double *commands, int *statuses) {{
  long k;
  for (k = 0; k < count; k++) {{
    if (resets[k]) {p}_reset(memory);
    commands[k] = {p}_step(memory, rows + k * {upper}_INPUTS);
    statuses[k] = {p}_status(memory);
    if (!isnan(told[k])) {p}_commanded(memory, told[k]);
  }}
}}
"""


@dataclass
class Record:
    """What a controller was shown and told, and what it answered."""

    rows: list[FloatArray] = field(default_factory=list)
    told: list[float] = field(default_factory=list)
    resets: list[int] = field(default_factory=list)
    commands: list[float] = field(default_factory=list)
    statuses: list[str] = field(default_factory=list)


class Recorder(ControllerAround):
    """A controller in Python that writes down what it does, and is shown some odd numbers."""

    def __init__(self, controller: LinearMPC, *, odd: float = 0.0) -> None:
        super().__init__(controller)
        self.record, self._again, self._rng, self._odd = (
            Record(),
            True,
            np.random.default_rng(1),
            odd,
        )

    def reset(self) -> None:
        super().reset()
        self._again = True

    def step(self, measurement: Measurement, time: float) -> float:
        r, row = self.record, measurement.values.copy()
        if self._rng.random() < self._odd:
            at = self._rng.integers(len(HEARD))
            row[at] = self._rng.choice((np.nan, np.inf, -np.inf, 3.0 * row[at], -row[at]))
        command = self._controller.step(Measurement(row), time)
        r.rows.append(row)
        r.commands.append(command)
        r.told.append(np.nan)
        r.resets.append(int(self._again))
        r.statuses.append(self._controller.status)
        self._again = False
        return command

    def commanded(self, command: float) -> None:
        self._controller.commanded(command)
        if self.record.told:
            self.record.told[-1] = command


class Player:
    """A compiled law, which plays a record."""

    def __init__(self, law: NativeLaw, folder: Path) -> None:
        compiler = find_compiler()
        assert compiler is not None
        self._library = ctypes.CDLL(str(build([law], folder, compiler.command, STRICT)))
        self._prefix = law.prefix

    @classmethod
    def of(cls, library: ctypes.CDLL, prefix: str) -> Player:
        found = cls.__new__(cls)
        found._library, found._prefix = library, prefix
        return found

    def __call__(self, record: Record) -> tuple[FloatArray, list[str]]:
        play, size = (getattr(self._library, f"{self._prefix}_{n}") for n in ("play", "bytes"))
        size.restype = ctypes.c_long
        memory = np.zeros(int(size()), np.uint8)
        rows, told = np.array(record.rows), np.array(record.told)
        resets = np.array(record.resets, np.intc)
        commands, statuses = np.empty(len(rows)), np.empty(len(rows), np.intc)
        at = [ctypes.c_void_p(a.ctypes.data) for a in (memory, rows, told, resets)]
        out = [ctypes.c_void_p(a.ctypes.data) for a in (commands, statuses)]
        play(*at, ctypes.c_long(len(rows)), *out)
        words = tuple(STATUSES)
        return commands, [words[k] for k in statuses.tolist()]


def write(law: NativeLaw, folder: Path) -> None:
    """Write a law, and a function beside it that plays a record."""
    law = law.written
    for name, text in law.files.items():
        (folder / name).write_text(text, encoding="utf-8")
    for name, path in law.copied.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(path.read_bytes())
    text = PLAYED.format(p=law.prefix, upper=law.prefix.upper())
    (folder / f"{law.prefix}_play.c").write_text(text, encoding="utf-8")


def build(
    laws: list[NativeLaw], folder: Path, compiler: tuple[str, ...], flags: tuple[str, ...]
) -> Path:
    """Compile laws into one library."""
    laws, sources = [law.written for law in laws], []
    for law in laws:
        write(law, folder)
        sources += [*law.sources, f"{law.prefix}_play.c"]
    command = [*compiler, *flags, "-fPIC", "-shared", "-o", "law.so", *sources, *laws[0].links]
    answer = subprocess.run(
        [*command, "-lm"], cwd=folder, check=False, capture_output=True, text=True
    )
    assert answer.returncode == 0, answer.stderr[-4000:]
    return folder / "law.so"


def recorded(
    controller: LinearMPC, case: Case, scenario: Scenario, duration: float, odd: float = 0.0
) -> Record:
    """Simulate a case with the operator's interface, and return what the controller within saw."""
    recorder = Recorder(controller, odd=odd)
    law = operated(recorder, case)
    sh.simulate(
        case, law, scenario=replace(scenario, duration=duration), duration=duration, seeds=[3]
    )
    return recorder.record


def troubled(case: Case, duration: float) -> Scenario:
    """Everything that may go wrong and come back, one after the other; set points all the while."""
    T = duration / 1000.0

    def period(start: float, lasting: float) -> tuple[float, float]:
        return start * T, start * T + lasting

    steps = scenario_named("steps", case, count=20, interval=duration / 22.0, size=0.3)
    steps = replace(
        steps,
        enabled=((5.0 * T, 600.0 * T), (620.0 * T, 1e6)),
        resets=(360.0 * T, 700.0 * T),
        rate=1.0,
        telemetry_outages=(period(60, 3.0), period(300, 0.6), period(500, 30.0)),
        sensor_failures=(period(90, 4.0),),
        stuck_readings=(period(120, 5.0),),
        mru_outages=(period(150, 5.0), period(505, 2.0)),
        load_cell_outages=(period(200, 8.0), period(508, 8.0)),
        encoder_outages=(period(690, 0.5),),
        telemetry_delays=((400 * T, 430 * T, 0.06), (440 * T, 450 * T, 0.5)),
        mru_biases=((460 * T, 463 * T, 2.0, 0.0), (470 * T, 490 * T, 0.0, 0.5)),
        disengage_at=None,
    )
    own = DriveLimits.from_case(steps.case_for(case)).parameters
    weaker: dict[str, float | None] = {
        name: 0.7 * own[name]
        for name in ("drive.torque_limit", "drive.current_limit")
        if name in own
    }
    back: dict[str, float | None] = dict.fromkeys(weaker, None)
    changes: dict[float, dict[str, float | None]] = {750 * T: weaker, 800 * T: back}
    if "drive.power_limit" in own:
        changes |= {
            850 * T: {"drive.power_limit": 0.4 * own["drive.power_limit"]},
            900 * T: {"drive.power_limit": None},
        }
    return replace(steps, parameter_changes=changes)


def check(
    record: Record,
    played: tuple[FloatArray, list[str]],
    controller: LinearMPC,
    *,
    share: float = 0.999,
    worst: float = 1e-6,
) -> None:
    """Hold commands and statuses of the C against the record, in units of the peak torque."""
    commands, statuses = played
    asked = np.array(record.commands)
    apart = np.abs(commands - asked)
    apart[np.isnan(commands) & np.isnan(asked)] = 0.0
    winch = controller.model.winch
    apart *= abs(winch.gain) / winch.case.winch.drive.torque_peak
    other = sum(a != b for a, b in zip(statuses, record.statuses, strict=True))
    near = float(np.mean(apart <= 1e-9))
    print(  # with -s
        f"{len(asked)} steps: {near:.5f} within 1e-9, median {np.median(apart):.1e}, worst "
        f"{apart.max():.1e} at {apart.argmax()}; {other} statuses differ, of",
        {word: record.statuses.count(word) for word in dict.fromkeys(record.statuses)},
    )
    assert apart.max() <= worst
    assert near >= share
    assert other <= 1


LIGHT = Weights(torque=0.03, noise=ProcessNoise(force=0.06, torque=0.02, rope=0.7, sensors=3e-4))
SEA, DROPS = "sea.significant_height", {"sensors.telemetry.dropout": 0.05}


@dataclass(frozen=True, kw_only=True)
class Replay:
    """A run that is played: what of the case is other, options, share of odd numbers.

    `share` is that of the steps whose command agrees to 1e-9 of the peak.  In two situations the
    Python's own rounding is more than that.  Telegrams that are lost leave the filter on the way to
    its steady gains, and a start that is interrupted by one begins with a covariance a million
    times the steady one: ten digits are lost, and the difference is forgotten in minutes.  And
    where soft limits are out of reach, the solver's answer is optimal to 1e-8.
    """

    case: str
    changes: dict[str, object] = field(default_factory=dict)
    options: dict[str, object] = field(default_factory=dict)
    odd: float = 0.0
    share: float = 0.999

    def made(self) -> tuple[Case, LinearMPC]:
        case = former_case(self.case) if self.case == "landing" else case_of(self.case)
        case = case.replace(self.changes)
        options = {"weights": WEIGHTS.get(self.case, LIGHT), **self.options}
        return case, LinearMPC(case, **options)  # type: ignore[arg-type]


REPLAYS = {
    "thesis": Replay(case="thesis-1975", changes=DROPS, odd=0.002, share=0.97),
    "thesis, saturated": Replay(case="thesis-1975", changes={SEA: 6.0}, share=0.99),
    "thesis, slow torque": Replay(
        case="thesis-1975",
        changes={SEA: 4.0},
        options={"predictor": "kalman", "torque_rate": 3e4},
        share=0.99,
    ),
    "rope": Replay(
        case="thesis-1975-rope", changes=DROPS, options={"excursion": 2.0}, odd=0.002, share=0.97
    ),
    "rope, saturated": Replay(case="thesis-1975-rope", changes={SEA: 5.0}, share=0.9),
    "crane": Replay(case="subsea-crane", changes=DROPS, odd=0.002, share=0.5),
    "crane, saturated": Replay(
        case="subsea-crane", changes={SEA: 7.0}, options={"thermal": True}, share=0.99
    ),
    "crane, late": Replay(
        case="subsea-crane",
        changes={"winch.drive.command_delay": 0.12},
        options={"predictor": "kalman"},
        share=0.95,
    ),
    "landing": Replay(case="landing", changes=DROPS, odd=0.001, share=0.5),
}


@needs_compiler
@pytest.mark.ci
@pytest.mark.parametrize("which", REPLAYS)
def test_20_000_samples_of_a_troubled_run_are_answered_as_in_python(which, tmp_path):
    case, controller = REPLAYS[which].made()
    law = native_mpc(controller, "winch")
    record = recorded(controller, case, troubled(case, 1000.0), 1000.0, REPLAYS[which].odd)
    check(record, Player(law, tmp_path)(record), controller, share=REPLAYS[which].share)


@needs_compiler
@pytest.mark.ci
@pytest.mark.parametrize("name", WEIGHTS)
def test_20_000_samples_of_a_calm_run_agree_to_a_billionth_of_the_peak(name, tmp_path):
    case, controller = Replay(case=name).made()
    record = recorded(controller, case, scenario_named("hold", case), 1000.0)
    check(record, Player(native_mpc(controller, "winch"), tmp_path)(record), controller)


@needs_compiler
def test_a_short_troubled_run_is_answered_as_in_python(tmp_path):
    case, controller = Replay(
        case="thesis-1975", changes=DROPS | {SEA: 4.0}, options={"predictor": "kalman"}
    ).made()
    record = recorded(controller, case, troubled(case, 100.0), 100.0, 0.01)
    assert {"engaged", "limited", "gated", "blind"} <= set(record.statuses)
    law = native_mpc(controller, "winch")
    check(record, Player(law, tmp_path)(record), controller, share=0.97)


@needs_compiler
def test_a_set_point_that_moves_and_is_lost_is_followed_as_in_python(tmp_path):
    case, controller = Replay(case="thesis-1975", options={"predictor": "kalman"}).made()
    record = recorded(controller, case, scenario_named("hold", case), 20.0)
    recorder = Recorder(controller)
    recorder.reset()
    at, applied = HEARD.index("reference.displacement"), HEARD.index("drive.applied")
    for k, row in enumerate(record.rows):
        time = 0.05 * k
        row[at : at + 2] = (0.001 * time, 0.001) if time < 10.0 else (0.01, 0.0)
        row[at + k % 2] = np.nan if 5.0 < time < 7.0 or 12.0 < time < 13.0 else row[at + k % 2]
        if k > 0:  # a drive that follows
            row[applied] = recorder.record.commands[-1]
        recorder.step(Measurement(row), time)
    played = Player(native_mpc(controller, "winch"), tmp_path)(recorder.record)
    check(recorder.record, played, controller)


def test_the_c_has_the_order_of_signals_and_statuses():
    source = export._SOURCES.joinpath("mpc_estimator.c").read_text(encoding="utf-8")
    at = [name.upper().replace(".", "_") for name in MEASURED]
    wanted = ",".join(f"MPC_{name}" for name in at)
    assert f"heard_at[NY]={{{wanted}}}" in "".join(source.split())
    step = export._SOURCES.joinpath("mpc.c").read_text(encoding="utf-8")
    words = step.partition("enum { ")[2].partition(" }")[0].lower().split(", ")
    assert words == list(STATUSES)[: len(words)]


def test_all_names_begin_with_the_prefix():
    _, controller = Replay(case="thesis-1975", options={"predictor": "kalman"}).made()
    law = native_mpc(controller, "port")
    assert law.commanded
    assert set(law.sources) == {name for name in law.files if name.endswith(".c")}
    assert all(name.startswith("port") for name in law.files)
    assert not any("mpc_" in text or "MPC_" in text for text in law.files.values())
    assert set(law.links) <= set(law.copied)
    assert all(path.is_file() for path in law.copied.values())


class _Own(LinearMPC):
    pass


@pytest.mark.parametrize(
    ("make", "options", "message"),
    [
        (ClippedMPC, {}, "controller must be a LinearMPC itself, got a ClippedMPC"),
        (_Own, {}, "controller must be a LinearMPC itself, got a _Own"),
        (LinearMPC, {"predictor": "ar"}, "predictor must be bank or kalman, got a _LearntHook"),
        (LinearMPC, {"predictor": "preview"}, "predictor must be bank or kalman"),
        (LinearMPC, {"deadline": 0.02}, "deadline must be none, as its C would not have it"),
    ],
)
def test_what_the_c_has_not_is_refused(make, options, message):
    controller = make(case_of("thesis-1975"), weights=WEIGHTS["thesis-1975"], **options)
    with pytest.raises(InputError, match=message):
        native_mpc(controller)


def test_a_preview_and_a_fallback_are_refused():
    options = {"weights": WEIGHTS["thesis-1975"], "predictor": "kalman"}
    case = case_of("thesis-1975")
    other = LinearMPC(case, **options)
    with pytest.raises(InputError, match="fallback must be none"):
        native_mpc(LinearMPC(case, fallback=other, **options))
    seen = AdaptiveAR(sample_time=0.05, horizon=4.0)
    with pytest.raises(InputError, match="preview must be none"):
        native_mpc(LinearMPC(case, weights=options["weights"], preview=seen))


def test_a_prefix_that_is_no_name_is_refused():
    _, controller = Replay(case="thesis-1975", options={"predictor": "kalman"}).made()
    with pytest.raises(InputError, match="prefix must be"):
        native_mpc(controller, "2nd")


def test_a_wheel_without_the_solver_is_told_of(tmp_path, monkeypatch):
    monkeypatch.setattr(export.casadi, "__file__", str(tmp_path / "casadi.py"))
    with pytest.raises(SolverError, match="must have the library of DAQP, but has no"):
        export.solver_files()


@needs_compiler
@pytest.mark.ci
def test_two_controllers_link_into_one_program(tmp_path):
    compiler = find_compiler()
    assert compiler is not None
    replays = {
        "port": Replay(case="thesis-1975", options={"predictor": "kalman"}),
        "starboard": Replay(case="subsea-crane", options={"predictor": "kalman"}),
    }
    laws, records = [], {}
    for prefix, replay in replays.items():
        case, controller = replay.made()
        laws.append(native_mpc(controller, prefix))
        records[prefix] = recorded(controller, case, scenario_named("hold", case), 30.0)
    library = ctypes.CDLL(str(build(laws, tmp_path, compiler.command, STRICT)))
    for prefix, record in records.items():
        commands, _ = Player.of(library, prefix)(record)
        assert commands == pytest.approx(record.commands, rel=1e-8, abs=1e-8)


MAIN = """
#include <stdio.h>
#include "{p}.h"
#include "{p}_play.c"
int main(void) {{
  static {p}_memory memory, copy;
  double row[{upper}_INPUTS], last = 0.0;
  long n = 0;
  {p}_reset(&memory);
  while (fread(row, sizeof row, 1, stdin) == 1) {{
    copy = memory; /* as bytes */
    last = {p}_step(&copy, row);
    memory = copy;
    if (n++ % 7 == 0) {p}_commanded(&memory, 0.999 * last);
  }}
  printf("%ld %.17g %d\\n", n, last, {p}_status(&memory));
  return 0;
}}
"""


@needs_compiler
@pytest.mark.ci
@pytest.mark.parametrize("which", ["rope, saturated", "crane, late"])
def test_no_step_leaves_its_memory(which, tmp_path):
    compiler = find_compiler()
    assert compiler is not None
    case, controller = REPLAYS[which].made()
    record = recorded(controller, case, troubled(case, 200.0), 200.0, 0.01)
    law = native_mpc(controller, "winch").written
    flags = ("-std=c99", "-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    (tmp_path / "empty.c").write_text("int main(void) { return 0; }\n")
    tried = [*compiler.command, *flags, "-o", "empty", "empty.c"]
    if subprocess.run(tried, cwd=tmp_path, check=False, capture_output=True).returncode:
        pytest.skip("the compiler has no sanitizers")
    write(law, tmp_path)
    (tmp_path / "main.c").write_text(MAIN.format(p="winch", upper="WINCH"))
    made = [*compiler.command, *flags, "-o", "main", "main.c", *law.sources, *law.links, "-lm"]
    subprocess.run(made, cwd=tmp_path, check=True)
    rows = np.array(record.rows).tobytes()
    answer = subprocess.run(["./main"], cwd=tmp_path, input=rows, capture_output=True, check=False)
    assert answer.returncode == 0, answer.stderr.decode()[-4000:]
    assert answer.stdout.split()[0] == str(len(record.rows)).encode()
