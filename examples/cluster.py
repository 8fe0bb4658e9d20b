"""
Two workers, one killed
=======================

The same project on one process and on two Dask workers, of which one is killed in
the middle: the same bytes. The guide is :doc:`../cluster`.
"""

# %%
# A project
# ---------
#
# ``$`` is what you type; each command runs as a process of its own.

import atexit
import hashlib
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import mkdtemp

from distributed import Client

folder = Path(mkdtemp())
atexit.register(shutil.rmtree, folder, ignore_errors=True)
environment = {
    **os.environ,
    "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
}


def shell(command, **more):
    print("$", command)
    done = subprocess.run(
        shlex.split(command),
        cwd=folder,
        env={**environment, **more},
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    print(done.stdout, end="")
    done.check_returncode()


shell("cylinder-friction init .")
shell("cylinder-friction params experiment=smoke")
shell("cylinder-friction stage record")

# %%
# One process
# -----------
#
# ``dvc repro label`` would run these stages; here they are run by themselves, for
# DVC would find the second run unnecessary.

STAGES = ("ingest", "filter", "label")
MADE = (
    "data/interim/recordings",
    "data/interim/signals",
    "data/processed/labelled",
)


def hashes():
    files = [path for place in MADE for path in sorted((folder / place).rglob("*"))]
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in files
        if path.is_file()
    }


for stage in STAGES:
    shell(f"cylinder-friction stage {stage}")
alone = hashes()
print(len(alone), "files")

# %%
# A scheduler and two workers
# ---------------------------
#
# On loopback here; elsewhere the workers are other machines, jobs of SLURM, or a
# cloud's. They find their scheduler by a file. ``--dashboard-address`` is needed as
# well: without it Dask's HTTP server listens on all addresses, whatever ``--host``
# is and although there is no dashboard. However this program ends, it ends them.


def start(command):
    print("$", command, "&")
    log = (folder / "dask.log").open("a")
    process = subprocess.Popen(
        shlex.split(f"{command} {LOOPBACK}"),
        cwd=folder,
        env=environment,
        stdout=log,
        stderr=log,
        start_new_session=True,
    )
    atexit.register(end, process)
    return process


def end(process):
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


LOOPBACK = "--host 127.0.0.1 --dashboard-address 127.0.0.1:0 --no-dashboard"
scheduler = start("dask scheduler --port 0 --scheduler-file scheduler.json")
worker = "dask worker --scheduler-file scheduler.json --nthreads 1"
workers = [start(worker), start(worker)]

# %%
# The same stages
# ---------------
#
# Only the environment changes: no parameter names the cluster, so that no result
# depends on it. As soon as both workers are busy, one is killed for good.

for place in MADE:
    shutil.rmtree(folder / place)
cluster = {"CYLINDER_FRICTION_WORKERS": "scheduler.json"}
first = subprocess.Popen(
    ["cylinder-friction", "stage", "ingest"],
    cwd=folder,
    env={**environment, **cluster},
    stdout=(folder / "ingest.log").open("w"),
    stderr=subprocess.STDOUT,
)


def why():
    logs = [folder / "ingest.log", folder / "dask.log"]
    return "\n".join(log.read_text()[-2000:] for log in logs)


while not (folder / "scheduler.json").exists():
    assert scheduler.poll() is None, why()
    time.sleep(0.05)
with Client(scheduler_file=str(folder / "scheduler.json")) as client:
    while len([each for each in client.processing().values() if each]) < 2:
        assert first.poll() is None, (
            f"ingest was over before a worker could be killed\n{why()}"
        )
        time.sleep(0.02)
    end(workers[0])
    assert first.wait() == 0, why()
    print(len(client.scheduler_info()["workers"]), "worker is left")
for stage in STAGES[1:]:
    shell(f"cylinder-friction stage {stage}", **cluster)

# %%
# What came out?

assert hashes() == alone
print(len(alone), "files, the same byte for byte")
for process in (scheduler, workers[1]):
    end(process)

# %%
# :doc:`../cluster` states what else is shared, what workers need, and what happens
# when the scheduler or the command is lost.
