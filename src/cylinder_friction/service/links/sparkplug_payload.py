"""Sparkplug B's payload, one protobuf message: what the service publishes of it, and the one command that it takes.

Field numbers and data types are those of the Sparkplug specification 3.0, chapter 6.
"""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

INT64, UINT32, UINT64, DOUBLE, BOOLEAN = 4, 7, 8, 10, 11
"""Data types of metrics."""
REBIRTH = "Node Control/Rebirth"
_TIMESTAMP, _METRICS, _SEQUENCE = 1, 2, 3
_NAME, _METRIC_TIMESTAMP, _DATA_TYPE = 1, 3, 4
_VALUE = {UINT32: 10, INT64: 11, UINT64: 11, DOUBLE: 13, BOOLEAN: 14}
_VARINT, _EIGHT_BYTES, _LENGTH, _FOUR_BYTES = 0, 1, 2, 5


class SparkplugError(ValueError):
    """What was got is no payload."""


@dataclass(frozen=True)
class Metric:
    """One value with its name."""

    name: str
    data_type: int
    value: float
    time_ms: int  # Unix


def payload_of(metrics: Sequence[Metric], time_ms: int, sequence: int | None) -> bytes:
    """Return a payload; a death certificate has no ``sequence``."""
    parts = [_number(_TIMESTAMP, time_ms), *(_bytes(_METRICS, _metric(each)) for each in metrics)]
    if sequence is not None:
        parts.append(_number(_SEQUENCE, sequence))
    return b"".join(parts)


def asks_for_rebirth(payload: bytes) -> bool:
    """Return whether a command has the metric ``Node Control/Rebirth`` with the value true.

    Raises:
        SparkplugError: It is no payload.
    """
    try:
        metrics = [dict(_fields(each)) for number, each in _fields(payload) if number == _METRICS]
    except (IndexError, struct.error, TypeError) as error:
        raise SparkplugError(f"got {payload[:40]!r}, expected a Sparkplug B payload") from error
    return any(each.get(_NAME) == REBIRTH.encode() and each.get(_VALUE[BOOLEAN]) == 1 for each in metrics)


def _metric(metric: Metric) -> bytes:
    place = _VALUE[metric.data_type]
    if metric.data_type == DOUBLE:
        value = _tag(place, _EIGHT_BYTES) + struct.pack("<d", metric.value)
    else:
        value = _number(place, int(metric.value))
    head = _bytes(_NAME, metric.name.encode()) + _number(_METRIC_TIMESTAMP, metric.time_ms)
    return head + _number(_DATA_TYPE, metric.data_type) + value


def _tag(number: int, wire: int) -> bytes:
    return _varint(number << 3 | wire)


def _number(number: int, value: int) -> bytes:
    return _tag(number, _VARINT) + _varint(value)


def _bytes(number: int, content: bytes) -> bytes:
    return _tag(number, _LENGTH) + _varint(len(content)) + content


def _varint(value: int) -> bytes:
    groups = bytearray()
    while value > 0x7F:
        groups.append(value & 0x7F | 0x80)
        value >>= 7
    groups.append(value)
    return bytes(groups)


def _fields(content: object) -> Iterator[tuple[int, bytes | int]]:
    """Yield number and value of each field of a message."""
    if not isinstance(content, bytes):
        raise TypeError("a message has a length")
    at = 0
    while at < len(content):
        tag, at = _read_varint(content, at)
        wire = tag & 7
        if wire == _VARINT:
            value, at = _read_varint(content, at)
            yield tag >> 3, value
            continue
        if wire == _LENGTH:
            size, at = _read_varint(content, at)
        elif wire in (_EIGHT_BYTES, _FOUR_BYTES):
            size = 8 if wire == _EIGHT_BYTES else 4
        else:
            raise TypeError(f"no such wire type: {wire}")
        if at + size > len(content):
            raise IndexError("a field ends beyond its message")
        yield tag >> 3, content[at : at + size]
        at += size


def _read_varint(content: bytes, at: int) -> tuple[int, int]:
    value = 0
    for place in range(10):
        value |= (content[at + place] & 0x7F) << 7 * place
        if content[at + place] < 0x80:
            return value, at + place + 1
    raise TypeError("a number has ten bytes at most")
