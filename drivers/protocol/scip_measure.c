/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "drivers/protocol/scip_session.h"

/* GD GS GE HD HE, MD MS ME ND NE %MD %ME: requests, and the scans that answer them. */

enum { TRY_NS = 100000000 };

int scip_has_head(const struct scip *s)
{
    return s->scan.head.known && s->scan.head.last < SCIP_MAX_STEPS;
}

/* If no frames show that the head scans, it is asked for its state, and started if it rests. */
const char *scip_laser_on(struct scip *s)
{
    enum { LATELY_NS = 500000000 };
    const int scans = s->scan.t0_ns != INT64_MIN && native_since_ns(s->now_ns, s->scan.t0_ns) < LATELY_NS;
    const enum protocol_head_state head = scans ? PROTOCOL_HEAD_SCANNING : protocol_ask_state(&s->spec.host);
    if (head == PROTOCOL_HEAD_FAULT) return "50";
    if (scip_boots(head)) return "10";
    if (head == PROTOCOL_HEAD_IDLE && !scan_wish_is_starting(&s->wish, &s->scan, s->now_ns)) {
        if (s->spec.host.command(s->spec.host.ctx, "SCAN:START", NULL, 0) != 0) return "10";
        scan_wish_start(&s->wish, s->now_ns);
    }
    if (!s->laser) s->laser_ns = s->now_ns;
    s->laser = 1;
    s->asleep = 0;
    return NULL;
}

void scip_laser_off(struct scip *s)
{
    s->laser = s->stream.active = 0;
    if (!s->single.active) return;
    s->single.active = 0;
    scip_answer(s, s->single.echo, s->single.echo_len, "10");
}

/* First all must be numbers: 01 start, 02 end, 03 cluster, 06 skip, 07 count. Then their values are checked. */
static const char *read_request(struct scip_request *q, const char *line, int streams, int32_t last)
{
    q->start = scip_number(line + 2, 4);
    q->end = scip_number(line + 6, 4);
    q->cluster = scip_number(line + 10, 2);
    const int32_t skip = streams ? scip_number(line + 12, 1) : 0;
    const int32_t count = streams ? scip_number(line + 13, 2) : 1;
    if (q->start < 0) return "01";
    if (q->end < 0) return "02";
    if (q->cluster < 0) return "03";
    if (skip < 0) return "06";
    if (count < 0) return "07";
    if (q->end > last) return "04";
    if (q->end < q->start) return "05";
    if (q->cluster == 0) q->cluster = 1;
    q->skip = (uint32_t)skip;
    q->count = q->remaining = (uint32_t)count;
    return NULL;
}

static const char *scip_measure_begin(struct scip *s, struct scip_request *q, int streams)
{
    *q = (struct scip_request){.echo_len = s->n_line, .time_us = s->line[0] == '%'};
    memcpy(q->echo, s->line, s->n_line);
    const char *line = s->line + q->time_us;
    q->n_chars = line[1] == 'S' ? 2 : 3;
    q->intensity = line[1] == 'E';
    q->multi_echo = line[0] == 'H' || line[0] == 'N';
    const char *refused = read_request(q, line, streams, s->scan.head.last);
    if (refused != NULL) return refused;
    if (s->features & SCIP_FIRST_AT_ONCE) q->skipped = q->skip;
    if (s->time_mode) return "10";
    if (s->simulation.broken) return "50";
    if (!streams && !s->laser) return "10";
    return scip_laser_on(s);
}

/* A second M or N replaces the first, unless it is refused. A second G or H before the first is answered
 * gets 0B: the sensor is still busy with a request. */
const char *scip_measure(struct scip *s)
{
    enum { WAIT_NS = 2000000000 };
    struct scip_request request;
    const int streams = strchr("%MN", s->line[0]) != NULL;
    const char *refused = scip_has_head(s) ? scip_measure_begin(s, &request, streams) : "0A";
    if (refused != NULL) return refused;
    if (!streams && s->single.active) return "0B";
    request.active = 1;
    request.after_ns = streams ? s->now_ns : s->laser_ns;
    request.until_ns = s->now_ns + WAIT_NS;
    s->try_ns = s->now_ns + TRY_NS;
    if (!streams) {
        s->single = request;
        return NULL;
    }
    s->stream = request;
    scan_wish_make(&s->wish, s->now_ns);
    s->simulation.n_waiting = 0; /* a new stream has all phases of DB, from the first on */
    return "00";
}

/* Starts the head again while it is not known to scan on: it may have been about to stop when it was asked for scans.
 * Once it scans, a later stop is intended, and the head is left alone. */
static void wake_head(struct scip *s)
{
    const int waits = s->single.active || (s->stream.active && s->wish.lasts);
    if (!waits || s->now_ns < s->try_ns) return;
    s->try_ns = scip_laser_on(s) == NULL ? s->now_ns + TRY_NS : INT64_MAX;
}

void scip_measure_time(struct scip *s)
{
    wake_head(s);
    if (!s->single.active || s->now_ns < s->single.until_ns) return;
    s->single.active = 0;
    scip_answer(s, s->single.echo, s->single.echo_len, "0A");
}

/* A scan that is being sent. */
struct measured {
    const struct planar_head *head;
    const struct planar_turn *turn;
    double mm_per_count;
    uint32_t min_mm; /* smaller ranges are sent as an error */
};

static uint32_t range_mm(const struct measured *m, const struct planar_echo *echo)
{
    const double mm = echo->range * m->mm_per_count;
    return mm < 4e9 ? (uint32_t)(mm + 0.5) : UINT32_MAX;
}

