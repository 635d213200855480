"""Random damage to model files and robot.toml: numbers, attributes, elements, names, bytes."""

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
NUMBERS = (
    "nan", "inf", "-inf", "0", "-0", "-1", "1", "1e300", "-1e300", "1e-300", "1e9", "1e4", "1e-9", "0.001", "90",
    "9" * 400, "", "x", "1 2 3", "0x10",
)  # fmt: skip
NAMES = (
    "",
    " ",
    "nan",
    "start",
    "goal",
    "floor",
    "world",
    "mesh#1",
    "m/part0",
    "[red]x",
    "ü\u202e",
    "a" * 300,
    "'",
    "&",
)
TETRA = 'vertex="0 0 0  1 0 0  0 1 0  0 0 1" face="0 2 1 0 1 3 0 3 2 1 2 3"'
DENT = 'vertex="0 0 0  1 0 0  0 1 0  0 0 1 0.2 0.2 0.2" face="0 2 1 0 1 3 0 3 2 1 2 4 2 3 4 3 1 4"'
GEOMS = (
    '<geom type="{kind}" size="{a} {b} {c}" pos="{x} {y} {z}" euler="{e} {f} 0" friction="{a}"/>',
    '<geom type="capsule" fromto="0 0 {z} {x} {y} {a}" size="{b}"/>',
    '<body pos="{x} {y} {z}" euler="{e} 0 {f}"><geom type="box" size="{a} {b} {c}"/></body>',
    '<geom type="mesh" mesh="tetra" pos="{x} {y} {z}"/>',
    '<geom type="mesh" mesh="dent" pos="{x} {y} {z}" euler="{e} {f} 0"/>',
    '<geom type="hfield" hfield="field" pos="{x} {y} {z}"/>',
    '<body name="b"><joint/><geom size="{a}"/></body>',
    '<frame pos="{x} {y} {z}" euler="0 {e} 0"><geom type="cylinder" size="{a} {b}" rgba="1 1 1 0"/></frame>',
    '<replicate count="3" offset="{a} {b} 0"><geom type="box" size="{c} {c} {c}" pos="0 0 {z}"/></replicate>',
    '<site name="start_left_palm" pos="{x} {y} {z}"/>',
)
ASSETS = (
    f'<asset><mesh name="tetra" {TETRA}/><mesh name="dent" {DENT}/>'
    '<hfield name="field" nrow="3" ncol="4" size="1 2 0.3 0.1" elevation="0 1 0 1 0 0 0 0 1 1 1 1"/></asset>'
)
SECTIONS = (
    '<option gravity="0 0 -1.62"/>', '<option timestep="{a}"/>', '<option><flag contact="disable"/></option>',
    '<compiler discardvisual="true" fusestatic="true"/>', '<compiler angle="radian"/>', '<size memory="1K"/>',
    '<include file="nowhere.xml"/>', '<sensor/>', '<visual><global fovy="{a}"/></visual>', '<statistic extent="{a}"/>',
    '<default><geom contype="{a}" margin="{b}" friction="{c}"/></default>', '<contact/>',
    '<custom><numeric name="transition_timing" data="{a} {b}"/></custom>', '<worldbody><geom size="{a}"/></worldbody>',
)  # fmt: skip


def snippet(template: str, rng: np.random.Generator) -> str:
    """A template filled with lengths, mostly sensible."""
    lengths = {key: f"{rng.uniform(0.02, 1.0):.3f}" for key in "abc"}
    places = {key: f"{rng.uniform(-1.5, 1.5):.3f}" for key in "xyz"}
    values = lengths | places | {key: f"{rng.uniform(-40, 40):.1f}" for key in "ef"}
    if rng.random() < 0.2:
        values[str(rng.choice(list(values)))] = str(rng.choice(NUMBERS))
    kinds = ("box", "sphere", "cylinder", "capsule", "ellipsoid", "plane", "sdf", "mesh")
    return template.format(kind=rng.choice(kinds, p=[0.4, 0.1, 0.2, 0.1, 0.1, 0.06, 0.02, 0.02]), **values)


def damaged_number(text: str, rng: np.random.Generator) -> str:
    """One number of a text replaced, scaled or turned round."""
    found = list(re.finditer(r"-?\d+\.?\d*(e-?\d+)?", text))
    if not found:
        return str(rng.choice(NUMBERS))
    match = found[int(rng.integers(len(found)))]
    number = float(match[0])
    choices = (
        str(rng.choice(NUMBERS)),
        f"{-number:g}",
        f"{number * rng.uniform(0, 3):g}",
        f"{number + rng.normal():g}",
    )
    return text[: match.start()] + str(rng.choice(choices)) + text[match.end() :]


