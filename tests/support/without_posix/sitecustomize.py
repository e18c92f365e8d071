"""Python as on Windows for the modules of ripple-sim, in this process and its children.

With this folder on PYTHONPATH, these modules import no module of POSIX, `os` and `signal` lack what
Windows does not have, and `os.open` and `os.fsync` refuse what Windows refuses. Locks are those of
`msvcrt`, made of `flock`. All other packages see the system as it is.
"""

import builtins
import fcntl
import os
import signal
import stat
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

POSIX_MODULES = {
    "fcntl", "grp", "posix", "pty", "pwd", "resource", "spwd", "syslog", "termios", "tty"
}  # fmt: skip

# Beginnings of names that `os` and `signal` do not have on Windows.
POSIX_NAMES = {
    "os": (
        "EX_", "F_", "GRND_", "O_ASYNC", "O_CLOEXEC", "O_DIRECT", "O_DSYNC", "O_NDELAY",
        "O_NOATIME", "O_NOCTTY", "O_NOFOLLOW", "O_NONBLOCK", "O_PATH", "O_SYNC", "O_TMPFILE",
        "POSIX_", "PRIO_", "RTLD_", "SCHED_", "ST_", "WCONT", "WCORE", "WEX", "WIF", "WNO",
        "WSTOP", "WTERM", "WUN", "chown", "chroot", "confstr", "copy_file_range", "ctermid",
        "environb", "eventfd", "fchdir", "fchmod", "fchown", "fdatasync", "fork", "fpathconf",
        "fstatvfs", "get_blocking", "getegid", "geteuid", "getgid", "getgr", "getloadavg",
        "getpg", "getpriority", "getrandom", "getres", "getsid", "getuid", "getxattr",
        "initgroups", "killpg", "lchown", "listxattr", "lockf", "memfd", "mkfifo", "mknod",
        "nice", "openpty", "pathconf", "pidfd", "posix_", "pread", "pwrite", "readv",
        "register_at_fork", "removexattr", "sched_", "sendfile", "set_blocking", "sete", "setg",
        "setp", "setre", "setsid", "setuid", "setxattr", "spawnlp", "spawnvp", "splice",
        "statvfs", "sync", "sysconf", "tcgetpgrp", "tcsetpgrp", "ttyname", "uname", "unshare",
        "wait3", "wait4", "waitid", "writev",
    ),
    "signal": (
        "ITIMER_", "SIGALRM", "SIGBUS", "SIGCHLD", "SIGCONT", "SIGHUP", "SIGIO", "SIGKILL",
        "SIGPIPE", "SIGPROF", "SIGQUIT", "SIGSTOP", "SIGTSTP", "SIGUSR", "SIGWINCH", "alarm",
        "getitimer", "pause", "pthread_", "set_wakeup", "setitimer", "siginterrupt",
        "sigpending", "sigtimedwait", "sigwait",
    ),
}  # fmt: skip

# It calls a function of the C library that is named by the system.
SEES_THE_SYSTEM = "ripple_sim.solver.backends.meeting"


class WindowsModule(ModuleType):
    """A module without what Windows does not have, and with functions of its own."""

    def __init__(self, module: ModuleType, **own: Any) -> None:
        super().__init__(module.__name__)
        self._module = module
        self.__dict__.update(own)

    def __getattr__(self, name: str) -> Any:
        if name.startswith(POSIX_NAMES[self.__name__]):
            raise AttributeError(f"{self.__name__} of Windows has no {name}")
        return getattr(self._module, name)


def open_file(path: Any, flags: int, mode: int = 0o777) -> int:
    if Path(path).is_dir():
        raise PermissionError(13, "Permission denied", path)
    return os.open(path, flags, mode)


def fsync(handle: int) -> None:
    if fcntl.fcntl(handle, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY:
        raise OSError(9, "Bad file descriptor")
    os.fsync(handle)


def locking(handle: int, mode: int, count: int) -> None:
    assert stat.S_ISREG(os.fstat(handle).st_mode)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise PermissionError(13, "Permission denied") from error


REPLACED = {
    "os": WindowsModule(os, name="nt", open=open_file, fsync=fsync),
    "signal": WindowsModule(signal),
    "msvcrt": SimpleNamespace(locking=locking, LK_NBLCK=2),
}
import_module = builtins.__import__


def import_as_on_windows(
    name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0
) -> Any:
    importer = (globals or {}).get("__name__", "")
    is_ours = importer.startswith("ripple_sim.") and importer != SEES_THE_SYSTEM
    if is_ours and not level:
        if name in POSIX_MODULES:
            raise ModuleNotFoundError(f"Windows has no module {name!r}", name=name)
        if name in REPLACED:
            return REPLACED[name]
    return import_module(name, globals, locals, fromlist, level)


builtins.__import__ = import_as_on_windows
