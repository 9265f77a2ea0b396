/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "drivers/protocol/scip_session.h"

/* Hokuyo's SCIP 2.0 and 2.2, the sensor's side: see SCIP.md. This file has the session, and cuts bytes into lines. */

static void scip_power_up(struct scip *s)
{
    s->laser = s->time_mode = s->asleep = 0;
    s->bit_rate = s->model->bit_rate;
    s->rb_ns = s->reboot_ns = INT64_MIN;
    s->stream.active = s->single.active = 0;
    scan_wish_reset(&s->wish, s->spec.identity);
    s->simulation = (struct scip_simulation){0};
    s->n_line = 0;
    s->is_over = s->foul = 0;
}

static int scip_begin(void *protocol, struct sh_err *err)
{
    struct scip *s = protocol;
    (void)err;
    s->model = scip_model_find(s->spec.identity->model);
    s->features = scip_model_features(s->model, s->spec.identity->firmware);
    s->epoch_us_ns = s->spec.power_ns;
    s->epoch_ns = s->spec.power_ns + (int64_t)s->spec.near_wrap * 1000000;
    planar_scan_init(&s->scan);
    scip_power_up(s);
    return SH_OK;
}

static void open_session(void *protocol, int64_t t_ns)
{
    ((struct scip *)protocol)->now_ns = t_ns;
}

uint32_t scip_time_ms(const struct scip *s, int64_t t_ns)
{
    const int64_t ns = t_ns - s->epoch_ns, ms = ns / 1000000 - (ns % 1000000 < 0);
    return (uint32_t)((uint64_t)ms & 0xffffff);
}

uint64_t scip_time_us(const struct scip *s, int64_t t_ns)
{
    return (uint64_t)((t_ns - s->epoch_us_ns) / 1000);
}

void scip_send(struct scip *s)
{
    scip_reply_end(&s->reply);
    s->spec.host.send(s->spec.host.ctx, s->reply.bytes, s->reply.len);
}

void scip_answer(struct scip *s, const char *echo, size_t len, const char *status)
{
    if (strcmp(status, "00") != 0 && strcmp(status, "98") != 0) s->spec.host.count(s->spec.host.ctx, PROTOCOL_WRONG, 1);
    scip_reply_begin(&s->reply, echo, len, status);
    scip_send(s);
}

/* A line with bytes that no command has is noise, of a wrong bit rate for example: it gets no answer. */
static void scip_take_line(struct scip *s)
{
    if (s->foul) s->spec.host.count(s->spec.host.ctx, PROTOCOL_INPUT_LOST, s->n_line);
    if (!s->foul && s->is_over)
        scip_answer(s, s->line, s->n_line, "0B");
    else if (!s->foul && s->n_line != 0)
        scip_command(s);
    s->n_line = 0;
    s->is_over = s->foul = 0;
}

/* Bytes without room are counted as they come, since the end of such a line may never come. */
static void scip_take_input(void *protocol, const uint8_t *bytes, size_t len)
{
    struct scip *s = protocol;
    uint64_t n_over = 0;
    for (size_t i = 0; i < len; i++) {
        if (bytes[i] == '\n' || bytes[i] == '\r') {
            scip_take_line(s);
            continue;
        }
        if (bytes[i] < 0x20 || bytes[i] > 0x7e) s->foul = 1;
        if (s->n_line < sizeof s->line) {
            s->line[s->n_line++] = (char)bytes[i];
            continue;
        }
        s->is_over = 1;
        n_over++;
    }
    if (n_over != 0) s->spec.host.count(s->spec.host.ctx, PROTOCOL_INPUT_LOST, n_over);
}

static void scip_take_frame(void *protocol, const uint8_t *bytes, size_t len)
{
    struct scip *s = protocol;
    (void)len;
    const struct planar_news news = planar_scan_frame(&s->scan, bytes);
    if (news.whole || news.broken != 0) scip_scans_came(s, news);
}

/* Reboots the head at once; scip_pass_time calls it a second after the second RB. The head's power cycle ends this
 * session, too. Where there can't be one, as with a recording, only this session ends and begins anew. */
static void scip_reboot(struct scip *s)
{
    const int refused = s->spec.host.command(s->spec.host.ctx, "HEAD:REBOOT", NULL, 0) != 0;
    scip_power_up(s);
    if (refused) s->spec.host.hang_up(s->spec.host.ctx);
}

static void scip_pass_time(void *protocol, int64_t t_ns)
{
    struct scip *s = protocol;
    s->now_ns = t_ns;
    scip_measure_time(s);
    if (s->reboot_ns != INT64_MIN && t_ns >= s->reboot_ns) scip_reboot(s);
}

static int owes(const void *protocol)
{
    const struct scip *s = protocol;
    return s->stream.active || s->single.active || s->reboot_ns != INT64_MIN;
}

/* A client that has sent RB twice may close before the reboot is due. Then the head reboots at once. */
static void gone(void *protocol)
{
    struct scip *s = protocol;
    if (s->reboot_ns != INT64_MIN) scip_reboot(s);
}

/* Scans are looked for at each tick; without a request it is enough to keep up with the stream. */
static int64_t next_ns(const void *protocol)
{
    enum { IDLE_NS = 50000000 };
    const struct scip *s = protocol;
    if (s->stream.active || s->single.active) return s->now_ns;
    const int64_t idle_ns = s->now_ns + IDLE_NS;
    return s->reboot_ns != INT64_MIN && s->reboot_ns < idle_ns ? s->reboot_ns : idle_ns;
}

static int check_head(const struct native_descriptor *d, const struct native_emitter *e, const uint8_t *beams,
                      struct sh_err *err)
{
    (void)beams;
    return planar_scan_check(d->pan_counts_per_turn, e, SCIP_MAX_STEPS, err);
}

const struct protocol_ops protocol_scip = {
    .name = "scip",
    .needs = PROTOCOL_NEEDS_POLAR,
    .emitters = 1u << NATIVE_EMIT_PLANAR,
    .max_unit = SCIP_MAX_UNIT,
    .content = scip_content,
    .reseal = scip_reseal,
    .check_head = check_head,
    .size = sizeof(struct scip),
    .begin = scip_begin,
    .open = open_session,
    .frame = scip_take_frame, /* .gap is not needed: times and steps of turns show losses */
    .time = scip_pass_time,
    .input = scip_take_input,
    .owes = owes,
    .gone = gone,
    .next_ns = next_ns,
};
