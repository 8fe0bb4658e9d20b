"""Every sentence on bounds, loads, zeros and sensors that commands print, counted against what was simulated.

    python performance/claims.py sentences [--quick] [--seeds N]

``SENTENCES`` lists them by the place in the code that makes them: a pattern for what is printed, and when it is true.
Campaigns of the simulated rig are written as logs, and `estimate`, `inspect`, `identify` and `adapt` read them. A line
that speaks of these things and matches no pattern counts as false, so that a new sentence has to enter the list.
"""

import contextlib
import io
import math
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from zero_sweep import RIG, Kind, raw_recordings

from cylinder_friction.arrays import Array
from cylinder_friction.commands.cli import main as command
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.identified_model import STEADY_VARIATION
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.friction_models.identification.steady_points import PRESLIDING_TRAVEL_M
from cylinder_friction.labelling.label import label
from cylinder_friction.labelling.sliding_blocks import OffsetPlan, up_and_down
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.rig.campaign import LOSS_SPEED_M_S, SPECIMENS, RigRecording, campaign
from cylinder_friction.rig.campaign_plan import CampaignPlan
from cylinder_friction.rig.friction import REFERENCE_C
from cylinder_friction.rig.parameters import FrictionParameters, RigParameters, default_rig
from cylinder_friction.rig.sensors import write_logger_csv
from cylinder_friction.rig.variation import draw_wide_rig
from cylinder_friction.signals.motion import steady_rows, travel_since_stop

MAPPING = Path(__file__).parents[1] / "conf/ingest/rig.yaml"
TOPICS = re.compile(r"bound|\bload|zero|sensor|asymmetr|port|±", re.IGNORECASE)
SLIDING_M_S = 0.02
"""Faster, friction is Coulomb and viscous friction alone [m/s]."""
SLOWEST_M_S = 0.004
"""What `inspect` counts as sliding, with this rig's position sensor: the fastest of 3 to 4 mm/s [m/s]."""
ALIKE, FEWEST = 0.12, 5
"""Logarithm of the ratio within which velocities are alike, and fewest recordings that show friction at one."""
WEIGHT_N = 4218.0
SCALED = "pressure-scaled"
"""In the title of the model whose parameters are those at zero pressure."""
LOAD = r"the load is (-?[\d.]+)(?: to (-?[\d.]+))? N ± (\d+) N"


@dataclass(frozen=True)
class World:
    """What is simulated, and what is stated of it."""

    zero_bar: float = 0.15
    stated_bar: float = 0.15
    options: Mapping[str, Any] = field(default_factory=dict)  # Fields of ``CampaignPlan``
    zeroed: bool = True  # Whether sensors are stated to be zeroed before each session
    load: str = "none"  # As ``--load`` states it
    noisy_position: bool = False
    identifies: bool = False  # Whether `identify` reads condition 1 too
    mass_stated: float = 1.0  # Moving mass as stated, over the true one
    line_stated: float = (
        0.0  # Loss of the line as stated, with the default uncertainty, over the true one; 0 if it is not stated
    )
    specimen: str = "wide"  # As in ``CampaignPlan``, or "free of pressure"

    @property
    def weight_n(self) -> float:
        return float(self.options.get("weight_n", 0.0))

    @property
    def line_bar(self) -> float:
        return float(self.options.get("line_loss_bar", 0.0))


