"""Data sets of labelled transitions: a manifest and numbered shards, each written whole or not at all.

    DIR/manifest.json      what was asked for: robot, fingerprint, seed, versions, settings
    DIR/shard-000000.npz   per category c: features_c (n, d) float32, feasible_c (n,) bool, targets_c (n, 7) float32,
                           sensitivity_c (n, k) float32

Shard i depends on the manifest and on i alone. So a collection that was killed goes on with the shards that are
missing, and nothing is lost or doubled. Older shards have no sensitivities: they are unknown there, and
`learning.differentiate` adds them.
"""

from __future__ import annotations

import json
import os
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.contacts.category import Category
from toolkit.errors import DatasetError
from toolkit.learning.sensitivity import sensitivity_size
from toolkit.prediction.features import TARGETS, feature_size

SCHEMA = "transition-data-2"
READABLE = ("transition-data-1", SCHEMA)  # the first had no sensitivities


@dataclass(frozen=True)
class Manifest:
    """What a data set was asked for.

    Attributes:
        schema: of the files.
        robot: name; fingerprint: of its dynamics.
        seed: of all shards.
        settings: of the collection, as plain values.
        versions: of the libraries at the start.
    """

    schema: str
    robot: str
    fingerprint: str
    seed: int
    settings: dict
    versions: dict

    def write(self, folder: Path) -> None:
        """Write `folder/manifest.json`, whole or not at all."""
        temporary = folder / "manifest.json.part"
        temporary.write_text(json.dumps(asdict(self), indent=2))
        os.replace(temporary, folder / "manifest.json")


@dataclass(frozen=True)
class Samples:
    """Labelled transitions of one category.

    Attributes:
        features: (n, d) float32, canonical, see `features.encode`.
        feasible: (n,) bool.
        targets: (n, 7) float32; objective, CoM (m), CoM velocity (m/s); zero where not feasible.
        sensitivity: (n, k) float32, derivatives of the objective, see `learning.sensitivity`; NaN where unknown. None:
            all unknown.
    """

    features: np.ndarray
    feasible: np.ndarray
    targets: np.ndarray
    sensitivity: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.features)

    def select(self, rows: np.ndarray | slice) -> Samples:
        """The samples of these rows."""
        known = None if self.sensitivity is None else self.sensitivity[rows]
        return Samples(self.features[rows], self.feasible[rows], self.targets[rows], known)


def no_samples(category: Category) -> Samples:
    """No samples of a category, with the columns that they have."""
    features, targets = np.zeros((0, feature_size(category)), np.float32), np.zeros((0, TARGETS), np.float32)
    return Samples(features, np.zeros(0, bool), targets, np.zeros((0, sensitivity_size(category)), np.float32))


def join(groups: list[Samples], category: Category) -> Samples:
    """Samples of a category one after the other; sensitivities that some lack are NaN there."""
    known = None
    if any(group.sensitivity is not None for group in groups):
        unknown = np.full((1, sensitivity_size(category)), np.nan, np.float32)
        known = np.concatenate(
            [np.repeat(unknown, len(g), 0) if g.sensitivity is None else g.sensitivity for g in groups]
        )
    return Samples(
        np.concatenate([group.features for group in groups]),
        np.concatenate([group.feasible for group in groups]),
        np.concatenate([group.targets for group in groups]),
        known,
    )


def read_manifest(folder: Path) -> Manifest:
    """Manifest of a data set.

    Raises:
        DatasetError: there is none, or it cannot be read.
    """
    path = folder / "manifest.json"
    if not path.is_file():
        raise DatasetError(
            f"{folder}: no data set here (manifest.json is missing); make one with: python -m toolkit.train collect"
        )
    try:
        manifest = Manifest(**json.loads(path.read_text()))
    except (json.JSONDecodeError, TypeError) as error:
        raise DatasetError(f"{path}: not a manifest ({error}); collect into another folder") from None
    if manifest.schema not in READABLE:
        raise DatasetError(f"{path}: schema {manifest.schema!r}, expected {SCHEMA!r}; collect the data again")
    return manifest


def plain_settings(config: Any, *without: str) -> dict:
    """Fields of a configuration, but for some, as plain values that come back from a manifest unchanged."""
    fields = {name: value for name, value in asdict(config).items() if name not in without}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in fields.items()}


