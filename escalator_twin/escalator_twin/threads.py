"""Threads of the linear algebra beneath numpy and scipy."""

from threadpoolctl import threadpool_limits

# Simulations already run on as many threads or processes as were asked for, and each one's matrices
# are small: threads of the linear algebra's own would wait for each other on the same cores.
one_thread_each = threadpool_limits.wrap(limits=1, user_api='blas')
