"""Print the table of ``trends.cusum``: how the greatest statistic of a healthy year falls off, by simulation."""

from __future__ import annotations

import argparse

import numpy as np
from scipy import signal

from cylinder_friction.arrays import Array
from cylinder_friction_monitoring.trends import cusum as module
from cylinder_friction_monitoring.trends.cusum import cusum
from cylinder_friction_monitoring.trends.reference import fitted

YEAR = 365
TAIL, RARE = 0.05, 1.0 / 300.0
"""The exponential tail is that of the greatest 5 % of years, and holds no less than the year in 300 that was seen."""


def healthy_life(generator: np.random.Generator, count: int, phi: float) -> tuple[Array, dict[str, Array]]:
    """Return an indicator of sessions with a scatter of 2 %, and its covariates, whose effects are drawn."""

    def wander(keep: float, deviation: float) -> Array:
        noise = generator.normal(0.0, deviation * np.sqrt(1.0 - keep**2), count)
        noise[0] /= np.sqrt(1.0 - keep**2)
        return np.asarray(signal.lfilter([1.0], [1.0, -keep], noise))

    season = np.sin(2.0 * np.pi * (np.arange(count) / YEAR + generator.uniform()))
    covariates = {
        "oil_temperature_c": 38.0 + 7.0 * season + wander(0.5, 2.5),
        "pressure_bar": 30.0 + wander(0.3, 2.0),
        "speed_m_s": 0.03 + wander(0.3, 0.002),
        "load_n": 1000.0 + wander(0.3, 100.0),
    }
    sizes = (0.005, 0.02, 0.01, 0.3)
    scaled = zip(sizes, covariates.values(), (1.0, 1.0, 1e3, 1e-3), strict=True)
    effects = sum(generator.normal(0.0, size) * unit * (values - values.mean()) for size, values, unit in scaled)
    return 1.0 + effects + wander(phi, 0.02), covariates


def greatest(baseline: int, phi: float, years: int, seed: int) -> Array:
    """Return the greatest statistic of each simulated healthy year after a baseline, shape ``(years,)``."""
    found = []
    for number in range(years):
        values, covariates = healthy_life(np.random.default_rng([seed, number]), baseline + YEAR, phi)
        first = {name: each[:baseline] for name, each in covariates.items()}
        unknown = np.zeros(len(values))
        reference = fitted("friction_n", values[:baseline], unknown[:baseline], first, 1.0)
        design = reference.design(covariates)
        residuals = values - design @ reference.coefficients
        test = cusum(reference, residuals, unknown, design, baseline)
        found.append(max(test.upward[baseline:].max(), test.downward[baseline:].max()))
    return np.array(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--years", type=int, default=2000, help="simulated per entry")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    print("baseline, and for each autocorrelation where the tail begins and how it falls")
    for baseline in module._SESSIONS:
        cells = []
        for phi in module._AUTOCORRELATIONS:
            values = greatest(baseline, phi, arguments.years, arguments.seed)
            start = float(np.quantile(values, 1.0 - TAIL))
            falls = float(np.mean(values[values > start] - start))
            begins, rare = start + falls * np.log(TAIL), float(np.quantile(values, 1.0 - RARE))
            cells.append(f"{begins:5.2f} {max(falls, (rare - begins) / -np.log(RARE)):5.2f}")
        print(baseline, *cells, sep="  |  ", flush=True)


if __name__ == "__main__":
    main()
