/* Tells valgrind's callgrind when to begin, and when to write what it has counted since the last time and count anew.
   The client request for the latter would take the calling thread alone; the monitor's command takes all threads. */
#include <valgrind/callgrind.h>

void begin(void) { CALLGRIND_START_INSTRUMENTATION; }

void mark(void) { VALGRIND_MONITOR_COMMAND("dump"); }