WEIGHT = {"weight_n": WEIGHT_N}
WORLDS = {
    "zeros as stated": World(identifies=True),
    "zeros worse than stated": World(0.6, 0.05),
    "asymmetry by condition": World(options={"asymmetry_by_condition": 0.1}),
    "asymmetry by session": World(options={"asymmetry_sd": 0.02}),
    "zeros kept": World(options={"zeros": "kept"}, zeroed=False),
    "zeros drift": World(options={"zeros": "drifting"}, zeroed=False),
    "large zeros kept": World(1.25, 1.25, options={"zeros": "kept"}, zeroed=False, identifies=True),
    "zeros kept and drift": World(options={"zeros": "kept and drifting"}, zeroed=False),
    "weight that nobody states": World(options=WEIGHT),
    "weight by position": World(options=WEIGHT, load="position", identifies=True),
    "weighed load": World(options=WEIGHT, load=f"{WEIGHT_N + 23.0:g}+-40"),
    "line": World(options={"line_loss_bar": 6.0}, identifies=True),
    "line, weight by position": World(options={"line_loss_bar": 3.0, **WEIGHT}, load="position"),
    "noisy position": World(noisy_position=True),
    "100 Hz": World(options={"sample_time_s": 0.01}),
}
ONLY_INTERVALS = {
    "line stated 20 % too small": World(options={"line_loss_bar": 3.0}, line_stated=0.8),
    "line stated 20 % too large": World(options={"line_loss_bar": 3.0}, line_stated=1.2),
} | {
    name: World(0.05, 0.05, specimen=specimen)
    for name, specimen in (("default rig", "default"), ("friction free of pressure", "free of pressure"))
}
"""Worlds whose intervals are counted, but no sentences."""


def free_of_pressure(rig: RigParameters, generator: np.random.Generator) -> RigParameters:
    """Draw any rig of this size, whose seals the pressure does not press."""
    drawn = draw_wide_rig(rig, generator)
    return replace(drawn, friction=replace(drawn.friction, piston_seal_n=0.0, rod_seal_n=0.0))


SPECIMENS["free of pressure"] = free_of_pressure


