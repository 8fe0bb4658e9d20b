"""Translation of an estimate's flags to OPC UA: a status code of friction and bounds, and the health of the device."""

from enum import IntEnum

from asyncua import ua

from cylinder_friction.realtime.flags import Flag

FAILED, UNSETTLED, OFF_RANGE = Flag.of_kind("sensor"), Flag.of_kind("settling"), Flag.of_kind("range")
_STATUS = (  # The first match counts
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
    """A sensor has failed."""
    CHECK_FUNCTION = 2
    """No valid friction at present: the estimate settles, or no samples come."""
    OFF_SPEC = 3
    """The cylinder works outside the model's training range."""
    MAINTENANCE_REQUIRED = 4
    """Part of the enumeration; the service never gives it."""


def status_of(flags: int) -> ua.StatusCode:
    """Choose the status code of friction and bounds."""
    return ua.StatusCode(next((code for mask, code in _STATUS if flags & mask), ua.StatusCodes.Good))


def health_of(flags: int) -> Health:
    """Choose the health for all flags that were set since the last update."""
    if flags & FAILED:
        return Health.FAILURE
    if flags & UNSETTLED:
        return Health.CHECK_FUNCTION
    return Health.OFF_SPEC if flags & OFF_RANGE else Health.NORMAL
