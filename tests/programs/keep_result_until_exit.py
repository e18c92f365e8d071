"""Keep a result in a cache that a thread still holds at exit; print when the result is freed."""

import threading
import time

from ripple_sim.solver.cache import ResultCache


class Result:
    def __del__(self) -> None:
        print("freed", flush=True)


def hold(cache: ResultCache) -> None:
    time.sleep(60)  # longer than the program runs


cache = ResultCache(1, lambda result: True)
cache.get("key", Result)
threading.Thread(target=hold, args=(cache,), daemon=True).start()
