"""Import the program, print "done", and meet all signals while the interpreter shuts down."""

import os
import signal

import ripple_sim.__main__  # noqa: F401

NUMBERS = [int(signal.SIGINT), int(signal.SIGTERM), int(signal.SIGHUP)]


class Last:
    """Sends the signals as it is deleted; modules are gone by then, so it keeps what it needs."""

    def __del__(self, kill=os.kill, process=os.getpid(), numbers=NUMBERS) -> None:  # noqa: B008
        for number in numbers:
            kill(process, number)


last = Last()
print("done")
