# C types of what every sample takes; see state.py.
import cython

cdef int STATE_SIZE_, _BODY_AT, _CHECK_AT
