"""
In the loop
===========

A trained estimator sample by sample, in Python and as C: newtons, bounds and flags,
also when a sensor fails.
"""

# %%
# An estimator
# ------------
#
# Trained here in short on the simulated bench; :doc:`own_cylinder` explains each
# line. After ``make reproduce``, take ``cf.load("models/hybrid")`` instead.

from pathlib import Path
from tempfile import mkdtemp
from time import perf_counter

import matplotlib.pyplot as plt
import numpy as np

import cylinder_friction as cf
from cylinder_friction.deployment.c_export.compiled import CompiledEstimator
from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.rig.campaign import CampaignPlan, campaign

folder = Path(mkdtemp())
cylinder = cf.Cylinder(
    bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0
)
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
for bench in campaign(
    cylinder,
    CampaignPlan(
        sessions_per_condition=3, recordings_per_session=2, duration_s=40.0
    ),
):
    if bench.metadata.condition in {"1", "3"}:
        bench.logger.to_csv(folder / f"{bench.metadata.name}.csv", index=False)
names = r"(?P<session>condition(?P<condition>[^_]+)_session\d+)_.*\.csv$"
recordings = cf.label(
    cf.read_recordings(
        folder / "*.csv", channels=channels, cylinder=cylinder, names=names
    ),
    cylinder,
)
train, test = cf.split(recordings)
offsets = cf.fit_offset_model(train, cylinder)
small = {
    "architecture": Architecture(layers=1, nodes=16),
    "plan": TrainingPlan(epochs=4),
}
hybrid = cf.HybridEstimator(cylinder, **small).fit(offsets.corrected(train))

# %%
# One sample at a time
# --------------------
#
# ``real_time()`` takes whatever the sensors give, NaN included, and never stops.
# ``warm_up`` states that the cylinder has stood like this for a while; without it
# the first seconds are flagged as warming up.

stream = hybrid.real_time()
samples = test[0].samples()
stream.warm_up(*samples[0])
begin = perf_counter()
estimates = [stream.step(*sample) for sample in samples]
each_us = 1e6 * (perf_counter() - begin) / len(samples)
print(f"{each_us:.0f} µs a sample, called from Python")
print(f"{1e6 * test[0].sample_time_s:.0f} µs between samples")
last = estimates[-1]
print(f"{last.friction_n:.0f} N, from {last.lower_n:.0f} to {last.upper_n:.0f} N")
print("flags:", Flag.names(last.flags))

# %%
# When a wire breaks
# ------------------
#
# For a second the first pressure is missing. The estimate goes on, its samples are
# flagged by name, and trust returns once the filters have forgotten the gap.

broken = samples.copy()
broken[2000:2200, 0] = np.nan
stream.reset()
stream.warm_up(*broken[0])
guarded = [stream.step(*sample) for sample in broken]
flagged = np.array(
    [
        bool(each.flags & (Flag.INVALID_PRESSURE_1 | Flag.RECOVERING))
        for each in guarded
    ]
)
print({name for each in guarded[2000:2600] for name in Flag.names(each.flags)})

rows = slice(1600, 3000)
time_s = test[0].column("time_s")[rows]
figure, axes = plt.subplots(figsize=(8, 4))
axes.fill_between(
    time_s,
    [each.lower_n for each in guarded[rows]],
    [each.upper_n for each in guarded[rows]],
    alpha=0.3,
    label="bounds",
)
axes.plot(
    time_s,
    [each.friction_n for each in estimates[rows]],
    color="black",
    label="with all sensors",
)
axes.plot(time_s, [each.friction_n for each in guarded[rows]], label="with the gap")
axes.fill_between(
    time_s,
    *axes.get_ylim(),
    where=flagged[rows],
    color="#D55E00",
    alpha=0.15,
    label="flagged",
)
axes.set(xlabel="time [s]", ylabel="friction [N]")
axes.legend(ncols=4)
figure.tight_layout()

# %%
# As C
# ----
#
# One source and one header, C99, nothing allocated. Compiled and called from Python
# it gives the same newtons, and so does the :doc:`FMU <../fmu>`.

exported = export_c(hybrid, folder / "press")
compiled = CompiledEstimator(exported).stream()
newtons, flags = compiled.run(samples)
difference_n = np.abs(newtons[:, 0] - hybrid.estimate(test[0])).max()
print(f"differs by at most {difference_n:.2g} N")
print(
    "".join(
        (folder / "press" / "friction.h").read_text().splitlines(keepends=True)[:12]
    )
)

# %%
# Fed forward
# -----------
#
# A position loop sets the reference of a pressure-difference loop. The estimate
# goes into that reference, unless a sensor fails or the filters still settle.

UNTRUSTED = ~int(Flag.OUTSIDE | Flag.OFFSET_UNKNOWN)


def force_reference_n(error_m, estimate, stiffness_n_m=6e6, share=0.5):
    fed_n = 0.0 if estimate.flags & UNTRUSTED else share * estimate.friction_n
    return stiffness_n_m * error_m + fed_n


print(f"{force_reference_n(2e-5, last):.0f} N for an error of 0.02 mm")

# %%
# :doc:`../in-the-loop` shows what this is worth, and when it does not pay;
# :doc:`../c` has a complete program for the controller's side.
