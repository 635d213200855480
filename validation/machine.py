"""What results were taken with: versions, machine, state of the code."""

from __future__ import annotations

import ast
import hashlib
import os
import platform
import resource
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from toolkit import cli
from toolkit.report.run_report import versions

ROOT = Path(__file__).resolve().parent.parent


def environment() -> dict[str, Any]:
    """Versions of the software and the machine that it ran on."""
    return {
        "versions": versions(),
        "code": code_fingerprint(),
        "machine": {
            "processor": _processor(),
            "cores": cli.cores(),
            "system": f"{platform.system()} {platform.machine()}",
            "load": round(os.getloadavg()[0], 2),
        },
    }


def code_fingerprint() -> str:
    """The same of the toolkit's source: results of two states of the code are never mixed unnoticed."""
    return source_fingerprint((ROOT / "toolkit").rglob("*.py"))


def source_fingerprint(paths: Iterable[Path]) -> str:
    """Twelve hex digits of what modules under the project's root compute: comments and docstrings are no part of it."""
    return _digest(ROOT, paths, _statements)


def _digest(folder: Path, paths: Iterable[Path], content: Callable[[Path], bytes]) -> str:
    """Twelve hex digits of the names of files in a folder and of what counts of their content."""
    digest = hashlib.sha256()
    for path in sorted(paths):
        digest.update(path.relative_to(folder).as_posix().encode())
        digest.update(content(path))
    return digest.hexdigest()[:12]


def _statements(path: Path) -> bytes:
    """A module as a tree of statements, without strings that stand alone."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [statement for statement in node.body if not _is_comment(statement)]
    return ast.dump(tree).encode()


def _is_comment(statement: ast.stmt) -> bool:
    """Whether a statement is a string and nothing else."""
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


def folder_fingerprint(folder: Path) -> str:
    """Twelve hex digits of every file of a robot's folder, networks included."""
    return _digest(folder, (path for path in folder.rglob("*") if path.is_file()), Path.read_bytes)


def memory() -> float:
    """MB that this process holds now; where the system does not say (not Linux), the most that it has held."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1024**2
    except OSError:
        unit = 1024**2 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def _processor() -> str:
    """Name of the processor."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"
