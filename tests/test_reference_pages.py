"""The pages in docs/reference/ match the tables and classes of the package."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from cranectl.log.description import LogDescription
from cranectl.log.writer import write_log
from cranectl.scenario.settings import Settings
from docs.figures import PICTURES
from docs.reference_pages import BEGIN, DIRECTORY, PAGES, PLANTS, pictures, recorded_run, written_anew


def page_of(name: str) -> str:
    return (DIRECTORY / f"{name}.md").read_text(encoding="utf-8")


RANKED = pytest.param("standings", marks=pytest.mark.slow)  # all rankings of the judged table


@pytest.mark.parametrize("name", [RANKED if name == "standings" else name for name in PAGES])
def test_a_reference_page_is_up_to_date(name: str) -> None:
    assert written_anew(name, page_of(name)) == page_of(name), "run python docs/reference_pages.py --write"


def test_the_generated_part_of_a_page_is_replaced() -> None:
    page = page_of("exit-codes")
    assert written_anew("exit-codes", page.replace(BEGIN, f"{BEGIN}old")) == page
    with pytest.raises(ValueError, match="lacks"):
        written_anew("exit-codes", page.replace(BEGIN, ""))


def test_pictures_of_the_standings_are_up_to_date() -> None:
    for name, svg in pictures().items():
        assert (PICTURES / name).read_text(encoding="utf-8") == svg, (
            "run python docs/reference_pages.py --write"
        )


def subclasses(model: type[Settings]) -> Iterator[type[Settings]]:
    for subclass in model.__subclasses__():
        yield subclass
        yield from subclasses(subclass)


def test_the_settings_page_has_every_key() -> None:
    page = PAGES["settings"]()
    file_models = [
        m for m in subclasses(Settings) if re.match(r"cranectl\.(scenario|campaign)\.", m.__module__)
    ]
    assert len(file_models) > 20
    for model in file_models:
        for key in model.model_fields:
            assert f"| `{key}` |" in page or re.search(rf"### .*\b{key}\b", page), f"{model.__name__}.{key}"


def test_the_topics_page_has_every_topic_of_a_log(tmp_path: Path) -> None:
    log = write_log(tmp_path / "a.mcap", [recorded_run(plant, "lqr+hinf") for plant in PLANTS])
    page = PAGES["topics"]()
    for topic in LogDescription.of(log).topics:
        name = re.sub(f"^/({'|'.join(PLANTS)})/", "/PLANT/", topic.topic)
        assert f"| `{name}` | `{topic.schema}` |" in page