def begin(folder: Path, wanted: Manifest) -> None:
    """Make the folder of a data set with its manifest, or check the manifest that is there.

    Raises:
        DatasetError: the folder holds something else, or data of other settings or of another robot.
    """
    if (folder / "manifest.json").is_file():
        found = read_manifest(folder)
        for name in ("robot", "fingerprint", "seed", "settings"):
            if getattr(found, name) != getattr(wanted, name):
                raise DatasetError(
                    f"{folder}: begun with other settings; it was begun with {name} {getattr(found, name)!r}, now "
                    f"{getattr(wanted, name)!r}; use another --out, or the same options"
                )
        return
    if folder.exists() and any(folder.iterdir()):
        raise DatasetError(f"{folder}: not empty and not a data set; use another --out")
    folder.mkdir(parents=True, exist_ok=True)
    wanted.write(folder)


def shards_of(folder: Path, fingerprint: str) -> list[Path]:
    """Files of the shards of a data set, in order.

    Args:
        folder: the data set.
        fingerprint: of the robot that it must belong to.

    Raises:
        DatasetError: no data set, another robot's, or one without shards.
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


def shard_index(path: Path) -> int:
    """Number of the shard in a file."""
    return int(path.stem.split("-")[1])


def write_shard(folder: Path, index: int, samples: dict[Category, Samples]) -> None:
    """Write a shard, whole or not at all."""
    arrays = {}
    for category, group in samples.items():
        arrays[f"features_{int(category)}"] = group.features
        arrays[f"feasible_{int(category)}"] = group.feasible
        arrays[f"targets_{int(category)}"] = group.targets
        if group.sensitivity is not None:
            arrays[f"sensitivity_{int(category)}"] = group.sensitivity
    path = shard_path(folder, index)
    temporary = path.with_suffix(".part")
    with temporary.open("wb") as file:
        np.savez(file, **arrays)
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)


def read_shard(path: Path) -> dict[Category, Samples]:
    """Samples of one shard by category.

    Raises:
        DatasetError: the file is truncated, or its arrays do not fit.
    """
    remedy = "delete it and run the collection again to refill it"
    try:
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise DatasetError(f"{path}: truncated or not a shard ({error}); {remedy}") from None
    samples = {}
    for category in Category:
        names = [f"{part}_{int(category)}" for part in ("features", "feasible", "targets")]
        if not any(name in arrays for name in names):
            continue
        if not all(name in arrays for name in names):
            raise DatasetError(f"{path}: incomplete arrays for category {int(category)}; {remedy}")
        known = arrays.get(f"sensitivity_{int(category)}")
        features, feasible, targets = (arrays[name] for name in names)
        group = Samples(features, feasible, targets, known)
        n = len(group.feasible)
        expected = [(n, feature_size(category)), (n,), (n, TARGETS)]
        shapes = [array.shape for array in (group.features, group.feasible, group.targets)]
        if known is not None:
            expected.append((n, sensitivity_size(category)))
            shapes.append(known.shape)
        if shapes != expected:
            raise DatasetError(f"{path}: category {int(category)} has shapes {shapes}, expected {expected}; {remedy}")
        infinite = known is not None and bool(np.isinf(known).any())
        if infinite or not (np.isfinite(group.features).all() and np.isfinite(group.targets).all()):
            raise DatasetError(f"{path}: category {int(category)} holds NaN or infinite values; {remedy}")
        samples[category] = group
    return samples


def read_dataset(folder: Path, fingerprint: str, *, limit: int | None = None) -> dict[Category, Samples]:
    """All samples of a data set by category, in the order of the shards; see `read_datasets`."""
    return read_datasets([folder], fingerprint, limit=limit)


def read_datasets(folders: list[Path], fingerprint: str, *, limit: int | None = None) -> dict[Category, Samples]:
    """All samples of data sets by category, in the order of the shards' numbers.

    So a shard and the variations of its transitions (`learning.enrich`) come together, and what training holds out,
    the last ones, has no variations among the others.

    Args:
        folders: the data sets.
        fingerprint: of the robot that they must belong to.
        limit: at most so many samples per category.

    Raises:
        DatasetError: another robot's data, no shards, or a broken one.
    """
    paths = [path for folder in folders for path in shards_of(folder, fingerprint)]
    groups: dict[Category, list[Samples]] = {}
    for path in sorted(paths, key=lambda path: path.name):
        for category, samples in read_shard(path).items():
            groups.setdefault(category, []).append(samples)
    return {category: join(items, category).select(slice(limit)) for category, items in sorted(groups.items())}
