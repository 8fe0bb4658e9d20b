"""What flags mean in OPC UA: a value's status code, and the health of the device that it stands for."""

from enum import IntEnum

from asyncua import ua

from cylinder_friction.realtime.flags import Flag

FAILED, UNSETTLED, OFF_RANGE = Flag.of_kind("sensor"), Flag.of_kind("settling"), Flag.of_kind("range")
_STATUS = (  # The first that applies
    (Flag.NOT_READY, ua.StatusCodes.BadWaitingForInitialData),
    (FAILED, ua.StatusCodes.BadSensorFailure),
    (OFF_RANGE, ua.StatusCodes.UncertainEngineeringUnitsExceeded),
    (UNSETTLED & ~Flag.OFFSET_UNKNOWN, ua.StatusCodes.UncertainSubNormal),
    (Flag.OFFSET_UNKNOWN, ua.StatusCodes.UncertainSensorNotAccurate),
)
SILENT = ua.StatusCode(ua.StatusCodes.UncertainNoCommunicationLastUsableValue)
CLOSED = ua.StatusCode(ua.StatusCodes.BadNoCommunication)


class Health(IntEnum):
    """``DeviceHealthEnumeration`` of OPC 10000-100, after NAMUR NE 107."""

    NORMAL = 0
    FAILURE = 1
    """A sensor has failed, now."""
    CHECK_FUNCTION = 2
    """No valid friction for the time being: the estimate settles, or nothing comes."""
    OFF_SPEC = 3
    """The cylinder works outside of what the model was trained on."""
    MAINTENANCE_REQUIRED = 4
    """All is well now, but a sensor failed a while ago: a wire that comes and goes."""


def status_of(flags: int) -> ua.StatusCode:
    """Return the status code of friction and bounds."""
    return ua.StatusCode(next((code for mask, code in _STATUS if flags & mask), ua.StatusCodes.Good))


def health_of(flags: int, failed_before: bool) -> Health:
    """Return the health.

    Args:
        flags: All that were set since the last update.
        failed_before: Whether a sensor failed within the stretch that health looks back on.
    """
    if flags & FAILED:
        return Health.FAILURE
    if flags & UNSETTLED:
        return Health.CHECK_FUNCTION
    if flags & OFF_RANGE:
        return Health.OFF_SPEC
    return Health.MAINTENANCE_REQUIRED if failed_before else Health.NORMAL
