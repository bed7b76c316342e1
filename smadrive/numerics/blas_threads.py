"""One thread for the linear algebra of numpy and scipy.

For matrices of a few rows the threads of the BLAS library wait for each other: milliseconds instead of microseconds,
and on a busy machine they take every core from the loop. The setting must be in force before numpy is imported.
"""

ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment variables of a process with one BLAS thread."""
