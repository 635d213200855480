"""The virtual scan, and how what is found in it is compared with the world."""

import numpy as np
import pytest

from tests.validation.test_programs import result
from toolkit.world.generators import KINDS
from toolkit.world.loader import load_world
from validation import scan
from validation.scan_trial import compared
from validation.virtual_scan import virtual_scan


@pytest.fixture
def field():
    return load_world("field.xml", mjcf=KINDS["rubble_field"](np.random.default_rng(0), rows=1))


def test_a_scan_has_the_noise_and_the_holes_that_are_asked_for(field):
    clean, holed, noisy = (
        virtual_scan(field, np.random.default_rng(0), noise=noise, holes=holes)
        for noise, holes in ((0.0, 0.0), (0.0, 0.05), (0.02, 0.0))
    )
    assert 0.92 < len(holed.vertices) / len(clean.vertices) < 0.955
    assert (noisy.vertices - clean.vertices).std() == pytest.approx(0.02, rel=0.02)
    level = clean.vertices[clean.vertices[:, 0] < 0.8]
    np.testing.assert_allclose(level[:, 2], 0.0, atol=1e-9)


def test_a_world_compared_with_itself_has_every_surface(field):
    found = compared(field, field)
    assert found["found"] == found["surfaces"] == 5 and found["invented"] == 0
    np.testing.assert_allclose(found["shares"], 1.0, atol=1e-9)
    np.testing.assert_allclose(found["offsets"], 0.0, atol=1e-9)
    other = load_world("field.xml", mjcf=KINDS["rubble_field"](np.random.default_rng(1), rows=1))
    assert compared(field, other)["found"] < 5


@pytest.mark.slow
def test_a_small_run_counts_surfaces(tmp_path):
    folders = ["--workers", "0", "--out", str(tmp_path / "out"), "--results", str(tmp_path / "results")]
    assert scan.main(["--surfaces-only", "--trials", "1", *folders]) == 0
    (row,) = result(folders, "scan")["table"]
    assert row["surfaces"] == 14 and row["found"] >= 13


@pytest.mark.slow
def test_a_plan_made_in_a_scanned_world_is_carried_out_in_the_real_one(tmp_path):
    folders = ["--workers", "0", "--out", str(tmp_path / "out"), "--results", str(tmp_path / "results")]
    scan.main(["--trials", "1", *folders])
    (row,) = result(folders, "scan")["table"]
    assert row["planned"] == 1 and row["max_slip"] < 0.02
