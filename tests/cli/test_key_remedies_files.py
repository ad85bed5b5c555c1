"""Remedies for files, names and capabilities of plants work on the refused input."""

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from tests.remedies import Case, prepared, remedy_test

pytestmark = pytest.mark.usefixtures("in_copy_of_files")

RUN = "run s.toml --plants analytic"
SCENARIO = "name='s'\nduration=2.0\nreference.start=[1.0, 0.77, -0.7]\ncontrol.period=0.005\n"
FILES = {
    "s.toml": SCENARIO,
    "folder/s.toml": SCENARIO,
    "wrong.toml": SCENARIO.replace("=2.0", "=2.0.0"),
    "twice.toml": f'rig = "lab-rig"\n{SCENARIO}\n[rig]\nload_mass = 1.5\n',
    "s.xml": "<mujoco model='crane'/>\n",
    "cut.parquet": "PAR1",
}


def from_file(kind: str, file: str, setting: str = "signs=[1, 1, 1]") -> str:
    return f"reference.segments=[{{kind='{kind}', file='{file}', {setting}}}]"


def on(plant: str, drive: str, *settings: str) -> list[str]:
    return [f"cranectl run s.toml --plants {plant} --drive {drive}", *settings]


SI = "units={time='s', length='m'}"
PLOT = "cranectl plan s.toml --plot a.png"
COULOMB, NO_COULOMB = "effects.friction.coulomb=[1.0, 1.0, 1.0]", "effects.friction.coulomb=[0.0, 0.0, 0.0]"
NO_FRICTION = [NO_COULOMB, "effects.friction.viscous=[0.0, 0.0, 0.0]"]
LIMITED = "effects.limits={velocity=[1.0, 1.0, 1.0], acceleration=[1.0, 1.0, 1.0], force=[90.0, 90.0, 90.0]}"
UNLIMITED = LIMITED.replace("[1.0, 1.0, 1.0]", "[1e+09, 1e+09, 1e+09]")
STIFF = ["duration=0.05", "effects.rope.stiffness=1e8"]
HOOK = ["duration=0.05", "effects.body.hook_offset=0.8"]
PLAN, AN_ENTRY = "cranectl plan", "choose one that is there, or set the whole list"
CASES = {
    "plants/capabilities.py": [
        Case("{}; or set {}", on("analytic", "velocity", COULOMB),
             on("analytic", "velocity", COULOMB, *NO_FRICTION)),
        Case("{} or '--drive force'; or set {}", on("mujoco", "ideal", COULOMB),
             on("mujoco", "ideal", *NO_FRICTION)),
        Case("{}; or set {}", on("mujoco", "force", LIMITED), on("mujoco", "force", UNLIMITED)),
    ],
    "plants/plant.py": [
        Case("set control.physics_step to {} or less; or choose a softer rope or frame, a heavier winch, "
             "or a body with more inertia", on("mujoco", "velocity", *STIFF),
             on("mujoco", "velocity", *STIFF[:1], "effects.rope.stiffness=1e5")),
        Case("lower the path or reduce hook_offset", on("mujoco", "velocity", *HOOK),
             on("mujoco", "velocity", *HOOK[:1], "effects.body.hook_offset=0.1")),
    ],
    "reference/files.py": [
        Case("leave out columns.speed", from_file("waypoints", "one.mcap", "columns={speed='v'}"),
             from_file("samples", "one.mcap")),
        Case("leave out {}", from_file("samples", "one.mcap", SI), from_file("samples", "one.mcap")),
    ],
    "support/errors.py": [
        Case("did you mean '{}'?", from_file("samples", "one.mcap", "topic='reference/loads'"),
             from_file("samples", "one.mcap", "topic='reference/load'")),
    ],
    "support/tables/columns.py": [
        Case("map another column, or write numbers", from_file("samples", "text.parquet", SI),
             from_file("samples", "own.parquet", SI)),
    ],
    "support/tables/head.py": [
        Case("write the file again, for example as CSV", from_file("samples", "cut.parquet", SI),
             from_file("samples", "own.parquet", SI)),
    ],
    "cli/plan.py": [
        Case("take kind = 'move', or time_law = 'minimum-time' instead of a duration",
             [PLOT, "reference.segments=[{kind='line', to=[1.1, 0.77, -0.7], duration=2.0}]"],
             [PLOT, "reference.segments=[{kind='line', to=[1.1, 0.77, -0.7], time_law='minimum-time'}]"]),
    ],
    "support/trees.py": [
        Case("leave '{}' out", "duration.long=2.0", "duration=2.0"),
        Case(AN_ENTRY, "reference.start.3=0.8", "reference.start.1=0.8", "reference.start=[1.0, 0.8, -0.7]"),
    ],
    "support/documents.py": [
        Case("correct it at that place", "cranectl plan wrong.toml", "cranectl plan s.toml"),
        Case("write that key once, either as a value or as a table", "cranectl plan twice.toml",
             "cranectl plan s.toml"),
        Case("name a {} file, or write the settings into one", "cranectl plan s.xml", "cranectl plan s.toml"),
    ],
    "support/resources.py": [
        Case("name a file in it, or another", f"{PLAN} folder", f"{PLAN} folder/s.toml"),
        Case("did you mean '{}'?", "cranectl plan fast-diagonale", "cranectl plan fast-diagonal"),
        Case("choose one of these, or correct the path", "cranectl plan lost/move.toml",
             "cranectl plan s.toml"),
    ],
    "controllers/registry.py": [
        Case("choose one of the controllers listed above, or name the file of a controller, law.py:NAME",
             "--drive ideal --controller zzz", "--drive ideal"),
    ],
}  # fmt: skip


def write_tables() -> None:
    time = np.arange(0.0, 1.0, 0.01)
    columns = {"time": time, "x": 0.0 * time + 1.0, "y": 0.0 * time + 0.77, "z": 0.0 * time - 0.7}
    parquet.write_table(pa.table(columns), "own.parquet")
    parquet.write_table(pa.table({**columns, "x": time.astype(str)}), "text.parquet")


prepared_files = prepared(FILES, [f"{RUN} --out one.mcap"], write_tables)
test_a_remedy_works_on_the_refused_input = remedy_test(CASES, RUN)
