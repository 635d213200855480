"""sheet.jpg: small pictures of sampled clips on one page."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path

import imageio.v3 as iio
import numpy as np
from PIL import Image, ImageDraw

from toolkit.clips.attempt import RUNS, Record, name_of
from toolkit.clips.statistics import SHEET
from toolkit.drafts import write_whole
from toolkit.report.files import PLAN
from toolkit.report.offscreen import Patches
from toolkit.report.plan_file import read_plan
from toolkit.report.saved_run import read_run
from toolkit.report.stroboscope import stroboscope

COLUMNS, ROWS = 5, 4
_SIZE, _LINE, _QUALITY = (320, 240), 16, 88  # pixels of a picture and of the line below it; of JPEG


def write_sheet(folder: Path, records: Sequence[Record], progress: Callable[[float], None] = lambda share: None) -> int:
    """Draw a page of clips, spread evenly over the kinds of worlds; those whose run was removed are left out.

    Args:
        folder: The data set.
        records: Records of all attempts.
        progress: Is called with the share that is done.

    Returns:
        Number of pictures; without any, no page is written.

    Raises:
        InputError: This machine cannot render, or the page cannot be written.
    """
    there = [r for r in records if r["passed"] and (folder / RUNS / name_of(r["attempt"]) / PLAN).is_file()]
    by_kind = sorted(there, key=lambda record: (record["kind"], record["attempt"]))
    rows = np.unique(np.linspace(0, len(by_kind) - 1, COLUMNS * ROWS).round().astype(int)) if by_kind else []
    pictures = []
    for row in rows:
        pictures.append(_picture(folder, by_kind[row]))
        progress(len(pictures) / len(rows))
    if not pictures:
        return 0
    blank = np.full_like(pictures[0], 255)
    pictures += [blank] * (-len(pictures) % min(COLUMNS, len(pictures)))
    lines = [np.hstack(pictures[first : first + COLUMNS]) for first in range(0, len(pictures), COLUMNS)]
    content = io.BytesIO()
    iio.imwrite(content, np.vstack(lines), extension=".jpg", quality=_QUALITY)
    write_whole(folder / SHEET, content.getvalue())
    return len(rows)


def _picture(folder: Path, record: Record) -> np.ndarray:
    """(height, width, 3) uint8; a clip with a line of text below it."""
    run = folder / RUNS / name_of(record["attempt"])
    execution = read_run(run).execution
    assert execution is not None  # only what passed has a run
    patches = Patches(read_plan(run / PLAN).contacts, execution.standard.robot.half_sizes)
    picture = stroboscope(execution.scene, execution.samples.qpos, size=_SIZE, patches=patches)
    page = Image.new("RGB", (_SIZE[0], _SIZE[1] + _LINE), "white")
    page.paste(Image.fromarray(picture))
    words = f"{name_of(record['attempt'])} {record['kind']}, {record['duration']:.1f} s, {record['contacts']} contacts"
    ImageDraw.Draw(page).text((4, _SIZE[1] + 2), words, fill="black")
    return np.asarray(page)
