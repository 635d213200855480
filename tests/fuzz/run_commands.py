"""Command lines that read runs and scans, and ways to damage what they read."""

import json
import shutil
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

from tests.fuzz.mutation import damaged_bytes
from tests.saved import damage
from toolkit.exchange.formats import FORMATS

MODULES = ("replay", "replay", "compare", "compare", "execute", "export", "export", "scan", "scan", "doctor")
RUN, HURT = "run", "hurt"
SCANS = ("plate.obj", "plate.stl", "plate.ply", "plate.glb", "cloud.ply", "cloud.pcd", "map.npy", "map.png", "map.tif")
FILES = ("report.json", "plan.json", "motion.npz", "execution.npz", "scene.mjb")
ODD_BYTES = (b"", b"\xff\xfe\x00", b"\xef\xbb\xbf{}", b"\xfc", b"PK\x03\x04", b"[" * 10**5, b"null", b"\0" * 999)


SCAN_NUMBERS = {"--start": 2, "--goal": 2, "--friction": 1, "--timing": 2, "--scale": 1, "--cell": 1, "--origin": 3}
RUN_NUMBERS = {"--push": 1, "--mass-error": 1, "--friction-error": 1, "--terrain-error": 2, "--state-noise": 1}
RUN_NUMBERS |= {"--delay": 1, "--seed": 1}
VALUES = (
    "0",
    "0.5",
    "0.3",
    "1",
    "-0.2",
    "3",
    "1e3",
    "1e-3",
    "1e-9",
    "1e9",
    "1e300",
    "1e-300",
    "-1e300",
    "nan",
    "10000",
)


def numbers(rng: np.random.Generator, options: dict[str, int], most: int) -> list[str]:
    """Some options with as many numbers as they take, small, huge or none."""
    names = rng.choice(list(options), int(rng.integers(0, most + 1)))
    return [f"{name}={','.join(rng.choice(VALUES, options[str(name)]))}" for name in names]


def make_inputs(folder: Path, whole: Path) -> None:
    """Write a run, a copy of it to be damaged, and scans of a plate into a folder."""
    for name in (RUN, HURT):
        shutil.copytree(whole, folder / name)
    plate = trimesh.creation.box((1.6, 1.0, 0.1))
    for ending in ("obj", "stl", "ply", "glb"):
        plate.export(folder / f"plate.{ending}")
    points = np.stack(np.meshgrid(np.arange(0, 1.6, 0.05), np.arange(0, 1.0, 0.05), [0.0]), -1).reshape(-1, 3)
    trimesh.PointCloud(points).export(folder / "cloud.ply")
    (folder / "cloud.pcd").write_text("# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n")
    heights = np.zeros((32, 48))
    np.save(folder / "map.npy", heights)
    Image.fromarray(heights.astype(np.uint8)).save(folder / "map.png")
    Image.fromarray(heights.astype(np.float32)).save(folder / "map.tif")


def hurt(folder: Path, rng: np.random.Generator, damaged) -> None:
    """Damage the run that is there for that, and one of the scans; `damaged` changes a JSON value."""
    run = folder / HURT
    name = str(rng.choice(FILES))
    match rng.choice(["cut", "flip", "without", "odd", "folder", "loop", "swap", "json", "array", "array", "array"]):
        case "cut":
            damage.cut(name)(run)
        case "flip":
            damage.flip(name)(run)
        case "without":
            damage.without(name)(run)
        case "odd":
            damage.filled(name, ODD_BYTES[int(rng.integers(len(ODD_BYTES)))])(run)
        case "folder":
            (run / name).unlink()
            (run / name).mkdir()
        case "loop":
            (run / name).unlink()
            (run / name).symlink_to(name)
        case "swap":
            (run / name).write_bytes((run / str(rng.choice(FILES))).read_bytes())
        case "json":
            name = str(rng.choice(["report.json", "plan.json"]))
            (run / name).write_text(json.dumps(damaged(json.loads((run / name).read_text()), rng)))
        case "array":
            damage_array(run / str(rng.choice(["execution.npz", "motion.npz"])), rng)
    scan = folder / str(rng.choice(SCANS))
    if rng.random() < 0.5:
        content = bytearray(scan.read_bytes())
        for _ in range(int(rng.integers(1, 20))):
            content[int(rng.integers(len(content)))] = int(rng.integers(256))
        scan.write_bytes(content[: int(rng.integers(len(content)))] if rng.random() < 0.3 else content)
    elif rng.random() < 0.2:
        scan.write_bytes(damaged_bytes("v 0 0 0\nv 1 0 0\nv 0 1 1e300\nf 1 2 3\nf 1 2 9\n", rng))


