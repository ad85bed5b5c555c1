"""Laws in other processes: the same bits as here, missed samples counted, and what remains when one fails."""

import contextlib
import math
import os
import re
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from cranectl.campaign.worker import PreparedCampaign, Worker
from cranectl.campaign.workers import Children, estimated_seconds
from cranectl.cli.main import main
from cranectl.loaders.opening import close_controllers, open_controller
from cranectl.simulate import Run, simulate_run
from cranectl.support.children import Timeout
from cranectl.support.errors import InputError
from tests.campaign.campaigns import campaign, fixed
from tests.loaders.controller_files import ASKED, LAW, SHORT, samples_before_failure, scenario
from tests.pace import HANG

QUESTION = struct.Struct("<I27d")
PROGRAM = """
import os, struct, sys, time
QUESTION = struct.Struct("<I27d")
while data := sys.stdin.buffer.read(QUESTION.size):
    n, *v = QUESTION.unpack(data)
    BROKEN
    command = []
    for axis in range(3):
        target, rate = (-v[14], -v[17]) if axis == 2 else (v[12 + axis], v[15 + axis])
        acceleration = 16.0 * (target - v[2 * axis])
        acceleration += 8.0 * (rate - v[2 * axis + 1])
        command.append(acceleration)
    sys.stdout.buffer.write(struct.pack("<I4d", n, *command, v[12] - v[0]))
    sys.stdout.buffer.flush()
time.sleep(6000)
"""

Peer = Callable[[int, list[float]], bytes | None]


def program(folder: Path, broken: str = "pass") -> Path:
    """The file of a law whose program lies beside it."""
    (folder / "law_program.py").write_text(PROGRAM.replace("BROKEN", broken))
    path = folder / "law.toml"
    command = f'["{sys.executable}", "law_program.py"]'
    path.write_text(f'name = "peer"\nprogram = {command}\nlogged = ["bridge_error"]\n')
    return path


@pytest.fixture
def listening() -> Iterator[Callable[[Peer], str]]:
    """Answers what a function says, at the address that it returns."""
    sockets = []

    def start(peer: Peer) -> str:
        here = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        here.bind(("127.0.0.1", 0))
        sockets.append(here)

        def serve() -> None:
            with contextlib.suppress(OSError):  # at the end it is closed
                while True:
                    data, sender = here.recvfrom(4096)
                    n, *values = QUESTION.unpack(data)
                    if (answer := peer(n, values)) is not None:
                        here.sendto(answer, sender)

        threading.Thread(target=serve, daemon=True).start()
        return f"udp://127.0.0.1:{here.getsockname()[1]}"

    yield start
    for each in sockets:
        each.close()


def servo(n: int, values: list[float]) -> bytes:
    """As the law `damper` of a file."""
    measured, reference = values[:12], values[12:]
    reference[2], reference[5] = -reference[2], -reference[5]
    command = [
        16.0 * (reference[axis] - measured[2 * axis]) + 8.0 * (reference[3 + axis] - measured[2 * axis + 1])
        for axis in range(3)
    ]
    return struct.pack("<I3d", n, *command)


def run(reference: str, *, plant: str = "mujoco") -> Run:
    name = open_controller(reference)
    return simulate_run(scenario(), plant=plant, controller=name)


def test_a_program_and_an_address_give_the_bits_of_the_law_in_this_process(
    tmp_path: Path, listening: Callable[[Peer], str]
) -> None:
    (tmp_path / "law.py").write_text(LAW)
    started = program(tmp_path)
    for plant in ("analytic", "mujoco"):  # a run each: every one begins with sample 0
        here = run(f"{tmp_path}/law.py:damper", plant=plant)
        for reference in (str(started), listening(servo)):
            there = run(reference, plant=plant)
            assert np.array_equal(there.block("state"), here.block("state"))
            assert not there.signal("controller.missed").any()
            close_controllers()
    error = run(str(started)).signal("controller.bridge_error")
    assert np.abs(error).max() > 1e-3


