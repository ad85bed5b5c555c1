"""Where the model, scenarios, campaigns and tolerances lie: in the wheel, or in the checkout beside it."""

from pathlib import Path

_PACKAGE = Path(__file__).parents[1]
_INSTALLED = _PACKAGE / "_data"
_ROOT = _INSTALLED if _INSTALLED.is_dir() else _PACKAGE.parent

MODEL_FILE = _ROOT / "models" / "crane.xml"
SCENARIO_DIRECTORY = _ROOT / "validation" / "scenarios"
TOLERANCE_FILE = _ROOT / "validation" / "tolerances.toml"
THESIS_DIRECTORY = _ROOT / "validation" / "thesis"
CAMPAIGN_DIRECTORY = _ROOT / "validation" / "campaigns"