@dataclass(frozen=True)
class Simulated:
    """A campaign, and what is true of it."""

    world: World
    cylinder: Cylinder
    friction: FrictionParameters
    recorded: tuple[RigRecording, ...]

    @property
    def beside(self) -> bool:
        """Whether bounds are said to be too narrow: zeros worse than stated, a line that is named, a noted position."""
        return self.world.zero_bar > self.world.stated_bar or bool(self.world.line_bar) or self.world.noisy_position

    def own(self, name: str) -> list[RigRecording]:
        """Return the recordings whose name begins so."""
        return [each for each in self.recorded if each.metadata.name.startswith(name)]

    def sliding(self, name: str) -> pd.DataFrame:
        """Return rows that slide: direction, dry friction against motion, also at zero pressure, viscous [N s/m]."""
        tables = list[pd.DataFrame]()
        for each in self.own(name):
            truth, constants = each.truth, self.friction
            warm_c = truth["oil_temperature_c"].to_numpy()
            thin = np.exp(-constants.viscosity_temperature_1_k * (warm_c - REFERENCE_C))
            viscous = constants.viscous_n_s_m * thin
            speed = truth["velocity_m_s"].to_numpy()
            dry = np.abs(truth["friction_n"].to_numpy()) - viscous * np.abs(speed)
            higher, rod = (
                1e-5 * np.maximum(truth[columns].to_numpy().max(axis=1), 0.0)
                for columns in (["pressure_1_pa", "pressure_2_pa"], ["pressure_2_pa"])
            )
            seals_n = constants.piston_seal_n * higher**0.8 + constants.rod_seal_n * rod**0.7
            free_n = constants.coulomb_n * (1.0 - constants.coulomb_temperature_1_k * (warm_c - REFERENCE_C))
            columns = {"dry_n": dry, "dry_at_zero_n": dry * free_n / (free_n + seals_n), "viscous": viscous}
            table = pd.DataFrame({"direction": np.sign(speed), **columns})
            tables.append(table.loc[np.abs(speed) > SLIDING_M_S])
        return pd.DataFrame(pd.concat(tables))

    def zero_n(self, name: str) -> float:
        """Return the offset of the force that the logged pressures give, less the true one [N].

        It is the median of rows, as the logger's filter lags where pressure changes; with a line, of resting rows.
        """
        areas = self.cylinder.piston_area_m2, -self.cylinder.annulus_area_m2
        off = []
        for each in self.own(name):
            still = np.abs(each.truth["velocity_m_s"].to_numpy()) < 1e-4
            read_n = np.zeros(len(still))
            for place, (column, area) in enumerate(zip(("pressure_1_pa", "pressure_2_pa"), areas, strict=True)):
                read_n += area * (1e5 * each.logger.iloc[:, 1 + place].to_numpy() - each.truth[column].to_numpy())
            off.append(float(np.median(read_n[still] if self.world.line_bar else read_n)))
        return float(np.mean(off)) if off else math.nan

    def friction_at(self, name: str, velocity_m_s: float) -> float:
        """Return the median of true friction while sliding at about this velocity [N]; NaN if few recordings do."""
        found = list[Array]()
        for each in self.own(name):
            own_m_s = each.truth["velocity_m_s"].to_numpy()
            step_s = each.metadata.sample_time_s
            rows = steady_rows(own_m_s, step_s, 1e-3, STEADY_VARIATION)
            rows &= travel_since_stop(own_m_s, 1e-3, step_s) > PRESLIDING_TRAVEL_M
            rows &= np.abs(np.log(np.maximum(own_m_s / velocity_m_s, 1e-9))) < ALIKE
            found += [each.truth["friction_n"].to_numpy()[rows]] * bool(rows.any())
        return float(np.median(np.concatenate(found))) if len(found) >= FEWEST else math.nan

    def uneven(self, name: str) -> float:
        """Return half the difference of dry friction retracting and extending over its mean."""
        ways = self.sliding(name).groupby("direction")["dry_n"].mean()
        if len(ways) < 2:  # One direction alone: that of the whole rig
            return self.uneven("condition")
        return float((ways[-1.0] - ways[1.0]) / (ways[-1.0] + ways[1.0]))

    def asymmetric_n(self, name: str) -> float:
        """Return half the difference of dry friction retracting and extending [N], without its sign."""
        return abs(self.uneven(name)) * float(self.sliding(name)["dry_n"].mean())

    def uneven_n(self, name: str) -> float:
        """Return what does not turn with the direction: weight, zeros, and half the sum of friction up and down [N]."""
        truth = pd.concat([each.truth for each in self.own(name)])
        x_m, v_m_s, f_n = (truth[column].to_numpy() for column in ("position_m", "velocity_m_s", "friction_n"))
        even_n, _ = up_and_down(x_m, v_m_s, f_n, np.ones(len(truth), dtype=np.bool_), OffsetPlan().slowest_m_s)
        return self.world.weight_n + self.zero_n(name) + even_n

    def mean_holds(self, name: str, given: tuple[float, ...]) -> bool:
        """Return whether the mean friction of both directions, and the weight nobody took off, lies within ±."""
        held = True
        for sign, mean_n, half_n in ((1.0, *given[:2]), (-1.0, *given[2:])):
            truths = [each.truth for each in self.own(name)]
            own = [each["friction_n"][sign * each["velocity_m_s"] > SLOWEST_M_S] for each in truths]
            left_n = self.world.weight_n if self.world.load == "none" else 0.0
            held &= abs(sign * (float(pd.concat(own).mean()) + left_n) - mean_n) <= half_n
        return held

    def lost_bar(self, speed_m_s: float, area: float = 1.0) -> float:
        """Return what a line loses [bar]; ``area`` is that of its side over the piston side's."""
        share = area * speed_m_s / LOSS_SPEED_M_S
        return self.world.line_bar * share * (0.2 + 0.8 * share)

    def grown_n(self, speed_m_s: float) -> float:
        """Return viscous friction and the lines' losses at a speed [N]."""
        areas = (self.cylinder.piston_area_m2, self.cylinder.annulus_area_m2)
        lost_n = sum(1e5 * area * self.lost_bar(speed_m_s, area / areas[0]) for area in areas)
        return float(self.sliding("condition")["viscous"].mean()) * speed_m_s + lost_n

    def parameter(self, name: str, condition: str = "condition1", dry: str = "dry_n") -> tuple[float, float] | None:
        """Return least and greatest true value of a parameter in the sessions of a condition; None if there is none."""
        sessions = sorted({each.metadata.session for each in self.own(condition)})
        slid = [table for table in map(self.sliding, sessions) if table["direction"].nunique() > 1]
        ways = [each.groupby("direction")[dry].mean() for each in slid]
        values = {
            "viscous_n_s_m": [float(each["viscous"].mean()) for each in slid],
            "retract_ratio": [float(each[-1.0] / each[1.0]) for each in ways],
            "coulomb_n": [float(each[1.0]) for each in ways],
        }
        return (min(values[name]), max(values[name])) if values.get(name) else None


