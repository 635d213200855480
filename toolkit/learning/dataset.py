"""Data sets of labelled transitions: a manifest and numbered shards, each written whole or not at all.

    DIR/manifest.json      what was asked for: robot, fingerprint, seed, versions, settings
    DIR/shard-000000.npz   per category c the arrays of its `Samples`: features_c (n, d) float32, feasible_c (n,) bool,
                           targets_c (n, 7) float32, goal_c (n, 3) float32, world_c (n,) int32

Shard i depends only on the manifest and on i. So a collection that was killed continues with the missing shards.
"""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.contacts.category import Category
from toolkit.drafts import clear_drafts, is_draft, write_whole
from toolkit.errors import DatasetError
from toolkit.learning.samples import PARTS, Samples, join
from toolkit.prediction.features import TARGETS, feature_size

SCHEMA, COMMAND = "transition-data-3", "toolkit.train collect"
_TYPES = ["f", "b", "f", "f", "i"]  # of the arrays of samples


@dataclass(frozen=True)
class Manifest:
    """Description of a data set.

    Attributes:
        schema: Version of the layout of the files.
        robot: Name of the robot.
        fingerprint: Fingerprint of the robot's dynamics.
        seed: Seed of all shards.
        settings: Settings of the collection, as plain values.
        versions: Versions of the libraries at the start.
    """

    schema: str
    robot: str
    fingerprint: str
    seed: int
    settings: dict
    versions: dict

    def write(self, folder: Path) -> None:
        """Write `folder/manifest.json`, whole or not at all."""
        write_whole(folder / "manifest.json", json.dumps(asdict(self), indent=2).encode())


def read_manifest(folder: Path, schema: str = SCHEMA, command: str = COMMAND) -> Manifest:
    """Manifest of a data set.

    Args:
        folder: The data set.
        schema: The layout that is expected.
        command: What makes such a data set, for messages.

    Raises:
        DatasetError: There is none, or it cannot be read.
    """
    path = folder / "manifest.json"
    if not path.is_file():
        raise DatasetError(f"{folder}: no data set here (manifest.json is missing); make one with: python -m {command}")
    try:
        manifest = Manifest(**json.loads(path.read_text()))
    except (OSError, ValueError, TypeError, RecursionError) as error:
        raise DatasetError(f"{path}: not a manifest ({error}); collect into another folder") from None
    if manifest.schema != schema:
        raise DatasetError(f"{path}: schema {manifest.schema!r}, expected {schema!r}; collect the data again")
    return manifest


def plain_settings(config: Any, *without: str) -> dict:
    """Fields of a configuration except some, as plain values that a manifest can store and return unchanged."""
    return json.loads(json.dumps({name: value for name, value in asdict(config).items() if name not in without}))


def begin(folder: Path, wanted: Manifest, command: str = COMMAND) -> None:
    """Make the folder of a data set with its manifest, or check the manifest that is there.

    Args:
        folder: The data set.
        wanted: What the manifest must say, but for the versions.
        command: What makes such a data set, for messages.

    Raises:
        DatasetError: The folder holds something else, or data of other settings or of another robot.
    """
    clear_drafts(folder)
    if (folder / "manifest.json").is_file():
        found = read_manifest(folder, wanted.schema, command)
        for name in ("robot", "fingerprint", "seed", "settings"):
            if getattr(found, name) != getattr(wanted, name):
                raise DatasetError(
                    f"{folder}: begun with other settings; it was begun with {name} {getattr(found, name)!r}, now "
                    f"{getattr(wanted, name)!r}; use another --out, or the same options"
                )
        return
    if folder.exists() and not all(is_draft(entry.name) for entry in folder.iterdir()):
        raise DatasetError(f"{folder}: not empty and not a data set; use another --out")
    folder.mkdir(parents=True, exist_ok=True)
    wanted.write(folder)


def begun_with(folder: Path, setting: str) -> Any:
    """A setting that a data set was begun with; None where there is no data set yet.

    Raises:
        DatasetError: Its manifest cannot be read.
    """
    return read_manifest(folder).settings.get(setting) if (folder / "manifest.json").is_file() else None


