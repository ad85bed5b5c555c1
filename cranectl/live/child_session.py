"""A session whose law is from outside: in a process of its own, which may end or fall silent without it."""

import sys
from collections.abc import Iterable
from dataclasses import replace
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from cranectl.controllers.controller import LawDesign
from cranectl.controllers.doors.law_file import LawFile
from cranectl.controllers.doors.opening import OPENED, open_again
from cranectl.design import Design
from cranectl.live.session import Session
from cranectl.plants.plant import Drive
from cranectl.plants.registry import plants_to_run
from cranectl.scenario import Scenario
from cranectl.simulate.child import PATIENCE, how_it_ended, spawned
from cranectl.simulate.plan import plan_scenario
from cranectl.simulate.run import Run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from cranectl.support.interrupts import serve_parent

STARTING = 120.0  # [s] for a process that imports and may compile


class ChildSession:
    """As `Session`. Once its process has ended all plants have failed, until the next start."""

    def __init__(
        self,
        scenario: Scenario,
        design: Design | LawDesign,
        *,
        plants: Iterable[str] = (),
        drive: Drive = "ideal",
        patience: float = PATIENCE,
    ) -> None:
        """Ready at time zero; raises InputError as `simulate_run` does. `patience`: for an answer [s]."""
        self.scenario, self.design, self.drive = scenario, design, drive
        self.plan = plan_scenario(scenario)
        self.origin_ns, self.now_ns, self.moving = 0, 0, True
        self._names, self._patience = plants_to_run(plants), patience
        self._child: tuple[BaseProcess, Connection] | None = None
        self._start()
        self._runs: list[Run] = self._ask("advance", 0) or []
        if not self._runs:
            raise InputError(
                f"{design.name} lets no session begin: its process ended or fell silent",
                allowed="a law that can be started",
                remedy="run it first: cranectl run",
            )

    def prepare(self) -> None:
        """As of a session."""
        self._ask("prepare", patience=STARTING)

    def advance(self, samples: int) -> list[Run]:
        """As of a session."""
        self._runs = self._ask("advance", samples) or self._failed()
        return self._runs

    def use(self, design: Design | LawDesign) -> None:
        """As of a session."""
        self._ask("use", design)
        self.design = design

    def pulse(self, acceleration: tuple[float, float], seconds: float) -> None:
        """As of a session."""
        self._ask("pulse", acceleration, seconds)

    def wish(self, velocity: tuple[float, float, float]) -> None:
        """As of a session."""
        self._ask("wish", velocity)

    def go(self, point: tuple[float, float, float]) -> None:
        """As of a session."""
        self._ask("go", point)

    def driven(self) -> Scenario | None:
        """As of a session; None also where its process has ended."""
        scenario: Scenario | None = self._ask("driven")
        return scenario

    def reset(self) -> None:
        """As of a session; in a new process where the one before has ended."""
        if self._child is None:
            self.origin_ns = self.now_ns
            self._start()
        else:
            self._ask("reset")

    def _ask(self, what: str, *given: Any, patience: float = 0.0) -> Any:
        """What the session in the process answers; None without one. Raises InputError as it does."""
        if self._child is None:
            return None
        process, connection = self._child
        patience = patience or self._patience
        try:
            connection.send((what, given))
            if connection.poll(patience):
                return self._told(connection)
            why = f"took more than {patience:g} s for a block"
        except (EOFError, OSError):
            process.join()
            why = how_it_ended(process.exitcode or 0)
        process.kill()
        process.join()
        self._child, self.moving = None, False
        print(f"cranectl: {self.design.name} {why}", file=sys.stderr)
        return None

    def _told(self, connection: Connection) -> Any:
        answer, self.origin_ns, self.now_ns, self.moving = connection.recv()
        if isinstance(answer, InputError):
            raise answer
        return answer

    def _failed(self) -> list[Run]:
        return [
            replace(
                run,
                time_ns=run.time_ns[:0],
                table=run.table[:0],
                reference=run.reference[:0],
                status=RunStatus.CONTROLLER_FAILED,
                end_ns=self.now_ns,
            )
            for run in self._runs
        ]

    def _start(self) -> None:
        made = (self.scenario, self.design, self._names, self.drive, self.origin_ns)
        self._child = spawned(_work, tuple(OPENED.values()), made)
        _, connection = self._child
        try:
            if connection.poll(STARTING):
                self._told(connection)
        except EOFError:
            self._ask("advance", 0)  # which says how it ended


def _work(laws: tuple[LawFile, ...], made: tuple[Any, ...], connection: Connection) -> None:
    """In the process: do what is asked, and answer with what came of it and where the session stands."""
    serve_parent()
    open_again(laws)
    scenario, design, plants, drive, origin_ns = made
    try:
        session = Session(scenario, design, plants=plants, drive=drive, origin_ns=origin_ns)
    except InputError as error:
        connection.send((error, 0, 0, False))
        return
    answer: Any = None
    while True:
        connection.send((answer, session.origin_ns, session.now_ns, session.moving))
        try:
            what, given = connection.recv()
        except EOFError:  # the end of the session
            return
        try:
            answer = getattr(session, what)(*given)
        except InputError as error:
            answer = error
