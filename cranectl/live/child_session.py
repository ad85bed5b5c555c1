"""A session whose law is from outside: in a process of its own, which may end or fall silent without it."""

import sys
from collections.abc import Iterable
from dataclasses import replace
from math import inf
from multiprocessing.connection import Connection
from typing import Any

from cranectl.controllers.open_controllers import OPEN, SharedControllers
from cranectl.design import ControllerDesign
from cranectl.live.session import Session
from cranectl.loaders.opening import open_again
from cranectl.plants.plant import Drive
from cranectl.plants.registry import plants_to_run
from cranectl.scenario import Scenario
from cranectl.simulate.child import BLOCK_TIMEOUT
from cranectl.simulate.plan import plan_scenario
from cranectl.simulate.run import Run
from cranectl.status import RunStatus
from cranectl.support.children import Child, ChildError, report_to_parent, requests, spawn_child
from cranectl.support.errors import InputError


class ChildSession:
    """As `Session`. Once its process has ended all plants have failed, until the next start."""

    def __init__(
        self,
        scenario: Scenario,
        design: ControllerDesign,
        *,
        plants: Iterable[str] = (),
        drive: Drive = "ideal",
        patience: float = BLOCK_TIMEOUT,
    ) -> None:
        """Ready at time zero; raises InputError as `simulate_run` does. `patience`: for an answer [s]."""
        self.scenario, self.design, self.drive = scenario, design, drive
        self.plan = plan_scenario(scenario)
        self.origin_ns, self.now_ns, self.moving = 0, 0, True
        self._names, self._patience = plants_to_run(plants), patience
        self._child: Child | None = None
        self._start()
        self._runs: list[Run] = self._ask("advance", 0, patience=inf) or []  # imports and compiles
        if not self._runs:
            raise InputError(
                f"{design.name} lets no session begin: its process ended or fell silent",
                allowed="a law that can be started",
                remedy="run it first: cranectl run",
            )

    def prepare(self) -> None:
        """As of a session."""
        self._ask("prepare", patience=inf)  # which compiles what is left

    def advance(self, samples: int) -> list[Run]:
        """As of a session."""
        self._runs = self._ask("advance", samples) or self._failed()
        return self._runs

    def use(self, design: ControllerDesign) -> None:
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
        try:
            self._child.send((what, given))
            return self._told(self._child, patience or self._patience)
        except ChildError as error:
            return self._lose(error)

    def _lose(self, error: ChildError) -> None:
        self._child, self.moving = None, False
        print(f"cranectl: {self.design.name} {error}", file=sys.stderr)

    def _told(self, child: Child, patience: float) -> Any:
        answer, self.origin_ns, self.now_ns, self.moving = child.receive(patience)
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
        self._child = spawn_child(_work, OPEN.share(), made)
        try:
            self._told(self._child, inf)  # it imports and may compile, which nothing bounds
        except ChildError as error:
            self._lose(error)


def _work(connection: Connection, shared: SharedControllers, made: tuple[Any, ...]) -> None:
    """In the process: do what is asked, and answer with what came of it and where the session stands."""
    report_to_parent(connection)
    open_again(shared)
    scenario, design, plants, drive, origin_ns = made
    try:
        session = Session(scenario, design, plants=plants, drive=drive, origin_ns=origin_ns)
    except InputError as error:
        connection.send((error, 0, 0, False))
        return
    connection.send((None, session.origin_ns, session.now_ns, session.moving))
    for what, given in requests(connection):
        try:
            answer = getattr(session, what)(*given)
        except InputError as error:
            answer = error
        connection.send((answer, session.origin_ns, session.now_ns, session.moving))
