"""The records of an experiment's trials, as JSON: an interrupted experiment goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from toolkit.drafts import write_whole
from toolkit.errors import InputError
from toolkit.report.files import plain


class TrialFile:
    """Records by name of the trial, kept in a file as they come in.

    Records made under other settings or by another state of the code are left where they are and not used.
    """

    def __init__(self, path: Path, settings: dict[str, Any]):
        """Read what is there.

        Args:
            path: the file; its folder is made.
            settings: everything that decides a record besides its name, as JSON can hold it.

        Raises:
            InputError: the file cannot be read or written.
        """
        self.path = path
        self.key = _key(settings)
        self.records: dict[str, dict[str, Any]] = {}
        self.others = 0
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            text = path.read_text(encoding="utf-8") if path.exists() else ""
            with path.open("a", encoding="utf-8") as file:
                if text and not text.endswith("\n"):
                    file.write("\n")  # the last line was cut short: it is skipped below
        except OSError as error:
            raise InputError(f"{path}: cannot be used ({error.strerror}); choose another --out") from error
        for line in text.splitlines():
            try:
                record = json.loads(line)
            except ValueError:
                continue
            if isinstance(record, dict) and record.get("key") == self.key:
                self.records[record["name"]] = record
            else:
                self.others += 1

    def add(self, record: dict[str, Any]) -> None:
        """Keep a record, which has a `name`."""
        record = {"key": self.key, **plain(record)}
        self.records[record["name"]] = record
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(record, allow_nan=False, ensure_ascii=False) + "\n")


class TrialFolder:
    """Records by name of the trial, each in a small file of its own that appears whole.

    Records made under other settings lie in folders beside this one.
    """

    def __init__(self, path: Path, settings: dict[str, Any]):
        """Read what is there; files that are no records are written anew.

        Args:
            path: The folder; records lie in one of its folders, which is named after the settings.
            settings: Everything that decides a record besides its name, as JSON can hold it.

        Raises:
            InputError: A file cannot be read.
        """
        self.path = path / _key(settings)
        self.records: dict[str, dict[str, Any]] = {}
        try:
            for file in sorted(self.path.glob("*.json")):
                record = _record(file.read_text(encoding="utf-8"))
                if record is not None:
                    self.records[record["name"]] = record
        except OSError as error:
            raise InputError(f"{self.path}: cannot be used ({error.strerror}); choose another --out") from error
        self.others = sum(file.parent != self.path for file in path.glob("*/*.json"))

    def add(self, record: dict[str, Any]) -> None:
        """Keep a record, which has a `name` that can name a file.

        Raises:
            InputError: It cannot be written.
        """
        record = plain(record)
        self.records[record["name"]] = record
        text = json.dumps(record, allow_nan=False, ensure_ascii=False, indent=1)
        write_whole(self.path / f"{record['name']}.json", f"{text}\n".encode())


def _key(settings: dict[str, Any]) -> str:
    """Twelve hex digits of settings."""
    return hashlib.sha256(json.dumps(plain(settings), sort_keys=True).encode()).hexdigest()[:12]


def _record(text: str) -> dict[str, Any] | None:
    """The record in a text; None where it holds none."""
    try:
        record = json.loads(text)
    except ValueError:
        return None
    return record if isinstance(record, dict) and isinstance(record.get("name"), str) else None
