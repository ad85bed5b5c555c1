"""Check what must hold for every command, whatever its input; and set the number of cases and time limits."""

import contextlib
import io
import itertools
import json
import os
import re
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis.database import DirectoryBasedExampleDatabase

from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.main import main
from tests.pace import within

SEED = os.environ.get("FUZZ_SEED")  # set by `make fuzz`; without it each run tests the same few cases
FUZZ_FACTOR = 10  # `make fuzz` tests this many times more cases
PROCESS_FUZZ_FACTOR = 3  # the same for cases that need a process each
DOCUMENTED_CODES = {*ExitCode} - {ExitCode.UNFORESEEN}
TIME_LIMIT = 10.0  # [s] of processor time for a command
SLOW_MACHINE_FACTOR = 20.0  # a slow machine may take this many times longer
FIRST_TIME_LIMIT = 1000.0  # [s] for the first attempt, which may have to compile or import something
MAX_MESSAGE_LENGTH = 20_000  # [characters]
UNSAFE_CHARACTERS = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2028\u2029\ud800-\udfff]")
OUTPUT_OPTIONS = {"--json", "--out", "--report", "--plot", "--merge", "--record"}
REPLACEABLE = (b"\x89M", b"\x89P", b"{\n", b"<!", b"<?")  # first bytes of files that a command may replace

T = TypeVar("T")


def fuzzed(count: int, *, factor: int = FUZZ_FACTOR, **strategies: Any) -> Callable[[Any], Any]:
    """Run a test with the same `count` cases each time; `make fuzz` runs `factor` times more at random."""
    chosen = settings(
        max_examples=count * factor if SEED else count,
        deadline=None,
        derandomize=SEED is None,
        database=DirectoryBasedExampleDatabase(".hypothesis/fuzz") if SEED else None,
        phases=[Phase.reuse, Phase.generate],  # cases are small, and shrinking takes minutes
        print_blob=True,
        suppress_health_check=list(HealthCheck),
    )

    def decorated(test: Any) -> Any:
        test = chosen(given(**strategies)(test))
        return seed(int(SEED))(test) if SEED else test

    return decorated


class TimeLimitError(BaseException):
    """The time limit has passed. It is no Exception, so that no command catches it."""


def call_within(function: Callable[[], T], seconds: float) -> T:
    """Call a function, which must take less processor time than `seconds`; return its result.

    It is called a second time if the first call took longer.
    """
    for limit in (max(seconds, FIRST_TIME_LIMIT), SLOW_MACHINE_FACTOR * seconds):
        start = time.process_time()
        with _time_limit(limit):
            result = function()
        if within(time.process_time() - start, seconds):
            return result
    raise AssertionError(f"takes more than {seconds} s")


@contextlib.contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    def stop(*_: Any) -> None:
        raise TimeLimitError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    except TimeLimitError:
        raise AssertionError(f"takes more than {seconds} s") from None
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def check_command(
    template: Path, arguments: Sequence[str], *, files: dict[str, bytes] | None = None, stream: str = "utf-8"
) -> tuple[int, dict[str, bytes]]:
    """Run a command in a copy of `template` with `files`; return its exit code and the files afterwards.

    `stream` is the encoding of its streams, or `full` if standard output goes to a full disk. Raise
    AssertionError with the command's output if any rule is violated.
    """
    code, out, err, before, after = call_within(
        lambda: _run(template, arguments, files or {}, stream), TIME_LIMIT
    )
    details = f"{list(arguments)} exits {code}\n{out[-2000:]}\n{err[-6000:]}"
    assert code in DOCUMENTED_CODES, details
    assert "Traceback" not in err, details
    assert not UNSAFE_CHARACTERS.search(out + err), details
    assert len(err) < MAX_MESSAGE_LENGTH, details
    assert code != ExitCode.BAD_INPUT or re.search(r"^(found: |Error: )", err, re.MULTILINE), details
    if code not in (ExitCode.BAD_INPUT, ExitCode.INTERRUPTED) and stream != "full":
        _check_json(arguments, out)
    _check_files(arguments, before, after)
    return code, after


def _check_json(arguments: Sequence[str], out: str) -> None:
    if "-" not in [arguments[k + 1] for k, word in enumerate(arguments[:-1]) if word == "--json"][-1:]:
        return
    try:
        text = json.dumps(json.loads(out))
    except ValueError:
        text = "NaN"
    assert not re.search(r"\b(NaN|Infinity)\b", text), "standard output is not valid JSON"


