#include <math.h>
#include <stdlib.h>

#include "drivers/protocol/scip_session.h"

/* VV, PP, II: key lines. */

uint64_t scip_lines_uhz(struct scip *s, const char *query)
{
    char reply[512], *end;
    if (s->host.command(s->host.ctx, query, reply, sizeof reply) != 0) return s->scan.head.lines_uhz;
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

void scip_info_version(struct scip *s, const char *line, size_t len)
{
    struct scip_reply *r = &s->reply;
    scip_reply_begin(r, line, len, "00");
    scip_reply_key(r, "VEND", "%s", or_else(s->model->vendor, s->identity->maker));
    scip_reply_key(r, "PROD", "%s", or_else(s->model->product, s->identity->model));
    scip_reply_key(r, "FIRM", "%s", s->identity->firmware);
    scip_reply_key(r, "PROT", "%s", s->model->protocol);
    scip_reply_key(r, "SERI", "%s", s->identity->serial);
    scip_send(s);
}

void scip_info_parameters(struct scip *s, const char *line, size_t len)
{
    struct scip_reply *r = &s->reply;
    const struct planar_head *head = &s->scan.head;
    if (!scip_has_head(s)) {
        scip_answer(s, line, len, "0A");
        return;
    }
    const unsigned normal_rpm = rpm(scip_lines_uhz(s, "HEAD:LINES? DEF"));
    scip_reply_begin(r, line, len, "00");
    scip_reply_key(r, "MODL", "%s", or_else(s->model->model, s->identity->model));
    scip_reply_key(r, "DMIN", "%u", (unsigned)scip_millimetres(head->range_min_m));
    scip_reply_key(r, "DMAX", "%u", (unsigned)scip_millimetres(head->range_max_m));
    scip_reply_key(r, "ARES", "%u", (unsigned)head->steps);
    scip_reply_key(r, "AMIN", "%d", (int)head->first);
    scip_reply_key(r, "AMAX", "%d", (int)head->last);
    scip_reply_key(r, "AFRT", "%d", (int)head->front);
    scip_reply_key(r, "SCAN", "%u", normal_rpm);
    scip_send(s);
}

static const char *mode(const struct scip *s)
{
    if (s->stream.active) return s->model->mode_streaming;
    return s->laser ? s->model->mode_single : s->model->mode_idle;
}

void scip_info_state(struct scip *s, const char *line, size_t len)
{
    struct scip_reply *r = &s->reply;
    const struct scip_model *m = s->model;
    const uint32_t ms = scip_time_ms(s, s->now_ns);
    char time[4];
    scip_encode4(time, ms);
    const unsigned now_rpm = rpm(scip_lines_uhz(s, "HEAD:LINES?"));
    const unsigned normal_rpm = rpm(scip_lines_uhz(s, "HEAD:LINES? DEF"));
    scip_reply_begin(r, line, len, "00");
    scip_reply_key(r, "MODL", "%s", or_else(m->model, s->identity->model));
    scip_reply_key(r, "LASR", "%s", s->laser ? "ON" : "OFF");
    scip_reply_key(r, "SCSP", "%s%u%s%s", m->speed_before, now_rpm, m->speed_after,
                   now_rpm == normal_rpm ? m->at_default : "");
    scip_reply_key(r, "MESM", "%s", mode(s));
    if (m->link != NULL)
        scip_reply_key(r, "SBPS", "%s", m->link);
    else
        scip_reply_key(r, "SBPS", "%u[bps]%s", (unsigned)s->bit_rate, s->bit_rate == m->bit_rate ? m->at_default : "");
    if ((m->features & SCIP_TIME_HEX) != 0)
        scip_reply_key(r, "TIME", "%06x", (unsigned)ms);
    else
        scip_reply_key(r, "TIME", "%.4s", time);
    scip_reply_key(r, "STAT", "%s", s->simulation.broken ? "Malfunction, played by DB" : m->works);
    scip_send(s);
}
