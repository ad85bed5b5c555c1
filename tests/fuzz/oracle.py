"""What cranectl owes its user, whatever it is given; and how long and how often that is tried."""

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

from cranectl.cli import exit_codes
from cranectl.cli.main import main
from tests.pace import within

SEED = os.environ.get("FUZZ_SEED")  # of `make fuzz`; without it the same few cases are tried each time
FACTOR = 10  # times more cases then
FEW = 3  # times more of those that take a process each
FORESEEN = exit_codes.MEANINGS.keys() - {exit_codes.UNFORESEEN}
SECONDS = 10.0  # of the processor, for a command
SLOWEST = 20.0  # times longer that a slow machine may take
PATIENCE = 1000.0  # the first time, when it may have to compile or import something
LONGEST = 20_000  # [characters] of a message
UNFIT = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2028\u2029\ud800-\udfff]")
OUTPUTS = {"--json", "--out", "--report", "--plot", "--merge", "--record"}
KINDS = (b"\x89M", b"\x89P", b"{\n", b"<!", b"<?")  # how files begin that a command may replace by its own

T = TypeVar("T")


def fuzzed(count: int, *, factor: int = FACTOR, **strategies: Any) -> Callable[[Any], Any]:
    """Try a test with `count` cases, always the same; many more, and others, in `make fuzz`."""
    chosen = settings(
        max_examples=count * factor if SEED else count,
        deadline=None,
        derandomize=SEED is None,
        database=DirectoryBasedExampleDatabase(".hypothesis/fuzz") if SEED else None,
        phases=[Phase.reuse, Phase.generate],  # these cases are small; to shrink them takes minutes
        print_blob=True,
        suppress_health_check=list(HealthCheck),
    )

    def decorated(test: Any) -> Any:
        test = chosen(given(**strategies)(test))
        return seed(int(SEED))(test) if SEED else test

    return decorated


class TooLongError(BaseException):
    """Not an Exception: no command may take it for something that it can tell."""


def in_time(use: Callable[[], T], seconds: float) -> T:
    """What `use` returns, in so many seconds of the processor, the second time if not the first."""
    for limit in (max(seconds, PATIENCE), SLOWEST * seconds):
        start = time.process_time()
        with _limited(limit):
            result = use()
        if within(time.process_time() - start, seconds):
            return result
    raise AssertionError(f"takes more than {seconds} s")


@contextlib.contextmanager
def _limited(seconds: float) -> Iterator[None]:
    def stop(*_: Any) -> None:
        raise TooLongError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    except TooLongError:
        raise AssertionError(f"takes more than {seconds} s") from None
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def check_command(
    template: Path, arguments: Sequence[str], *, files: dict[str, bytes] | None = None, stream: str = "utf-8"
) -> tuple[int, dict[str, bytes]]:
    """Run a command in a copy of `template` with `files`; its exit code and the files that are there then.

    `stream` is the encoding of its streams, or `full` for a disk without space behind standard output.
    Raises AssertionError with all that was said if anything is not as it should be.
    """
    code, out, err, before, after = in_time(lambda: _run(template, arguments, files or {}, stream), SECONDS)
    told = f"{list(arguments)} exits {code}\n{out[-2000:]}\n{err[-6000:]}"
    assert code in FORESEEN, told
    assert "Traceback" not in err, told
    assert not UNFIT.search(out + err), told
    assert len(err) < LONGEST, told
    assert code != exit_codes.BAD_INPUT or re.search(r"^(found: |Error: )", err, re.MULTILINE), told
    if code not in (exit_codes.BAD_INPUT, exit_codes.INTERRUPTED) and stream != "full":
        _check_json(arguments, out)
    _check_files(arguments, before, after)
    return code, after


