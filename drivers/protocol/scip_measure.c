#include <math.h>
#include <stdio.h>
#include <string.h>

#include "drivers/protocol/scip_session.h"

/* GD GS GE HD HE, MD MS ME ND NE: requests, and the scans that answer them. */

enum { TRY_NS = 100000000 };

/* Where no frames show that the head scans, it is asked, and started from rest. */
const char *scip_laser_on(struct scip *s)
{
    enum { LATELY_NS = 500000000 };
    char reply[512];
    const int scans = s->scan.in_turn && s->now_ns - s->scan.t0_ns < LATELY_NS;
    if (!scans && s->host.command(s->host.ctx, "HEAD:STATE?", reply, sizeof reply) == 0) {
        if (strcmp(reply, "fault") == 0) return "50";
        if (strcmp(reply, "boot") == 0 || strcmp(reply, "off") == 0) return "10";
        if (strcmp(reply, "idle") == 0 && s->host.command(s->host.ctx, "SCAN:START", reply, sizeof reply) != 0)
            return "10";
    }
    if (!s->laser) s->laser_ns = s->now_ns;
    s->laser = 1;
    return NULL;
}

void scip_laser_off(struct scip *s)
{
    s->laser = s->stream.active = 0;
    if (!s->single.active) return;
    s->single.active = 0;
    scip_answer(s, s->single.echo, s->single.echo_len, "10");
}

/* Numbers first, then what they say: 01 start, 02 end, 03 cluster, 06 skip, 07 count. */
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

static const char *begin(struct scip *s, struct scip_request *q, const char *line, size_t len, int streams)
{
    memset(q, 0, sizeof *q);
    memcpy(q->echo, line, len);
    q->echo_len = len;
    q->n_chars = line[1] == 'S' ? 2 : 3;
    q->intensity = line[1] == 'E';
    q->multi_echo = line[0] == 'H' || line[0] == 'N';
    const char *refused = read_request(q, line, streams, s->scan.last);
    if (refused != NULL) return refused;
    if (s->time_mode) return "10";
    if (s->simulation.broken) return "50";
    if (!streams && !s->laser) return "10";
    return scip_laser_on(s);
}

/* A second M or N replaces the first, but not when it is refused. A second G or H before the first is
 * answered repeats what is already being processed. */
void scip_measure(struct scip *s, const char *line, size_t len)
{
    enum { WAIT_NS = 2000000000 };
    struct scip_request request;
    const int streams = line[0] == 'M' || line[0] == 'N';
    const char *refused = s->scan.known ? begin(s, &request, line, len, streams) : "0A";
    if (refused == NULL && !streams && s->single.active) refused = "0B";
    if (refused != NULL) {
        scip_answer(s, line, len, refused);
        return;
    }
    request.active = 1;
    request.after_ns = streams ? s->now_ns : s->laser_ns;
    request.until_ns = s->now_ns + WAIT_NS;
    s->try_ns = s->now_ns + TRY_NS;
    if (!streams) {
        s->single = request;
        return;
    }
    s->stream = request;
    scip_answer(s, line, len, "00");
}

/* The head may have been about to stop when it was asked for scans. Once its first scan has come, who stops the head
 * means it. */
static void wake_head(struct scip *s)
{
    const int waits = s->single.active || (s->stream.active && s->stream.sent == 0);
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

/* 100 at the detection threshold, or 1000 of a matt white surface under zero incidence; the root of the
 * power. */
static uint32_t intensity_of(const struct scip_scan *scan, int16_t level_cdb)
{
    if (level_cdb == SCIP_LEVEL_NONE) return 0;
    const double value = (scan->amplitudes ? 100.0 : 1000.0) * pow(10.0, level_cdb / 2000.0);
    return value < 1.0 ? 1 : value > 65535.0 ? 65535 : (uint32_t)lround(value);
}

static int is_range(const struct scip_scan *scan, int32_t number)
{
    const struct scip_step *step = &scan->step[number];
    return number >= scan->first && step->n != 0 && step->range_mm[0] >= scan->min_mm;
}

/* The step that stands for a cluster: the one of the least range, or its first where there is none. */
static int32_t nearest(const struct scip_scan *scan, int32_t from, int32_t to)
{
    int32_t best = -1;
    for (int32_t i = from; i <= to; i++)
        if (is_range(scan, i) && (best < 0 || scan->step[i].range_mm[0] < scan->step[best].range_mm[0])) best = i;
    return best < 0 ? from : best;
}

static void put_step(struct scip *s, const struct scip_request *q, int32_t number)
{
    const struct scip_step *step = &s->scan.step[number];
    const int there = number >= s->scan.first && step->n != 0;
    const int n = !there ? 1 : q->multi_echo ? step->n : 1;
    for (int k = 0; k < n; k++) {
        const int good = there && step->range_mm[k] >= s->scan.min_mm;
        uint32_t value = good ? step->range_mm[k] : s->model->too_near;
        if (!there) value = number < s->scan.first ? s->model->no_step : s->model->no_object;
        if (k > 0) scip_reply_mark(&s->reply, '&');
        scip_reply_value(&s->reply, value, q->n_chars);
        if (q->intensity) scip_reply_value(&s->reply, good ? intensity_of(&s->scan, step->level_cdb[k]) : 0, 3);
    }
}

static void send_scan(struct scip *s, const struct scip_request *q, const char *status)
{
    scip_reply_begin(&s->reply, q->echo, q->echo_len, status);
    scip_reply_time(&s->reply, scip_time_ms(s, s->scan.t0_ns));
    for (int32_t from = q->start; from <= q->end; from += q->cluster) {
        const int32_t to = from + q->cluster - 1;
        put_step(s, q, nearest(&s->scan, from, to < q->end ? to : q->end));
    }
    scip_send(s);
}

/* The last two digits of a stream's echo are the scans that are left; 00 stays where there is no end. */
static void write_remaining(struct scip_request *q)
{
    q->echo[13] = (char)('0' + q->remaining / 10);
    q->echo[14] = (char)('0' + q->remaining % 10);
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

/* A broken scan isn't sent and isn't one of the count: as many whole ones come as were asked for. */
void scip_scans_came(struct scip *s, struct scip_turns turns)
{
    const int streams = s->stream.active, waits = s->single.active;
    if ((streams || waits) && turns.broken != 0) {
        s->host.count(s->host.ctx, PROTOCOL_UNITS_LOST, turns.broken);
        const uint32_t left_out = s->stream.skip - s->stream.skipped;
        s->stream.skipped += turns.broken < left_out ? turns.broken : left_out;
    }
    if (!turns.whole) return;
    if (waits && s->scan.t0_ns >= s->single.after_ns) {
        s->single.active = 0;
        send_scan(s, &s->single, "00");
    }
    if (streams && s->scan.t0_ns >= s->stream.after_ns) stream_scan(s);
}
