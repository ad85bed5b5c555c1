"""`cranectl design`."""

import functools
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from cranectl import controllers, loaders, report, simulate
from cranectl.cli.command import Command
from cranectl.cli.completion import Completion
from cranectl.cli.controller_options import ControllerName
from cranectl.cli.idle import IdleSettings
from cranectl.cli.output import Screen
from cranectl.cli.refused_options import fmi_option, refuse_fmi, refuse_options
from cranectl.cli.scenario_request import ScenarioRequest
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.support import File, FileKind, InputError
from cranectl.tools import export as exports

if TYPE_CHECKING:
    from cranectl.scenario import Scenario
    from cranectl.tools.export import Exported

# What only runs read, and what designs of the flat family do not read either.
UNREAD = (*IdleSettings.OF_RUNS, *IdleSettings.OF_MOTIONS, "control.physics_step", "control.lag_compensation")
OF_OTHER_CONTROLLERS = ("effects.*", "rig.effects.*", "rig.*_mass", "rig.*_time_constant", "rig.*_range.*")


@click.command("design", cls=Command)
@click.argument(
    "names",
    metavar="NAME...",
    type=ControllerName(),
    nargs=-1,
    required=True,
    shell_complete=Completion.controllers,
)
@click.option(
    "--scenario",
    metavar="NAME",
    shell_complete=Completion.scenarios,
    help="Whose [design], [control] and [rig] to take. Default: the defaults.",
)
@ScenarioRequest.options
@Command.output_option(
    "--plot",
    None,
    "Draw singular values, loop gains and step responses (.svg, .pdf, .png).",
    endings=FileKind.PLOTS,
)
@click.option(
    "--export",
    "directory",
    metavar="DIR",
    type=Command.PATH,
    help="Write the controller as C99, with test vectors of a run of the scenario.",
)
@click.option(
    "--real", type=click.Choice(["double", "float"]), help="Numbers in the code of --export. Default: double."
)
@Command.output_option(
    "--fmu",
    None,
    "Write the controller as an FMU for co-simulation on Linux, with its C files.",
    endings=FileKind.FMUS,
)
@fmi_option
@click.option(
    "--drive",
    metavar="NAME",
    shell_complete=Completion.drives,
    help="Drive that --export and --fmu command. Default: by what the controller commands.",
)
@Command.json_option
def design_command(
    names: tuple[str, ...],
    request: ScenarioRequest,
    plot: Path | None,
    screen: Screen,
    **exporting: Any,
) -> None:
    """Design one or several controllers and show what they achieve.

    Several controllers share one table, and one sheet of overlaid plots.

    \b
    cranectl design pole-placement
    cranectl design lqr+loop-shaping --plot design.svg
    cranectl design pole-placement lqr --set 'design.poles=[-3+1j, -3-1j, -4, -4]' --plot both.svg
    cranectl design lqr+loop-shaping --scenario fixed-position
    cranectl design lqr+hinf --set design.hinf.back_off=1.05 --json -
    cranectl design lqr --scenario settled-trajectory --drive velocity --export lqr-c --fmu lqr.fmu
    """
    export = Export(**exporting)
    export.check(names, request)
    loaded = request.load() if export.is_asked else request.read()
    designs = [ALL_CONTROLLERS.design(name, loaded) for name in dict.fromkeys(names)]
    tell = functools.partial(
        IdleSettings.print_in_analysis, screen, loaded, request, names, plant="analytic", drive="ideal"
    )
    if designs[0].axis_design is None and len(designs) == 1 and plot is None:
        controller = designs[0]
        screen.print_each(
            report.DesignReport.controller_tables(
                controller,
                ALL_CONTROLLERS[controller.name],
                simulate.PreparedController.near_rest(loaded, controller),
            )
        )
        if export.is_asked:
            export.write(loaded, names[0], screen)
        else:
            tell(unread=UNREAD)
        screen.write_json(controller.to_json())
        return
    flat = [design.flat for design in designs]
    for design in flat:
        controllers.Tracker.of(loaded, design)  # raises if sampling makes it unstable
    screen.print_each(
        report.DesignReport.tables(flat[0])
        if len(flat) == 1
        else [report.DesignReport.comparison_table(flat)]
    )
    if export.is_asked:
        export.write(loaded, names[0], screen)
    else:
        tell(unread=(*UNREAD, *OF_OTHER_CONTROLLERS))
    if plot is not None:
        screen.save_figure(
            report.DesignReport.figure(flat[0])
            if len(flat) == 1
            else report.DesignReport.comparison_figure(flat),
            plot,
        )
    results = [design.to_json() for design in flat]
    screen.write_json(results[0] if len(flat) == 1 else {"designs": results})