Truth = Callable[[re.Match[str], Simulated, str], bool]
"""Whether a sentence is true, from its match, what was simulated, and the recording or session that it is about."""


def near(given: float, true: float, factor: float) -> bool:
    return min(given / true, true / given) * factor >= 1.0


def odd_zeros(_: re.Match[str], made: Simulated, name: str) -> bool:
    """Something is uneven beyond what is stated: a load, a line, asymmetry above 15 %, or a zero worse than stated."""
    return bool(made.world.weight_n) or made.beside or abs(made.uneven(name)) > 0.15


def holds(interval: tuple[float, float], true: tuple[float, float] | None) -> bool:
    return true is None or (interval[0] <= true[1] and true[0] <= interval[1])


LOSS = "labelling/apparent_loss.py sentence"
GROWS = r"^\w+ +([\d.e+]+) N of the force against motion at ([\d.]+) m/s grow with speed: .* such as ([\d.]+) bar"


SENTENCES: tuple[tuple[str, str, Truth], ...] = (
    (
        LOSS,
        GROWS,
        lambda m, made, _: (
            near(float(m[1]), made.grown_n(float(m[2])), 1.25) and made.lost_bar(float(m[2])) <= 1.25 * float(m[3])
        ),
    ),
    (
        "labelling/apparent_loss.py missing_loss",
        r"what you stated explains ([\d.]+) of about ([\d.]+) bar \(piston side\) at ([\d.]+) m/s",
        lambda m, made, _: made.world.line_stated < 1.0 and near(float(m[2]), made.lost_bar(float(m[3])), 1.35),
    ),
    (
        "labelling/known_offset.py, value of strokes",
        r"(-?[\d.]+) ± ([\d.]+) N +strokes in both directions",
        lambda m, made, name: abs(made.zero_n(name) - float(m[1])) <= float(m[2]),
    ),
    (
        "labelling/known_offset.py too_uneven",
        r"does not turn with the direction, (?:where|while) the stated zeros and an asymmetry of friction explain",
        odd_zeros,
    ),
    (
        "labelling/known_offset.py, session to session",
        r"differs from session to session by ± \d+ N, while the stated zeros explain",
        lambda m, made, name: odd_zeros(m, made, name) or "asymmetry_sd" in made.world.options,
    ),
    (
        "labelling/known_offset.py undetermined, expected",
        r"differs from its mean by (\d+) %, where \d+ % is expected",
        lambda m, made, name: odd_zeros(m, made, name) or near(0.01 * float(m[1]), abs(made.uneven(name)), 1.5),
    ),
    (
        "labelling/known_offset.py, value as stated",
        r"within ± ([\d.]+) N +stated uncertainty",
        lambda m, made, name: made.beside or abs(made.zero_n(name)) <= float(m[1]),
    ),
    (
        "estimation/results.py load_left; evaluation/inspection",
        r"holds a load, a sensor's zero or the loss of a line, of about (-?\d+)"
        r"|(-?\d+)[.\d]* N does not turn with the direction;",
        lambda m, made, name: (
            made.world.noisy_position
            or bool(made.world.line_bar)
            or near(float(m[1] or m[2]) or 1e-9, made.uneven_n(name), 1.25)
        ),
    ),
    (
        "labelling/load.py sentence, load",
        LOAD,
        lambda m, made, _: abs(0.5 * (float(m[1]) + float(m[2] or m[1])) - made.world.weight_n) <= float(m[3]),
    ),
    (
        "labelling/load.py sentence, asymmetry",
        r"± (\d+) N of that are assumed, not observed, for asymmetric friction",
        lambda m, made, name: made.asymmetric_n(name) <= float(m[1]),
    ),
    (
        "commands/adapt.py offset and load",
        r"of the sensors' zeros: (?:not )?identified|; an error of the load \(.*\) comes on top",
        lambda *_: True,  # What was done, and what bounds leave out; they are counted as "adapted bounds hold"
    ),
    (
        "reporting/inspection/text.py STILL_IN",
        r"^means above hold these offsets",
        lambda *_: True,  # What the command does
    ),
    (
        "recordings/checks/limits.py in_words",
        r"(-?[\d.]+) ± ([\d.]+) N, as stated",
        lambda m, made, _: abs(float(m[1]) - made.world.weight_n) <= float(m[2]),
    ),
    (
        "recordings/checks/recording_checks.py",
        r"position_m (?:has|is disturbed|jumps|holds)",
        lambda _m, made, _: made.world.noisy_position,
    ),
    (
        "recordings/checks/recording_checks.py pressure_stuck",
        r"the sensor is stuck or at the end of its range",
        lambda _m, made, _: bool(made.world.line_bar),  # A transmitter at the valve ends at its lowest value
    ),
    (
        "recordings/checks/plausibility.py _opposing",
        r"so there is (?:another|a) load of about (-?[\d.e+]+) N, or a pressure sensor's zero is off",
        odd_zeros,
    ),
    (
        "evaluation/inspection/sliding_friction.py, refused",
        r"friction would push the piston .*the position counts the other way or is disturbed, .* or a load acts",
        lambda _m, made, _: made.world.noisy_position or bool(made.world.weight_n),
    ),
    (
        "evaluation/friction_levels.py in_words",
        r"recordings agree within their scatter|it differs from the others' for",
        lambda *_: True,  # It compares what was measured
    ),
    (
        "estimation/from_logs.py bounds",
        r"hold friction in about 95 % of the rows",
        lambda *_: True,  # Counted by recording as "bounds hold"
    ),
    (
        "evaluation/inspection/sliding_friction.py",
        r"mean of all sliding rows: (-?[\d.]+) ± ([\d.]+) N extending, (-?[\d.]+) ± ([\d.]+) N retracting \(95 %\)",
        lambda m, made, name: made.beside or made.mean_holds(name, tuple(map(float, m.groups()))),
    ),
    (
        "realtime/model.py and trained_for.py in_words",
        r"bounds +they hold \w+ .*with probability [\d.]+|^for +a cylinder",
        lambda *_: True,  # Counted as "adapted bounds hold"
    ),
    (
        "estimation/identified_model.py, interval of a parameter",
        r"^  (viscous_n_s_m|retract_ratio|coulomb_n) +[\d.e+-]+ +\S* *\S* +([\d.e+-]+) to ([\d.e+-]+), ± \d+ %",
        lambda m, made, name: holds(
            (float(m[2]), float(m[3])), made.parameter(m[1], dry="dry_at_zero_n" if name == SCALED else "dry_n")
        ),
    ),
    (
        "estimation/identification.py ZEROS",
        r"^zeros +(?:state how exact|vent the chambers|map the load)|^intervals of 95 % hold",
        lambda *_: True,  # Advice, and what the intervals are, which are counted
    ),
    (
        "estimation/identified_model.py, no number",
        r"^  \w+ +not determined: |: not identified: |points of steady sliding, .*(?:no curve: |curve fitted)"
        r"|± more than 50 % in \d+ of \d+ points?, too wide to use|, ± \d+ %(?:, too wide to use|$)",
        lambda *_: True,  # What has no number claims nothing
    ),
    (
        "reporting/inspection/recording_pane.py, no friction",
        r"friction is not known from this recording alone: ",
        lambda *_: True,  # What has no number claims nothing
    ),
)