def test_free_running_holds_the_last_command_and_counts_what_it_missed(
    tmp_path: Path, listening: Callable[[Peer], str]
) -> None:
    def sluggish(n: int, values: list[float]) -> bytes | None:
        """One answer of a hundred is late."""
        answer = servo(n, values)
        if n % 100 == 99:
            time.sleep(0.03)
        return answer

    law = tmp_path / "law.toml"
    law.write_text(f'address = "{listening(sluggish)}"\ndeadline = 0.01\n')
    held = run(str(law))
    assert held.status.label == "completed"
    missed = held.signal("controller.missed")
    assert 32 <= missed[-1] < len(missed)  # while a late one is worked at, more go unanswered
    late = np.flatnonzero(np.diff(missed) > 0) + 1
    assert 99 in late
    command = held.block("input")[:, :3]
    assert np.array_equal(command[late], command[late - 1])


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        ("if n == 1200: sys.exit(7)", "the program ended with exit code 7"),
        ("if n == 1200: time.sleep(60)", "no answer to sample 1200 within 2 s"),
        ("if n == 1200: n = 1199", "no answer to sample 1200"),
        ("if n == 1200: v[12] = float('nan')", ""),
    ],
)
def test_a_program_that_fails_ends_its_run_only(
    broken: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("cranectl.tools.export.loaders.process_controller.ANSWER_TIMEOUT", 2.0)
    monkeypatch.chdir(tmp_path)
    law = str(program(tmp_path, broken))
    assert samples_before_failure(law, Path("run.mcap")) == 1200
    assert said in capfd.readouterr().err


def test_a_program_ends_with_its_run_even_if_it_reads_nothing_more(tmp_path: Path) -> None:
    run(str(program(tmp_path, "if n == 0: open('pid', 'w').write(str(os.getpid()))")))
    number, deadline = int((tmp_path / "pid").read_text()), time.monotonic() + HANG
    while time.monotonic() < deadline:
        try:
            os.kill(number, 0)
        except ProcessLookupError:
            return
        time.sleep(0.01)
    pytest.fail("the program is still there")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ('address = "udp://localhost:1"\nprogram = ["x"]', "needs an address or a program"),
        ('address = "udp://["', "the address 'udp://['"),
        ('address = "udp://localhost:99999"', "the address 'udp://localhost:99999'"),
        ('name = "\udcff"', "a controller named"),
    ],
)
def test_what_tells_of_no_process_is_refused(text: str, found: str, tmp_path: Path) -> None:
    law = tmp_path / "law.toml"
    law.write_text(text, errors="surrogateescape")
    with pytest.raises(InputError, match=re.escape(found)):
        open_controller(str(law))


def test_an_address_is_asked_by_one_run_at_a_time(
    tmp_path: Path, listening: Callable[[Peer], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    order: list[int] = []

    def peer(n: int, values: list[float]) -> bytes:
        order.append(n)
        return servo(n, values)

    asked = ["validate", "fast-diagonal", "near-slack", "--controller", listening(peer), "--keep", "none"]
    main([*asked, *ASKED, "--plants", "analytic", "--drive", "ideal", "--jobs", "2"])
    assert order.count(0) == 2
    assert order == [n for _ in range(2) for n in range(len(order) // 2)]


def test_starting_a_program_does_not_count_to_the_timeout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may import or compile. The timeout of the run holds again from its first answer on."""
    allowed: list[float] = []

    class Noted(Timeout):
        def __init__(self, pid: int, seconds: float) -> None:
            allowed.append(seconds)
            super().__init__(pid, math.inf)

    monkeypatch.setattr("cranectl.support.children.Timeout", Noted)
    name = open_controller(str(program(tmp_path)))
    run = simulate_run(scenario(), plant="analytic", controller=name, timeout=7.0)
    assert run.status.label == "completed"
    assert allowed[:3] == [7.0, math.inf, 7.0]
    assert set(allowed[3:]) <= {7.0}


def test_an_estimate_of_time_waits_for_as_long_as_a_run_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that is given up would be taken for one that is quick."""
    given: list[float] = []

    def noted(prepared: PreparedCampaign, _: Children, timeout: float) -> Worker:
        given.append(timeout)
        return Worker(prepared)

    monkeypatch.setattr("cranectl.campaign.workers.make_worker", noted)
    made = campaign({"rig.load_mass": fixed(0.8)}, plants=["analytic"], runs=1, set=SHORT)
    assert 0.0 < estimated_seconds(made, workers=1) < math.inf
    assert given == [math.inf]


def test_a_word_of_a_program_may_be_longer_than_a_name_of_a_file(tmp_path: Path) -> None:
    """As with `python -c CODE`."""
    law = tmp_path / "law.toml"
    law.write_text(f"name = 'long'\nprogram = ['{sys.executable}', '-c', '{'pass;' * 1000}']")
    assert open_controller(str(law)) == "long"
