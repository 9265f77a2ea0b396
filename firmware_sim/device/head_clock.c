#include "firmware_sim/device/head_clock.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "firmware_sim/base/clock.h"

static const char LEAP_FILE[] = "/usr/share/zoneinfo/leap-seconds.list";
static const int64_t PPT = 1000000000000;

/* The system's table when it is there and good for longer than ours. */
static void choose_table(struct head_clock *clock)
{
    char text[32768];
    struct utc_table table;
    struct sh_err why;
    clock->table = *utc_table_builtin();
    FILE *f = fopen(LEAP_FILE, "r");
    if (f == NULL) return;
    size_t n = fread(text, 1, sizeof text - 1, f);
    fclose(f);
    text[n] = '\0';
    if (utc_table_parse(text, &table, &why) != SH_OK)
        snprintf(clock->warning, sizeof clock->warning, "%s: %.80s; the built-in table is used", LEAP_FILE, why.text);
    else if (table.expires_s > clock->table.expires_s)
        clock->table = table;
}

static void warn_expired(struct head_clock *clock)
{
    char day[UTC_TEXT_LEN];
    struct utc_time end;
    int64_t end_ns = utc_tai_from_posix(&clock->table, clock->table.expires_s * UTC_SECOND_NS);
    if (clock->tai0_ns < end_ns) return;
    utc_from_tai(&clock->table, end_ns, &end);
    utc_format(&end, 0, day);
    snprintf(clock->warning, sizeof clock->warning,
             "leap seconds are known up to %.10s only: UTC and GPS time may differ by one more since (renew tzdata)",
             day);
}

int head_clock_create(const struct config *cfg, struct head_clock *clock, struct sh_err *err)
{
    memset(clock, 0, sizeof *clock);
    choose_table(clock);
    int rc = epoch_parse(cfg->time.epoch, &clock->table, &clock->source, &clock->tai0_ns, err);
    clock->offset_ns = llround(cfg->time.offset_s * 1e9);
    clock->drift_ppt = llround(cfg->time.drift_ppm * 1e6);
    clock->jump_ns = llround(cfg->time.jump_s * 1e9);
    clock->jump_at_ns = llround(cfg->time.jump_at_s * 1e9);
    return rc == SH_OK ? head_clock_power_up(clock, clock_now_ns(), err) : rc;
}

int head_clock_power_up(struct head_clock *clock, int64_t now_ns, struct sh_err *err)
{
    if (clock->source == EPOCH_UTC) clock->tai0_ns = utc_tai_from_posix(&clock->table, clock_utc_ns(now_ns));
    if (clock->source == EPOCH_TAI && !clock_tai_ns(now_ns, &clock->tai0_ns))
        return sh_fail(err, SH_ESTATE,
                       "time.epoch: tai: the system does not know TAI (its offset is 0 s: no PTP or NTP has set it); "
                       "utc goes by the table of leap seconds");
    if (clock->source != EPOCH_NONE) warn_expired(clock);
    return SH_OK;
}

int64_t head_clock_true_ns(const struct head_clock *clock, int64_t t_ns)
{
    return clock->tai0_ns + t_ns;
}

/* Without or with the jump. Rounded down. */
static int64_t piece_ns(const struct head_clock *clock, int64_t t_ns, int after)
{
    __int128 drift = (__int128)t_ns * clock->drift_ppt;
    int64_t drift_ns = (int64_t)(drift / PPT) - (drift % PPT < 0);
    return clock->tai0_ns + t_ns + clock->offset_ns + drift_ns + (after ? clock->jump_ns : 0);
}

int64_t head_clock_ns(const struct head_clock *clock, int64_t t_ns)
{
    return piece_ns(clock, t_ns, t_ns >= clock->jump_at_ns);
}

/* The same within one piece. Its clock runs on steadily, so the edge is the first nanosecond that has reached
 * the second, and is found by halving. */
static int find_edge(const struct head_clock *clock, int64_t from_ns, int64_t to_ns, int after, int64_t *edge_ns,
                     int64_t *tai_s)
{
    if (from_ns >= to_ns) return 0;
    int64_t s = piece_ns(clock, to_ns - 1, after) / UTC_SECOND_NS, target_ns = s * UTC_SECOND_NS;
    if (piece_ns(clock, from_ns - 1, after) >= target_ns) return 0;
    int64_t low_ns = from_ns - 1, high_ns = to_ns - 1; /* before it, and not before it */
    while (high_ns - low_ns > 1) {
        int64_t mid_ns = low_ns + (high_ns - low_ns) / 2;
        if (piece_ns(clock, mid_ns, after) < target_ns)
            low_ns = mid_ns;
        else
            high_ns = mid_ns;
    }
    *edge_ns = high_ns;
    *tai_s = s;
    return 1;
}

int head_clock_edge(const struct head_clock *clock, int64_t from_ns, int64_t to_ns, int64_t *edge_ns, int64_t *tai_s)
{
    int64_t jump_ns = clock->jump_at_ns;
    if (jump_ns < from_ns) jump_ns = from_ns;
    if (jump_ns > to_ns) jump_ns = to_ns;
    return find_edge(clock, jump_ns, to_ns, 1, edge_ns, tai_s) || find_edge(clock, from_ns, jump_ns, 0, edge_ns, tai_s);
}