def sentences(seed: int, quick: bool) -> Iterator[tuple[str, str, bool | float]]:
    """Yield place, sentence and truth of all that the commands print of campaigns with this seed."""
    for name, world in WORLDS.items():
        made = simulated(world, seed, quick)
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            mapping = write_logs(made, folder)
            for verb, files in [("estimate", "*"), ("inspect", "*")] + [
                ("identify", "condition1_*")
            ] * world.identifies:
                lines = printed(verb, files, made, folder, mapping)
                named = any(re.search(GROWS, each) for each in lines)
                yield LOSS, "a loss is named if there is a line, and only then", named == bool(world.line_bar)
                for place, pattern, true in judged(lines, made):
                    yield place, pattern[:60], true
            if world.identifies and not quick:
                yield from adapted(made, folder, mapping)
            for each in sorted((folder / "estimate").rglob("*.parquet")):
                yield "estimation/from_logs.py bounds", "bounds hold 90 % of the rows", bounded(each, made)
        print(f"simulated and read: {name}, seed {seed}", flush=True)


def simulated(world: World, seed: int, quick: bool, sessions: int = 3) -> Simulated:
    mass_kg = RIG.moving_mass_kg + world.weight_n / 9.81
    cylinder = replace(RIG, moving_mass_kg=mass_kg)
    plan = CampaignPlan(
        seed=seed,
        sessions_per_condition=sessions,
        recordings_per_session=1,
        duration_s=15.0 if quick else 25.0,
        residual_offset_bar=world.zero_bar,
        specimen=world.specimen,  # type: ignore[arg-type]
        **world.options,
    )
    rig = SPECIMENS[world.specimen](default_rig(cylinder, plan.supply), np.random.default_rng([seed, 0, 0, 0]))
    return Simulated(world, cylinder, rig.friction, tuple(campaign(cylinder, plan)))


