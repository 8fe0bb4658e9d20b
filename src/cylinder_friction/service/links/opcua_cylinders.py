"""What monitoring found of each cylinder, by OPC UA: its status after NAMUR NE 107, and the sentence beside it.

``cylinder-friction monitor`` writes ``health.json`` each night; the server's process reads it again when it changes.
"""

import asyncio
import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from asyncua import Node, Server, ua

NAMESPACE = "urn:cylinder-friction:health"
"""Of its own: a cylinder and a session may have the same name."""
FOLDER = "Cylinders"
DEVICE_HEALTH, STATUS = "DeviceHealth", "Status"
GONE = ua.StatusCode(ua.StatusCodes.BadNoData)
_log = logging.getLogger(__name__)


@dataclass
class MonitoredCylinders:
    """The folder ``Cylinders`` of the server: an object per cylinder that monitoring knows.

    Attributes:
        server: The server.
        number: Of ``NAMESPACE`` on it.
        folder: Gets the objects.
        file: ``health.json`` of monitoring.
        kind: Data type of ``DeviceHealth``.
        numbers: Number of each status of NE 107 in that data type.
    """

    server: Server
    number: int
    folder: Node
    file: Path
    kind: ua.NodeId
    numbers: Mapping[str, int]
    _read: tuple[int, int] | None = None  # Time and size of the file as it was read last
    _nodes: dict[str, tuple[ua.NodeId, ua.NodeId]] = field(default_factory=dict)

    @classmethod
    async def of(cls, server: Server, parent: Node, results: Path, kind: ua.NodeId, numbers: Mapping[str, int]) -> Self:
        """Add the folder, still empty, to ``parent``; ``results`` is the folder that monitoring writes."""
        number = await server.register_namespace(NAMESPACE)
        folder = await parent.add_folder(ua.NodeId(FOLDER, number), ua.QualifiedName(FOLDER, number))
        return cls(server, number, folder, results / "health.json", kind, numbers)

    async def refresh(self) -> None:
        """Read the file again if it has changed, and show what it states.

        Until there is a file, or while it is damaged, the values stay as they are; the log gets one line.
        """
        try:
            about = self.file.stat()
            if (about.st_mtime_ns, about.st_size) == self._read:
                return
            self._read = about.st_mtime_ns, about.st_size
            given = {each["cylinder"]: each for each in json.loads(self.file.read_bytes()).get("cylinders", ())}
            values = {name: self._values(each) for name, each in given.items()}
        except FileNotFoundError:
            return
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            text = "%s: expected what `cylinder-friction monitor` writes, got %r; run it again"
            _log.warning(text, self.file, error)
            return
        for name, (health, words, start) in values.items():
            if name not in self._nodes:
                self._nodes[name] = await self._add(name)
            await self._write(name, (health, words), ua.StatusCode(), start)
            await asyncio.sleep(0)  # clients are served in between
        for name in self._nodes.keys() - values.keys():
            await self._write(name, (None, None), GONE, None)

    def _values(self, line: Mapping[str, Any]) -> tuple[int, str, datetime | None]:
        start = datetime.fromisoformat(line["last_start"]) if line["last_start"] else None
        return self.numbers[line["ne107"]], f"{line['answer']}: {line['words']}", start

    async def _add(self, name: str) -> tuple[ua.NodeId, ua.NodeId]:
        """Add a cylinder's object; return its two variables."""
        place, number = f"{FOLDER}/{name}", self.number
        node = await self.folder.add_object(ua.NodeId(place, number), ua.QualifiedName(name, number))
        health = await node.add_variable(
            ua.NodeId(f"{place}/{DEVICE_HEALTH}", number), ua.QualifiedName(DEVICE_HEALTH, self.kind.NamespaceIndex),
            0, ua.VariantType.Int32, self.kind,
        )  # fmt: skip
        status = await node.add_variable(
            ua.NodeId(f"{place}/{STATUS}", number), ua.QualifiedName(STATUS, number), "", ua.VariantType.String
        )
        return health.nodeid, status.nodeid

    async def _write(
        self, name: str, values: tuple[int | None, str | None], status: ua.StatusCode, start: datetime | None
    ) -> None:
        kinds = ua.VariantType.Int32, ua.VariantType.String
        for node, value, kind in zip(self._nodes[name], values, kinds, strict=True):
            variant = ua.Variant() if value is None else ua.Variant(value, kind)
            await self.server.write_attribute_value(node, ua.DataValue(variant, status, start, datetime.now(UTC)))
