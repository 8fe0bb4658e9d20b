"""Windows, faked as far as Linux can: its modules instead of POSIX's, and none of the functions that it lacks."""

import subprocess
import sys
from pathlib import Path

import pytest

FAKED = """
import errno, os, signal, subprocess, sys, types
from importlib import import_module
from cylinder_friction.import_graph import all_modules

modules = [name for name in all_modules() if name.startswith("cylinder_friction")]
for name in modules:  # other packages are those of this system
    import_module(name)
for name in [name for name in sys.modules if name.startswith("cylinder_friction")]:
    del sys.modules[name]
sys.platform = "win32"
for name in ("fcntl", "resource", "grp", "pwd", "termios"):
    sys.modules[name] = None
for owner, names in ((os, "fork killpg getuid geteuid register_at_fork sched_setaffinity sched_getscheduler"),
                     (signal, "pause SIGKILL SIGHUP SIGUSR1 sigwait sigtimedwait pthread_sigmask")):
    for name in names.split():
        delattr(owner, name)
calls = []
def locking(file, mode, size):
    calls.append((mode, size))
    if len(calls) == 1:
        raise OSError(errno.EDEADLK, "given after ten seconds")
sys.modules["msvcrt"] = types.SimpleNamespace(locking=locking, LK_LOCK=1, LK_NBLCK=2)
"""


WORK = """
for name in modules:
    import_module(name)
from pathlib import Path
from cylinder_friction.files.whole_files import locked
with locked(Path("some/lock")):
    print("locked", calls)

import psutil
from cylinder_friction.deployment.child_server import _end
child = "import subprocess, sys; subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)']).wait()"
server = subprocess.Popen([sys.executable, "-c", child])
while not psutil.Process(server.pid).children():
    pass
(grandchild,) = psutil.Process(server.pid).children()
signal.SIGKILL = 9  # psutil is that of this system
_end(server)
print(server.poll() is not None, psutil.wait_procs([grandchild], 10)[1])
"""


@pytest.mark.extended
def test_every_module_imports_the_store_waits_for_its_lock_and_a_server_ends_with_its_children(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", FAKED + WORK], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "locked [(1, 1), (1, 1)]\nTrue []\n"
