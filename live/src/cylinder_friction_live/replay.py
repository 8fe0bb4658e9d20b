"""Replay of recordings through the service, at their own speed or faster, to try it without a machine."""

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

from cylinder_friction.recordings.recording import Recording
from cylinder_friction_live.client import Client

BLOCK_S = 0.05
PAUSE_S = 5.0
"""Duration of the gap between two recordings of a session, so that each begins anew. The replay does not wait for it:
the next recording is dated as if it followed at once."""


@dataclass
class Replay:
    """Recordings that are sent by session, one after the other, with a gap between two.

    Args:
        url: Address of the service.
        recordings: Recordings by the name of their session.
        speed: Factor on the recorded speed; None: as fast as the service accepts samples.
    """

    url: str
    recordings: dict[str, list[Recording]]
    speed: float | None = 1.0

    def run(self, inputs: Sequence[str], stop: threading.Event) -> int:
        """Send everything, or until ``stop``; return the number of samples sent."""
        threads = [
            threading.Thread(target=self._send, args=(name, recordings, tuple(inputs), stop), daemon=True)
            for name, recordings in self.recordings.items()
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return sum(len(each) for recordings in self.recordings.values() for each in recordings)

    def _send(self, name: str, recordings: Sequence[Recording], inputs: tuple[str, ...], stop: threading.Event) -> None:
        sample_time_s = recordings[0].sample_time_s
        rows = max(1, round(BLOCK_S / sample_time_s))
        with Client(self.url, name, sample_time_s, inputs) as client:
            begin_s, sent = time.monotonic(), 0
            rows_in_all = sum(len(each) for each in recordings)
            ahead = 1.0 - 1.0 / self.speed if self.speed else 1.0  # Share of the time that a faster replay saves
            client.start_time_s -= max(0.0, ahead) * rows_in_all * sample_time_s  # no sample is of the future

            for recording in recordings:
                if client.next_index:  # of the recording before, or of a replay before a restart
                    client.skip(round(PAUSE_S / sample_time_s))
                    client.start_time_s -= PAUSE_S
                samples = recording.readings(inputs)
                for first in range(0, len(samples), rows):
                    if stop.is_set():
                        return
                    sent += rows
                    if self.speed is not None:  # a block is sent when its last sample has been taken
                        due_s = begin_s + sent * sample_time_s / self.speed
                        time.sleep(max(0.0, due_s - time.monotonic()))
                    client.send(samples[first : first + rows])
                    while len(client.estimates(timeout_s=0.0)[2]):
                        pass  # the page shows them; this reader only must not stall
            client.wait_until_kept()
