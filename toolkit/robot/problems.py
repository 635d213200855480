"""Everything that is wrong with a robot, said in one message."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from toolkit.errors import RobotError

_SAID = 6  # most problems that one message says; one cause may have many


@dataclass(frozen=True)
class Problems:
    """Collects what is wrong until it is said.

    Attributes:
        path: The robot.toml.
        found: The file that each problem is about, and one line that says what is wrong.
    """

    path: Path
    found: list[tuple[Path, str]] = field(default_factory=list)

    def add(self, problem: str, path: Path | None = None) -> None:
        """Note a problem of the robot.toml, or of another file."""
        entry = (self.path if path is None else path, problem)
        if entry not in self.found:
            self.found.append(entry)

    def check(self) -> None:
        """Raise a RobotError of one line with all problems noted so far; do nothing where there are none."""
        if len(self.found) == 1:
            path, problem = self.found[0]
            raise RobotError(f"{path}: {problem}")
        if self.found:
            said = [text if path == self.path else f"{path.name}: {text}" for path, text in self.found]
            numbered = " ".join(f"({number}) {text}" for number, text in enumerate(said[:_SAID], start=1))
            more = f" and {len(said) - _SAID} more" if len(said) > _SAID else ""
            raise RobotError(f"{self.path}: {len(said)} things are wrong: {numbered}{more}")
