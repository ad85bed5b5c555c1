"""Test results on disk: complete parts in order, and errors for damage and differences."""

import errno
import json
import shutil
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest
from pyarrow import parquet

from cranectl.campaign import CampaignSettings, load_campaign, sample_values
from cranectl.campaign.definition import batches_of
from cranectl.campaign.manifest import Manifest, SoftwareOrigin
from cranectl.campaign.results import PARTS, REPLAYS, Store, read_results
from cranectl.campaign.table import ResultDamageError, part_name, read_part, row_columns
from cranectl.plants import registry
from cranectl.support.errors import InputError
from tests.campaign.campaigns import MASS, campaign
from tests.campaign.results import invented_rows, two_controllers, write_all
from tests.conftest import PLANTS

CAMPAIGN = two_controllers()
ORIGINS = Manifest.origins(Manifest.of(CAMPAIGN))


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """A finished result."""
    write_all(CAMPAIGN, tmp_path / "result")
    return tmp_path / "result"


@pytest.fixture(scope="module")
def one_part(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the part of the first batch; no test may change it."""
    folder = tmp_path_factory.mktemp("part")
    write_all(CAMPAIGN, folder, leave=len(batches_of(CAMPAIGN)) - 1)
    return folder / PARTS / part_name(batches_of(CAMPAIGN)[0])


def caught(function: Any, *arguments: Any, **options: Any) -> InputError:
    with pytest.raises(InputError) as error:
        function(*arguments, **options)
    assert error.value.remedy
    assert error.value.allowed
    return error.value


def opened(*arguments: Any, **options: Any) -> tuple[int, tuple[str, ...]]:
    """Open a store; return its number of missing batches and its quarantined parts."""
    with Store.open(*arguments, **options) as store:
        return len(store.missing), store.quarantined


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("runs", [1, 16, 17, 64, 65, 1000, 100_000])
def test_batches_hold_every_sample_once(plant: str, runs: int) -> None:
    uncertain = {"rig": {"load_mass": MASS}}
    of = two_controllers(uncertain=uncertain, runs=runs, plants=[plant])
    assert batches_of(of)[0].last == min(runs, registry.PLANTS.entry(plant).batch if runs < 100_000 else 98)
    for controller in of.settings.controllers:
        ends = [(b.first, b.last) for b in batches_of(of) if b.controller == controller]
        assert ends[0][0] == 0
        assert ends[-1][1] == runs
        assert all(first < last for first, last in ends)
        assert [last for _, last in ends[:-1]] == [first for first, _ in ends[1:]]


def test_what_was_written_is_read_in_order_and_has_the_same_bytes_again(
    directory: Path, tmp_path: Path
) -> None:
    results, batches = read_results(directory), batches_of(CAMPAIGN)
    expected = [row for batch in batches for row in invented_rows(CAMPAIGN, batch)]
    assert results.table.to_pylist() == expected
    assert results.row(47) == expected[47]
    assert np.isnan(results.column("settling_time_s")[7])
    assert results.rows("mujoco", "pole-placement").tolist() == list(range(40, 80))
    assert results.missing == ()
    assert [column.name for column in row_columns(CAMPAIGN)] == results.table.column_names
    write_all(CAMPAIGN, tmp_path / "again")
    parts = {path.name: path.read_bytes() for path in (directory / PARTS).iterdir()}
    assert len(parts) == len(batches) == 6
    assert parts == {path.name: path.read_bytes() for path in (tmp_path / "again" / PARTS).iterdir()}


def test_columns_say_what_they_are(one_part: Path) -> None:
    schema = parquet.read_schema(one_part)
    units = {field.name: field.metadata[b"unit"].decode() for field in schema}
    assert units["max_error_m"] == units["final_load_m_x"] == units["initial.load_offset.0"] == "m"
    assert units["max_acceleration_m_s2_rope"] == "m/s²"
    assert units["effects.friction.coulomb.1"] == units["min_rope_tension_n"] == "N"
    assert units["disturbances.0.magnitude"] == "rad/s²"
    assert units["rig.winch_time_constant"] == units["end_s"] == units["effects.delay.seconds"] == "s"
    assert units["drive_work_j_bridge"] == "J"
    assert all(field.metadata[b"description"] for field in schema)
    assert not schema.field("sample").nullable
    assert schema.field("max_error_m").nullable


@pytest.mark.parametrize("name", CampaignSettings.shipped_names())
def test_a_record_is_enough_to_draw_the_samples_again(name: str) -> None:
    of = load_campaign(name)
    manifest = json.loads(json.dumps(Manifest.of(of)))
    restored = Manifest.campaign(manifest, "manifest")
    assert (restored.settings, restored.nominal) == (of.settings, of.nominal)
    assert np.array_equal(sample_values(restored, 0, 10), sample_values(of, 0, 10))
    assert Manifest.differences(Manifest.of(restored), manifest) == []


def test_a_record_does_not_need_the_scenario_file(tmp_path: Path) -> None:
    from cranectl.support.resources import Shipped

    path = tmp_path / "mine.toml"
    shutil.copy(Shipped.SCENARIOS.folder / "fast-diagonal.toml", path)
    manifest = Manifest.of(campaign(scenario=str(path)))
    path.unlink()
    assert Manifest.campaign(manifest, "manifest").nominal.name == "fast-diagonal"
    assert Manifest.origins(manifest) == Manifest.origins(Manifest.of(campaign())), (
        "the scenario counts, not its place"
    )


@pytest.mark.parametrize(("leave", "runs"), [(2, 56), (6, 0)])
def test_an_unfinished_result_says_so(tmp_path: Path, leave: int, runs: int) -> None:
    write_all(CAMPAIGN, tmp_path, leave=leave)
    assert f"{leave} of 6 parts are missing" in caught(read_results, tmp_path).found
    results = read_results(tmp_path, unfinished=True)
    assert results.missing == tuple(batches_of(CAMPAIGN)[-leave:])
    assert results.column("max_error_m").shape == (runs,)
    assert results.missing_runs == 80 - runs


def test_truncated_and_foreign_parts_are_found(one_part: Path, tmp_path: Path) -> None:
    batch = batches_of(CAMPAIGN)[0]
    original, path = one_part.read_bytes(), tmp_path / one_part.name
    for size in (0, 3, 100, len(original) // 2, len(original) - 1):
        path.write_bytes(original[:size])
        with pytest.raises(ResultDamageError):
            read_part(path, CAMPAIGN, ORIGINS, batch)
    with pytest.raises(ResultDamageError, match="another campaign"):
        read_part(one_part, CAMPAIGN, [SoftwareOrigin("other", {})], batch)


def test_a_flipped_bit_is_found_or_does_no_harm(one_part: Path, tmp_path: Path) -> None:
    """Nearly all bytes are data or describe data; a few have no meaning, like the writer's name."""
    batch = batches_of(CAMPAIGN)[0]
    original, path = one_part.read_bytes(), tmp_path / one_part.name
    expected, _ = read_part(one_part, CAMPAIGN, ORIGINS, batch)
    rng = np.random.default_rng(0)
    damaged = 0
    positions = rng.choice(len(original), 150, replace=False).tolist()
    for position in positions:
        changed = bytearray(original)
        changed[position] ^= 1 << int(rng.integers(8))
        path.write_bytes(changed)
        try:
            assert read_part(path, CAMPAIGN, ORIGINS, batch)[0].equals(expected)
        except ResultDamageError:
            damaged += 1
    assert damaged > 0.75 * len(positions)


def test_damaged_parts_are_told_quarantined_and_run_again(directory: Path) -> None:
    first, second, third, *_ = (directory / PARTS / part_name(batch) for batch in batches_of(CAMPAIGN))
    stray = directory / PARTS / "part-copy.parquet"
    original = first.read_bytes()
    shutil.copy(first, stray)
    first.write_bytes(original[:-100])
    shutil.copy(third, second)
    third.rename(third.with_name(f"{third.name}.4711.part"))  # as a kill leaves it, half-written
    error = caught(read_results, directory)
    for phrase in (
        first.name,
        f"{second.name}: it holds the batch mujoco lqr 32",
        f"{stray.name}: its name belongs to no batch",
    ):
        assert phrase in error.found
    assert "--resume" in error.remedy
    with Store.open(CAMPAIGN, directory, resume=True) as store:
        assert store.missing == tuple(batches_of(CAMPAIGN)[:3])
        assert all("was damaged" in note for note in store.quarantined)
        for batch in store.missing:
            store.write(batch, invented_rows(CAMPAIGN, batch))
    corrupt = {path.stem for path in (directory / PARTS).glob("*.corrupt")}
    assert corrupt == {first.name, second.name, stray.name}
    assert first.read_bytes() == original
    assert len(list((directory / PARTS).iterdir())) == 6 + 3
    assert len(read_results(directory)) == 80


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
def test_a_full_disk_leaves_a_result_that_can_be_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    write = parquet.write_table

    def full(table: Any, stream: BinaryIO, **options: Any) -> None:
        if parts:
            stream.write(b"half")
            raise OSError(number, "as the system says it")
        parts.append(stream)
        write(table, stream, **options)

    parts: list[BinaryIO] = []
    monkeypatch.setattr(parquet, "write_table", full)
    error = caught(write_all, CAMPAIGN, tmp_path)
    assert ("the disk is full" if number == errno.ENOSPC else "as the system says it") in error.found
    assert "--resume" in error.remedy
    assert len(list((tmp_path / PARTS).iterdir())) == 1
    monkeypatch.undo()
    assert opened(CAMPAIGN, tmp_path, resume=True) == (5, ())


def test_a_result_is_overwritten_only_when_told_with_its_replays_and_nothing_else(directory: Path) -> None:
    error = caught(opened, CAMPAIGN, directory)
    assert "already holds a result of the campaign 'test'" in error.found
    assert "--resume" in error.remedy
    assert "--overwrite" in error.remedy
    replays = directory / REPLAYS
    replays.mkdir()
    (replays / "mujoco-lqr-0000001.mcap").write_text("of the old result")
    assert opened(CAMPAIGN, directory, overwrite=True) == (6, ())
    assert not replays.exists()
    replays.mkdir()
    notes = [replays / "notes.txt", directory / "notes.txt"]
    for path in notes:
        path.write_text("mine")
    assert opened(CAMPAIGN, directory, overwrite=True) == (6, ())
    assert [path.read_text() for path in notes] == ["mine", "mine"]


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"seed": 1}, "campaign.seed is 0, not 1"),
        ({"runs": 41}, "campaign.runs is 40, not 41"),
        ({"drive": "ideal"}, "campaign.drive is velocity, not ideal"),
        ({"set": ["rig.bridge_mass=7.0"]}, "scenario.rig.bridge_mass is 6.0, not 7.0"),
        ({"controllers": ["lqr"]}, 'campaign.controllers is ["lqr", "pole-placement"], not ["lqr"]'),
    ],
)
def test_another_campaign_is_not_mixed_in(tmp_path: Path, changes: dict[str, Any], named: str) -> None:
    uncertain = {"rig": {"load_mass": MASS}}
    write_all(two_controllers(uncertain=uncertain), tmp_path)
    error = caught(opened, two_controllers(uncertain=uncertain, **changes), tmp_path, resume=True)
    assert named in error.found
    assert "another campaign" in error.found
    assert len(read_results(tmp_path)) == 80


def test_places_that_are_no_results(tmp_path: Path) -> None:
    assert "holds no result" in caught(read_results, tmp_path).found
    (tmp_path / "notes.txt").write_text("mine")
    for options in ({}, {"resume": True}, {"overwrite": True}):
        assert "other files: notes.txt" in caught(opened, CAMPAIGN, tmp_path, **options).found
    assert sorted(path.name for path in tmp_path.iterdir()) == ["notes.txt"]
    assert "cannot write" in caught(opened, CAMPAIGN, tmp_path / "notes.txt" / "below").found


def test_nothing_is_left_where_nothing_could_be_run(tmp_path: Path) -> None:
    def refused() -> None:
        with Store.open(CAMPAIGN, tmp_path):
            raise InputError("the nominal crane cannot be run", allowed="one that can", remedy="correct it")

    caught(refused)
    assert opened(two_controllers(seed=3), tmp_path) == (6, ())
