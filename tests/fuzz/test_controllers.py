"""A controller that misbehaves, at a random step or earlier, ends only its own run."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st

from cranectl.log.reader import read_log
from tests.fuzz.child_process import check, run_in_child
from tests.fuzz.conftest import NewDirectory
from tests.fuzz.oracle import PROCESS_FUZZ_FACTOR, fuzzed

CONTROLLER = """
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
# Statements by their allowed effect: "same" changes no number, "ends" ends the run at this step, and "any"
# may change everything from this step on.
STATEMENT_TEXTS = {
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
STATEMENTS = {effect: text.split("\n")[1:-1] for effect, text in STATEMENT_TEXTS.items()}
EXPECTED = {"same": {0}, "ends": {2, 3}, "any": {0, 2, 3}}
Record = Callable[[], np.ndarray]
NESTED = "{}"  # Numba cannot compile this, so the step stays in the interpreter


NORMAL = {"top": "", "bottom": "", "declared": "", "preparing": "pass", "stepping": "pass"}


@pytest.fixture(scope="module")
def normal_record(new_directory: NewDirectory) -> Record:
    """Return the signals of the correct controller, as a function: pytest would print an array."""
    record = run_controller(new_directory())[1]
    return lambda: record


def run_controller(directory: Path, step: int = 3, **statements: str) -> tuple[int, np.ndarray]:
    """Run a controller with these statements; return the exit code and the logged signals."""
    text = CONTROLLER.format(**{**NORMAL, **statements}, parameter=16.0, step=float(step))
    (directory / "law.py").write_text(text, encoding="utf-8", errors="surrogatepass")
    arguments = ["run", "s.toml", "--controller", "law.py:Odd", "--plants", "analytic", "--every", "1"]
    arguments += ["--out", "o.mcap", "--json", "-"]
    result = run_in_child(directory, arguments)
    check(result, arguments)
    if result.code in (0, 3):
        assert json.loads(result.out)["runs"], "the controller has written to standard output"
    else:
        assert not result.out
    assert {path.name for path in directory.iterdir()} <= {"law.py", "s.toml", "o.mcap", "__pycache__"}
    if not (directory / "o.mcap").exists():
        assert result.code == 2
        return result.code, np.zeros((0, 0))
    (run,) = read_log(directory / "o.mcap").values()
    assert (run.status.label == "completed") == (result.code == 0)
    return result.code, run.table


@st.composite
def faults(draw: st.DrawFn) -> tuple[str, str, int]:
    """Draw the allowed effect of a step, the statement that it executes, and its number."""
    effect = draw(st.sampled_from(sorted(STATEMENTS)))
    return effect, draw(st.sampled_from(STATEMENTS[effect])), draw(st.integers(1, 20))


@fuzzed(12, factor=PROCESS_FUZZ_FACTOR, fault=faults(), callback=st.booleans())
def test_a_faulty_step_ends_its_run_or_changes_no_earlier_sample(
    new_directory: NewDirectory, normal_record: Record, fault: tuple[str, str, int], callback: bool
) -> None:
    effect, statement, step = fault
    is_called_back = callback and not statement.startswith(("return", "raise"))
    stepping = f"{statement}; str({NESTED})" if is_called_back else statement
    code, record = run_controller(new_directory(), step, stepping=stepping)
    assert code in EXPECTED[effect], f"{statement} at step {step} exits {code}"
    # A process that ends loses the last block of its log.
    unaffected = len(normal_record()) if effect == "same" else min(len(record), step - 1)
    is_unaffected = record[:unaffected].tobytes() == normal_record()[:unaffected].tobytes()
    assert is_unaffected, f"{statement} at step {step}"


# Before the run, the controller is loaded by the command's own process, which these statements can end.
ENDS_THIS_PROCESS = ("os.kill", "ctypes.string_at", "sys.stdout.close", "os.close", "os.umask")
MODULE_STATEMENTS = [
    statement
    for statement in (*STATEMENTS["same"], *STATEMENTS["ends"])
    if not statement.startswith((*ENDS_THIS_PROCESS, "raise KeyboardInterrupt"))
]
MODULE_STATEMENTS += ["import no_such_module", "Odd_ = 1/0", "os.remove('o.mcap')", "x = (", "\0"]
DECLARATION_TEXT = r"""
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
DECLARATIONS = DECLARATION_TEXT.split("\n")[1:-1]
PREPARE_STATEMENTS = [*MODULE_STATEMENTS, "start = None", "start[:] = np.inf", "start = 'x'"]
PREPARE_STATEMENTS += ["start = np.zeros(10**7)", "return 1", "return {}, []"]
FAULTY_LINES = {"top": MODULE_STATEMENTS, "bottom": MODULE_STATEMENTS}
FAULTY_LINES |= {"preparing": PREPARE_STATEMENTS, "declared": DECLARATIONS}


@fuzzed(12, factor=PROCESS_FUZZ_FACTOR, position=st.sampled_from([*FAULTY_LINES]), data=st.data())
def test_a_faulty_definition_is_refused_or_changes_nothing(
    new_directory: NewDirectory, normal_record: Record, position: str, data: st.DataObject
) -> None:
    statement = data.draw(st.sampled_from(FAULTY_LINES[position]))
    code, record = run_controller(new_directory(), **{position: statement})
    if statement in STATEMENTS["same"]:
        assert code == 0, f"{statement} exits {code}"
        assert record.tobytes() == normal_record().tobytes(), statement
    elif statement in STATEMENTS["ends"] and position != "preparing":
        assert code == 2, f"{statement} exits {code}"
