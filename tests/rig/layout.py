"""Where the kernels keep things: rows of the work array, of the marks, and of the state."""

# rows of the work array
X, Z, VX, VZ, COS, SIN, KAPPA, S_RATE, FT, FN, NORMAL, S_DESIGN, FX, FZ, TENSION, PULL = range(16)
WORK_ROWS = 16
# rows of the integer array: segment, on the carriage, dog (index), inside the drive, laps
SEGMENT, CARRIED, DOG, ENGAGED, LAPS = range(5)
MARK_ROWS = 5
# behind the lateral states
U, U_RATE, RACK, MODE, MODE_RATE = range(5)
TAIL = 5
NO_DOG = -(2**40)
