/* SPDX-License-Identifier: MIT */
/* Command lines that are wrong, run in this process: each is one line on standard error, and nothing is made. */
#ifndef TESTS_UNIT_LINES_RIG_H
#define TESTS_UNIT_LINES_RIG_H

#include <stddef.h>

struct lines_row {
    /* The whole line, but for the command's name before it and the reference to the help after it. If it begins with
     * "scanhead: ", it is the line as it stands. $ stands for the first word after the command. */
    const char *says;
    const char *words[9]; /* command lines that give it: a command and its words, apart by blanks */
};

/* Each has exit status 2. */
void lines_expect(const struct lines_row *rows, size_t n);

#endif
