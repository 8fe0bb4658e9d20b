"""What the tests of the checks share: the recordings of a crane, as its mapping reads them."""

from pathlib import Path

import pytest
import yaml

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.reading_logs import Logs, find_logs

CHECKOUT = Path(__file__).parents[3]
CRANE = CHECKOUT / "../shared/data/crane/scope"


@pytest.fixture
def crane_logs() -> Logs:
    if not CRANE.is_dir():
        pytest.skip("the recordings of a crane are not there")
    jib = Cylinder(**yaml.safe_load((CHECKOUT / "conf/cylinder/hmf_2020k_jib.yaml").read_text()))
    return find_logs(CRANE, CHECKOUT / "conf/ingest/crane.yaml", jib)