def damaged_xml(text: str, rng: np.random.Generator) -> bytes:
    """A model file with one to four kinds of damage."""
    root = ElementTree.fromstring(text)
    damages = ["number"] * 6 + ["drop", "twice", "nest", "tag", "key", "name", "lose", "swap"] + ["add"] * 5
    if rng.random() < 0.5:
        damages = ["add"]  # worlds that are odd rather than broken
    for _ in range(rng.integers(1, 5)):
        parents = {child: parent for parent in root.iter() for child in parent}
        every = list(parents)
        if not every:
            break
        item = every[int(rng.integers(len(every)))]
        parent, other = parents[item], every[int(rng.integers(len(every)))]
        keys = sorted(item.attrib)
        key = keys[int(rng.integers(len(keys)))] if keys else "pos"
        match rng.choice(damages):
            case "number":
                item.set(key, damaged_number(item.get(key, "0 0 0"), rng))
            case "drop":
                item.attrib.pop(key, None)
            case "twice":
                parent.append(item)
            case "nest" if item not in list(other.iter()) and other not in list(item.iter()):
                other.append(item)
            case "tag":
                item.tag = other.tag
            case "key":
                item.set(sorted(other.attrib or {"pos": ""})[0], item.attrib.pop(key, "1"))
            case "name":
                item.set("name", str(rng.choice(NAMES)))
            case "lose":
                parent.remove(item)
            case "swap":
                item.set(key, other.get(key, "0"))
            case "add":
                worldbody = root.find("worldbody")
                if rng.random() < 0.3 or worldbody is None:
                    root.append(ElementTree.fromstring(snippet(str(rng.choice(SECTIONS)), rng)))
                else:
                    root.append(ElementTree.fromstring(ASSETS)) if root.find(
                        "asset/mesh[@name='tetra']"
                    ) is None else None
                    worldbody.append(ElementTree.fromstring(snippet(str(rng.choice(GEOMS)), rng)))
    return damaged_bytes(ElementTree.tostring(root, encoding="unicode"), rng)


def damaged_toml(text: str, rng: np.random.Generator) -> bytes:
    """A robot.toml with one to four kinds of damage."""
    lines = text.splitlines()
    for _ in range(rng.integers(1, 5)):
        k, m = rng.integers(len(lines), size=2)
        match rng.choice(["number"] * 6 + ["drop", "twice", "swap", "name", "key", "deep", "odd"]):
            case "number":
                lines[k] = damaged_number(lines[k], rng)
            case "drop":
                lines[k] = ""
            case "twice":
                lines.insert(m, lines[k])
            case "swap":
                lines[k], lines[m] = lines[m], lines[k]
            case "name":
                lines[k] = re.sub(r'"[^"]*"', f'"{rng.choice(NAMES)}"', lines[k], count=1)
            case "key":
                lines[k] = re.sub(r"^\w+", str(rng.choice(["pad", "body", "site", "x", "patch"])), lines[k])
            case "deep":
                lines.insert(0, f"declared = {'[' * 5000}{']' * 5000}")
            case "odd":
                lines[k] = re.sub(
                    r"= .*", f"= {rng.choice(['true', '{}', '[]', '1979-05-27', '[1, [2]]', 'nan'])}", lines[k]
                )
    return damaged_bytes("\n".join(lines) + "\n", rng)


def damaged_bytes(text: str, rng: np.random.Generator) -> bytes:
    """A text as bytes, now and then cut, flipped, or in another encoding."""
    data = bytearray(text.encode("utf-8", "replace"))
    match rng.choice(["whole"] * 30 + ["cut", "flip", "utf-16", "latin-1", "bom", "crlf", "nul", "empty"]):
        case "cut":
            return bytes(data[: int(rng.integers(len(data)))])
        case "flip":
            data[int(rng.integers(len(data)))] = int(rng.integers(256))
        case "utf-16" | "latin-1" as name:
            return text.encode(name, "replace")
        case "bom":
            return b"\xef\xbb\xbf" + data
        case "crlf":
            return bytes(data).replace(b"\n", b"\r\n")
        case "nul":
            data.insert(int(rng.integers(len(data))), 0)
        case "empty":
            return b""
    return bytes(data)
