"""One thread for the linear algebra of numpy and scipy.

For matrices of a few rows the threads of their library wait for each other: milliseconds instead of microseconds, and
on a busy machine every core is kept from the loop. It is told before numpy is imported.
"""

ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""What the environment of a process has to say."""
