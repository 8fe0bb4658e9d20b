"""
Your own cylinder
=================

From several sessions of logs to an estimator trained on them, compared with others
on sessions that no training has seen.
"""

# %%
# Sessions
# --------
#
# A *condition* is an operating condition, such as a load; a *session* is a stretch
# of work with one calibration of the sensors. Files' names state both. Here the
# simulated bench writes three sessions in each of two conditions; put your own
# files in their place.

from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt

import cylinder_friction as cf
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.rig.campaign import CampaignPlan, campaign

folder = Path(mkdtemp())
cylinder = cf.Cylinder(
    bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0
)
plan = CampaignPlan(
    sessions_per_condition=3, recordings_per_session=2, duration_s=40.0
)
truth_n = {}
for bench in campaign(cylinder, plan):
    if bench.metadata.condition in {"1", "3"}:
        bench.logger.to_csv(folder / f"{bench.metadata.name}.csv", index=False)
        truth_n[bench.metadata.name] = bench.truth["friction_n"].to_numpy()
print(*sorted(path.name for path in folder.glob("*.csv"))[:3], "...", sep="\n")

# %%
# Reading and labelling
# ---------------------
#
# The mapping states each channel's unit and how accurate its sensor is. Every file
# is checked and brought to one schema: SI units, gauge pressures, one constant
# rate.

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
names = r"(?P<session>condition(?P<condition>[^_]+)_session\d+)_.*\.csv$"
recordings = cf.read_recordings(
    folder / "*.csv", channels=channels, cylinder=cylinder, names=names
)
labelled = cf.label(recordings, cylinder)

# %%
# Friction cannot be measured in a moving cylinder. The label is what the equation
# of motion gives, off line: P1·A1 − P2·A2 − m·a − load. Its largest error is the
# zero of the pressure sensors. Strokes in both directions, of several sessions,
# determine it:

train, test = cf.split(labelled)
offsets = cf.fit_offset_model(train, cylinder)
train, test = offsets.corrected(train), offsets.corrected(test)
print("held out:", sorted({recording.metadata.session for recording in test}))

# %%
# Estimators
# ----------
#
# Two that are hard to beat because they know the equation of motion, and the
# classical friction model. The hybrid is trained for few epochs here, so that this
# page is built in a minute.

small = {
    "architecture": Architecture(layers=1, nodes=16),
    "plan": TrainingPlan(epochs=4),
}
estimators = {
    "LuGre": cf.LugreEstimator(cylinder).fit(
        [r for r in train if r.metadata.condition == "1"]
    ),
    "ridge on lagged samples": cf.RidgeEstimator().fit(train),
    "hybrid, four epochs": cf.HybridEstimator(cylinder, **small).fit(train),
}
comparison = cf.compare(estimators, test)
print(comparison)

# %%
# LuGre was identified in condition 1 and knows nothing of pressure, so it fails in
# condition 3. Percentages are of the mean absolute label; the intervals on the
# report of the whole pipeline know that sessions differ.

recording = next(each for each in test if each.metadata.condition == "3")
rows = slice(2000, 5000)
time_s = recording.column("time_s")[rows]
figure, axes = plt.subplots(figsize=(8, 4))
axes.plot(
    time_s,
    truth_n[recording.name][rows],
    color="black",
    label="true friction, which no sensor sees",
)
for name in ("LuGre", "hybrid, four epochs"):
    axes.plot(time_s, estimators[name].estimate(recording)[rows], label=name)
axes.set(xlabel="time [s]", ylabel="friction [N]")
axes.legend()
figure.tight_layout()

# %%
# Saving and loading
# ------------------
#
# JSON and ONNX, no pickle. :doc:`in_the_loop` runs such a folder sample by sample
# and as C. The whole pipeline, with search, baselines, intervals, MLflow and a
# registered model, is ``dvc repro``: see :doc:`../own-recordings`.

estimators["hybrid, four epochs"].save(folder / "hybrid")
print(*sorted(path.name for path in (folder / "hybrid").iterdir()))
