"""The tools that these tests start send no usage data."""

import json

from viewer import tools
from viewer.studio import Studio

CAN_FETCH = "url => fetch(url, { mode: 'no-cors' }).then(() => true, () => false)"


def test_rerun_sends_no_usage_data() -> None:
    """Rerun would send usage data from its second run on."""
    assert json.loads(tools.run("rerun", "analytics", "config").stdout)["analytics_enabled"] is False


def test_the_browser_resolves_no_host_name(studio: Studio) -> None:
    assert studio.page.evaluate(CAN_FETCH, f"{studio.origin}/")
    assert not studio.page.evaluate(CAN_FETCH, studio.origin.replace("127.0.0.1", "localhost"))
