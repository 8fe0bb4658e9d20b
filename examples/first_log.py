"""
A first log
===========

From a logger's file to friction in newtons with bounds, and to a Stribeck curve.
You need the file and four dimensions of the cylinder; no pipeline, no training.
"""

# %%
# A log to work with
# ------------------
#
# The simulated test bench writes one as a logger would: a CSV file in s, bar and
# mm. With a log of your own, leave this part out.

from pathlib import Path
from tempfile import mkdtemp
from textwrap import fill

import matplotlib.pyplot as plt
import pandas as pd

import cylinder_friction as cf
from cylinder_friction.rig.campaign import CampaignPlan, campaign

folder = Path(mkdtemp())
cylinder = cf.Cylinder(
    bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0
)
bench = next(
    campaign(
        cylinder, CampaignPlan(sessions_per_condition=1, recordings_per_session=1)
    )
)
bench.logger.round(3).to_csv(folder / "monday.csv", index=False)
print((folder / "monday.csv").read_text()[:200])

# %%
# Friction
# --------
#
# ``estimate_logs`` does what the command ``cylinder-friction estimate monday.csv``
# does. Nobody has stated which column is which, so it guesses from names and units,
# and a warning states each guess: read it before you believe a number. A mapping
# replaces the guess and can state how accurate the sensors are; with it come
# bounds.

pressure = {
    "unit": "bar",
    "sensor": {
        "range": [0, 250],
        "unit": "bar",
        "accuracy_percent": 0.05,
        "zero_uncertainty": 0.03,
        "zeroed": "each session",
    },
}
channels = {
    "time_s": {"channel": "Time [s]", "unit": "s"},
    "pressure_1_pa": {"channel": "P1 [bar]", **pressure},
    "pressure_2_pa": {"channel": "P2 [bar]", **pressure},
    "position_m": {"channel": "Position [mm]", "unit": "mm"},
}
result = cf.estimate_logs(
    folder / "monday.csv", cylinder, folder / "friction", channels=channels
)
print(f"{result.recordings[0].friction_n:.0f} N: half of extending less retracting")
print(fill(f"Bounds: {result.bounds}", 80))

# %%
# The folder holds a row per sample, a page to open in a browser, and
# ``summary.json``.

print(
    *sorted(
        path.name for path in (folder / "friction").rglob("*") if path.is_file()
    ),
    sep="\n",
)
friction = pd.read_parquet(folder / "friction" / "monday.parquet")
friction.head()

# %%
# Over time. Friction is positive when it opposes extension. It is drawn where the
# force balance is friction alone: not at the end stops, where the wall carries part
# of the force. The label looks ahead; in real time an estimator does not.

shown = friction[friction["time_s"].between(20, 40)]
usable = shown["friction_n"].where(shown["usable"])
figure, (top, bottom) = plt.subplots(
    2, 1, sharex=True, figsize=(8, 5), height_ratios=(1, 2)
)
top.plot(shown["time_s"], 1e3 * shown["position_m"], color="#555555")
top.set(ylabel="position [mm]")
bottom.fill_between(
    shown["time_s"], shown["lower_n"], shown["upper_n"], alpha=0.3, label="bounds"
)
bottom.plot(shown["time_s"], usable, label="friction")
bottom.set(xlabel="time [s]", ylabel="friction [N]")
bottom.legend()
figure.tight_layout()

# %%
# A bench knows what no logger sees: its true friction. How far off is the label?

truth_n = bench.truth["friction_n"].to_numpy()
rows = friction["usable"].to_numpy()
error_n = (friction["friction_n"].to_numpy() - truth_n[: len(friction)])[rows]
constant_n = error_n.mean()
print(f"mean |friction|       {abs(truth_n).mean():.1f} N")
print(f"mean absolute error   {abs(error_n).mean():.1f} N")
print(f"its constant part     {constant_n:.1f} N")
print(f"without that          {abs(error_n - constant_n).mean():.1f} N")
print(fill(f"Offset of the sensors' zeros: {result.offsets[0].words}", 80))

# %%
# Nearly all of the error is one constant: what the pressure sensors read at
# nothing, 0.05 bar or so. A single session cannot determine it, and the bounds are
# as wide as they are because of it. :doc:`own_cylinder` takes it off.

# %%
# The Stribeck curve
# ------------------
#
# ``identify_logs`` makes a friction model of the same files: points of steady
# sliding with their intervals, and LuGre where the motion determines it. A single
# recording of a minute does not determine much, and the result states what is
# missing.

models = cf.identify_logs(
    folder / "monday.csv",
    cylinder,
    folder / "models",
    channels=channels,
    generations=10,
)
curve = models.curves[0]
figure, axes = plt.subplots(figsize=(8, 3.5))
for direction, name in ((1.0, "extending"), (-1.0, "retracting")):
    points = [point for point in curve.points if point.velocity_m_s * direction > 0]
    axes.errorbar(
        [1e3 * abs(point.velocity_m_s) for point in points],
        [abs(point.friction_n) for point in points],
        yerr=[
            point.half_width_n if point.half_width_n == point.half_width_n else 0.0
            for point in points
        ],
        fmt="o",
        label=name,
    )
axes.set(xlabel="speed [mm/s]", ylabel="|friction| [N]", ylim=(0, None))
axes.legend()
figure.tight_layout()

# %%
# What comes next: several files in one call determine the sensors' zeros and the
# model better (:doc:`own_cylinder`), and an estimator that learns from them runs in
# real time (:doc:`in_the_loop`). The guides :doc:`../estimate` and
# :doc:`../identify` state what every number is.