class Export(NamedTuple):
    """What is asked to be exported, and where to."""

    directory: Path | None  # of C files
    real: str | None
    fmu: Path | None
    fmi: str | None
    drive: str | None

    @property
    def is_asked(self) -> bool:
        """Whether anything is to be exported."""
        return self.directory is not None or self.fmu is not None

    def check(self, names: tuple[str, ...], request: ScenarioRequest) -> None:
        """Raise InputError unless one controller with a scenario goes to places that are free."""
        if self.fmu is None:
            refuse_fmi(self.fmi)
        if self.directory is None:
            real = {"--real": self.real}
            refuse_options(
                real, "without --export", allowed="--real with --export", remedy="add --export DIR"
            )
        if not self.is_asked:
            refuse_options(
                {"--drive": self.drive},
                "without --export and --fmu",
                allowed="--drive where a controller is exported",
                remedy="leave out --drive, or add --export DIR",
            )
            return
        option = "--export" if self.directory else "--fmu"
        if request.source is None:
            raise InputError(
                f"{option} without --scenario",
                allowed=f"{option} with a scenario, whose start and motion it needs",
                remedy="add --scenario fast-diagonal, or another one",
            )
        if len(set(names)) > 1:
            raise InputError(
                f"{option} of {len(set(names))} controllers",
                allowed="one controller",
                remedy="export each by itself",
            )
        if self.directory is not None:
            _check_directory(self.directory)
        if self.fmu is not None:
            FileKind.FMU_TABLE.check_place(self.fmu.with_suffix(".toml"), option="--fmu")

    def write(self, scenario: "Scenario", name: str, screen: Screen) -> None:
        """Write the files of an exported controller."""
        exported = exports.prepare_export(scenario, name, self.drive)
        content = exports.controller_fmu(exported, int(self.fmi or 2)) if self.fmu else None
        if self.directory is not None:
            _write_c(exported, self.directory, single=self.real == "float")
            readme = self.directory / "README.md"
            screen.print(f"exported: {self.directory}; {readme} says how to check it on the target")
        if self.fmu is not None and content is not None:
            table = self.fmu.with_suffix(".toml")
            with File(table).writing(remedy="choose another place with --fmu"):
                File(table).write_text(content.table)
                with File(self.fmu).replacing() as part:
                    part.write_bytes(content.archive)
            screen.print(f"exported: {self.fmu}, and {table} with what cranectl reads beside it")


def _check_directory(directory: Path) -> None:
    """Raise InputError unless a directory is new or empty."""
    with File(directory).writing(remedy="choose another place with --export"):
        is_free = not directory.exists() or (directory.is_dir() and not any(directory.iterdir()))
    if not is_free:
        raise InputError(
            f"there is something in {directory}, or it is no directory",
            allowed="a new or an empty directory",
            remedy="choose another place with --export",
        )


def _write_c(exported: "Exported", directory: Path, *, single: bool) -> None:
    """Write the C files of an exported controller."""
    texts = exports.exported_files(exported, Command.given(), single=single)
    if not single:  # the library for cranectl computes with doubles
        texts[loaders.HEADER.name] = loaders.HEADER.read_text(encoding="utf-8")
    for file, text in texts.items():
        with File(directory / file).writing(remedy="choose another place with --export"):
            directory.mkdir(parents=True, exist_ok=True)
            File(directory / file).write_text(text)
