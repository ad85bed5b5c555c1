"""The viewer complains of broken logs: otherwise its silence over sound ones would prove nothing."""

from pathlib import Path

import pytest

from viewer import panels
from viewer.logs import BROKEN
from viewer.studio import Studio, eventually

COMPLAINTS = {
    "truncated": ("unindexed",),
    "damaged": ("Error during decompression", "Incorrect chunk CRC"),  # by what the bytes happen to mean
    "garbled": ("Error decoding message on /mujoco/load",),
    "foreign": ("Expected MCAP magic",),
    "empty": ("unindexed",),
}


@pytest.mark.parametrize("how", BROKEN)
def test_complains(how: str, studio: Studio, files: Path, logs: dict[str, Path]) -> None:
    log = BROKEN[how](logs["one-plant"], files / f"{how}.mcap")
    layout = panels.shipped("single", files)
    studio.open_log(f"/files/{log.name}", panels.alone(layout, next(iter(panels.of_type(layout, "Plot")))))

    def is_expected(complaints: list[str]) -> bool:
        return any(text in complaint for text in COMPLAINTS[how] for complaint in complaints)

    complaints = eventually(lambda: [*studio.problems(), *studio.exceptions], is_expected)
    assert is_expected(complaints), complaints
