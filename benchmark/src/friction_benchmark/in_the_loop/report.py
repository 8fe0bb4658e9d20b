"""Tables and the picture of the experiment in the loop."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from cylinder_friction.files.whole_files import write_text
from cylinder_friction.reporting.print_figure import draw, panels, png_bytes
from friction_benchmark.in_the_loop.closed_loop import FED, FRICTION, POSITION, REFERENCE
from friction_benchmark.in_the_loop.compensators import BY_TITLE
from friction_benchmark.in_the_loop.courses import MIDDLE_M, WARM_UP_S, course
from friction_benchmark.in_the_loop.experiment import NOMINAL, Bench, Settings, follow, ratio, session
from friction_benchmark.servo_rig.dynamics import TICK_S

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OVER = {
    "hybrid": ("none", "integral action", "LuGre of the reference", "low-pass", "Kalman observer", "true friction"),
    "integral and hybrid": ("integral action", "integral and low-pass"),
}
SHOWN = {"none": "#D55E00", "hybrid": "#0072B2"}
SPAN_S = (0.9, 10.0)  # Of the slow sine: two reversals
SENSOR_LAG_MS = 5  # Anti-aliasing filter 3 ms, logger 4 ms, of which half on average: nobody knows friction sooner


def write(folder: Path, bench: Bench, settings: Settings, tables: dict[str, pd.DataFrame]) -> str:
    """Write runs as CSV, settings and tables as JSON, and the picture; return the tables as text."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in tables.items():
        write_text(folder / f"{name}.csv", table.to_csv(index=False, float_format="%.6g"))
    shown = {"Settings after tuning": pd.Series(settings).to_frame("settings"), **summarise(**tables)}
    stated = {title: json.loads(table.reset_index().to_json(orient="records")) for title, table in shown.items()}
    write_text(folder / "in_the_loop.json", json.dumps({"cascade": bench.gains._asdict(), **stated}, indent=1) + "\n")
    (folder / "in_the_loop.png").write_bytes(png_bytes(draw(picture, bench, settings)))
    with pd.option_context("display.width", 250, "display.max_colwidth", None, "display.precision", 3):
        return "\n\n".join(f"{title}\n{table.to_string()}" for title, table in shown.items())


def summarise(runs: pd.DataFrame, shares: pd.DataFrame, lags: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return what each table shows, by its title."""
    titles = list(dict.fromkeys(runs["compensator"]))
    parts = [part for name in ("course", "condition") for part in runs.groupby(name, sort=False)] + [("all", runs)]
    over_none = {key: {title: f"{ratio(part, title, 'none')[0]:.2f}" for title in titles} for key, part in parts}
    intervals = {"95 %": {title: "{1:.2f} to {2:.2f}".format(*ratio(runs, title, "none")) for title in titles}}
    measured = runs.drop(columns=["training", "session", "share", "lag_ms"]).groupby("compensator")
    by_share = shares.groupby(["compensator", "condition", "share"], sort=False)
    text = by_share.apply(lambda part: f"{part['rms_um'].mean():.0f}{'*' * int(part['cycles'].any())}")
    return {
        "Mean over sessions, courses and conditions": measured.mean(numeric_only=True).loc[titles],
        "RMS error over that of none": pd.DataFrame(over_none | intervals),
        **{f"RMS error of {title} over that of others, 95 %": against(runs, title) for title in OVER},
        "RMS error in the triangle by share [um]; * a session cycles": text.unstack(),
        "RMS error by lag of what is fed forward [um]": lags.pivot_table("rms_um", ["course", "compensator"], "lag_ms"),
        "RMS error at reversals [um], nominal": at_reversals(runs, lags),
    }


def against(runs: pd.DataFrame, title: str) -> pd.DataFrame:
    """Return a compensator's error over that of others, with the interval over trainings and sessions, as text."""
    grouped = [*runs.groupby(["condition", "course"], sort=False), (("all",), runs)]
    found = {
        over: {", ".join(key): "{:.2f} ({:.2f} to {:.2f})".format(*ratio(part, title, over)) for key, part in grouped}
        for over in OVER[title]
    }
    return pd.DataFrame(found)


def at_reversals(runs: pd.DataFrame, lags: pd.DataFrame) -> pd.DataFrame:
    """Return errors at reversals without and with the hybrid, with true friction, and with it as late as sensors are.

    Late true friction is what the best estimator behind these sensors could feed forward.
    """
    found = lags[lags["lag_ms"].isin((0, SENSOR_LAG_MS)) & (lags["compensator"] == "true friction")]
    late = found.pivot_table("reversal_um", "course", "lag_ms")
    late.columns = pd.Index(["true friction", f"true friction, {SENSOR_LAG_MS} ms late"])
    nominal = runs[(runs["condition"] == NOMINAL) & runs["compensator"].isin(("none", "low-pass", "hybrid"))]
    return nominal.pivot_table("reversal_um", "course", "compensator").join(late)


def picture(bench: Bench, settings: Settings) -> "Figure":
    """Draw position, error and friction over two reversals of the slow sine, with and without the hybrid."""
    figure, (position, error, friction) = panels(3, 1, 8.0, 7.0)
    rows = slice(*(round((WARM_UP_S + each) / TICK_S) for each in SPAN_S))
    for title, colour in SHOWN.items():
        way = BY_TITLE[title].tuned(bench.gains, settings[title])
        trace = follow(bench, session(NOMINAL, 1, 0, 0), way, course("slow sine"), 0, 0, 0)[rows]
        time_s, words = TICK_S * np.arange(len(trace)), "without" if title == "none" else f"with the {title}"
        error_m = trace[:, REFERENCE] - trace[:, POSITION]
        position.plot(time_s, 1e3 * (trace[:, POSITION] - MIDDLE_M), color=colour, label=words)
        error.plot(time_s, 1e6 * error_m, color=colour, label=words)
    position.plot(time_s, 1e3 * (trace[:, REFERENCE] - MIDDLE_M), color="black", linestyle=":", label="reference")
    friction.plot(time_s, trace[:, FRICTION], color="black", label="true friction")
    friction.plot(time_s, trace[:, FED], color=colour, label="fed forward")
    labels = "position [mm]", "tracking error [µm]", "friction [N]"
    for axis, label in zip((position, error, friction), labels, strict=True):
        axis.set(ylabel=label)
        axis.legend(ncols=3)
    friction.set(xlabel="time [s]")
    return figure
