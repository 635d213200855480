"""The video of a replay."""

from __future__ import annotations

import tempfile
from pathlib import Path

from toolkit.contacts.sequence import ContactSequence
from toolkit.drafts import write_whole
from toolkit.execution.result import Execution
from toolkit.report.offscreen import Patches
from toolkit.report.pictures import video


def write_replay_video(path: Path, again: Execution, sequence: ContactSequence) -> None:
    """Write an MP4 file of a replay in real time, with the planned contacts; it appears whole or not at all.

    Raises:
        InputError: This machine cannot render, or the file cannot be written.
    """
    patches = Patches(sequence.contacts, again.standard.robot.half_sizes)
    with tempfile.TemporaryDirectory(prefix="toolkit-video-") as folder:
        draft = Path(folder) / "video.mp4"
        video(again.scene, again.samples.qpos, again.samples.tick_times, draft, patches=patches)
        write_whole(path, draft.read_bytes(), "--video")
