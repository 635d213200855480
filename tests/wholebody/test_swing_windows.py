import numpy as np
import pytest

from toolkit.wholebody.swing import Window, blend


@pytest.mark.parametrize("kind", ["step", "bump"])
@pytest.mark.parametrize("window", [Window(0.0, 1.0), Window(0.05, 0.85), Window(0.6, 0.7)])
def test_derivatives_match_finite_differences(kind, window):
    function, h = getattr(window, kind), 1e-5
    for u in np.linspace(0.001, 0.999, 101):
        if min(abs(u - window.start), abs(u - window.end)) < 2 * h:
            continue  # the second derivative jumps at the ends of the window
        value, rate, second = function(u)
        # Central differences of a polynomial: the error is h^2 times a third derivative of some 1e4 at most.
        np.testing.assert_allclose(rate, (function(u + h)[0] - function(u - h)[0]) / (2 * h), atol=1e-4)
        np.testing.assert_allclose(second, (function(u + h)[1] - function(u - h)[1]) / (2 * h), atol=1e-1)


def test_step_rests_at_both_ends_and_never_turns_back():
    window = Window(0.2, 0.8)
    values = np.array([window.step(u)[0] for u in np.linspace(0, 1, 201)])
    assert values[0] == 0.0 and values[-1] == 1.0
    assert (np.diff(values) >= 0.0).all()
    assert window.step(0.2)[:2] == (0.0, 0.0)
    np.testing.assert_allclose(window.step(0.8)[:2], (1.0, 0.0), atol=1e-12)


def test_bump_returns_and_peaks_at_one():
    window = Window(0.1, 0.9)
    assert window.bump(0.0)[0] == window.bump(1.0)[0] == 0.0
    np.testing.assert_allclose(window.bump(0.5)[:2], (1.0, 0.0), atol=1e-12)


def test_arrays_and_numbers_agree():
    u = np.linspace(-0.2, 1.2, 29)
    window = Window(0.1, 0.7)
    np.testing.assert_allclose(window.value(u), [window.step(x)[0] for x in u], rtol=0, atol=0)


def test_blend_peaks_lower_than_minimum_jerk():
    assert blend(0.5)[1] < 30 / 16  # the peak rate of a pure minimum-jerk profile
