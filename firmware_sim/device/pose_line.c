/* SPDX-License-Identifier: MIT */
#include "firmware_sim/device/pose_line.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/command/decimal.h"

static const double most[7] = {1e9, 1e9, 1e9, 1e9, 360.0, 90.0, 360.0}; /* time, then the pose */

/* Reads the numbers from `first` on, of the seven that `most` has. */
static int read_numbers(const char *line, int first, double *v)
{
    line += strspn(line, " \t");
    for (int i = first; i < 7; i++) {
        struct command_decimal decimal;
        const char *end = command_parse_decimal(line, &decimal); /* after the number and its blanks */
        if (end == NULL) return -1;
        v[i - first] = command_decimal_to_double(&decimal);
        if (!(fabs(v[i - first]) <= most[i])) return -1;
        const int apart = *end == ',' || end[-1] == ' ' || end[-1] == '\t';
        if (i < 6 && !apart) return -1;
        line = end;
        if (i < 6 && *line == ',') line += 1 + strspn(line + 1, " \t");
    }
    return line[strspn(line, " \t\r")] == '\0' ? 0 : -1;
}

int pose_line_read(const char *line, double v[6])
{
    return read_numbers(line, 1, v);
}

int pose_line_read_timed(const char *line, double *t_s, double v[6])
{
    double all[7];
    if (read_numbers(line, 0, all) != 0) return -1;
    *t_s = all[0];
    memcpy(v, all + 1, 6 * sizeof *v);
    return 0;
}

/* Prints the fewest digits that read back as the same number. */
static int print_number(char *text, size_t room, double value)
{
    int digits = 15, n;
    do
        n = snprintf(text, room, "%.*g", digits, value);
    while (strtod(text, NULL) != value && digits++ < 17);
    return n;
}

void pose_line_write(const double v[6], char text[POSE_LINE_LEN])
{
    int n = 0;
    for (int i = 0; i < 6; i++) {
        if (i > 0) text[n++] = ' ';
        n += print_number(text + n, (size_t)(POSE_LINE_LEN - n), v[i]);
    }
}
