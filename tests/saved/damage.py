"""Ways to damage the folder of a run, with a word of the line that each gets."""

import json
from pathlib import Path

import numpy as np


def cut(name: str):
    """Leave half of a file."""
    return lambda folder: (folder / name).write_bytes(
        (folder / name).read_bytes()[: (folder / name).stat().st_size // 2]
    )


def flip(name: str):
    """Change one byte in the middle of a file."""

    def change(folder: Path) -> None:
        content = bytearray((folder / name).read_bytes())
        content[len(content) // 2] ^= 0xFF
        (folder / name).write_bytes(content)

    return change


def without(name: str):
    """Remove a file."""
    return lambda folder: (folder / name).unlink()


def filled(name: str, content: bytes):
    """Put something else into a file."""
    return lambda folder: (folder / name).write_bytes(content)


def edited(name: str, **entries):
    """Change entries at the top of a JSON file; None removes one."""

    def change(folder: Path) -> None:
        content = json.loads((folder / name).read_text())
        content = {key: value for key, value in (content | entries).items() if value is not None}
        (folder / name).write_text(json.dumps(content))

    return change


def array(name: str, change):
    """Change an array of execution.npz; where `change` gives None it is left out."""

    def write(folder: Path) -> None:
        with np.load(folder / "execution.npz") as file:
            arrays = dict(file)
        value = change(arrays.pop(name))
        np.savez(folder / "execution.npz", **arrays, **({} if value is None else {name: value}))

    return write


def nan_at_the_end(values: np.ndarray) -> np.ndarray:
    """The values with a NaN."""
    values = values.copy()
    values.flat[-1] = np.nan
    return values


def standard(**entries):
    """Change the standard of a run."""
    return array("standard", lambda text: np.asarray(json.dumps(json.loads(str(text)) | entries)))


def other_robot(folder: Path) -> None:
    """Say in the standard that another robot ran."""
    with np.load(folder / "execution.npz") as file:
        robot = json.loads(str(file["standard"]))["robot"]
    standard(robot=robot | {"name": "somebody"})(folder)


DAMAGES = {
    "no report": (without("report.json"), "holds no report.json"),
    "a cut report": (cut("report.json"), "report.json: is not a JSON file"),
    "a report of text": (filled("report.json", b'"text"'), "is not the report of a run"),
    "an older report": (edited("report.json", schema=1), "has schema 1, this version reads 3"),
    "a newer report": (edited("report.json", schema=99), "has schema 99"),
    "a report without stages": (edited("report.json", stages={}), "stages.surfaces has no valid"),
    "a report with odd checks": (edited("report.json", checks=[{"name": "slip"}]), "checks has no valid 'value'"),
    "an odd verdict": (edited("report.json", verdict="maybe"), "verdict is maybe"),
    "a seed of text": (edited("report.json", seed="many"), "report.json: the file is broken"),
    "no scene": (without("scene.mjb"), "lacks scene.mjb"),
    "a cut scene": (cut("scene.mjb"), "scene.mjb: is cut off, was changed"),
    "a scene with another bit": (flip("scene.mjb"), "scene.mjb: is cut off, was changed"),
    "an empty scene": (filled("scene.mjb", b""), "scene.mjb: is cut off, was changed"),
    "no execution": (without("execution.npz"), "lacks execution.npz"),
    "a cut execution": (cut("execution.npz"), "execution.npz: is cut off or broken"),
    "an execution with another bit": (flip("execution.npz"), "execution.npz: is cut off or broken"),
    "an empty execution": (filled("execution.npz", b""), "execution.npz: is cut off or broken"),
    "an execution of text": (filled("execution.npz", b"text" * 99), "execution.npz: is cut off or broken"),
    "an older execution": (array("standard", lambda value: None), "lacks standard: a version before this one"),
    "an execution without controls": (array("ctrl", lambda value: None), "has no valid 'ctrl'"),
    "fewer controls": (array("ctrl", lambda value: value[:-1]), "ctrl has shape"),
    "controls that are no numbers": (array("ctrl", nan_at_the_end), "ctrl has numbers that are not finite"),
    "a start of another robot": (array("qpos0", lambda value: value[:-1]), "qpos0 has shape"),
    "odd touchdowns": (array("touchdowns", lambda value: np.asarray('[{"transition": 99}]')), "no transition 99"),
    "odd scuffs": (array("scuffs", lambda value: np.asarray('[{"transition": 99}]')), "no transition 99"),
    "checks that are no JSON": (array("checks", lambda value: np.asarray("[{")), "execution.npz: is broken"),
    "no ticks": (standard(ticks=0), "are no run"),
    "another step": (standard(timestep=0.001), "are not of this run"),
    "another robot": (other_robot, "is of robot"),
}
