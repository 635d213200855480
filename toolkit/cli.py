"""What every command line shares: options, one line per error, exit codes."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path

from toolkit.errors import ToolkitError

EXIT_CODES = "exit codes: 0 success, 1 a plan or check failed (the reason is printed), 2 bad input"


def parser(module: str, description: str, epilog: str = "") -> argparse.ArgumentParser:
    """Argument parser of `python -m toolkit.<module>` whose help teaches."""
    return argparse.ArgumentParser(
        prog=f"python -m toolkit.{module}",
        description=description,
        epilog=f"{epilog}\n\n{EXIT_CODES}".strip(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def add_robot_options(target: argparse.ArgumentParser) -> None:
    """Add `--robot` and `--robots`."""
    target.add_argument("--robot", help="folder name under robots/, or a path (default: the one in robots/default)")
    target.add_argument("--robots", type=Path, metavar="DIR", help="folder with the robots (default: robots/)")


def positive(kind: Callable[[str], float]) -> Callable[[str], float]:
    """An argparse type: a number of `kind` that is finite and above zero."""

    def convert(text: str) -> float:
        value = kind(text)
        if not 0 < value < float("inf"):
            raise argparse.ArgumentTypeError(f"{text} is not above zero")
        return value

    convert.__name__ = f"positive {kind.__name__}"
    return convert


def run(main: Callable[[list[str] | None], int], argv: list[str] | None = None) -> None:
    """Call `main`, turn toolkit errors into one line on stderr, and leave with the exit code."""
    try:
        code = main(argv)
    except ToolkitError as error:
        message = " ".join(str(error).split())
        sys.stderr.write(f"error: {message}\n")
        code = error.exit_code
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        code = 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 1
    sys.exit(code)
