"""Faults of cylinders as changes to the rig, for demonstrations of condition monitoring."""

from collections.abc import Callable
from dataclasses import replace

from cylinder_friction.rig.parameters import BAR_PA, RigParameters, refuse_unknown


def with_fault(rig: RigParameters, fault: str, severity: float = 1.0) -> RigParameters:
    """Give a healthy rig one of ``FAULTS``; severity 0 is healthy, and a mechanic would act at severity 1.

    Raises:
        ValueError: The fault is not known, or the severity is negative.
    """
    refuse_unknown("fault", fault, FAULTS)
    if severity < 0.0:
        raise ValueError(f"severity: got {severity}, but expected 0 (healthy) or more")
    return FAULTS[fault](rig, severity)


def _wear(rig: RigParameters, severity: float) -> RigParameters:
    """Worn seals: less friction, more leakage."""
    friction = replace(rig.friction, coulomb_n=rig.friction.coulomb_n * 0.6**severity)
    leakage = rig.hydraulics.leakage_m3_s_pa * 50.0**severity
    return replace(rig, friction=friction, hydraulics=replace(rig.hydraulics, leakage_m3_s_pa=leakage))


def _tight_seal(rig: RigParameters, severity: float) -> RigParameters:
    """Swollen or over-tight seals: more friction, a higher and narrower Stribeck peak, stick-slip."""
    friction = replace(
        rig.friction,
        coulomb_n=rig.friction.coulomb_n * 1.6**severity,
        static_ratio=1.0 + (rig.friction.static_ratio - 1.0) * 1.8**severity,
        stribeck_velocity_m_s=rig.friction.stribeck_velocity_m_s * 0.6**severity,
    )
    return replace(rig, friction=friction)


def _aeration(rig: RigParameters, severity: float) -> RigParameters:
    """Air in the oil: a soft column of oil."""
    air = min(rig.hydraulics.air_fraction * 8.0**severity, 0.2)
    return replace(rig, hydraulics=replace(rig.hydraulics, air_fraction=air))


def _sensor_drift(rig: RigParameters, severity: float) -> RigParameters:
    """Transmitters with drifting zeros: 0.5 bar per minute on side 1, 0.25 bar per minute the other way on side 2."""
    drift = 0.5 * BAR_PA / 60.0 * severity
    return replace(rig, sensors=replace(rig.sensors, pressure_drift_pa_s=(drift, -0.5 * drift)))


def _bent_rod(rig: RigParameters, severity: float) -> RigParameters:
    """A bent rod: friction grows as it comes out."""
    return replace(rig, friction=replace(rig.friction, bend_n_per_n=0.6 * severity))


FAULTS: dict[str, Callable[[RigParameters, float], RigParameters]] = {
    "none": lambda rig, _: rig,
    "wear": _wear,
    "tight_seal": _tight_seal,
    "aeration": _aeration,
    "sensor_drift": _sensor_drift,
    "bent_rod": _bent_rod,
}
"""Every fault by its name."""
