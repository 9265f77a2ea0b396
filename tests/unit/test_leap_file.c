/* SPDX-License-Identifier: MIT */
/* The table of leap seconds that a head's clock takes: the system's where that reaches further than the built-in one,
 * else the built-in one. The system's file is one of the test's own. */
#include "tests/unit/device_rig.h"

#include <dlfcn.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/device/head_clock.h"

static char list[4096]; /* the file's text; empty: the system's own */

/* This fopen takes the place of the C library's. */
FILE *fopen(const char *path, const char *mode)
{
    FILE *(*next)(const char *, const char *) = NULL;
    void *found = dlsym(RTLD_NEXT, "fopen");
    memcpy(&next, &found, sizeof next); /* ISO C has no cast from void * to a function */
    if (list[0] != '\0' && strstr(path, "leap-seconds.list") != NULL) return fmemopen(list, strlen(list), mode);
    return next(path, mode);
}

enum { NTP_OF_1970_S = 2208988800, YEAR_S = 365 * 86400, JULY_2027_S = 1814400000 };

/* The first n leap seconds of the built-in table, then one at the beginning of July 2027 (date -u -d 2027-07-01 +%s) or
 * none. */
static struct head_clock clock_with(uint32_t n, int with_2027, int64_t expires_s)
{
    static struct config cfg;
    struct head_clock clock;
    struct sh_err err;
    const struct utc_table *table = utc_table_builtin();
    size_t used = (size_t)sprintf(list, "#@ %lld\n", (long long)(expires_s + NTP_OF_1970_S));
    for (uint32_t i = 0; i < n; i++)
        used += (size_t)sprintf(list + used, "%lld %d\n", (long long)(table->leap[i].posix_s + NTP_OF_1970_S),
                                table->leap[i].tai_minus_utc);
    if (with_2027) sprintf(list + used, "%lld 38\n", (long long)JULY_2027_S + NTP_OF_1970_S);
    strcpy(cfg.time.epoch, "2026-01-01T00:00:00Z");
    need(head_clock_create(&cfg.time, &clock, &err), &err);
    list[0] = '\0';
    return clock;
}

static void the_table_that_reaches_further(void **state)
{
    (void)state;
    const struct utc_table *builtin = utc_table_builtin();
    struct head_clock clock = clock_with(builtin->n, 1, JULY_2027_S + YEAR_S);
    assert_int_equal(clock.table.n, builtin->n + 1);
    assert_int_equal(clock.table.expires_s, JULY_2027_S + YEAR_S);
    assert_string_equal(clock.warning, "");
    /* An old system: its table ends before 2017, whose leap second it does not have. */
    clock = clock_with(builtin->n - 1, 0, builtin->leap[builtin->n - 1].posix_s - 1);
    assert_int_equal(clock.table.n, builtin->n);
    assert_int_equal(clock.table.expires_s, builtin->expires_s);
    assert_string_equal(clock.warning, "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_table_that_reaches_further)};
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