def shards_of(folder: Path, fingerprint: str) -> list[Path]:
    """Files of the shards of a data set, in order; it must belong to the robot with this fingerprint.

    Raises:
        DatasetError: There is no data set, it belongs to another robot, or it has no shards.
    """
    manifest = read_manifest(folder)
    if manifest.fingerprint != fingerprint:
        raise DatasetError(
            f"{folder}: collected for another robot; it was collected for robot {manifest.robot!r} with fingerprint "
            f"{manifest.fingerprint[:12]}, not {fingerprint[:12]}; collect again for this robot"
        )
    paths = sorted(folder.glob("shard-*.npz"))
    if not paths:
        raise DatasetError(f"{folder}: holds no shards yet; run python -m toolkit.train collect")
    return paths


def shard_path(folder: Path, index: int) -> Path:
    """File of shard `index`."""
    return folder / f"shard-{index:06d}.npz"


def write_shard(folder: Path, index: int, samples: dict[Category, Samples]) -> None:
    """Write a shard, whole or not at all."""
    arrays = {f"{part}_{int(category)}": getattr(group, part) for category, group in samples.items() for part in PARTS}
    content = io.BytesIO()
    np.savez(content, **arrays)
    write_whole(shard_path(folder, index), content.getvalue())


def read_shard(path: Path) -> dict[Category, Samples]:
    """Samples of one shard by category.

    Raises:
        DatasetError: The file is truncated, or its arrays do not fit.
    """
    remedy = "delete it and run the collection again to refill it"
    try:
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise DatasetError(f"{path}: truncated or not a shard ({error}); {remedy}") from None
    samples = {}
    for category in Category:
        names = [f"{part}_{int(category)}" for part in PARTS]
        if not any(name in arrays for name in names):
            continue
        if not all(name in arrays for name in names):
            raise DatasetError(f"{path}: incomplete arrays for category {int(category)}; {remedy}")
        group = Samples(*(arrays[name] for name in names))
        kinds = [arrays[name].dtype.kind for name in names]
        if kinds != _TYPES or group.feasible.ndim != 1:
            raise DatasetError(f"{path}: category {int(category)} has arrays of other types; {remedy}")
        n = len(group.feasible)
        expected = [(n, feature_size(category)), (n,), (n, TARGETS), (n, 3), (n,)]
        shapes = [arrays[name].shape for name in names]
        if shapes != expected:
            raise DatasetError(f"{path}: category {int(category)} has shapes {shapes}, expected {expected}; {remedy}")
        known = group.known
        if not all(np.isfinite(values).all() for values in (group.features, group.targets[known], group.goal)):
            raise DatasetError(f"{path}: category {int(category)} holds NaN or infinite values; {remedy}")
        if (known & ~group.feasible).any():
            raise DatasetError(f"{path}: category {int(category)} has outcomes of infeasible transitions; {remedy}")
        samples[category] = group
    return samples


def read_dataset(folder: Path, fingerprint: str, *, limit: int | None = None) -> dict[Category, Samples]:
    """All samples of a data set by category, in the order of the shards; see `read_datasets`."""
    return read_datasets([folder], fingerprint, limit=limit)


def read_datasets(folders: list[Path], fingerprint: str, *, limit: int | None = None) -> dict[Category, Samples]:
    """All samples of data sets by category, in the order of the shards' numbers.

    Args:
        folders: The data sets.
        fingerprint: Fingerprint of the robot that the data sets must belong to.
        limit: Largest number of samples per category.

    Raises:
        DatasetError: The data belong to another robot, there are no shards, or a shard is broken.
    """
    paths = [path for folder in folders for path in shards_of(folder, fingerprint)]
    groups: dict[Category, list[Samples]] = {}
    for path in sorted(paths, key=lambda path: path.name):
        for category, samples in read_shard(path).items():
            groups.setdefault(category, []).append(samples)
    return {category: join(items).select(slice(limit)) for category, items in sorted(groups.items())}
