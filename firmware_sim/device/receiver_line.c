/* SPDX-License-Identifier: MIT */
#include "firmware_sim/device/receiver_line.h"

#include <math.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/device/clock_faults.h"

static int64_t configured_ns(const struct gnss *gnss)
{
    return llround(1e6 * gnss->site->cfg->gnss.nmea_late_ms);
}

static const struct receiver_sentence *sentence_at(const struct receiver_line *line, uint64_t i)
{
    return &line->kept[i % RECEIVER_KEPT];
}

static uint64_t oldest_of(const struct receiver_line *line)
{
    return line->n > RECEIVER_KEPT ? line->n - RECEIVER_KEPT : 0;
}

/* Returns whether a fault of this kind strikes at the fix of t_ns. If so, the fault counts it. */
static int receiver_line_strikes(struct head_faults *faults, enum fault_kind kind, int64_t t_ns)
{
    if (!device_has_clock_fault(faults, kind, t_ns)) return 0;
    device_count_clock_fault(faults, kind, t_ns);
    return 1;
}

static void send_fix(struct receiver_line *line, const struct gnss *gnss, struct head_faults *faults, uint64_t index)
{
    const int64_t t_ns = gnss_time_ns(gnss, index);
    struct receiver_sentence next = {.t_ns = t_ns + configured_ns(gnss), .index = index};
    if (receiver_line_strikes(faults, FAULT_NMEA_LOST, t_ns) || !gnss->site->cfg->gnss.nmea) return;
    next.is_void = receiver_line_strikes(faults, FAULT_NMEA_VOID, t_ns);
    next.is_spoilt = receiver_line_strikes(faults, FAULT_NMEA_CHECKSUM, t_ns);
    if (receiver_line_strikes(faults, FAULT_NMEA_LATE, t_ns)) next.t_ns += device_sentence_late_ns(faults, t_ns);
    if (line->n != 0 && next.t_ns <= sentence_at(line, line->n - 1)->t_ns)
        next.t_ns = sentence_at(line, line->n - 1)->t_ns + 1;
    line->kept[line->n++ % RECEIVER_KEPT] = next;
}

void receiver_line_run(struct receiver_line *line, const struct gnss *gnss, struct head_faults *faults, int64_t end_ns)
{
    for (const uint64_t n = gnss_count(gnss, end_ns); line->next < n; line->next++)
        send_fix(line, gnss, faults, line->next);
}

/* Counts the fixes whose sentences arrive before t_ns, if nothing is wrong. */
static uint64_t count_due(const struct gnss *gnss, int64_t t_ns)
{
    t_ns -= configured_ns(gnss);
    return t_ns > 0 && gnss->site->cfg->gnss.nmea ? gnss_count(gnss, t_ns) : 0;
}

int receiver_line_last(const struct receiver_line *line, const struct gnss *gnss, int64_t t_ns,
                       struct receiver_sentence *out)
{
    const uint64_t due = count_due(gnss, t_ns + 1), oldest = oldest_of(line);
    if (due > line->next || (oldest > 0 && t_ns < sentence_at(line, oldest)->t_ns)) {
        if (due == 0) return 0;
        *out = (struct receiver_sentence){.t_ns = gnss_time_ns(gnss, due - 1) + configured_ns(gnss), .index = due - 1};
        return 1;
    }
    for (uint64_t i = line->n; i-- > oldest;) {
        *out = *sentence_at(line, i);
        if (out->t_ns <= t_ns) return 1;
    }
    return 0;
}

int64_t receiver_line_next_ns(const struct receiver_line *line, const struct gnss *gnss, int64_t t_ns)
{
    if (!gnss->on || !gnss->site->cfg->gnss.nmea) return INT64_MAX;
    for (uint64_t i = oldest_of(line); i < line->n; i++)
        if (sentence_at(line, i)->t_ns >= t_ns) return sentence_at(line, i)->t_ns;
    const uint64_t due = count_due(gnss, t_ns);
    return gnss_time_ns(gnss, due > line->next ? due : line->next) + configured_ns(gnss);
}
