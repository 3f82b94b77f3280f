from __future__ import annotations

import copy
import ctypes
import functools
import math
import multiprocessing
import os
import pickle
import signal
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import casadi as ca
import numpy as np
import numpy.typing as npt
import pytest
from former_cases import load_case
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from models import InputError, SolverError, build_plant
from models.simulation import Kernel
from models.simulation.compiler import find_compiler, load_library
from models.simulation.integrate import hermite_midpoint, rk4_step
from models.simulation.kernel import _DRIVER, BLOCK, VM_BLOCKS, _Compiled

FloatArray = npt.NDArray[np.float64]

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


@pytest.fixture(scope="module", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STILLHOOK_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "empty"
    monkeypatch.setenv("STILLHOOK_CACHE", str(folder))
    return folder / "kernels"


def small() -> ca.Function:
    s, r, p = ca.SX.sym("s", 2), ca.SX.sym("r", 3), ca.SX.sym("p", 1)
    after = ca.vertcat(0.9 * s[0] + p * ca.sin(s[1]) + r[0], s[0] - r[1] * r[2])
    return ca.Function("small", [s, r, p], [after, ca.vertcat(s[0] + 2 * s[1], r[2], p, 7.0)])


def small_in_numpy(s: FloatArray, rows: FloatArray, p: float) -> tuple[FloatArray, FloatArray]:
    out = []
    for r in rows:
        out.append([s[0] + 2.0 * s[1], r[2], p, 7.0])
        s = np.array([0.9 * s[0] + p * np.sin(s[1]) + r[0], s[0] - r[1] * r[2]])
    return s, np.array(out).reshape(-1, 4)


def rows_of(n: int, width: int = 3, seed: int = 1) -> FloatArray:
    return np.random.default_rng(seed).standard_normal((n, width))


def both() -> list[bool]:
    return [False] if find_compiler() is None else [True, False]


def crane(name: str, masses: int | None, step: float) -> tuple[ca.Function, FloatArray, FloatArray]:
    """Return the recursion of one Runge-Kutta step of a case, its start and its parameters."""
    plant = build_plant(load_case(name), masses)
    rest = plant.operating_point()
    s = ca.SX.sym("s", len(plant.states))
    r = ca.SX.sym("r", 7)
    p = ca.SX.sym("p", len(plant.parameters))
    z0, v0, a0, z1, v1, a1, u = ca.vertsplit(r)

    def rhs(x: ca.SX, motions: list[tuple[ca.SX, ca.SX]]) -> ca.SX:
        return plant.function(x, u, ca.vertcat(*motions[0], 0, 0), p)[0]

    middle = hermite_midpoint(z0, v0, a0, z1, v1, a1, step)
    after = rk4_step(rhs, s, [(z0, v0)], [middle], [(z1, v1)], step)
    out = plant.function(s, u, ca.vertcat(z0, v0, 0, 0), p)[2]
    return ca.Function("crane", [s, r, p], [after, out]), np.array(rest.x), np.array(rest.p)


def crane_rows(n: int, step: float, command: float) -> FloatArray:
    t = np.arange(n + 1) * step
    motion = [0.8 * np.sin(0.7 * t), 0.56 * np.cos(0.7 * t), -0.392 * np.sin(0.7 * t)]
    jerky = command * (1.0 + 0.05 * np.sign(np.sin(0.31 * t[:-1])))
    return np.column_stack([*(m[:-1] for m in motion), *(m[1:] for m in motion), jerky])


@needs_compiler
@pytest.mark.parametrize(
    ("name", "masses", "step"), [("thesis-1975", None, 0.02), ("subsea-crane", 10, 0.005)]
)
def test_compiled_and_interpreted_crane_are_equal_to_the_bit(
    name: str, masses: int | None, step: float
) -> None:
    function, start, p = crane(name, masses, step)
    command = build_plant(load_case(name), masses).operating_point().command
    rows = crane_rows(100_000, step, command)
    state, out = Kernel(function, compiled=True).run(start, rows, p)
    state_vm, out_vm = Kernel(function, compiled=False).run(start, rows, p)
    assert np.isfinite(out).all()
    assert np.ptp(out, axis=0).min() > 0.0
    assert np.array_equal(state, state_vm)
    assert np.array_equal(out, out_vm)


@pytest.mark.parametrize("compiled", both())
@pytest.mark.parametrize(
    "n", [0, 1, 15, 16, 17, VM_BLOCKS[0], VM_BLOCKS[0] + 17, BLOCK, 2 * BLOCK + 3]
)
def test_run_is_the_recursion_written_in_numpy(compiled: bool, n: int) -> None:
    rows, start = rows_of(n), np.array([0.3, -0.2])
    state, out = Kernel(small(), compiled=compiled).run(start, rows, [0.7])
    expected_state, expected = small_in_numpy(start, rows, 0.7)
    assert out.shape == (n, 4)
    assert out == pytest.approx(expected, rel=1e-12, abs=1e-12)
    assert state == pytest.approx(expected_state, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("compiled", both())
def test_steps_one_by_one_are_a_run(compiled: bool) -> None:
    kernel = Kernel(small(), compiled=compiled)
    rows = rows_of(300)
    state, out = kernel.run([0.3, -0.2], rows, [0.7])
    moving: FloatArray = np.array([0.3, -0.2])
    each = []
    for row in rows:
        moving, one = kernel.step(moving, row, [0.7])
        each.append(one)
    assert np.array_equal(moving, state)
    assert np.array_equal(each, out)


@pytest.mark.parametrize("compiled", both())
def test_run_in_two_parts_is_a_run(compiled: bool) -> None:
    kernel = Kernel(small(), compiled=compiled)
    rows = rows_of(1000)
    state, out = kernel.run([0.3, -0.2], rows, [0.7])
    middle, first = kernel.run([0.3, -0.2], rows[:333], [0.7])
    after, second = kernel.run(middle, rows[333:], [0.7])
    assert np.array_equal(after, state)
    assert np.array_equal(np.vstack([first, second]), out)


@pytest.mark.parametrize("compiled", both())
def test_what_is_given_is_never_changed_and_may_be_read_only(compiled: bool) -> None:
    kernel = Kernel(small(), compiled=compiled)
    given_arrays = np.array([0.3, -0.2]), rows_of(300), np.array([0.7])
    before = copy.deepcopy(given_arrays)
    for array in given_arrays:
        array.setflags(write=False)
    state, out = kernel.run(*given_arrays)
    once, row_out = kernel.step(given_arrays[0], given_arrays[1][0], given_arrays[2])
    for array, copied in zip(given_arrays, before, strict=True):
        assert np.array_equal(array, copied)
    # and what comes back belongs to the caller
    kept = once.copy()
    for array in (state, out, row_out):
        array[:] = 0.0
    kernel.step([9.0, 9.0], given_arrays[1][0], [0.7])
    assert np.array_equal(once, kept)


@pytest.mark.parametrize("compiled", both())
def test_rows_in_any_memory_order_and_type_give_the_same(compiled: bool) -> None:
    kernel = Kernel(small(), compiled=compiled)
    rows = np.round(4.0 * rows_of(400))
    expected = kernel.run([0.0, 1.0], rows, [0.5])[1]
    doubled = np.repeat(rows, 2, axis=0)[::2]
    for same in (np.asfortranarray(rows), doubled, rows.astype(np.int64), rows.tolist()):
        assert np.array_equal(kernel.run([0, 1], same, [0.5])[1], expected)


@pytest.mark.parametrize("compiled", both())
@pytest.mark.parametrize("graph", [ca.SX, ca.MX])
def test_functions_without_rows_parameters_or_outputs_run(compiled: bool, graph: type) -> None:
    s, empty = graph.sym("s", 1), graph.sym("empty", 0)
    kernel = Kernel(ca.Function("f", [s, empty, empty], [2 * s, graph(0, 1)]), compiled=compiled)
    state, out = kernel.run([1.0], np.empty((10, 0)), [])
    assert state == [1024.0]
    assert out.shape == (10, 0)
    assert kernel.step([3.0], [], [])[0] == [6.0]


@pytest.mark.parametrize("compiled", both())
def test_structural_zeros_are_written(compiled: bool) -> None:
    s, r, p = (ca.SX.sym(name, 2) for name in "srp")
    after = ca.vertcat(ca.SX(1, 1), s[0])
    function = ca.Function("sparse", [s, r, p], [after, ca.vertcat(r[0], ca.SX(2, 1), p[1])])
    assert not function.sparsity_out(0).is_dense()
    state, out = Kernel(function, compiled=compiled).run([5.0, 6.0], np.ones((1, 2)), [3.0, 4.0])
    assert np.array_equal(state, [0.0, 5.0])
    assert np.array_equal(out, [[1.0, 0.0, 0.0, 4.0]])


@pytest.mark.parametrize("compiled", both())
def test_graph_that_calls_one_substep_many_times_is_the_same_recursion(compiled: bool) -> None:
    inner = small()
    s, r, p = ca.MX.sym("s", 2), ca.MX.sym("r", 3), ca.MX.sym("p", 1)
    twice = ca.Function("twice", [s, r, p], list(inner.call([inner(s, r, p)[0], r, p])))
    rows = rows_of(500)
    state, out = Kernel(twice, compiled=compiled).run([0.1, 0.2], rows, [0.3])
    expected_state, expected = small_in_numpy(np.array([0.1, 0.2]), np.repeat(rows, 2, 0), 0.3)
    assert state == pytest.approx(expected_state, rel=1e-12, abs=1e-12)
    assert out == pytest.approx(expected[1::2], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("compiled", both())
@pytest.mark.parametrize("name", ["sin", "main", "malloc", "stillhook_drive", "double"])
def test_name_of_the_function_does_not_matter(compiled: bool, name: str) -> None:
    s = ca.SX.sym("s")
    function = ca.Function(name, [s, s.sym("r"), s.sym("p")], [ca.sin(s), s])
    assert Kernel(function, compiled=compiled).step([0.5], [0.0], [0.0])[0] == [np.sin(0.5)]


def every_operation() -> ca.Function:
    s, r, p = ca.SX.sym("s", 2), ca.SX.sym("r", 4), ca.SX.sym("p", 1)
    a, b, c, d = ca.vertsplit(r)
    terms = [
        ca.fmax(a, b), ca.fmin(a, b), ca.fmax(0, a), ca.fabs(a) * a, ca.sign(a), ca.tanh(a),
        ca.if_else(a > b, c, d), ca.floor(a * p), ca.sqrt(ca.fabs(b)), ca.exp(-c * c), a**3,
        ca.fabs(a) ** d, ca.atan2(a, b), ca.fmod(c, 2.5), ca.log1p(ca.fabs(d)), a / b, a * b + c,
        ca.logic_and(a > 0, b > 0), ca.cos(a) - ca.sin(a), ca.erf(d), ca.hypot(a, b), 1 / c,
    ]  # fmt: skip
    after = ca.vertcat(0.5 * s[0] + ca.tanh(sum(terms[:8])), s[0] + ca.if_else(d > 0, a, s[1]))
    return ca.Function("every", [s, r, p], [after, ca.vertcat(s, *terms)])


@functools.cache
def every_pair() -> tuple[Kernel, Kernel]:
    return Kernel(every_operation(), compiled=True), Kernel(every_operation(), compiled=False)


@needs_compiler
@given(
    arrays(
        np.float64,
        st.tuples(st.integers(1, 40), st.just(4)),
        elements=st.one_of(st.floats(-5.0, 5.0), st.floats(allow_nan=True, allow_infinity=True)),
    )
)
def test_compiled_is_interpreted_for_all_numbers_nan_and_infinity_too(rows: FloatArray) -> None:
    compiled, interpreted = every_pair()
    state, out = compiled.run([0.1, 0.2], rows, [1.5])
    state_vm, out_vm = interpreted.run([0.1, 0.2], rows, [1.5])
    assert np.array_equal(state, state_vm, equal_nan=True)
    assert np.array_equal(out, out_vm, equal_nan=True)


@pytest.mark.parametrize("compiled", both())
def test_nan_in_the_state_stays_and_does_not_spoil_the_next_run(compiled: bool) -> None:
    kernel = Kernel(small(), compiled=compiled)
    state, out = kernel.run([np.nan, 0.0], rows_of(20), [0.7])
    assert np.isnan(state).all()
    assert np.isnan(out[:, 0]).all()
    assert np.isfinite(out[:, 1:]).all()
    assert np.isfinite(kernel.run([0.0, 0.0], rows_of(20), [0.7])[1]).all()


@needs_compiler
def test_second_kernel_is_found_in_the_cache(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert Kernel(small()).compiled
    kept = [path.name for path in empty_cache.iterdir()]
    assert len(kept) == 1

    def refuse(*arguments: object, **options: object) -> None:
        raise AssertionError("the compiler was called")

    monkeypatch.setattr(subprocess, "run", refuse)
    kernel = Kernel(small(), compiled=True)
    expected = small_in_numpy(np.zeros(2), rows_of(5), 1.0)[1]
    assert kernel.run([0.0, 0.0], rows_of(5), [1.0])[1] == pytest.approx(expected)
    assert [path.name for path in empty_cache.iterdir()] == kept


@needs_compiler
def test_another_function_gets_another_library(empty_cache: Path) -> None:
    s = ca.SX.sym("s")
    for factor in (2.0, np.nextafter(2.0, 3.0)):
        function = ca.Function("f", [s, s.sym("r"), s.sym("p")], [factor * s, s])
        assert Kernel(function, compiled=True).step([1.0], [0.0], [0.0])[0] == [factor]
    assert len(list(empty_cache.iterdir())) == 2


@needs_compiler
@pytest.mark.parametrize("spoil", ["truncated", "empty", "text", "one byte"])
def test_spoilt_library_is_built_again(empty_cache: Path, spoil: str) -> None:
    # In a process of its own for each step: a library in use must not be written to.
    code = (
        "import casadi as ca; from models.simulation.kernel import Kernel;"
        "s = ca.SX.sym('s');"
        "k = Kernel(ca.Function('f', [s, s.sym('r'), s.sym('p')], [3*s, s]), compiled=True);"
        "print(k.step([2.0], [0.0], [0.0])[0][0])"
    )
    environment = {**os.environ, "STILLHOOK_CACHE": str(empty_cache.parent)}

    def run() -> str:
        return subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True,
            check=True,
        ).stdout.strip()  # fmt: skip

    assert run() == "6.0"
    (library,) = empty_cache.iterdir()
    whole = library.read_bytes()
    middle = len(whole) // 2
    library.write_bytes(
        {
            "truncated": whole[:middle],
            "empty": b"",
            "text": b"not a library",
            "one byte": whole[:middle] + bytes([whole[middle] ^ 255]) + whole[middle + 1 :],
        }[spoil]
    )
    assert run() == "6.0"
    (library,) = empty_cache.iterdir()
    assert library.read_bytes() == whole


def test_without_a_compiler_the_virtual_machine_takes_over(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    kernel = Kernel(small())
    assert not kernel.compiled
    assert kernel.note == (
        "kernel: no C compiler is to be had: set CC or put cc, gcc or clang on the PATH, and do "
        "not set STILLHOOK_COMPILE to 0"
    )
    with pytest.raises(SolverError, match="no C compiler is to be had"):
        Kernel(small(), compiled=True)
    assert Kernel(small(), compiled=False).note == ""


def test_compilation_can_be_switched_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STILLHOOK_COMPILE", "0")
    assert find_compiler() is None
    assert not Kernel(small()).compiled


@pytest.mark.skipif(os.name != "posix", reason="a shell script stands for the compiler")
def test_compiler_that_fails_is_quoted_or_passed_over(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    script = tmp_path / "my cc"
    script.write_text(
        "#!/bin/sh\n"
        'if [ "$2" = --version ]; then echo "my cc 1.0"; exit 0; fi\n'
        "echo kernel.c: In function drive >&2\n"
        "echo kernel.c:1: error: the disk is full >&2\n"
        "exit 1\n"
    )
    script.chmod(script.stat().st_mode | stat.S_IEXEC)
    monkeypatch.setenv("CC", f"'{script}' -m64")
    compiler = find_compiler()
    assert compiler is not None
    assert (compiler.command, compiler.version) == ((str(script), "-m64"), "my cc 1.0")
    said = f"C compiler: {script} failed: kernel.c:1: error: the disk is full"
    with pytest.raises(SolverError) as caught:
        Kernel(small(), compiled=True)
    assert str(caught.value) == said
    kernel = Kernel(small())
    assert (kernel.compiled, kernel.note) == (False, said)
    assert list(empty_cache.iterdir()) == []


@needs_compiler
@pytest.mark.skipif(os.name != "posix", reason="owner and mode are those of POSIX")
def test_the_libraries_are_their_users_alone(empty_cache: Path) -> None:
    umask = os.umask(0)
    try:
        Kernel(small(), compiled=True)
    finally:
        os.umask(umask)
    (library,) = empty_cache.iterdir()
    assert [stat.S_IMODE(path.stat().st_mode) for path in (empty_cache, library)] == [0o700] * 2


@needs_compiler
@pytest.mark.skipif(os.name != "posix", reason="owner and mode are those of POSIX")
@pytest.mark.parametrize("whose", ["anybody may write", "another's", "a link"])
def test_a_library_that_is_not_ours_is_not_loaded(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, whose: str
) -> None:
    Kernel(small(), compiled=True)
    (library,) = empty_cache.iterdir()
    if whose == "anybody may write":
        library.chmod(0o722)
    elif whose == "a link":
        library.rename(tmp_path / "elsewhere")
        library.symlink_to(tmp_path / "elsewhere")
    else:
        lstat = Path.lstat

        def of_another(path: Path) -> os.stat_result:
            found = list(lstat(path))
            found[stat.ST_UID] += path == library
            return os.stat_result(found)

        monkeypatch.setattr(Path, "lstat", of_another)
    loaded: list[int] = []
    load = ctypes.CDLL

    def remember(path: str) -> ctypes.CDLL:
        loaded.append(Path(path).lstat().st_ino)
        return load(path)

    before = library.lstat().st_ino
    monkeypatch.setattr(ctypes, "CDLL", remember)
    assert Kernel(small(), compiled=True).compiled
    assert loaded
    assert before not in loaded


@needs_compiler
@pytest.mark.skipif(os.name != "posix", reason="owner and mode are those of POSIX")
@pytest.mark.parametrize("whose", ["anybody may write", "another's"])
def test_a_cache_folder_that_is_not_ours_is_closed_or_done_without(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch, whose: str
) -> None:
    empty_cache.mkdir(parents=True)
    empty_cache.chmod(0o777)
    if whose == "another's":
        monkeypatch.setattr(os, "geteuid", lambda: empty_cache.stat().st_uid + 1)
    assert Kernel(small(), compiled=True).compiled
    assert len(list(empty_cache.iterdir())) == (whose == "anybody may write")
    assert stat.S_IMODE(empty_cache.stat().st_mode) == 0o700


@needs_compiler
def test_a_compiler_in_the_current_folder_is_not_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("cc", "gcc", "clang"):
        (tmp_path / name).write_text("#!/bin/sh\ntouch planted\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", os.pathsep.join([".", "", os.environ["PATH"]]))
    find_compiler()
    assert not (tmp_path / "planted").exists()


@needs_compiler
def test_unknown_compiler_in_cc_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    expected = find_compiler()
    for value in ("no-such-compiler", "'", ""):
        monkeypatch.setenv("CC", value)
        assert find_compiler() == expected


@needs_compiler
def test_cache_that_cannot_be_written_is_done_without(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("STILLHOOK_CACHE", str(tmp_path / "file" / "cache"))
    assert Kernel(small(), compiled=True).compiled
    monkeypatch.setattr(subprocess, "run", None)
    assert Kernel(small(), compiled=True).compiled  # kept for the process


@needs_compiler
def test_libraries_longest_unused_are_tidied_away(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("models.simulation.compiler.KEPT", 2)
    s = ca.SX.sym("s")
    functions = [ca.Function("f", [s, s.sym("r"), s.sym("p")], [k * s, s]) for k in (2, 3, 4)]
    names = []
    for k, function in enumerate(functions[:2]):
        Kernel(function, compiled=True)
        (new,) = (path for path in empty_cache.iterdir() if path.name not in names)
        os.utime(new, (1000.0 + k, 1000.0 + k))
        names.append(new.name)
    Kernel(functions[0], compiled=True)  # the first is older, but used now
    Kernel(functions[2], compiled=True)
    left = {path.name for path in empty_cache.iterdir()}
    assert len(left) == 2
    assert names[0] in left
    assert names[1] not in left


def run_in_a_worker(kernel: Kernel) -> tuple[bool, FloatArray]:
    return kernel.compiled, kernel.run([0.3, -0.2], rows_of(100), [0.7])[1]


@needs_compiler
def test_processes_may_build_the_same_library_at_once(empty_cache: Path) -> None:
    kernel = Kernel(small())
    expected = run_in_a_worker(kernel)[1]
    for path in empty_cache.iterdir():
        path.unlink()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, mp_context=context) as pool:
        for compiled, out in pool.map(run_in_a_worker, [kernel] * 4):
            assert compiled
            assert np.array_equal(out, expected)
    assert len({path.name.split("-")[0] for path in empty_cache.iterdir()}) == 1


@pytest.mark.parametrize("compiled", [None, False])
def test_pickled_kernel_is_the_same_kernel(compiled: bool | None) -> None:
    kernel = Kernel(small(), compiled=compiled)
    again = pickle.loads(pickle.dumps(kernel))
    assert again.compiled == kernel.compiled
    assert again.compiled == kernel.compiled
    expected = kernel.run([0.3, -0.2], rows_of(100), [0.7])
    found = again.run([0.3, -0.2], rows_of(100), [0.7])
    assert np.array_equal(found[0], expected[0])
    assert np.array_equal(found[1], expected[1])


@pytest.mark.parametrize("compiled", both())
def test_threads_may_share_a_kernel(compiled: bool) -> None:
    kernel = Kernel(small(), compiled=compiled)
    tables = [rows_of(600, seed=seed) for seed in range(8)]
    barrier = threading.Barrier(4)

    def work(k: int) -> tuple[FloatArray, FloatArray]:
        if k < 4:
            barrier.wait()
        state = np.array([0.3, -0.2])
        for row in tables[k]:
            state, _ = kernel.step(state, row, [0.7])
        return state, kernel.run([0.3, -0.2], tables[k], [0.7])[0]

    with ThreadPoolExecutor(4) as pool:
        for k, (stepped, run) in enumerate(pool.map(work, range(8))):
            expected = small_in_numpy(np.array([0.3, -0.2]), tables[k], 0.7)[0]
            assert stepped == pytest.approx(expected)
            assert run == pytest.approx(expected)


@pytest.mark.skipif(os.name != "posix", reason="needs a POSIX alarm")
@pytest.mark.parametrize("compiled", both())
def test_run_can_be_interrupted(compiled: bool) -> None:
    s, empty = ca.SX.sym("s", 60), ca.SX.sym("empty", 0)
    kernel = Kernel(ca.Function("f", [s, empty, empty], [ca.sin(s), empty]), compiled=compiled)
    rows = np.zeros((20_000_000, 0))  # some 15 s of work and no memory

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        begin = time.perf_counter()
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(KeyboardInterrupt):
            kernel.run(np.ones(60), rows, [])
        assert time.perf_counter() - begin < 3.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@needs_compiler
def test_function_that_casadi_cannot_write_as_c_is_interpreted() -> None:
    class Double(ca.Callback):
        def __init__(self) -> None:
            super().__init__()
            self.construct("double_it", {})

        def eval(self, arguments: list[ca.DM]) -> list[ca.DM]:
            return [2 * arguments[0]]

    inner = Double()
    s, r, p = (ca.MX.sym(name) for name in "srp")
    function = ca.Function("outer", [s, r, p], [inner(s), r])
    kernel = Kernel(function)
    assert not kernel.compiled
    assert "callback" in kernel.note.lower()
    assert kernel.run([1.0], np.zeros((3, 1)), [0.0])[0] == [8.0]
    with pytest.raises(SolverError, match="Callback"):
        Kernel(function, compiled=True)


def test_interpreted_recursion_that_fails_says_where() -> None:
    x, square = ca.SX.sym("x"), ca.SX.sym("square")
    root = {"x": x, "p": square, "g": x**2 - square}
    solver = ca.rootfinder("solver", "newton", root, {"show_eval_warnings": False})
    s, r, p = (ca.MX.sym(name) for name in "srp")
    kernel = Kernel(
        ca.Function("root", [s, r, p], [s + 1, solver(x0=1.5, p=r)["x"]]), compiled=False
    )
    rows = np.full((300, 1), 2.0)
    assert kernel.run([0.0], rows, [0.0])[1] == pytest.approx(np.full((300, 1), np.sqrt(2.0)))
    rows[270] = -1.0  # has no root
    with pytest.raises(SolverError, match="failed at row 256 or soon after it"):
        kernel.run([0.0], rows, [0.0])
    with pytest.raises(SolverError, match="failed at row 0"):
        kernel.step([0.0], [-1.0], [0.0])


@needs_compiler
def test_compiled_recursion_that_fails_says_where() -> None:
    # CasADi writes few functions as C that can fail, so this one is written by hand.
    source = """
typedef long long casadi_int;
static int stillhook_recursion(const double **arg, double **res, casadi_int *iw, double *w, int m) {
  iw[0] = 0; w[0] = arg[1][0]; res[0][0] = arg[0][0] + arg[2][0]; res[1][0] = w[0];
  return w[0] < 0.0;
}
"""
    sizes = {"sz_arg": 3, "sz_res": 2, "sz_iw": 2, "sz_w": 3, "next": 1, "ns": 1, "nr": 1}
    source += _DRIVER.format(name="stillhook_recursion", nout=1, **sizes)
    compiler = find_compiler()
    assert compiler is not None
    engine = _Compiled(load_library(source, compiler))
    state, rows = np.zeros(1), np.ones((BLOCK + 100, 1))
    engine.run(state, rows, np.full(1, 2.0), out := np.zeros_like(rows))
    assert state == [2.0 * (BLOCK + 100)]
    assert np.array_equal(out, rows)
    rows[BLOCK + 50] = -1.0
    with pytest.raises(SolverError, match=f"failed at row {BLOCK + 50} or"):
        engine.run(state, rows, np.full(1, 2.0), out)


@pytest.mark.parametrize("compiled", both())
@pytest.mark.parametrize(
    ("state", "rows", "parameters"),
    [
        (np.zeros(3), np.zeros((5, 3)), np.zeros(1)),
        (np.zeros((2, 1)), np.zeros((5, 3)), np.zeros(1)),
        (np.zeros(2), np.zeros((5, 2)), np.zeros(1)),
        (np.zeros(2), np.zeros(3), np.zeros(1)),
        (np.zeros(2), np.zeros((3, 5)), np.zeros(1)),
        (np.zeros(2), np.zeros((5, 3)), np.zeros(2)),
        (np.zeros(2), np.zeros((5, 3)), 0.0),
    ],
)
def test_wrong_shapes_are_refused(
    compiled: bool, state: FloatArray, rows: FloatArray, parameters: FloatArray
) -> None:
    kernel = Kernel(small(), compiled=compiled)
    with pytest.raises(InputError, match="must have 2, 3 and 1 numbers, got shapes"):
        kernel.run(state, rows, parameters)


@pytest.mark.parametrize("compiled", both())
@pytest.mark.parametrize(
    ("state", "row", "parameters"),
    [
        (np.zeros(1), np.zeros(3), np.zeros(1)),
        (0.0, np.zeros(3), np.zeros(1)),
        (np.zeros(2), np.zeros((1, 3)), np.zeros(1)),
        (np.zeros(2), np.zeros(1), np.zeros(1)),
        (np.zeros(2), np.zeros(3), np.zeros(0)),
    ],
)
def test_wrong_shapes_of_one_step_are_refused(
    compiled: bool, state: FloatArray, row: FloatArray, parameters: FloatArray
) -> None:
    with pytest.raises(InputError, match="must have 2, 3 and 1 numbers, got shapes"):
        Kernel(small(), compiled=compiled).step(state, row, parameters)


def test_functions_of_another_form_are_refused() -> None:
    s, r, p = ca.SX.sym("s", 2), ca.SX.sym("r", 3), ca.SX.sym("p", 1)
    for inputs, outputs in (
        ([s, r], [s, r]),
        ([s, r, p], [s]),
        ([s, r, p], [r, s]),
        ([s, r, p], [s, r.T]),
        ([s, ca.SX.sym("r", 1, 3), p], [s, p]),
        ([s, ca.SX.sym("r", ca.Sparsity(2, 1)), p], [s, p]),
    ):
        with pytest.raises(InputError, match=r"of dense columns, s_next as long as s, got f:\("):
            Kernel(ca.Function("f", inputs, outputs))


@needs_compiler
def test_compiled_run_and_step_are_worth_their_while() -> None:
    # Ratios, best of five in turn: other processes take their share of the machine.
    function, start, p = crane("thesis-1975", None, 0.02)
    rows = crane_rows(5_000, 0.02, 0.0)
    kernel, interpreted = Kernel(function, compiled=True), Kernel(function, compiled=False)

    def call_casadi() -> None:
        for row in rows[:500]:
            function(start, row, p)

    def step() -> None:
        for row in rows[:500]:
            kernel.step(start, row, p)

    works: list[Callable[[], object]] = [
        call_casadi,
        step,
        lambda: kernel.run(start, rows, p),
        lambda: interpreted.run(start, rows, p),
    ]
    best = [math.inf] * len(works)
    for _ in range(5):
        for k, work in enumerate(works):
            begin = time.perf_counter()
            work()
            best[k] = min(best[k], time.perf_counter() - begin)
    assert best[1] < best[0] / 3.0
    assert best[2] < best[3] / 3.0


@needs_compiler
def test_library_exports_its_loop_and_nothing_else(empty_cache: Path) -> None:
    Kernel(small(), compiled=True)
    (path,) = empty_cache.iterdir()
    library = ctypes.CDLL(str(path))
    assert hasattr(library, "stillhook_drive")
    assert not hasattr(library, "stillhook_recursion")
