"""The viewer reports broken logs. Otherwise its silence about valid logs would prove nothing."""

from pathlib import Path

import pytest

from viewer import panels
from viewer.logs import BROKEN
from viewer.studio import Studio, poll_until

COMPLAINTS = {
    "truncated": ("unindexed",),
    "damaged": ("Error during decompression", "Incorrect chunk CRC"),  # depends on the inverted bytes
    "garbled": ("Error decoding message on /mujoco/load",),
    "foreign": ("Expected MCAP magic",),
    "empty": ("unindexed",),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_the_viewer_reports_a_broken_log(
    fault: str, studio: Studio, files: Path, logs: dict[str, Path]
) -> None:
    log = BROKEN[fault](logs["one-plant"], files / f"{fault}.mcap")
    layout = panels.load_shipped_layout("single", files)
    studio.open_log(
        f"/files/{log.name}", panels.single_panel(layout, next(iter(panels.panels_of_type(layout, "Plot"))))
    )

    def is_expected(complaints: list[str]) -> bool:
        return any(text in complaint for text in COMPLAINTS[fault] for complaint in complaints)

    complaints = poll_until(lambda: [*studio.problems(), *studio.exceptions], is_expected)
    assert is_expected(complaints), complaints
