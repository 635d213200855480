"""Results belong to what the code computes, not to what it says about itself."""

import pytest

from validation import machine
from validation.machine import code_fingerprint, source_fingerprint

SOURCE = '''"""Doc."""

def force(mass):
    """In N."""
    return 9.81 * mass  # on earth
'''


@pytest.fixture
def fingerprint(tmp_path, monkeypatch):
    monkeypatch.setattr(machine, "ROOT", tmp_path)

    def of(source: str, name: str = "module.py") -> str:
        path = tmp_path / name
        path.write_text(source)
        return source_fingerprint([path])

    return of


@pytest.mark.parametrize(("old", "new"), [("In N.", "Newton."), ("on earth", "here"), ("(mass):", "(mass):\n")])
def test_words_about_the_code_are_not_part_of_it(fingerprint, old, new):
    assert fingerprint(SOURCE) == fingerprint(SOURCE.replace(old, new))


@pytest.mark.parametrize(("old", "new"), [("9.81", "9.8"), ("force", "weight"), ("return ", "yield ")])
def test_statements_are(fingerprint, old, new):
    assert fingerprint(SOURCE) != fingerprint(SOURCE.replace(old, new))


def test_so_are_names_of_files(fingerprint):
    assert fingerprint(SOURCE) != fingerprint(SOURCE, "other.py")


def test_the_toolkit_has_one():
    assert len(code_fingerprint()) == 12
    assert set(code_fingerprint()) <= set("0123456789abcdef")
