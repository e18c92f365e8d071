"""Scenes made by the workers of a Dask cluster, which share the batch's folder with this process."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

from ripple_sim.errors import BatchError
from ripple_sim.solver.errors import shown

_PER_THREAD = 2  # tasks a thread, so that none waits for the next one
_COUNTED = 2.0  # between looks at how many threads there are [s]


class DaskExecutor(Executor):
    """The workers of a Dask cluster, however many there are at the time.

    Parameters
    ----------
    address : str
        Of the scheduler, such as tcp://host:8786.

    Raises
    ------
    BatchError
        If Dask is not installed or does not answer.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise BatchError("--dask needs Dask; install it with: pip install 'ripple-sim[dask]'") from error
        try:
            self._client = Client(address, timeout=20, set_as_default=False)
        except (OSError, ValueError) as error:
            raise BatchError(
                f"no Dask scheduler answers at {shown(address)} ({error}); valid is an address such as tcp://host:8786"
            ) from error
        self._places, self._counted = 0, -math.inf
        self._executor = self._client.get_executor(pure=False, retries=0)

    @property
    def places(self) -> int:
        """How many tasks may be submitted at a time."""
        if time.monotonic() - self._counted > _COUNTED:  # the scheduler takes a while to answer
            self._places = _PER_THREAD * max(1, sum(self._client.nthreads().values()))
            self._counted = time.monotonic()
        return self._places

    def submit(self, function: Callable, /, *arguments: Any, **named: Any) -> Future:
        """Have a function called by one of the workers."""
        return self._executor.submit(function, *arguments, **named)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave the cluster; without `wait` what is not yet done is given up."""
        self._executor.shutdown(wait=wait)
        self._client.close()