def _check_files(arguments: Sequence[str], before: dict[str, bytes], after: dict[str, bytes]) -> None:
    """Check that only files which the command had to write have changed, and that they kept their kind."""
    assert "here/-" not in after
    assert not [name for name in after if name.endswith(".part")]
    resumed = {"--resume", "--overwrite"} & set(arguments)
    pairs = enumerate(itertools.pairwise(arguments), 2)  # the last value of a repeated option counts
    words = [(a, b) for later, (a, b) in pairs if not (a.startswith("--") and a in arguments[later:])]
    for name, content in before.items():
        if after.get(name) == content or (resumed and name.startswith("here/r/")):
            continue
        options = {option for option, word in words if os.path.normpath(f"here/{word}") == name}
        assert len(options) == 1, f"{name} has changed"
        assert options & OUTPUT_OPTIONS or {"render", "layout"} & set(arguments[:2]), f"{name} has changed"
        assert content[:2] in REPLACEABLE, f"{name} has changed"
        assert after[name][:2] == content[:2], f"{name} is of another kind"


def _run(
    template: Path, arguments: Sequence[str], files: dict[str, bytes], stream: str
) -> tuple[int, str, str, dict[str, bytes], dict[str, bytes]]:
    encoding = "utf-8" if stream == "full" else stream
    with (
        tempfile.TemporaryDirectory() as sandbox,
        tempfile.TemporaryFile() as error,
        open("/dev/full", "wb") if stream == "full" else tempfile.TemporaryFile() as output,  # noqa: PTH123
    ):
        directory = Path(sandbox, "here")
        shutil.copytree(template, directory, symlinks=True)
        for name, content in files.items():
            (directory / name).write_bytes(content)
        before = _contents(sandbox)
        with (
            contextlib.chdir(directory),
            _redirect_streams(output, error, encoding),
            _forbid_writing_outside(Path(sandbox)),
        ):
            code = main(["--traceback", *arguments])
        texts = []
        for file in (output, error):
            text = b""
            if file.readable():
                file.seek(0)
                text = file.read()
            # click treats the encoding ASCII as a mistake, and writes its help in UTF-8.
            texts.append(text.decode("utf-8" if encoding == "ascii" else encoding))
        return code, *texts, before, _contents(sandbox)


def _contents(directory: str) -> dict[str, bytes]:
    files = (path for path in Path(directory).rglob("*") if path.is_file() and not path.is_symlink())
    return {str(path.relative_to(directory)): path.read_bytes() for path in files}


@contextlib.contextmanager
def _redirect_streams(output: Any, error: Any, encoding: str) -> Iterator[None]:
    """Redirect standard output and error to files with a strict encoding."""
    before = sys.stdout, sys.stderr
    opened = [
        io.TextIOWrapper(io.BufferedWriter(io.FileIO(file.fileno(), "wb", closefd=False)), encoding=encoding)
        for file in (output, error)
    ]
    sys.stdout, sys.stderr = opened
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before
        with contextlib.suppress(OSError):
            for wrapper in opened:
                wrapper.close()


_watched: list[tuple[Path, list[str]]] = []  # directories, and the writes outside them
WRITE_EVENTS = {"os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.truncate", "os.symlink", "os.link"}


def _audit(event: str, arguments: tuple[Any, ...]) -> None:
    if not _watched or not (event in WRITE_EVENTS or event == "open"):
        return
    path = arguments[0]
    writes = event != "open" or (isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR))
    if writes and isinstance(path, str | bytes | os.PathLike):
        directory, violations = _watched[-1]
        full = os.path.realpath(os.fsdecode(path))
        temporary = f"{os.path.realpath(tempfile.gettempdir())}/cranectl-{os.geteuid()}/"
        places = os.path.realpath(directory), "/dev/", "/proc/", temporary
        allowed = full.startswith(places) or "cache" in full
        if not allowed and not (event == "os.mkdir" and Path(full).is_dir()):
            violations.append(f"{event} {full}")


sys.addaudithook(_audit)


@contextlib.contextmanager
def _forbid_writing_outside(directory: Path) -> Iterator[None]:
    """Fail if anything is written outside `directory`, except caches and temporary files of the process."""
    violations: list[str] = []
    _watched.append((directory, violations))
    try:
        yield
    finally:
        _watched.pop()
    assert not violations, violations
