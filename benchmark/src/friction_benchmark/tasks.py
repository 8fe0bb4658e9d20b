"""The tasks of the benchmark, in the order of its tables."""

from cylinder_friction.recordings.columns import OIL_TEMPERATURE, SAMPLE_COLUMNS
from friction_benchmark.cases import LEVELS, Task

_FORECASTS = tuple(
    Task(
        name=f"forecast_{milliseconds}ms",
        title=f"Forecast {milliseconds} ms ahead",
        explanation=f"Friction {milliseconds} ms from now, from pressures and position until now; for the baseline it "
        "stays as it is.",
        inputs=SAMPLE_COLUMNS,
        baseline="hold",
        ahead_s=milliseconds / 1e3,
        tuned_as="forecast_100ms",
    )
    for milliseconds in (25, 50, 100, 250)
)

TASKS: tuple[Task, ...] = (
    Task(
        "identity",
        "Identity, the paper's task",
        "Friction now, from both pressures and the position: algebra on the inputs gives nearly the label, so this "
        "measures filtering more than learning.",
        SAMPLE_COLUMNS,
        baseline="low_pass",
    ),
    Task(
        "pressure_free",
        "Without pressures",
        "Friction now, from the position and the oil's temperature alone: no algebra leads to it, so that models of "
        "friction, given or learnt, are needed.",
        ("position_m", OIL_TEMPERATURE),
        baseline="constant_by_direction",
    ),
    Task(
        "pressure_level",
        "Pressure level only",
        "As without pressures, but a slow logger gives the mean of both pressures over each second once it is over, "
        "which shows how hard the seals are pressed.",
        ("position_m", OIL_TEMPERATURE, *LEVELS),
        baseline="constant_by_direction",
    ),
    *_FORECASTS,
    Task(
        "sensor_drift",
        "Sensor offset and drift",
        "Friction now, from pressure sensors that each have an unknown offset within their data sheet's ±1.25 bar and "
        "drift: plain algebra carries an error of the size of friction.",
        SAMPLE_COLUMNS,
        baseline="constant_by_direction",
        reference="truth",
        drifts=True,
        needs_truth=True,
    ),
    Task(
        "external_load",
        "Unknown external load",
        "Friction now, while a load that nobody measures works on the rod, so that pressures give the sum of the two; "
        "a load cell was there for training alone.",
        SAMPLE_COLUMNS,
        baseline="constant_by_direction",
        reference="truth",
        campaign="loaded",
        needs_truth=True,
    ),
)
NAMES = tuple(task.name for task in TASKS)


def task_named(name: str) -> Task:
    """Return a task; raises ``ValueError`` if there is none of this name."""
    for task in TASKS:
        if task.name == name:
            return task
    raise ValueError(f"no task {name!r}; expected one of {', '.join(NAMES)}")
