"""Impossible is a proof: worlds whose answer is known."""

from pathlib import Path

import numpy as np
import pytest

from tests.validation.test_programs import result
from toolkit.robot.loader import find_robots
from validation import proofs
from validation.proof_worlds import impassable, passable
from validation.proofs import NO_WAY, WAY, proof_trial

ROBOTS = Path("robots")
ROBOT = "humanoid30"


def records(kind, seeds):
    return [proof_trial(ROBOT, ROBOTS, seed, kind) for seed in seeds]


def test_worlds_are_those_of_their_seeds():
    for make in (passable, impassable):
        one, same, other = (make(np.random.default_rng(seed)) for seed in (1, 1, 2))
        assert one == same != other


def test_ways_are_never_called_impossible():
    assert ROBOT in find_robots()
    wrong = [each["reason"] for each in records(WAY, range(5000, 5024)) if each["proven"]]
    assert not wrong


def test_most_impossible_worlds_are_proven_so():
    found = records(NO_WAY, range(5000, 5015))
    unproven = [each["reason"] for each in found if not each["proven"]]
    assert len(unproven) <= 3, unproven
    assert all("nothing leads to the goal" in each["reason"] for each in found if each["proven"])


def test_the_program_tells_wrong_proofs_and_shares(tmp_path):
    folders = ["--workers", "0", "--out", str(tmp_path / "out"), "--results", str(tmp_path / "results")]
    assert proofs.main(["--worlds", "2", "--impossible", "2", *folders]) == 0
    found = result(folders, "proofs")
    assert len(found["trials"]) == 4
    assert {goal["result"] for goal in found["goals"]} == {"met"}
    lies = [each | {"proven": True} for each in found["trials"]]
    assert [goal.result for goal in proofs.goals_of(lies)] == ["not met", "met", "met"]


@pytest.mark.slow
def test_two_thousand_ways_are_never_called_impossible():
    wrong = [each["reason"] for each in records(WAY, range(10_000, 12_000)) if each["proven"]]
    assert not wrong
