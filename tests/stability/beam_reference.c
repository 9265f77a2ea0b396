/* The same reference, for the programs of this folder: helpers are built from beside a test. */
#include "tests/accuracy/beam_reference.c"