def damage_array(path: Path, rng: np.random.Generator) -> None:
    """Change one array of an npz file: its numbers, its shape, its type, or leave it out."""
    with np.load(path) as file:
        arrays = dict(file)
    name = str(rng.choice(sorted(arrays)))
    array = arrays.pop(name)
    kind = str(rng.choice(["number", "number", "shape", "row", "type", "text", "out", "empty"]))
    if kind == "number" and array.dtype.kind == "f" and array.size:
        array = array.copy()
        with np.errstate(over="ignore"):  # 1e300 in single precision is infinite
            array.flat[int(rng.integers(array.size))] = float(
                rng.choice([np.nan, np.inf, 1e300, -1e300, 0.0, 1e9, -1.0])
            )
    elif kind == "shape":
        array = array.reshape(-1)
    elif kind == "row" and array.ndim:
        array = array[:-1]
    elif kind == "type":
        array = np.zeros(array.shape, str(rng.choice(["complex64", "int8", "U3", "bool", "datetime64[s]"])))
    elif kind == "text":
        array = np.asarray("{" if rng.random() < 0.5 else "ü")
    elif kind == "empty":
        array = np.zeros((0,) * max(array.ndim, 1))
    np.savez(path, **arrays, **({} if kind == "out" else {name: array}))


def run_command(rng: np.random.Generator, odd, odd_options) -> tuple[str, list[str]]:
    """A module that reads runs or scans, and its arguments; `odd` and `odd_options` draw odd values."""
    module = str(rng.choice(MODULES))
    run = str(rng.choice([RUN, HURT, HURT, HURT])) if rng.random() < 0.85 else odd(rng)
    out = [] if rng.random() < 0.4 else ["--out", odd(rng)]
    if module == "replay":
        words = [run, *odd_options(rng, ["--rerun", "--video", "--viewer"], 1)]
        words += ["--rerun", "again.rrd"] if rng.random() < 0.3 else []
    elif module == "compare":
        words = [run, *[RUN if rng.random() < 0.8 else odd(rng) for _ in range(int(rng.integers(0, 3)))], *out]
        words += ["--out", str(rng.choice(["c.md", "c.csv", "c.rrd", "taken.xml/c.md"]))] if rng.random() < 0.6 else []
    elif module == "execute":
        words = [run if rng.random() < 0.7 else f"{run}/plan.json", "--no-recording", *out]
        words += odd_options(rng, ["--world", "--robot", "--robots", "--seed", "--push", "--mass-error", "--delay"], 2)
        words += ["--world", "world.xml"] if rng.random() < 0.5 else []
        words += numbers(rng, RUN_NUMBERS, 2)
    elif module == "export":
        form = str(rng.choice(list(FORMATS))) if rng.random() < 0.9 else odd(rng)
        words = [run, "--to", form, *out, *odd_options(rng, ["--planned", "--robot", "--robots"], 1)]
        words += numbers(rng, {"--fps": 1}, 1)
    elif module == "scan":
        files = [str(rng.choice(SCANS)) if rng.random() < 0.9 else odd(rng) for _ in range(int(rng.integers(1, 3)))]
        words = [*files, *out, *(odd_options(rng, [*SCAN_NUMBERS, "--up"], 1) if rng.random() < 0.3 else [])]
        words += ["--cell=0.05"] if "map" in "".join(files) and rng.random() < 0.8 else []
        words += ["--scale=0.001"] if "map.png" in files and rng.random() < 0.8 else []
        words += numbers(rng, SCAN_NUMBERS, 2)
    else:
        words = ["--quick", *odd_options(rng, ["--robot", "--robots"], 2)]
    return f"toolkit.{module}", [word for word in words if "\0" not in word]
