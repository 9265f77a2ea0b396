/* SPDX-License-Identifier: MIT */
#include "firmware_sim/device/head_clock.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "firmware_sim/base/clock.h"

static const char LEAP_FILE[] = "/usr/share/zoneinfo/leap-seconds.list";
static const int64_t PPT = 1000000000000;

/* Takes the system's table where there is one that reaches further than ours. */
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
    snprintf(
        clock->warning, sizeof clock->warning,
        "leap seconds are known up to %.10s only: UTC and GPS time may differ by one more after that (update tzdata)",
        day);
}

/* Computes piece i and all later pieces from the changes at their beginnings. */
static void renew_pieces(struct head_clock *clock, uint32_t i)
{
    for (; i < clock->n; i++) {
        struct head_clock_piece *p = &clock->piece[i];
        static const struct head_clock_piece none = {0};
        const struct head_clock_piece *before = i > 0 ? p - 1 : &none;
        p->shift_ns = before->shift_ns + p->change.jump_ns;
        p->gain_ppt = before->gain_ppt + p->change.gain_ppt;
        p->stands = before->stands + p->change.stands;
        p->rate_ppt = p->stands > 0 || p->gain_ppt < -PPT ? -PPT : p->gain_ppt;
        p->gained = before->gained + (head_clock_wide)(p->from_ns - before->from_ns) * before->rate_ppt;
    }
}

/* The oldest piece goes: the next one has the sums up to it, and its own change is not needed any more. */
static void forget_oldest(struct head_clock *clock)
{
    memmove(clock->piece, &clock->piece[1], (clock->n - 1) * sizeof clock->piece[0]);
    clock->n--;
}

void head_clock_change(struct head_clock *clock, int64_t t_ns, const struct head_clock_change *change)
{
    if (clock->n == HEAD_CLOCK_CHANGES) forget_oldest(clock);
    uint32_t i = clock->n;
    while (i > 1 && clock->piece[i - 1].from_ns > t_ns)
        i--;
    memmove(&clock->piece[i + 1], &clock->piece[i], (clock->n - i) * sizeof clock->piece[0]);
    clock->piece[i] = (struct head_clock_piece){.from_ns = t_ns, .change = *change};
    clock->n++;
    renew_pieces(clock, i);
}

int head_clock_create(const struct config_time *time, struct head_clock *clock, struct sh_err *err)
{
    const struct head_clock_change from_start = {.jump_ns = llround(time->offset_s * 1e9),
                                                 .gain_ppt = llround(time->drift_ppm * 1e6)};
    const struct head_clock_change later = {.jump_ns = llround(time->jump_s * 1e9)};
    memset(clock, 0, sizeof *clock);
    choose_table(clock);
    int rc = epoch_parse(time->epoch, &clock->table, &clock->source, &clock->tai0_ns, err);
    head_clock_change(clock, 0, &from_start);
    if (later.jump_ns != 0) head_clock_change(clock, llround(time->jump_at_s * 1e9), &later);
    return rc == SH_OK ? head_clock_power_up(clock, clock_now_ns(), err) : rc;
}

int head_clock_power_up(struct head_clock *clock, int64_t now_ns, struct sh_err *err)
{
    if (clock->source == EPOCH_UTC) clock->tai0_ns = utc_tai_from_posix(&clock->table, clock_utc_ns(now_ns));
    if (clock->source == EPOCH_TAI && !clock_tai_ns(now_ns, &clock->tai0_ns))
        return sh_fail(
            err, SH_ESTATE,
            "time.epoch: tai: the system does not know TAI (its offset is 0 s: no PTP or NTP has set it); utc uses "
            "the table of leap seconds");
    if (clock->source != EPOCH_NONE) warn_expired(clock);
    return SH_OK;
}

int64_t head_clock_true_ns(const struct head_clock *clock, int64_t t_ns)
{
    return clock->tai0_ns + t_ns;
}

/* Returns the clock's time at t_ns, rounded down. */
static int64_t piece_ns(const struct head_clock *clock, const struct head_clock_piece *piece, int64_t t_ns)
{
    const head_clock_wide gained = piece->gained + (head_clock_wide)(t_ns - piece->from_ns) * piece->rate_ppt;
    const int64_t gained_ns = (int64_t)(gained / PPT) - (gained % PPT < 0);
    return clock->tai0_ns + t_ns + piece->shift_ns + gained_ns;
}

int64_t head_clock_ns(const struct head_clock *clock, int64_t t_ns)
{
    uint32_t i = clock->n - 1;
    while (i > 0 && t_ns < clock->piece[i].from_ns)
        i--;
    return piece_ns(clock, &clock->piece[i], t_ns);
}

int head_clock_add_leap(struct head_clock *clock, int64_t t_ns, int64_t *posix_s)
{
    const int64_t head_ns = head_clock_ns(clock, t_ns), true_ns = head_clock_true_ns(clock, t_ns);
    const int64_t tai_ns = head_ns > true_ns ? head_ns : true_ns;
    const int64_t now_s = utc_posix_from_tai(&clock->table, tai_ns) / UTC_SECOND_NS;
    *posix_s = now_s - now_s % 60 + 60;
    for (uint32_t i = 0; i < clock->table.n; i++)
        if (clock->table.leap[i].posix_s == *posix_s) *posix_s += 60;
    return utc_table_add(&clock->table, *posix_s);
}

/* Returns the clock's time a nanosecond before t_ns. A piece that begins with a jump is extended backward, so that the
 * jump counts as no edge. */
static int64_t before_ns(const struct head_clock *clock, const struct head_clock_piece *piece, int64_t t_ns)
{
    const int begins = t_ns == piece->from_ns && piece != clock->piece && piece->change.jump_ns == 0;
    return piece_ns(clock, begins ? piece - 1 : piece, t_ns - 1);
}

/* Does the work of head_clock_edge within one piece. Within a piece the clock never runs backwards. So the edge is the
 * first nanosecond that has reached the second, and is found by halving. */
static int find_edge(const struct head_clock *clock, const struct head_clock_piece *piece, int64_t from_ns,
                     int64_t to_ns, int64_t *edge_ns, int64_t *tai_s)
{
    if (from_ns >= to_ns) return 0;
    int64_t s = piece_ns(clock, piece, to_ns - 1) / UTC_SECOND_NS, target_ns = s * UTC_SECOND_NS;
    if (before_ns(clock, piece, from_ns) >= target_ns) return 0;
    int64_t low_ns = from_ns - 1, high_ns = to_ns - 1; /* low_ns < edge <= high_ns */
    while (high_ns - low_ns > 1) {
        int64_t mid_ns = low_ns + (high_ns - low_ns) / 2;
        if (piece_ns(clock, piece, mid_ns) < target_ns)
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
    int64_t end_ns = to_ns;
    for (uint32_t i = clock->n; i-- > 0;) {
        const struct head_clock_piece *piece = &clock->piece[i];
        const int64_t begin_ns = i > 0 && piece->from_ns > from_ns ? piece->from_ns : from_ns;
        if (find_edge(clock, piece, begin_ns, end_ns, edge_ns, tai_s)) return 1;
        if (begin_ns < end_ns) end_ns = begin_ns;
    }
    return 0;
}
