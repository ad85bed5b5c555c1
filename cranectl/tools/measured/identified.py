"""Files of an identified crane: its rig, and a campaign that varies it within its intervals."""

from collections import defaultdict

from cranectl.tools.measured.experiment import ANGLE_DELAY, ANGLE_SCALE
from cranectl.tools.measured.identification import NORMAL, Estimate, Identification

MILLISECOND = 1e-3  # to which a rig's delay is rounded, since it must be a whole number of control periods
MAX_DEVIATIONS = 2.5  # half-widths from the value to the end of a distribution


def rig_text(result: Identification, base: str, logs: str) -> str:
    """Return the rig file of an identified crane: `base`, with what was fitted to `logs`."""
    values = {estimate.name: estimate for estimate in _of_rig(result)}
    tables: dict[str, list[str]] = defaultdict(list)
    for estimate in values.values():
        table, _, name = estimate.name.rpartition(".")
        if name.isdigit():  # one of three axes: the others have the rig's own value
            table, _, name = table.rpartition(".")
            numbers = getattr(getattr(result.rig.effects, table.rpartition(".")[2]), name)
            intervals = [values.get(f"{table}.{name}.{k}") for k in range(3)]
            known = ", ".join("as before" if e is None else f"± {e.half_width:.2g}" for e in intervals)
            line = f"{name} = [{', '.join(f'{number:.8g}' for number in numbers)}]  # {known}"
        elif estimate.name == "effects.delay.seconds":
            rounded = round(estimate.value / MILLISECOND) * MILLISECOND
            line = f"{name} = {rounded:.3g}  # {estimate.value:.8g} {_interval(estimate)}, whole milliseconds"
        else:
            line = f"{name} = {estimate.value:.8g}  # {_interval(estimate)}"
        if line not in tables[table]:
            tables[table].append(line)
    if result.replay != "motion":
        tables["effects.friction"].append("viscous = [0.0, 0.0, 0.0]  # part of time constants and gains")
    lines = [f"# Identified from {logs}, with 95 % intervals.", f'extends = "{base}"', *tables.pop("", [])]
    for table in sorted(tables):
        lines += ["", f"[{table}]", *tables[table]]
    return "\n".join(lines) + "\n"


def campaign_text(result: Identification, rig: str, name: str, logs: str) -> str:
    """Return a campaign that varies the crane in the file `rig` within its intervals."""
    drive = "ideal" if result.replay == "motion" else "velocity"
    lines = [
        f"# The crane identified from {logs}, with what its intervals leave open.",
        f'name = "{name}"',
        f'rig = "{rig}"',
        'scenario = "fast-diagonal"  # one that fits this crane',
        'controllers = ["lqr"]',
        'plants = ["mujoco"]',
        f'drive = "{drive}"',
        "runs = 200",
    ]
    for estimate in _of_rig(result):
        setting = estimate.name if estimate.name.startswith("effects.") else f"rig.{estimate.name}"
        lines += [
            "",
            f"[uncertain.{setting}]",
            'distribution = "normal"',
            f"mean = {estimate.value:.8g}",
            f"deviation = {estimate.half_width / NORMAL:.3g}",
        ]
        if estimate.name != "effects.installation.rope_offset":
            lines.append(f"low = {max(estimate.value - MAX_DEVIATIONS * estimate.half_width, 0.0):.6g}")
    return "\n".join(lines) + "\n"


def _of_rig(result: Identification) -> list[Estimate]:
    """Return the numbers that are settings of a rig, without those of the angles' sensor."""
    return [estimate for estimate in result.estimates if estimate.name not in (ANGLE_SCALE, ANGLE_DELAY)]


def _interval(estimate: Estimate) -> str:
    return f"± {estimate.half_width:.2g} {estimate.unit}"
