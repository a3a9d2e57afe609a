"""The package on systems without POSIX: what only that has is used where it was asked for, and names of files."""

import ast
import signal
from pathlib import Path

import pytest

import paraflex
from paraflex import interrupts
from paraflex.cli import signals
from paraflex.writing import portable_name

PACKAGE = Path(paraflex.__file__).parent
MODULES = {"crypt", "fcntl", "grp", "posix", "pty", "pwd", "resource", "spwd", "syslog", "termios", "tty", "nis"}
# What Windows lacks; of `os` as its documentation says.
OF_OS = """
    chown chroot fork forkpty getegid geteuid getgid getgroups getloadavg getpgid getpgrp getresuid getsid getuid
    initgroups killpg lchown major makedev minor mkfifo mknod nice openpty pathconf posix_spawn pread pwrite
    register_at_fork sched_getaffinity sched_yield setpgid setsid setuid statvfs sync sysconf tcgetpgrp ttyname uname
    wait3 wait4 waitid
    WIFEXITED WNOHANG O_CLOEXEC O_DIRECTORY O_NOFOLLOW O_NONBLOCK O_SYNC
"""
OF_SIGNAL = """
    SIGALRM SIGBUS SIGCHLD SIGCONT SIGHUP SIGKILL SIGPIPE SIGQUIT SIGSTOP SIGTSTP SIGUSR1 SIGUSR2 SIG_BLOCK SIG_SETMASK
    SIG_UNBLOCK alarm pause pthread_kill pthread_sigmask setitimer siginterrupt sigpending sigwait
"""
LACKING = {"os": set(OF_OS.split()), "signal": set(OF_SIGNAL.split()), "time": {"tzset", "clock_gettime"}}
OPTIONS = {"start_new_session", "preexec_fn", "pass_fds", "process_group", "umask", "user", "group"}
FOLDERS = ("/dev", "/etc", "/proc", "/tmp", "/usr", "/var")
# Called or looked at only where there is such a thing: a function whose caller asks, and a file that may not be there.
ASKED = {("cache_folder.py", "os.getuid"), ("comparison.py", "/proc/cpuinfo")}


def uses(source, file=""):
    """What a source uses of POSIX alone outside functions that ask whether it is there."""
    tree = ast.parse(source)
    asking = [each for each in ast.walk(tree) if isinstance(each, ast.FunctionDef) and asks(each)]
    guarded = {id(node) for function in asking for node in ast.walk(function)}
    nodes = [node for node in ast.walk(tree) if id(node) not in guarded]
    found = [name for node in nodes for name in of_posix(node)]
    return [name for name in found if (Path(file).name, name) not in ASKED]


def asks(function):
    """Whether a function asks `hasattr(os, ...)`, or for the system."""
    calls = [each for each in ast.walk(function) if isinstance(each, ast.Call)]
    return any(isinstance(call.func, ast.Name) and call.func.id == "hasattr" for call in calls)


def of_posix(node):
    if isinstance(node, ast.Import):
        return [each.name for each in node.names if each.name in MODULES]
    if isinstance(node, ast.ImportFrom):
        lacking = LACKING.get(node.module or "", ())
        return [each.name for each in node.names if each.name in lacking or node.module in MODULES]
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return [f"{node.value.id}.{node.attr}"] if node.attr in LACKING.get(node.value.id, ()) else []
    if isinstance(node, ast.keyword):
        return [node.arg] if node.arg in OPTIONS else []
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return [node.value] if node.value.startswith(FOLDERS) else []
    return []


def test_nothing_of_posix_is_used_where_it_was_not_asked_for():
    files = sorted(PACKAGE.rglob("*.py"))
    found = {file.name: names for file in files if (names := uses(file.read_text(encoding="utf-8"), file.name))}
    assert not found
    assert len(files) > 200


@pytest.mark.parametrize(
    ("source", "name"),
    [
        ("import fcntl", "fcntl"),
        ("from os import fork", "fork"),
        ("import os; os.getuid()", "os.getuid"),
        ("import signal\ndef f():\n    signal.signal(signal.SIGHUP, None)", "signal.SIGHUP"),
        ("Popen(start_new_session=True)", "start_new_session"),
        ("open('/tmp/file')", "/tmp/file"),
    ],
)
def test_what_is_looked_for_is_found(source, name):
    assert uses(source) == [name]
    assert not uses("import os\ndef f():\n    return os.getuid() if hasattr(os, 'getuid') else 0")


def test_signals_and_workers_do_without_what_windows_lacks(monkeypatch):
    for name in LACKING["signal"]:
        monkeypatch.delattr(signal, name, raising=False)
    with interrupts.starting_processes():
        pass
    with pytest.raises(KeyboardInterrupt), signals.raised():
        signals._send(signal.SIGINT)
    assert signals.exit_code() == 130


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("desired_path", "desired_path"),
        ("responses_+-0+", "responses_+-0+"),
        ("path a/b", "path a_b"),
        ('a:b*c?"<>|\\\n', "a_b_c_______"),
        ("con", "_con"),
        ("Lpt1.old", "_Lpt1.old"),
        ("ends in dots. .", "ends in dots"),
        ("...", "_"),
        ("Federgelenk, träge", "Federgelenk, träge"),
    ],
)
def test_names_of_files_are_names_on_every_system(text, name):
    assert portable_name(text) == name
    assert portable_name(name) == name


def test_files_of_the_package_have_portable_names():
    for path in PACKAGE.rglob("*"):
        assert portable_name(path.name) == path.name