def write_logs(made: Simulated, folder: Path) -> Path:
    """Write the logs below ``folder`` and return their mapping."""
    content = yaml.safe_load(MAPPING.read_text())
    for name in ("pressure_1_pa", "pressure_2_pa"):
        content["channels"][name]["sensor"]["zero_uncertainty"] = made.world.stated_bar / math.sqrt(3.0)
        content["channels"][name]["sensor"]["zeroed"] = "each session" if made.world.zeroed else ""
        if stated_bar := made.world.line_stated * made.world.line_bar:
            share = 1.0 if name == "pressure_1_pa" else made.cylinder.piston_area_m2 / made.cylinder.annulus_area_m2
            line = {"bar": stated_bar, "speed_m_s": LOSS_SPEED_M_S * share, "laminar_percent": 20.0}
            content["channels"][name]["sensor"]["line_loss"] = line
    (folder / "logs").mkdir()
    generator = np.random.default_rng(0)
    for each in made.recorded:
        table = each.logger.copy()
        if made.world.noisy_position:
            third = slice(len(table) // 3, 2 * len(table) // 3)
            table.iloc[third, 3] += generator.normal(0.0, 1.8, third.stop - third.start)  # 60 times 30 µm [mm]
        write_logger_csv(folder / "logs" / f"{each.metadata.name}.csv", table)
    mapping = folder / "mapping.yaml"
    mapping.write_text(yaml.safe_dump({"channels": content["channels"]}))
    return mapping


def printed(verb: str, files: str, made: Simulated, folder: Path, mapping: Path) -> list[str]:
    """Return the lines that a command prints of the logs."""
    cylinder = {name: value for name, value in vars(made.cylinder).items() if isinstance(value, float) and value}
    (folder / "cylinder.yaml").write_text(yaml.safe_dump(cylinder))
    logs = sorted(map(str, (folder / "logs").glob(f"{files}.csv")))
    output = folder / (f"{verb}.html" if verb == "inspect" else verb)
    given = [
        verb,
        *([str(folder / "source")] if verb == "adapt" else []),
        *logs,
        "--cylinder",
        str(folder / "cylinder.yaml"),
        "--channels",
        str(mapping),
    ]
    given += ["--output", str(output), "--load", made.world.load, "--names", NAMES]
    if verb == "identify":
        given += ["--generations", "2"]
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()):
        command(given)
    return out.getvalue().splitlines()


