/* SPDX-License-Identifier: MIT */
/* Text that a part of the program prints to standard output or standard error is kept here. */
#ifndef TESTS_UNIT_OUTPUT_RIG_H
#define TESTS_UNIT_OUTPUT_RIG_H

#include <stddef.h>
#include <stdio.h>

struct output {
    FILE *stream;
    int was;
    char path[64];
};

/* From now on the stream, stdout or stderr, goes to a file. */
void output_take(struct output *output, FILE *stream);

/* The stream is as before. Returns all that went to the file; free it. */
char *output_give(struct output *output);

/* The same without lines of progress ("what: 12 %, 3 s left", "what ..."), whose number depends on the machine. */
char *output_give_said(struct output *output);

#endif
