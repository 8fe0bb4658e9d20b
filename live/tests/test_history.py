"""What writes the history beside the newtons."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd

WRITES = """
import sys
from pathlib import Path
import numpy as np
from cylinder_friction_live.frames import EstimateBlock
from cylinder_friction_live.history import join_past_days, table_of, write_whole
from cylinder_friction_live.journal import Chunk
folder = Path(sys.argv[1])
samples = np.arange(30.0).reshape(10, 3)
for first, day in ((0, "2026-01-01"), (10, "2026-01-01"), (20, "2026-01-02")):
    estimates = EstimateBlock.of(1, first, 0.0, first + samples, np.arange(10, dtype=np.uint32))
    chunk = Chunk("press", first, 0.0, 0.005, ("a", "b", "c"), samples, estimates)
    write_whole(table_of([chunk]), folder / "press" / day / f"{first:016d}.parquet")
assert len(join_past_days(folder)) == 1
print(*sys.modules)
"""


def test_writing_does_not_import_pandas(tmp_path: Path) -> None:
    """It takes a quarter of a second, in which newtons wait; pyarrow does so by itself when given an array."""
    done = subprocess.run([sys.executable, "-c", WRITES, str(tmp_path)], capture_output=True, text=True, check=True)
    assert not {"pandas", "numexpr"} & set(done.stdout.split())
    written = pd.concat([pd.read_parquet(path) for path in sorted(tmp_path.rglob("*.parquet"))])
    np.testing.assert_array_equal(written["upper_n"], written["c"] + written["index"] // 10 * 10)
