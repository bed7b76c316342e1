"""One thread for the linear algebra of numpy and scipy.

For matrices of a few rows the threads of the BLAS library wait for each other, so that a product takes milliseconds
instead of microseconds. On a busy machine these threads also take every core from the control loop. The environment
variables `ONE_THREAD` must be set before numpy is imported.
"""

ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment variables of a process with one BLAS thread."""
