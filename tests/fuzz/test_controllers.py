"""Controllers that misbehave, at a random step or before, end their own run and harm nothing else."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st

from cranectl.log.reader import read_log
from tests.fuzz.forked import check, forked
from tests.fuzz.oracle import FEW, fuzzed

LAW = """
import ctypes, gc, os, signal, subprocess, sys, threading, time, warnings
import numpy as np
{top}

class Odd:
    memory = 5
    def prepare(nominal):
        start = np.zeros(5)
        {preparing}
        return np.array([{parameter}]), start
    def step(parameters, measured, reference, memory, command):
        memory[3] += 1.0
        for axis in range(3):
            target = -reference[2] if axis == 2 else reference[axis]
            memory[axis] = target - measured[2 * axis]
            command[axis] = parameters[0] * memory[axis] - 8.0 * measured[2 * axis + 1]
        if memory[3] == {step:.1f}:
            {stepping}
        return 0
    {declared}
{bottom}
"""
# By what may come of it: "same" leaves every number as it is, "ends" ends the run at this step, and of "any"
# only what came before it is known.
TEXTS = {
    "same": r"""
print('x')
print('\x1b[2J\x07')
sys.stdout.write('no end')
os.write(1, b'raw\xff')
os.write(2, b'\x1b[31m')
warnings.warn('hm')
time.sleep(0.05)
np.random.seed(1)
gc.collect()
os.chdir('/')
np.seterr(all='raise')
threading.Thread(target=time.sleep, args=[9], daemon=True).start()
subprocess.Popen(['sleep', '60'])
sys.stdout.close()
os.environ.clear()
sys.setrecursionlimit(300)
signal.signal(signal.SIGINT, signal.SIG_IGN)
sys.argv.clear()
sys.path.clear()
os.umask(0o777)
signal.alarm(0)
np.set_printoptions(precision=1)
sys.stderr.write('\u202e' * 50)
ctypes.CDLL(None).fesetround(0x800)
""",
    "ends": r"""
raise ValueError('lost')
raise ValueError('\x1b[2J\r\nfound: forged')
raise SystemExit(0)
raise KeyboardInterrupt
os._exit(0)
os._exit(75)
os._exit(3)
os.kill(os.getpid(), signal.SIGSEGV)
os.kill(os.getpid(), signal.SIGABRT)
ctypes.string_at(0)
return 7
return -1
return 2**70 + len({})
return None
return 'x'
command[0] = np.nan
command[2] = -np.inf
raise Odd_
raise type('\x9b', (Exception,), dict(__str__=lambda self: 1 / 0))()
raise ValueError('a' * 10**6)
raise ValueError('\ud800')
assert not memory[3]
step(1)
raise BaseExceptionGroup('g', [KeyboardInterrupt()])
exec('def f(): f()\nf()', dict())
raise StopIteration
raise GeneratorExit
del memory.x
os.close(2); raise ValueError('unheard')
""",
    "any": r"""
