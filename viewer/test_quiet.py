"""No tool that is started here sends usage data."""

import json

from viewer import tools
from viewer.studio import Studio

ANSWERS = "url => fetch(url, { mode: 'no-cors' }).then(() => true, () => false)"


def test_rerun_is_told_not_to() -> None:
    """It would from its second run on."""
    assert json.loads(tools.run("rerun", "analytics", "config").stdout)["analytics_enabled"] is False


def test_the_browser_finds_nobody(studio: Studio) -> None:
    assert studio.page.evaluate(ANSWERS, f"{studio.origin}/")
    assert not studio.page.evaluate(ANSWERS, studio.origin.replace("127.0.0.1", "localhost"))
