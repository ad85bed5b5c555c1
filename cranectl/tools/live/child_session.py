"""Run a live session with an external controller in a child process, so that a crash does no harm."""

import sys
from collections.abc import Iterable
from dataclasses import replace
from math import inf
from typing import Any

from cranectl.controllers import ALL_CONTROLLERS, SharedControllers
from cranectl.design import ControllerDesign
from cranectl.loaders import open_again
from cranectl.plants import PLANTS, Drive
from cranectl.scenario import Scenario
from cranectl.simulate import Loop, Plan, Run
from cranectl.status import RunStatus
from cranectl.support import Child, InputError, Parent
from cranectl.tools.live.hand import HandRequest
from cranectl.tools.live.session import Session


class ChildSession:
    """Forwards the calls of `Session` to a session in a child process.

    After the child process has ended, every plant counts as failed and `driven_scenario` returns None. The
    next `reset` starts a new child process.
    """

    def __init__(
        self,
        scenario: Scenario,
        design: ControllerDesign,
        *,
        plants: Iterable[str] = (),
        drive: Drive = "ideal",
    ) -> None:
        """Prepare the session at time zero; raise InputError as `simulate_run` does."""
        self.scenario, self.design, self.drive = scenario, design, drive
        self.plan = Plan.of(scenario)
        self.origin_ns, self.now_ns, self.moving = 0, 0, True
        self._names, self._timeout = PLANTS.to_run(plants), Loop.TIMEOUT
        self._child: Child | None = None
        self._runs = self._start()
        if not self._runs:
            raise InputError(
                f"the session with {design.name} did not start: its process ended or did not answer in time",
                allowed="a controller that can be started",
                remedy="run it first: cranectl run",
            )

    def prepare(self) -> None:
        self._ask("prepare", timeout=inf)  # this compiles all remaining code

    def advance(self, samples: int) -> list[Run]:
        self._runs = self._ask("advance", samples) or self._failed_runs()
        return self._runs

    def use(self, design: ControllerDesign) -> None:
        self._ask("use", design)
        self.design = design

    def pulse(self, acceleration: tuple[float, float], seconds: float) -> None:
        self._ask("pulse", acceleration, seconds)

    def steer(self, request: HandRequest) -> None:
        self._ask("steer", request)

    def driven_scenario(self) -> Scenario | None:
        scenario: Scenario | None = self._ask("driven_scenario")
        return scenario

    def reset(self) -> None:
        if self._child is None:
            self.origin_ns = self.now_ns
            self._start()
        else:
            self._ask("reset")

    def _ask(self, method: str, *arguments: Any, timeout: float = 0.0) -> Any:
        """Call a method of the session in the child process, and return its result.

        Returns None if there is no child process. Raises the InputError that the session raises.
        """
        if self._child is None:
            return None
        try:
            self._child.send((method, arguments))
            answer, self.origin_ns, self.now_ns, self.moving = self._child.receive(timeout or self._timeout)
        except Child.Error as error:
            self._child, self.moving, answer = None, False, None
            print(f"cranectl: {self.design.name} {error}", file=sys.stderr)
        return answer

    def _failed_runs(self) -> list[Run]:
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
        """Start the child process and return runs without rows, or an empty list if the process has ended."""
        settings = (self.scenario, self.design, self._names, PLANTS.model_files, self.drive, self.origin_ns)
        self._child = Child.spawn(_serve_requests, ALL_CONTROLLERS.opened.share(), settings)
        return (
            self._ask("advance", 0, timeout=inf) or []
        )  # the start imports and may compile, so it has no time limit


def _serve_requests(parent: Parent, shared: SharedControllers, settings: tuple[Any, ...]) -> None:
    """Serve requests in the child process: call the session, and answer with the result and its time."""
    parent.keep_informed()
    open_again(shared)
    scenario, design, plants, models, drive, origin_ns = settings
    PLANTS.update(models)
    session: Session | None = None
    for method, arguments in parent.requests():
        try:
            session = session or Session(scenario, design, plants=plants, drive=drive, origin_ns=origin_ns)
            answer = getattr(session, method)(*arguments)
        except InputError as error:
            parent.send(error)
        else:
            parent.send((answer, session.origin_ns, session.now_ns, session.moving))
