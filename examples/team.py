"""
Two people, one server
======================

Two people, one MLflow server with logins, one store of data: what the one has run,
the other pulls, and nothing runs twice. The server keeps its runs in SQLite and the
data lie in a folder, the smallest team there is; :doc:`../team` does the same with
PostgreSQL and an S3-protocol store.
"""

# %%
# The server
# ----------
#
# ``$`` is what you type. Passwords are made up here; each person has one of their
# own, in a file of the home folder.

import os
import shlex
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from tempfile import mkdtemp

import requests

folder = Path(mkdtemp())
password = {name: os.urandom(12).hex() for name in ("admin", "ada", "bo")}
with socket.create_server(("127.0.0.1", 0)) as free:
    url = f"http://127.0.0.1:{free.getsockname()[1]}"
environment = {
    **os.environ,
    "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    "MLFLOW_TRACKING_URI": url,
    "MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT": "true",
}
(folder / "logins.ini").write_text(
    f"""[mlflow]
default_permission = MANAGE
database_uri = sqlite:///{folder}/logins.db
auth_cache_ttl_seconds = 60
"""
)
server = subprocess.Popen(
    shlex.split(
        f"mlflow server --app-name basic-auth --port {url.rpartition(':')[2]}"
        " --workers 1"
    ),
    cwd=folder,
    env={
        **environment,
        "MLFLOW_AUTH_CONFIG_PATH": str(folder / "logins.ini"),
        "MLFLOW_AUTH_ADMIN_USERNAME": "admin",
        "MLFLOW_AUTH_ADMIN_PASSWORD": password["admin"],
        "MLFLOW_FLASK_SERVER_SECRET_KEY": os.urandom(32).hex(),
        "MLFLOW_BACKEND_STORE_URI": f"sqlite:///{folder}/mlflow.db",
        "MLFLOW_ARTIFACTS_DESTINATION": str(folder / "artifacts"),
        "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",
    },
    stdout=(folder / "server.log").open("w"),
    stderr=subprocess.STDOUT,
    start_new_session=True,
)

# %%
# The administrator makes the logins.

while True:
    try:
        requests.get(f"{url}/health", timeout=30).raise_for_status()
        break
    except requests.ConnectionError:
        assert server.poll() is None, (folder / "server.log").read_text()
        time.sleep(0.1)
for name in ("ada", "bo"):
    requests.post(
        f"{url}/api/2.0/mlflow/users/create",
        json={"username": name, "password": password[name]},
        auth=("admin", password["admin"]),
        timeout=30,
    ).raise_for_status()

# %%
# Ada makes a project
# -------------------
#
# And runs its first stages. A whole ``dvc repro`` would train, compare and register
# a model as well; what follows is the same for it.


def shell(place, command, who=None):
    print("$", command)
    done = subprocess.run(
        shlex.split(command),
        cwd=folder / place,
        env={
            **environment,
            **{
                f"GIT_{role}_{what}": f"{who}@localhost"
                for role in ("AUTHOR", "COMMITTER")
                for what in ("NAME", "EMAIL")
            },
            "MLFLOW_TRACKING_USERNAME": who or "",
            "MLFLOW_TRACKING_PASSWORD": password.get(who, ""),
        },
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    print(done.stdout, end="")
    return done.returncode


shell("", "cylinder-friction init ada", "ada")
shell("ada", "cylinder-friction params experiment=smoke", "ada")
shell("ada", "dvc repro --quiet ingest", "ada")

# %%
# and shares what came out: data go to the store, their hashes into git.

shell("", "git init --quiet --bare press.git", "ada")
for command in (
    f"dvc remote add --quiet --default team {folder}/store",
    "git add --all",
    "git commit --quiet --message 'A project and its first results'",
    "git push --quiet ../press.git HEAD",
    "dvc push",
):
    assert shell("ada", command, "ada") == 0

# %%
# Bo joins
# --------
#
# After a clone and a pull everything is there, and nothing has to run again.
# ``track`` would log what the server lacks; Ada's stages were logged as they ran.

shell("", "git clone --quiet press.git bo", "bo")
for command in (
    "dvc pull --with-deps ingest",
    "dvc repro ingest",
    "cylinder-friction track",
):
    assert shell("bo", command, "bo") == 0

# %%
# Without a login nobody sees anything.

assert shell("bo", "cylinder-friction track", "stranger") == 1

# %%
# What the server holds now, for everybody who has a login. Each recipe has an
# experiment of its own:

smoke = requests.get(
    f"{url}/api/2.0/mlflow/experiments/get-by-name",
    params={"experiment_name": "cylinder-friction-smoke"},
    auth=("bo", password["bo"]),
    timeout=30,
).json()
found = requests.post(
    f"{url}/api/2.0/mlflow/runs/search",
    json={"experiment_ids": [smoke["experiment"]["experiment_id"]]},
    auth=("bo", password["bo"]),
    timeout=30,
).json()
for run in found["runs"]:
    print(run["info"]["run_name"], run["info"]["status"])

os.killpg(server.pid, signal.SIGKILL)
server.wait()

# %%
# :doc:`../team` goes on with models, trials of the search that are shared, going
# back to an earlier champion, and backups; :doc:`../registry` with who decides
# which model is in use.
