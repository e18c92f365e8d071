"""A module that sends its process a signal while it is imported, and then prints "imported".

The environment variable SIGNAL_ON_IMPORT has the signal's number.
"""

import os

os.kill(os.getpid(), int(os.environ["SIGNAL_ON_IMPORT"]))
print("imported", flush=True)
