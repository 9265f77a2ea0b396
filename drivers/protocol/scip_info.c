/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/scip_session.h"

/* VV, PP and II are answered with key lines, %ST with a number. */

uint64_t scip_lines_uhz(struct scip *s, const char *query)
{
    char reply[PROTOCOL_REPLY], *end;
    if (s->spec.host.command(s->spec.host.ctx, query, reply, sizeof reply) != 0) return s->scan.head.lines_uhz;
    const double hz = strtod(reply, &end);
    return end == reply || !(hz > 0 && hz < 1e6) ? s->scan.head.lines_uhz : (uint64_t)llround(hz * 1e6);
}

static unsigned rpm(uint64_t lines_uhz)
{
    return (unsigned)((lines_uhz * 60 + 500000) / 1000000);
}

uint32_t scip_millimetres(double range_m)
{
    return range_m > 0 && range_m < 4e6 ? (uint32_t)lround(range_m * 1e3) : 0;
}

static const char *or_else(const char *text, const char *other)
{
    return text != NULL ? text : other;
}

const char *scip_info_version(struct scip *s)
{
    struct scip_reply *r = &s->reply;
    scip_reply_begin(r, s->line, s->n_line, "00");
    scip_reply_key(r, "VEND", "%s", or_else(s->model->vendor, s->spec.identity->maker));
    scip_reply_key(r, "PROD", "%s", or_else(s->model->product, s->spec.identity->model));
    scip_reply_key(r, "FIRM", "%s", s->spec.identity->firmware);
    scip_reply_key(r, "PROT", "%s", s->model->protocol);
    scip_reply_key(r, "SERI", "%s", s->spec.identity->serial);
    scip_send(s);
    return NULL;
}

const char *scip_info_parameters(struct scip *s)
{
    struct scip_reply *r = &s->reply;
    const struct planar_head *head = &s->scan.head;
    if (!scip_has_head(s)) return "0A";
    const unsigned normal_rpm = rpm(scip_lines_uhz(s, "HEAD:LINES? DEF"));
    scip_reply_begin(r, s->line, s->n_line, "00");
    scip_reply_key(r, "MODL", "%s", or_else(s->model->model, s->spec.identity->model));
    scip_reply_key(r, "DMIN", "%u", (unsigned)scip_millimetres(head->range_min_m));
    scip_reply_key(r, "DMAX", "%u", (unsigned)scip_millimetres(head->range_max_m));
    scip_reply_key(r, "ARES", "%u", (unsigned)head->steps);
    scip_reply_key(r, "AMIN", "%d", (int)head->first);
    scip_reply_key(r, "AMAX", "%d", (int)head->last);
    scip_reply_key(r, "AFRT", "%d", (int)head->front);
    scip_reply_key(r, "SCAN", "%u", normal_rpm);
    scip_send(s);
    return NULL;
}

static const char *mode(const struct scip *s, enum protocol_head_state head)
{
    if (scip_boots(head)) return s->model->mode_booting;
    if (head == PROTOCOL_HEAD_FAULT) return s->model->mode_fault;
    if (s->stream.active) return s->model->mode_streaming;
    return s->laser ? s->model->mode_single : s->model->mode_idle;
}

static const char *status(const struct scip *s, enum protocol_head_state head)
{
    if (s->simulation.broken) return "Malfunction, played by DB";
    if (scip_boots(head)) return s->model->boots;
    return head == PROTOCOL_HEAD_FAULT ? s->model->has_failed : s->model->works;
}

static void put_speed(struct scip *s)
{
    const struct scip_model *m = s->model;
    const unsigned now_rpm = rpm(scip_lines_uhz(s, "HEAD:LINES?"));
    const unsigned normal_rpm = rpm(scip_lines_uhz(s, "HEAD:LINES? DEF"));
    scip_reply_key(&s->reply, "SCSP", "%s%u%s%s", m->speed_before, now_rpm, m->speed_after,
                   now_rpm == normal_rpm ? m->at_default : "");
}

static void put_time(struct scip *s)
{
    const uint32_t ms = scip_time_ms(s, s->now_ns);
    char time[4];
    scip_encode4(time, ms);
    if ((s->features & SCIP_TIME_HEX) != 0)
        scip_reply_key(&s->reply, "TIME", "%06X", (unsigned)ms);
    else
        scip_reply_key(&s->reply, "TIME", "%.4s", time);
}

const char *scip_info_state(struct scip *s)
{
    struct scip_reply *r = &s->reply;
    const struct scip_model *m = s->model;
    const enum protocol_head_state head = protocol_ask_state(&s->spec.host);
    scip_reply_begin(r, s->line, s->n_line, "00");
    scip_reply_key(r, "MODL", "%s", or_else(m->model, s->spec.identity->model));
    scip_reply_key(r, "LASR", "%s", s->laser ? "ON" : "OFF");
    put_speed(s);
    scip_reply_key(r, "MESM", "%s", mode(s, head));
    if (m->link != NULL)
        scip_reply_key(r, "SBPS", "%s", m->link);
    else
        scip_reply_key(r, "SBPS", "%u[bps]%s", (unsigned)s->bit_rate, s->bit_rate == m->bit_rate ? m->at_default : "");
    put_time(s);
    scip_reply_key(r, "STAT", "%s", status(s, head));
    scip_send(s);
    return NULL;
}

/* Answers %ST. MESM of a UTM-30LX-EW has the same numbers, but neither 002 (time mode) nor 005 (asleep). */
const char *scip_info_state_number(struct scip *s)
{
    const enum protocol_head_state head = protocol_ask_state(&s->spec.host);
    const char *number = "000";
    if (scip_boots(head))
        number = "001";
    else if (head == PROTOCOL_HEAD_FAULT || s->simulation.broken)
        number = "900";
    else if (s->time_mode)
        number = "002";
    else if (s->stream.active)
        number = "004";
    else if (s->laser)
        number = "003";
    else if (s->asleep)
        number = "005";
    scip_reply_begin(&s->reply, s->line, s->n_line, "00");
    scip_reply_line(&s->reply, number, strlen(number));
    scip_send(s);
    return NULL;
}
