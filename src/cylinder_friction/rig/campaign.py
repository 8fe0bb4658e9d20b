"""A measuring campaign on the rig: four load conditions, several sessions each, several recordings per session."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd
from numpy.random import Generator

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.recording import RecordingMetadata
from cylinder_friction.rig.campaign_plan import CampaignPlan
from cylinder_friction.rig.duty_cycles import Row, duty_cycle, unlogged_stroke
from cylinder_friction.rig.external_load import ExternalLoad, crane_load, varied_load
from cylinder_friction.rig.faults import with_fault
from cylinder_friction.rig.lever import TICK_S, ornstein_uhlenbeck
from cylinder_friction.rig.parameters import (
    BAR_PA,
    THROTTLE_GAINS,
    RigParameters,
    SensorParameters,
    default_rig,
    refuse_unknown,
)
from cylinder_friction.rig.sensors import at_ports, measure
from cylinder_friction.rig.simulate import balanced_state, simulate
from cylinder_friction.rig.variation import PAUSE_S, Session, draw_rig, draw_session, draw_wide_rig

TRUTH_COLUMNS = (
    "time_s",
    "friction_n",
    "position_m",
    "velocity_m_s",
    "pressure_1_pa",
    "pressure_2_pa",
    "oil_temperature_c",
)
LOADS = {
    "1": "no load, throttle open",
    "2": "light load, throttle setting 2",
    "3": "medium load, throttle setting 3",
    "4": "heavy load, throttle setting 4",
}
EXTERNAL_LOADS = {
    "none": "",
    "varied": "; an external load that varies, measured by a load cell",
    "boom": "; a weight on a crane's boom",
}
"""Forces on the rod, and their descriptions in a recording's metadata."""
SPECIMENS = {"default": draw_rig, "wide": draw_wide_rig}
MAKEUP_GAIN = 2e-6  # Gain of the anti-cavitation valves [m³/s/√Pa]; they lose 0.25 bar at 100 mm/s
LOSS_SPEED_M_S = 0.1  # Piston speed at which the plan states the loss in the lines [m/s]
LOAD_SEED = 1
"""Last word of the load's own seed; thanks to it, hand and noise are the same with and without a load."""
KEPT_SHARES = {"kept": 1.0, "drifting": 0.0, "kept and drifting": 0.5}
"""Share of a zero's limit that the transmitters keep in all sessions, by ``CampaignPlan.zeros``."""
ZERO_DRIFT_SESSIONS = 5.0
"""Number of sessions in which a drifting zero forgets its value."""
ZERO_DRIFT_SD = 0.5
"""Standard deviation of a drifting zero, as a share of its limit."""
ZERO_SESSIONS = 1000
"""Sessions after which drifting zeros repeat themselves."""
ZERO_SEED = 2


@dataclass(frozen=True)
class RigRecording:
    """One recording as the logger wrote it, and the truth that no logger measures.

    ``campaign`` yields recordings. Treat ``logger`` as a real log in its own units, and use ``truth`` only to score
    estimates. Friction is positive when it opposes extension.
    """

    metadata: RecordingMetadata  # Condition, session and time
    # Columns ``sensors.LOGGER_COLUMNS``: seconds, bar, bar, millimetres, °C; with an external load also
    # ``sensors.LOAD_COLUMN``, newtons
    logger: pd.DataFrame
    # Columns ``TRUTH_COLUMNS`` at the same times, SI units; with an external load also ``load_force_n``
    truth: pd.DataFrame


def campaign(cylinder: Cylinder, plan: CampaignPlan) -> Iterator[RigRecording]:
    """Yield the campaign's recordings one at a time; equal plans give equal recordings, bit for bit.

    Every recording has its own random numbers, so a longer campaign begins with the sessions of a shorter one.

    Raises:
        ValueError: Two times do not fit together, or the supply, the fault, the load or the specimen is not known.
    """
    refuse_unknown("external_load", plan.external_load, EXTERNAL_LOADS)
    refuse_unknown("specimen", plan.specimen, SPECIMENS)
    specimen = SPECIMENS[plan.specimen](default_rig(cylinder, plan.supply), _generator(plan, 0, 0, 0))
    specimen = with_fault(specimen, plan.fault)
    friction = replace(specimen.friction, ageing=plan.ageing)
    specimen = replace(specimen, friction=friction, sensors=_sensors(plan, specimen))
    if plan.external_load != "none" or plan.weight_n:
        # A load that pulls would draw a vacuum; circuits for such loads have anti-cavitation valves.
        specimen = replace(specimen, hydraulics=replace(specimen.hydraulics, makeup_gain=MAKEUP_GAIN))
    for condition, gain in THROTTLE_GAINS.items():
        off = plan.asymmetry_by_condition * float(_generator(plan, int(condition), 0, 0).standard_normal())
        for number in range(1, plan.sessions_per_condition + 1):
            session = draw_session(
                specimen.with_throttle(gain),
                _generator(plan, int(condition), number, 0),
                plan.recordings_per_session * (plan.duration_s + PAUSE_S),
                zeroed=plan.zeroed,
                residual_offset_pa=plan.residual_offset_bar * BAR_PA,
                zeros=_zeros(plan, number),
                asymmetry_sd=plan.asymmetry_sd,
                asymmetry_off=off,
            )
            yield from _session(plan, session, condition, number)


