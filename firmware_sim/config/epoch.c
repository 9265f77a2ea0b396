/* SPDX-License-Identifier: MIT */
#include "firmware_sim/config/epoch.h"

#include <string.h>

int epoch_parse(const char *text, const struct utc_table *table, enum epoch_source *source, int64_t *tai0_ns,
                struct sh_err *err)
{
    static const char *const words[] = {[EPOCH_NONE] = "none", [EPOCH_UTC] = "utc", [EPOCH_TAI] = "tai"};
    struct utc_time utc;
    int64_t tai_ns = 0;
    if (text[0] == '\0') text = words[EPOCH_NONE];
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (words[i] != NULL && strcmp(text, words[i]) == 0) {
            *source = (enum epoch_source)i;
            return SH_OK;
        }
    *source = EPOCH_DATE;
    int rc = utc_parse(text, &utc, err);
    /* The years that core/utc.h allows are not those of GPS time: one limit at a time is the answer. */
    const int is_early = rc == SH_OK && utc.year < 1980;
    if (rc == SH_OK && utc.year > UTC_LAST_YEAR) rc = sh_fail(err, SH_EINPUT, "after %d-12-31", UTC_LAST_YEAR);
    if (rc == SH_OK && !is_early) rc = utc_to_tai(table, &utc, &tai_ns, err);
    if (rc == SH_OK && (is_early || utc_gps_ns(tai_ns) <= 0))
        rc = sh_fail(err, SH_EINPUT, "not after 1980-01-06T00:00:00Z, where GPS time begins");
    if (rc == SH_OK && tai0_ns != NULL) *tai0_ns = tai_ns;
    return rc;
}
