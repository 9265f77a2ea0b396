/* SPDX-License-Identifier: MIT */
/* Command lines that are wrong, run in this process: each is one line on standard error, and nothing is made. */
#ifndef TESTS_UNIT_LINES_RIG_H
#define TESTS_UNIT_LINES_RIG_H

#include <stddef.h>

struct lines_row {
    /* The whole line without the command's name before it, and where the help is after it. With "scanhead: " it is the
     * whole line as it stands. $ stands for the first word after the command. */
    const char *says;
    const char *words[9]; /* command lines that it is said of: a command, its words, apart by blanks */
};

/* Each has exit status 2. */
void lines_expect(const struct lines_row *rows, size_t n);

#endif