def adapted(made: Simulated, folder: Path, mapping: Path) -> Iterator[tuple[str, str, bool]]:
    """Yield the sentences of `adapt`, from a model of another rig, and whether its bounds hold friction as stated."""
    source = HybridEstimator(RIG)
    logs, _ = raw_recordings(RIG, CampaignPlan(1, 2, 1, 25.0), Kind(0.05, 0.05))
    source = HybridEstimator(RIG, plan=replace(source.plan, epochs=4)).fit(label(logs, RIG))
    source.save(folder / "source")
    lines = printed("adapt", "*", made, folder, mapping)
    for place, pattern, true in judged(lines, made):
        yield place, pattern[:60], true
    if not (folder / "adapt").is_dir():  # Refused, with the reason in place of sentences
        return
    model, held = load_estimator(folder / "adapt"), list[float]()
    assert model.bounds is not None
    for each in made.recorded:
        columns = {"time_s": each.truth["time_s"].to_numpy()} | {
            name: factor * each.logger.iloc[:, place].to_numpy()
            for name, place, factor in (("pressure_1_pa", 1, 1e5), ("pressure_2_pa", 2, 1e5), ("position_m", 3, 1e-3))
        }
        newtons, flags = model.real_time().run(Recording(each.metadata, pd.DataFrame(columns)).samples(model.inputs))
        rows, truth_n = flags == 0, each.truth["friction_n"].to_numpy()
        held += [float(((newtons[:, 1] <= truth_n) & (truth_n <= newtons[:, 2]))[rows].mean())] if rows.any() else []
    yield (
        "realtime/model.py in_words",
        "adapted bounds hold",
        made.beside or bool(np.mean(held) >= model.bounds.probability - 0.05),
    )


NAMES = r"(?P<session>condition(?P<condition>[^_/]+)_session[^_/]+)_[^/]*\.csv$"


def judged(lines: list[str], made: Simulated) -> Iterator[tuple[str, str, bool]]:
    """Yield each sentence and whether it is true; a line on these topics that is not listed is false."""
    name = "condition"
    for line in lines:  # an indented one belongs to the file above it
        found = re.search(rf"condition\d+_session\d+|{SCALED}", line)
        name, listed = found[0] if found else name if line.startswith("  ") else "condition", False
        for place, pattern, true in SENTENCES:
            for match in re.finditer(pattern, line):
                listed = True
                yield place, pattern, true(match, made, name)
        if not listed and TOPICS.search(line) and not re.match(r"(files|page|note|offset) ", line):
            yield "not listed", line.strip(), False


def bounded(result: Path, made: Simulated) -> bool:
    """Return whether bounds hold true friction in nine of ten rows of a result, unless the command says otherwise."""
    table = pd.read_parquet(result)
    truth_n = made.own(result.stem)[0].truth["friction_n"].to_numpy()[: len(table)]
    rows: Array = table["usable"].to_numpy()
    held = (table["lower_n"].to_numpy() <= truth_n) & (truth_n <= table["upper_n"].to_numpy())
    excepted = (made.beside and not made.world.line_bar) or (made.world.weight_n and made.world.load == "none")
    return bool(excepted or not rows.any() or held[rows].mean() >= 0.9)
