/* SPDX-License-Identifier: MIT */
#include "firmware_sim/device/pose_line.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "firmware_sim/command/decimal.h"

enum { FIELDS = 7 };

/* The time, then the pose. TIME:STEP has the same limits for its pose. */
static const struct {
    const char *name, *unit;
    double most; /* of its absolute value */
} field[FIELDS] = {{"t_s", "s", 1e9},      {"x", "m", 1e9},        {"y", "m", 1e9},          {"z", "m", 1e9},
                   {"roll", "deg", 360.0}, {"pitch", "deg", 90.0}, {"heading", "deg", 360.0}};

static int fail_form(int first, struct sh_err *err)
{
    return sh_fail(err, SH_EFORMAT, "a pose is not of the form %sx y z roll pitch heading", first == 0 ? "t_s " : "");
}

static int check_limit(int i, double value, struct sh_err *err)
{
    if (fabs(value) <= field[i].most) return SH_OK;
    char text[COMMAND_DOUBLE_LEN];
    command_print_double(text, sizeof text, value);
    return sh_fail(err, SH_EINPUT, "%s of a pose is %s, allowed %.10g to %.10g %s", field[i].name, text, -field[i].most,
                   field[i].most, field[i].unit);
}

/* Reads the numbers of all fields from `first` on. The limits come last, so that a line of another form is called that.
 */
static int read_numbers(const char *line, int first, double *v, struct sh_err *err)
{
    int rc = SH_OK;
    line += strspn(line, " \t");
    for (int i = first; i < FIELDS; i++) {
        struct command_decimal decimal;
        const char *end = command_parse_decimal(line, &decimal); /* after the number and its blanks */
        if (end == NULL) return fail_form(first, err);
        v[i - first] = command_decimal_to_double(&decimal);
        const int apart = *end == ',' || end[-1] == ' ' || end[-1] == '\t';
        if (i + 1 < FIELDS && !apart) return fail_form(first, err);
        line = end;
        if (i + 1 < FIELDS && *line == ',') line += 1 + strspn(line + 1, " \t");
    }
    if (line[strspn(line, " \t\r")] != '\0') return fail_form(first, err);
    for (int i = first; i < FIELDS && rc == SH_OK; i++)
        rc = check_limit(i, v[i - first], err);
    return rc;
}

int pose_line_read(const char *line, double v[6], struct sh_err *err)
{
    return read_numbers(line, 1, v, err);
}

int pose_line_read_timed(const char *line, double *t_s, double v[6], struct sh_err *err)
{
    double all[FIELDS];
    const int rc = read_numbers(line, 0, all, err);
    if (rc != SH_OK) return rc;
    *t_s = all[0];
    memcpy(v, all + 1, 6 * sizeof *v);
    return SH_OK;
}

void pose_line_write(const double v[6], char text[POSE_LINE_LEN])
{
    int n = 0;
    for (int i = 0; i < 6; i++) {
        if (i > 0) text[n++] = ' ';
        n += command_print_double(text + n, (size_t)(POSE_LINE_LEN - n), v[i]);
    }
}
