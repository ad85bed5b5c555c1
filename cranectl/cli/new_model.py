"""The rig and the first scenario that `cranectl new model` writes for a user's model in MJCF."""

import math
import shlex
from collections.abc import Iterator, Sequence
from contextlib import suppress
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING

from cranectl import planning, plants
from cranectl import scenario as scenario_files
from cranectl.cli.model_rig import model_settings, rig_lines
from cranectl.support import InputError, temporary_directory

if TYPE_CHECKING:
    from cranectl.scenario import RigParameters

TRAVEL = (0.2, 0.15, 0.1)  # of bridge, trolley and rope, in lengths of the rope
MARGIN = 0.1  # at most, to the ends of a range, as a share of it
EXACT = 12  # digits of a place that the model's joints must reach
SWINGS = 3  # duration of the motion and of the rest after it, in periods of the free swing
RIG = """\
# Guessed from the geometry of {model}. Confirm what is in [plant.names]: where the rope leaves the
# trolley (pivot), the point whose motion counts (load), and which actuator moves which axis. An axis without
# an actuator is fixed.
"""
SCENARIO = """\
# {what} of {model}, from about where its load hangs in the file. All keys:
# `cranectl list --schema scenario`.
name = "{name}"
rig = "{rig}"
controller = "{controller}"
duration = {duration:g}  # [s]
{effects}
[reference]
start = {start}  # of the load [m]; z points up from the height of the pivot
{segment}
# [limits]  # what runs must keep: `cranectl run` and `validate` end with code 1 if not
# max_error_m = 0.05
"""
SEGMENT = """
[[reference.segments]]
{lines}
"""


class ModelFiles:
    """The rig and the first scenario of a model, to be written to a directory.

    `overrides` such as "rig.plant.names.load=hook" replace what is guessed.
    Raises InputError if the model is no crane that can be run.
    """

    def __init__(self, model: Path, directory: Path, overrides: Sequence[str] = ()) -> None:
        self.model = model
        self.rig, self.scenario = (directory / f"{model.stem}{end}.toml" for end in ("-rig", ""))
        guessed = plants.OwnFile.guess_rig(model, overrides)
        self.own = plants.open_model(model, guessed.model_names)
        settings = model_settings(model, guessed)
        lines = rig_lines(Path(relpath(model, directory)).as_posix(), guessed, settings, all_names=True)
        rig_text = RIG.format(model=model.name) + "".join(f"{line}\n" for line in lines)
        self.texts = {self.rig: rig_text, self.scenario: self._scenario_text(rig_text)}

    @property
    def commands(self) -> Iterator[str]:
        """The commands that show the model, and run it."""
        drive = "force" if self.own.servo == "force" else "velocity"
        model, rig, scenario = (shlex.quote(str(path)) for path in (self.model, self.rig, self.scenario))
        yield f"look at it: cranectl info {model} --rig {rig}"
        yield f"run it: cranectl run {scenario} --drive {drive}"

    def _scenario_text(self, rig_text: str) -> str:
        """Return a first scenario: a motion that the crane's drives can follow, or else a hold."""
        folder = temporary_directory("model")
        rig_file, scenario_file = folder / self.rig.name, folder / self.scenario.name
        rig_file.write_text(rig_text, encoding="utf-8")
        planned = scenario_files.ScenarioFile.read(None, rig=rig_file)
        texts = [*self._scenarios(planned.rig, 2.0 * planned.planning.clearance)]
        for text in texts:
            scenario_file.write_text(text, encoding="utf-8")
            with suppress(InputError):
                planning.load_scenario(scenario_file)
                return text
        return texts[-1]

    def _scenarios(self, rig: "RigParameters", clearance: float) -> Iterator[str]:
        """Yield scenarios that move, then one that holds; all keep `clearance` [m] from ends of ranges."""
        import numpy as np

        low, high = rig.workspace.T
        margin = np.minimum(MARGIN * (high - low), clearance)
        rest = self.own.rest[:6:2].round(EXACT)
        place = np.clip(rest, low + margin, high - margin)
        place = np.where(place == rest, rest, place.round(4))
        way = place[2] * np.array(TRAVEL) * rig.moves
        towards = np.where(rig.workspace.mean(axis=1) < place, -1.0, 1.0)
        end = np.clip(place + towards * way, low + margin, high - margin).round(4)
        end = np.where(rig.moves, end, place)
        start, end = ((point * [1.0, 1.0, -1.0] + 0.0).tolist() for point in (place, end))
        seconds = math.ceil(SWINGS * self.own.swing_period)
        segments = {
            f'kind = "line"\nto = {end}\nduration = {seconds:.1f}': rig.rope == "hoisted",
            f'kind = "move"  # planned in minimum time\nto = {end}': True,
        }
        for lines in [*(lines for lines, is_possible in segments.items() if is_possible), ""]:
            yield SCENARIO.format(
                what="A first motion" if lines else "A hold",
                model=self.model.name,
                name=plants.PLANTS.find(str(self.model)).name,
                rig=self.rig.name,
                controller="lqr" if rig.rope == "hoisted" else "lqr-integral",
                duration=2 * seconds,
                effects="effects.delay = {}  # as of the model's drives\n" if self.own.delay else "",
                start=start,
                segment=SEGMENT.format(lines=lines) if lines else "",
            )
