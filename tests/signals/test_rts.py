import numpy as np
import pytest

from cylinder_friction.signals.kalman import KalmanModel, constant_jerk, random_walk
from cylinder_friction.signals.kalman_passes import smooth_states
from cylinder_friction.signals.rts import RtsSmoother

STEP_S = 0.005


def least_squares(model: KalmanModel, measured: np.ndarray) -> np.ndarray:
    """Return the most likely states by solving for all of them at once: what the smoother must give."""
    rows, size = len(measured), len(model.transition)

    def root(covariance: np.ndarray) -> np.ndarray:
        return np.linalg.inv(np.linalg.cholesky(covariance))

    first, step = root(model.first_covariance), root(model.process_noise)
    design, target = [], []
    for row in range(rows):
        block = np.zeros((1, rows * size))
        block[0, row * size] = 1.0 / np.sqrt(model.measurement_noise)
        design.append(block)
        target.append([(measured[row] - measured[0]) / np.sqrt(model.measurement_noise)])
        block = np.zeros((size, rows * size))
        here = slice(row * size, (row + 1) * size)
        if row == 0:
            block[:, here] = first
        else:
            block[:, here] = step
            block[:, (row - 1) * size : row * size] = -step @ model.transition
        design.append(block)
        target.append(np.zeros(size))
    states = np.linalg.lstsq(np.concatenate(design), np.concatenate(target), rcond=None)[0].reshape(rows, size)
    states[:, 0] += measured[0]
    return states


@pytest.mark.parametrize("rows", [1, 2, 60])
def test_smoother_equals_least_squares(rows: int) -> None:
    measured = np.cumsum(np.random.default_rng(0).normal(size=rows))
    walk = random_walk(1.0, 2.0)
    np.testing.assert_allclose(smooth_states(walk, measured), least_squares(walk, measured), rtol=1e-6, atol=1e-6)
    motion = constant_jerk(50.0, 1e-3, 0.05)
    got, expected = smooth_states(motion, 1e-2 * measured), least_squares(motion, 1e-2 * measured)
    np.testing.assert_allclose(got, expected, rtol=1e-3, atol=1e-4)


def test_how_much_is_smoothed_depends_on_time_alone() -> None:
    """Noise that is twice as large leaves twice as much: nothing is known of any sensor's noise."""
    noise = np.random.default_rng(1).normal(0.0, 1.0, (3000, 3))
    smoother = RtsSmoother()
    for one, other in zip(
        vars(smoother.smooth(noise, STEP_S)).values(),
        vars(smoother.smooth(2.0**40 * noise, STEP_S)).values(),
        strict=True,
    ):
        np.testing.assert_array_equal(other, 2.0**40 * one)
    wave = np.sin(2.0 * np.pi * 2.0 * STEP_S / 4.0 * np.arange(8000))
    coarse, fine = smoother.motion(wave[::4], STEP_S)[0], smoother.motion(wave, STEP_S / 4.0)[0][::4]
    np.testing.assert_allclose(coarse[200:-200], fine[200:-200], atol=0.01 * np.ptp(fine))


def test_state_that_nothing_moves_is_refused() -> None:
    with pytest.raises(ValueError, match=r"have not settled after .* raise the process noise"):
        random_walk(0.0, 1.0).gains  # noqa: B018 - found when it is asked for
