"""A session with a controller from outside, in its own process, which may end or hang without harm."""

import sys
from collections.abc import Iterable
from dataclasses import replace
from math import inf
from multiprocessing.connection import Connection
from typing import Any

from cranectl.controllers.open_controllers import OPEN, SharedControllers
from cranectl.design import ControllerDesign
from cranectl.live.hand import HandRequest
from cranectl.live.session import Session
from cranectl.loaders.opening import open_again
from cranectl.plants.plant import Drive
from cranectl.plants.registry import plants_to_run
from cranectl.scenario import Scenario
from cranectl.simulate.child import BLOCK_TIMEOUT
from cranectl.simulate.plan import plan_scenario
from cranectl.simulate.run import Run
from cranectl.status import RunStatus
from cranectl.support.children import Child, ChildError, requests, spawn_child
from cranectl.support.errors import InputError, report_to_parent


class ChildSession:
    """Forwards what `Session` offers to one in a process of its own.

    Once that has ended all plants have failed and nothing was driven, until `reset` starts another one.
    """

    def __init__(
        self,
        scenario: Scenario,
        design: ControllerDesign,
        *,
        plants: Iterable[str] = (),
        drive: Drive = "ideal",
        patience: float = BLOCK_TIMEOUT,
    ) -> None:
        """Prepare the session at time zero; raise InputError as `simulate_run` does."""
        self.scenario, self.design, self.drive = scenario, design, drive
        self.plan = plan_scenario(scenario)
        self.origin_ns, self.now_ns, self.moving = 0, 0, True
        self._names, self._patience = plants_to_run(plants), patience
        self._child: Child | None = None
        self._runs = self._start()
        if not self._runs:
            raise InputError(
                f"{design.name} lets no session begin: its process ended or fell silent",
                allowed="a controller that can be started",
                remedy="run it first: cranectl run",
            )

    def prepare(self) -> None:
        self._ask("prepare", patience=inf)  # which compiles what is left

    def advance(self, samples: int) -> list[Run]:
        self._runs = self._ask("advance", samples) or self._failed()
        return self._runs

    def use(self, design: ControllerDesign) -> None:
        self._ask("use", design)
        self.design = design

    def pulse(self, acceleration: tuple[float, float], seconds: float) -> None:
        self._ask("pulse", acceleration, seconds)

    def steer(self, request: HandRequest) -> None:
        self._ask("steer", request)

    def driven(self) -> Scenario | None:
        scenario: Scenario | None = self._ask("driven")
        return scenario

    def reset(self) -> None:
        if self._child is None:
            self.origin_ns = self.now_ns
            self._start()
        else:
            self._ask("reset")

    def _ask(self, what: str, *arguments: Any, patience: float = 0.0) -> Any:
        """Return what the session in the process answers, None without one; raises InputError as it does."""
        if self._child is None:
            return None
        try:
            self._child.send((what, arguments))
            answer, self.origin_ns, self.now_ns, self.moving = self._child.receive(patience or self._patience)
        except ChildError as error:
            self._child, self.moving, answer = None, False, None
            print(f"cranectl: {self.design.name} {error}", file=sys.stderr)
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

    def _start(self) -> list[Run]:
        """Return runs without rows; nothing where the process has ended."""
        made = (self.scenario, self.design, self._names, self.drive, self.origin_ns)
        self._child = spawn_child(_work, OPEN.share(), made)
        return self._ask("advance", 0, patience=inf) or []  # it imports and may compile, which nothing bounds


def _work(connection: Connection, shared: SharedControllers, made: tuple[Any, ...]) -> None:
    """Serve requests in the child process: call the session, and answer with the result and its position."""
    report_to_parent(connection.send)
    open_again(shared)
    scenario, design, plants, drive, origin_ns = made
    session: Session | None = None
    for what, arguments in requests(connection):
        try:
            session = session or Session(scenario, design, plants=plants, drive=drive, origin_ns=origin_ns)
            answer = getattr(session, what)(*arguments)
        except InputError as error:
            connection.send(error)
        else:
            connection.send((answer, session.origin_ns, session.now_ns, session.moving))