/* An intensity is proportional to the root of the power. With amplitudes it is 100 at the detection threshold, else
 * 1000 for a matt white surface at zero incidence. */
static uint32_t intensity_of(const struct measured *m, const struct planar_echo *echo)
{
    const int amplitudes = m->head->attributes;
    const int16_t level_cdb = amplitudes ? echo->amplitude_cdb : echo->refl_cdb;
    if (level_cdb == (amplitudes ? (int)NATIVE_AMPLITUDE_NONE : (int)LINE_REFL_NONE)) return 0;
    const double value = (amplitudes ? 100.0 : 1000.0) * pow(10.0, level_cdb / 2000.0);
    return value < 1.0 ? 1 : value > 65535.0 ? 65535 : (uint32_t)lround(value);
}

/* Number of echoes of a step; 0 also where the step can't be measured. */
static int n_echoes(const struct measured *m, int32_t number)
{
    if (number < m->head->first || number > m->head->last) return 0;
    const int n = m->turn->n[number - m->head->first];
    return n < SCIP_MAX_ECHOES ? n : SCIP_MAX_ECHOES;
}

/* Returns the step that stands for a cluster: the step with the smallest range. Ranges below min_mm are errors, and do
 * not count. If no step has a range that counts, the first step stands for the cluster. */
static int32_t nearest(const struct measured *m, int32_t from, int32_t to)
{
    int32_t best = -1;
    uint32_t least_mm = UINT32_MAX;
    for (int32_t i = from; i <= to; i++) {
        if (n_echoes(m, i) == 0) continue;
        const uint32_t mm = range_mm(m, &m->turn->echo[i - m->head->first][0]);
        if (mm < m->min_mm || (best >= 0 && mm >= least_mm)) continue;
        best = i;
        least_mm = mm;
    }
    return best < 0 ? from : best;
}

static void put_step(struct scip *s, const struct scip_request *q, const struct measured *m, int32_t number)
{
    const int n = n_echoes(m, number);
    if (n == 0) {
        scip_reply_value(&s->reply, number < m->head->first ? s->model->no_step : s->model->no_object, q->n_chars);
        if (q->intensity) scip_reply_value(&s->reply, 0, 3);
        return;
    }
    const struct planar_echo *echo = m->turn->echo[number - m->head->first];
    for (int k = 0; k < (q->multi_echo ? n : 1); k++) {
        const uint32_t mm = range_mm(m, &echo[k]);
        const int good = mm >= m->min_mm;
        if (k > 0) scip_reply_mark(&s->reply, '&');
        scip_reply_value(&s->reply, good ? mm : s->model->too_near, q->n_chars);
        if (q->intensity) scip_reply_value(&s->reply, good ? intensity_of(m, &echo[k]) : 0, 3);
    }
}

static void send_scan(struct scip *s, const struct scip_request *q, const char *status)
{
    const struct planar_head *head = &s->scan.head;
    const struct measured m = {.head = head,
                               .turn = s->scan.whole,
                               .mm_per_count = head->m_per_count * 1e3,
                               .min_mm = scip_millimetres(head->range_min_m)};
    scip_reply_begin(&s->reply, q->echo, q->echo_len, status);
    if (q->time_us)
        scip_reply_time_us(&s->reply, scip_time_us(s, m.turn->t0_ns));
    else
        scip_reply_time(&s->reply, scip_time_ms(s, m.turn->t0_ns));
    for (int32_t from = q->start; from <= q->end; from += q->cluster) {
        const int32_t to = from + q->cluster - 1;
        put_step(s, q, &m, nearest(&m, from, to < q->end ? to : q->end));
    }
    scip_send(s);
}

/* The last two digits of a stream's echoed request are the scans that are left; 00 stays where there is no end. */
static void write_remaining(struct scip_request *q)
{
    char *digits = q->echo + 13 + q->time_us;
    digits[0] = (char)('0' + q->remaining / 10);
    digits[1] = (char)('0' + q->remaining % 10);
}

/* Status 50 ends the stream; the laser then is off. */
static void send_in_place(struct scip *s, const char *status)
{
    struct scip_request *q = &s->stream;
    scip_answer(s, q->echo, q->echo_len, status);
    if (strcmp(status, "50") == 0) scip_laser_off(s);
}

static void stream_scan(struct scip *s)
{
    struct scip_request *q = &s->stream;
    if (q->skipped < q->skip) {
        q->skipped++;
        return;
    }
    const char *simulated = scip_simulated(s);
    if (simulated != NULL) {
        if (*simulated != 0) send_in_place(s, simulated);
        return;
    }
    q->skipped = 0;
    q->sent++;
    if (q->count != 0) q->remaining--;
    write_remaining(q);
    send_scan(s, q, "99");
    if (q->count != 0 && q->remaining == 0) q->active = s->laser = 0;
}

/* A broken scan is not sent, and is not one of the scans that the client asked for: the client gets as many whole
 * scans. Broken scans count as lost units, and as scans that are left out before the next one. */
void scip_scans_came(struct scip *s, struct planar_news news)
{
    const int streams = s->stream.active, waits = s->single.active;
    if ((streams || waits) && news.broken != 0) {
        s->spec.host.count(s->spec.host.ctx, PROTOCOL_UNITS_LOST, news.broken);
        s->stream.skipped += news.broken;
    }
    if (!news.whole) return;
    if (waits && s->scan.whole->t0_ns >= s->single.after_ns) {
        s->single.active = 0;
        send_scan(s, &s->single, "00");
    }
    if (streams && s->scan.whole->t0_ns >= s->stream.after_ns) {
        scan_wish_take_turn(&s->wish, &s->scan, &s->spec.host);
        stream_scan(s);
    }
}
