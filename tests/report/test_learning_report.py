"""The table of scores and the picture of learning curves."""

import io

import imageio.v3 as iio
import numpy as np
from rich.console import Console

from toolkit.contacts.category import Category
from toolkit.learning.evaluate import Score
from toolkit.report.curves import draw_curves
from toolkit.report.scores import score_table


def test_the_table_has_a_row_per_category():
    score = Score(1000, 0.4, 0.953, 200.0, 9.0, 0.0042, 0.0039, 60.0)
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(score_table({Category.MOVE_FOOT: score, Category.ADD_PALM: score}))
    lines = console.export_text().splitlines()
    row = next(line.split() for line in lines if "move foot" in line)
    assert row[3:] == ["1000", "40.0", "%", "95.3", "%", "200", "9", "4.5", "%", "4.2", "3.9"]
    assert any("1 add palm" in line for line in lines)


def test_learning_curves_are_drawn(tmp_path):
    losses = np.geomspace(1, 0.1, 20)
    curve = (losses, 1.2 * losses)
    draw_curves({Category.MOVE_FOOT: {"classifier": curve, "regressor": curve}}, tmp_path / "curves.png")
    assert iio.imread(tmp_path / "curves.png").std() > 5
    draw_curves({}, tmp_path / "none.png")
    assert (tmp_path / "none.png").exists()