def _zeros(plan: CampaignPlan, number: int) -> Array | None:
    """Draw both transmitters' zeros in a session as shares of their limit; None if each session draws its own."""
    if plan.zeros == "drawn anew":
        return None
    generator, kept = _generator(plan, 0, 0, ZERO_SEED), KEPT_SHARES[plan.zeros]
    shares = generator.uniform(-1.0, 1.0, 2)
    walk = partial(ornstein_uhlenbeck, generator, ZERO_SESSIONS, 1.0, ZERO_DRIFT_SESSIONS, ZERO_DRIFT_SD)
    drifted = np.clip([walk()[number % ZERO_SESSIONS] for _ in shares], -1.0, 1.0)
    return np.asarray(kept * shares + (1.0 - kept) * drifted)


def _sensors(plan: CampaignPlan, specimen: RigParameters) -> SensorParameters:
    """Build the specimen's sensors with the logger of the plan, at the cylinder or at the valve."""
    flow_m3_s = LOSS_SPEED_M_S * specimen.hydraulics.piston_area_m2
    laminar_pa = plan.line_laminar_share * plan.line_loss_bar * BAR_PA
    return replace(
        specimen.sensors,
        sample_time_s=plan.sample_time_s,
        jitter_s=0.5 * plan.jitter * plan.sample_time_s,
        load_delay_s=plan.load_delay_s,
        position_step_m=plan.position_step_m,
        pressure_lag_s=plan.pressure_lag_s,
        line_laminar_pa_s_m3=laminar_pa / flow_m3_s,
        line_turbulent_pa_s2_m6=(plan.line_loss_bar * BAR_PA - laminar_pa) / flow_m3_s**2,
    )


def _session(plan: CampaignPlan, session: Session, condition: str, number: int) -> Iterator[RigRecording]:
    temperature_c = session.oil_temperature_c
    stride = round(plan.sample_time_s / TICK_S)
    for take in range(1, plan.recordings_per_session + 1):
        generator = _generator(plan, int(condition), number, take)
        began_s = (take - 1) * (plan.duration_s + PAUSE_S)
        rig = session.rig
        before, lead_s = list[Row](), 0.0
        if plan.start != "work":
            before, lead_s = unlogged_stroke(rig, generator, plan.start == "end_stop")
        simulated_s = plan.duration_s + lead_s
        load = _load(replace(plan, duration_s=simulated_s), rig.hydraulics.stroke_m, int(condition), number, take)
        position_m = rig.hydraulics.stroke_m * generator.uniform(0.2, 0.8)
        start = balanced_state(
            rig,
            position_m,
            pressure_2_pa=generator.uniform(4.0, 12.0) * BAR_PA,
            oil_temperature_c=temperature_c,
            load_force_n=0.0 if load is None else load.at_start(position_m, rig.hydraulics.stroke_m),
        )
        lever = duty_cycle(rig, generator, simulated_s, turn=number + take, before=before)
        drift = session.drift_from(began_s, simulated_s)
        trace = simulate(rig, lever, start, simulated_s, drift, plan.time_step_s, external_force=load)
        trace = trace.iloc[round(lead_s / TICK_S) :].reset_index(drop=True)
        trace["time_s"] -= trace["time_s"].iloc[0]
        # Work goes on between recordings and warms the oil at the same rate.
        warming_c = float(trace["oil_temperature_c"].iloc[-1]) - temperature_c
        temperature_c += warming_c * (1.0 + PAUSE_S / plan.duration_s)
        seen = at_ports(trace, rig.hydraulics) if plan.cushions_unseen else trace
        logger = measure(rig.sensors, seen, generator, began_s, load_cell=plan.external_load == "varied")
        known = TRUTH_COLUMNS if load is None else (*TRUTH_COLUMNS, "load_force_n")
        truth = trace[list(known)].iloc[::stride].reset_index(drop=True)
        yield RigRecording(_metadata(plan, rig.cylinder.name, condition, number, take), logger, truth)


def _load(plan: CampaignPlan, stroke_m: float, *words: int) -> ExternalLoad | None:
    load = None
    if plan.external_load == "varied":
        load = varied_load(_generator(plan, *words, LOAD_SEED), plan.duration_s, stroke_m)
    elif plan.external_load == "boom":
        load = crane_load(plan.duration_s, stroke_m)
    elif plan.weight_n:
        load = ExternalLoad.of_time(np.zeros(round(plan.duration_s / TICK_S) + 2))
    return load if load is None else replace(load, force_n=load.force_n + plan.weight_n)


def _metadata(plan: CampaignPlan, cylinder: str, condition: str, number: int, take: int) -> RecordingMetadata:
    return RecordingMetadata(
        name=f"condition{condition}_session{number:02d}_recording{take:02d}",
        condition=condition,
        session=f"condition{condition}_session{number:02d}",
        sample_time_s=plan.sample_time_s,
        cylinder=cylinder,
        load=LOADS[condition] + EXTERNAL_LOADS[plan.external_load],
    )


def _generator(plan: CampaignPlan, *words: int) -> Generator:
    return np.random.default_rng([plan.seed, *words])
