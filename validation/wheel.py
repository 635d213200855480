"""Build the wheel, install it with all that it needs into a fresh environment, and use it from an empty folder.

With --freeze the versions that were installed are written down once everything has passed. This is how constraints.txt
is made:

    python -m validation.wheel --extras train,cluster,dev --freeze constraints.txt
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = "humanoid-contact-toolkit"
HEAD = """\
# Versions with which the wheel passed `python -m validation.wheel`, for
#   pip install -c constraints.txt '.[train,cluster,dev]'
# Python {python}, {platform}.
"""
COMMANDS = (
    ("-c", "import pathlib, toolkit; print(pathlib.Path(toolkit.__file__).parent)"),
    ("-m", "toolkit.doctor"),
    ("-m", "toolkit.robots"),
    ("-m", "toolkit.validate", "flat", "--out", "walk"),
    ("-m", "toolkit.export", "walk", "--to", "mjlab"),
    ("-m", "toolkit.export", "walk", "--to", "csv", "--planned"),
)


def main(argv: list[str] | None = None) -> int:
    """Build, install and use; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.wheel",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--extras", default="", help="comma-separated extras to install, e.g. train,cluster,dev")
    parser.add_argument("--constraints", type=Path, metavar="FILE", help="versions to install")
    parser.add_argument("--freeze", type=Path, metavar="FILE", help="file for the versions that passed")
    args = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        _run(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", scratch, str(ROOT), cwd=ROOT)
        (wheel,) = folder.glob("*.whl")
        venv.create(folder / "venv", with_pip=True)
        python = str(folder / "venv" / "bin" / "python")
        wanted = f"{wheel}[{args.extras}]" if args.extras else str(wheel)
        pinned = ["-c", str(args.constraints.resolve())] if args.constraints else []
        _run(python, "-m", "pip", "install", "--quiet", wanted, *pinned, cwd=folder)
        empty = folder / "empty"
        empty.mkdir()
        for words in COMMANDS:
            if _run(python, *words, cwd=empty):
                sys.stdout.write(f"FAIL  {' '.join(words)}\n")
                return 1
        if args.freeze:
            args.freeze.write_text(_versions(python))
    sys.stdout.write("PASS\n")
    return 0


def _run(*words: str, cwd: Path) -> int:
    """Run a command that sees no checkout; its exit code. Building and installing have to succeed."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run(words, cwd=cwd, env=environment, check="pip" in words).returncode


def _versions(python: str) -> str:
    """The installed versions as constraints, but for the toolkit's own."""
    text = subprocess.run([python, "-m", "pip", "freeze"], check=True, capture_output=True, text=True).stdout
    lines = [line.partition("+")[0] for line in text.splitlines() if not line.startswith(PACKAGE)]
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    return HEAD.format(python=version, platform=sys.platform) + "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