memory[:] = np.nan
memory[3] = 1e300
command[:] = 1e308
command[0] = 1e9
parameters[0] = 1.0
os.close(1)
os.close(2)
os.killpg(os.getpgrp(), signal.SIGTERM)
os.closerange(3, 64)
reference[0] = 9.0
""",
}
DEEDS = {kind: text.split("\n")[1:-1] for kind, text in TEXTS.items()}
EXPECTED = {"same": {0}, "ends": {2, 3}, "any": {0, 2, 3}}
NESTED = "{}"  # what Numba cannot compile, so that the step stays in the interpreter


@pytest.fixture(scope="module")
def usual(template: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[], np.ndarray]:
    """The record with the controller when it behaves, as a function: failures print it."""
    record = ran(template, tmp_path_factory.mktemp("usual"), source(stepping="pass"))[1]
    return lambda: record


def source(**changes: object) -> str:
    usual: dict[str, object] = {
        "top": "",
        "bottom": "",
        "declared": "",
        "preparing": "pass",
        "stepping": "pass",
    }
    return LAW.format(**usual | {"parameter": 16.0, "step": 3.0} | changes)


def ran(template: Path, directory: Path, text: str) -> tuple[int, np.ndarray]:
    """The exit code with a controller of this source, and what its log holds."""
    (directory / "law.py").write_text(text, encoding="utf-8", errors="surrogatepass")
    (directory / "s.toml").write_bytes((template / "s.toml").read_bytes())
    line = ["run", "s.toml", "--controller", "law.py:Odd", "--plants", "analytic", "--every", "1"]
    line += ["--out", "o.mcap", "--json", "-"]
    (directory / "o.mcap").unlink(missing_ok=True)
    told = forked(directory, line)
    check(told, line)
    if told.code in (0, 3):
        assert json.loads(told.out)["runs"], "standard output is the command's own"
    else:
        assert not told.out
    left = {path.name for path in directory.iterdir()} - {"law.py", "s.toml", "o.mcap", "__pycache__"}
    assert not left
    if not (directory / "o.mcap").exists():
        assert told.code == 2
        return told.code, np.zeros((0, 0))
    (run,) = read_log(directory / "o.mcap").values()
    assert (run.status.label == "completed") == (told.code == 0)
    return told.code, run.table


@st.composite
def misdeeds(draw: st.DrawFn) -> tuple[str, str, int]:
    """What may come of a step, what it does, and which it is."""
    kind = draw(st.sampled_from(sorted(DEEDS)))
    return kind, draw(st.sampled_from(DEEDS[kind])), draw(st.integers(1, 20))


@fuzzed(12, factor=FEW, misdeed=misdeeds(), callback=st.booleans())
def test_what_a_step_does(
    template: Path,
    tmp_path_factory: pytest.TempPathFactory,
    usual: Callable[[], np.ndarray],
    misdeed: tuple[str, str, int],
    callback: bool,
) -> None:
    kind, deed, step = misdeed
    stepping = f"{deed}; str({NESTED})" if callback and not deed.startswith(("return", "raise")) else deed
    code, record = ran(template, tmp_path_factory.mktemp("odd"), source(stepping=stepping, step=step))
    assert code in EXPECTED[kind], f"{deed} at step {step} exits {code}"
    whole = (
        len(usual()) if kind == "same" else min(len(record), step - 1)
    )  # a process that ends loses a block
    assert record[:whole].tobytes() == usual()[:whole].tobytes(), f"{deed} at step {step}"


# In this process a controller can still do what it wants: end it by a signal, close its streams.
TAKEN = ("os.kill", "ctypes.string_at", "sys.stdout.close", "os.close", "raise KeyboardInterrupt", "os.umask")
TOPS = [deed for kind in ("same", "ends") for deed in DEEDS[kind] if not deed.startswith(TAKEN)]
TOPS += ["import no_such_module", "Odd_ = 1/0", "os.remove('o.mcap')", "x = (", "\0"]
DECLARED_TEXT = r"""
name = 'a\x1b[2J'
name = ''
name = 'lqr'
command = 'jerk'
every = 0
every = 1e300
every = 7
measures = 'all'
follows = 'nothing'
preview = -1
preview = 10**9
memory = -1
memory = [np.nan] * 5
memory = np.zeros((2, 3))
memory = 10**9
logged = {'a': 9}
logged = {'\x1b[2J': 0}
logged = {'a' * 10**5: 0}
logged = {f's{k}': 0 for k in range(3000)}
parameters = {'a b': 1.0}
parameters = {'x': np.nan}
parameters = {'x': 'y'}
parameters = 3
logged = 3
name = 3
prepare = 3
step = None
__doc__ = '\x1b[2J'
command = 'force'
command = 'velocity'
measures = 'encoders'
"""
DECLARED = DECLARED_TEXT.split("\n")[1:-1]
PREPARED = [
    *TOPS,
    "start = None",
    "start[:] = np.inf",
    "start = 'x'",
    "start = np.zeros(10**7)",
    "return 1",
    "return {}, []",
]


@fuzzed(
    12,
    factor=FEW,
    place=st.sampled_from(["top", "bottom", "preparing", "declared"]),
    data=st.data(),
)
def test_what_it_does_before_it_runs(
    template: Path,
    tmp_path_factory: pytest.TempPathFactory,
    usual: Callable[[], np.ndarray],
    place: str,
    data: st.DataObject,
) -> None:
    lines = {"top": TOPS, "bottom": TOPS, "preparing": PREPARED, "declared": DECLARED}[place]
    deed = data.draw(st.sampled_from(lines))
    code, record = ran(template, tmp_path_factory.mktemp("odd"), source(**{place: deed}))
    if deed in DEEDS["same"]:
        assert code == 0, f"{deed} exits {code}"
        assert record.tobytes() == usual().tobytes(), deed
    elif deed in DEEDS["ends"] and place != "preparing":
        assert code == 2, f"{deed} exits {code}"
