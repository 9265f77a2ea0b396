/* SPDX-License-Identifier: MIT */
#include "tests/stability/table.h"

#include <math.h>
#include <stdio.h>

static unsigned failed_rows; /* of the running test */

void table_head(const char *title)
{
    printf("# %s\n# %-50s %-34s %10s %10s %10s\n", title, "regime", "naive method", "naive", "ours", "bound");
}

void table_row(const char *regime, const char *naive_method, double naive, double ours, double bound, const char *unit)
{
    const char *verdict = "";
    if (!(ours <= bound))
        verdict = "  OURS BREAKS THE BOUND";
    else if (!(naive > bound))
        verdict = "  THE NAIVE METHOD HOLDS: proves nothing";
    failed_rows += verdict[0] != '\0';
    printf("# %-50s %-34s %10.3g %10.3g %10.3g %s%s\n", regime, naive_method, naive, ours, bound, unit, verdict);
    fflush(stdout);
}

void table_note(const char *format, ...)
{
    va_list args;
    va_start(args, format);
    printf("#   ");
    vprintf(format, args);
    printf("\n");
    va_end(args);
}

void table_check(void)
{
    unsigned failed = failed_rows;
    failed_rows = 0;
    if (failed != 0) fail_msg("%u rows of the table fail", failed);
}