def _check_json(arguments: Sequence[str], out: str) -> None:
    if "-" not in [arguments[k + 1] for k, each in enumerate(arguments[:-1]) if each == "--json"][-1:]:
        return
    try:
        told = json.dumps(json.loads(out))
    except ValueError:
        told = "NaN"
    assert not re.search(r"\b(NaN|Infinity)\b", told), "standard output is no JSON"


def _check_files(arguments: Sequence[str], before: dict[str, bytes], after: dict[str, bytes]) -> None:
    """What was there has changed only where the command was told to write a file of that kind."""
    assert "here/-" not in after
    assert not [name for name in after if name.endswith(".part")]
    resumed = {"--resume", "--overwrite"} & set(arguments)
    pairs = enumerate(itertools.pairwise(arguments), 2)  # of an option that is repeated the last value counts
    said = [(a, b) for later, (a, b) in pairs if not (a.startswith("--") and a in arguments[later:])]
    for name, content in before.items():
        if after.get(name) == content or (resumed and name.startswith("here/r/")):
            continue
        named = {option for option, word in said if os.path.normpath(f"here/{word}") == name}
        assert len(named) == 1, f"{name} has changed"
        assert named & OUTPUTS or {"render", "layout"} & set(arguments[:2]), f"{name} has changed"
        assert content[:2] in KINDS, f"{name} has changed"
        assert after[name][:2] == content[:2], f"{name} is of another kind"


def _run(
    template: Path, arguments: Sequence[str], files: dict[str, bytes], stream: str
) -> tuple[int, str, str, dict[str, bytes], dict[str, bytes]]:
    encoding = "utf-8" if stream == "full" else stream
    with (
        tempfile.TemporaryDirectory() as box,
        tempfile.TemporaryFile() as error,
        open("/dev/full", "wb") if stream == "full" else tempfile.TemporaryFile() as output,  # noqa: PTH123
    ):
        here = Path(box, "here")
        shutil.copytree(template, here, symlinks=True)
        for name, content in files.items():
            (here / name).write_bytes(content)
        before = _contents(box)
        with contextlib.chdir(here), _streams(output, error, encoding), _watched(Path(box)):
            code = main(["--traceback", *arguments])
        said = []
        for file in (output, error):
            text = b""
            if file.readable():
                file.seek(0)
                text = file.read()
            # click takes an encoding of ASCII for a mistake, and writes its help in UTF-8.
            said.append(text.decode("utf-8" if encoding == "ascii" else encoding))
        return code, *said, before, _contents(box)


def _contents(box: str) -> dict[str, bytes]:
    files = (path for path in Path(box).rglob("*") if path.is_file() and not path.is_symlink())
    return {str(path.relative_to(box)): path.read_bytes() for path in files}


@contextlib.contextmanager
def _streams(output: Any, error: Any, encoding: str) -> Iterator[None]:
    """Standard output and error are files that refuse what their encoding lacks."""
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


_watching: list[tuple[Path, list[str]]] = []
CHANGES = {"os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.truncate", "os.symlink", "os.link"}


def _audit(event: str, arguments: tuple[Any, ...]) -> None:
    if not _watching or not (event in CHANGES or event == "open"):
        return
    path = arguments[0]
    writes = event != "open" or (isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR))
    if writes and isinstance(path, str | bytes | os.PathLike):
        box, seen = _watching[-1]
        full = os.path.realpath(os.fsdecode(path))
        temporary = f"{os.path.realpath(tempfile.gettempdir())}/cranectl-{os.geteuid()}/"
        known = full.startswith((os.path.realpath(box), "/dev/", temporary)) or "cache" in full
        if not known and not (event == "os.mkdir" and Path(full).is_dir()):
            seen.append(f"{event} {full}")


sys.addaudithook(_audit)


@contextlib.contextmanager
def _watched(box: Path) -> Iterator[None]:
    """Fail if anything is written outside `box`, but for caches and temporary files of the process."""
    seen: list[str] = []
    _watching.append((box, seen))
    try:
        yield
    finally:
        _watching.pop()
    assert not seen, seen
