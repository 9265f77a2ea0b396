/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "drivers/host/scanhead.h"
#include "drivers/protocol/native.h"
#include "firmware_sim/app/studio/soak/head.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/app/studio/soak/row.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/app/studio/soak/usb.h"
#include "firmware_sim/command/head.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/fault/fault.h"

/* Between two events the head's clock and device time should go equally far. Where the clock lost more than STEP_S, it
 * was stopped. A difference between GAIN_S and STEP_S is drift. Both limits are far above a nanosecond, the unit of the
 * times, and far below a usual jump. PPS_WITHIN_S: the longest time between two pulses. */
static const double STEP_S = 1e-3, GAIN_S = 1e-6, PPS_WITHIN_S = 1.5;

/* Why a client can't notice faults of a kind. */
static const char NMEA[] = "only the receiver's sentences and a VLP-16's packets show it",
                  NTP[] = "only the dates of a SICK scanner's scans show it",
                  MIRROR[] = "only the polar layout of a line head has the encoder of the mirror";
static const char *const hidden[FAULT_N_KINDS] = {
    [FAULT_PAN_SLIP] = "no encoder shows it; only points that no longer fit do",
    [FAULT_WINDOW_SOILED] = "amplitudes fall: a client has no others to compare with",
    [FAULT_COUNTERS_HIGH] = "counters continue after their wrap",
    [FAULT_NMEA_LOST] = NMEA,
    [FAULT_NMEA_LATE] = NMEA,
    [FAULT_NMEA_VOID] = NMEA,
    [FAULT_NMEA_CHECKSUM] = NMEA,
    [FAULT_NTP_SILENT] = NTP,
    [FAULT_NTP_KISS] = NTP,
    [FAULT_NTP_UNSYNC] = NTP,
    [FAULT_NTP_STEP] = NTP,
    [FAULT_PTP_ASYMMETRY] = "a follower can't see it; only another clock does",
    [FAULT_PTP_JITTER] = "the noise of the path looks the same",
    [FAULT_PTP_NO_SYNC] = "the follower keeps its states; only its offset no longer changes",
    [FAULT_MIRROR_SLOW] = MIRROR,
    [FAULT_MIRROR_STUCK] = MIRROR,
    [FAULT_MIRROR_WOBBLE] = MIRROR,
};
/* Why the fault, or the run, may end before the client can notice it. */
static const char PTP[] = "the follower's state and offset showed nothing of it in that time";
static const char *const unseen[FAULT_N_KINDS] = {
    [FAULT_LEAP_SECOND] = "the minute with the leap second was not over",
    [FAULT_SLOW_BOOT] = "at this pace it may end before a client connects",
    [FAULT_PTP_LOST] = PTP,
    [FAULT_PTP_FAULTY] = PTP,
    [FAULT_PTP_GRANDMASTER] = PTP,
    [FAULT_PTP_STEP] = PTP,
};

/* Returns NULL where a client can notice faults of the kind. */
static const char *why_hidden(const struct soak *soak, enum fault_kind kind)
{
    const int has_mirror = soak->cfg->profile.emitter.kind == EMITTER_LINE && soak->cfg->output.layout == LINE_POLAR;
    return hidden[kind] == MIRROR && has_mirror ? NULL : hidden[kind];
}

/* ---- what was done */

static void add_moment(struct soak_link *link, const struct fault_note *note)
{
    struct soak_row *row = &link->row[note->kind];
    const char *why = why_hidden(link->soak, note->kind);
    row->injected++;
    if (note->kind == FAULT_POWER_CYCLE)
        soak_usb_forget(&link->plugs, link->row, "power went before a client opened it");
    if (link->datagrams != NULL) why = "the clean packets come from the same head, so they have this fault, too";
    if (!link->usable) why = "the link has no client here";
    if (why == NULL && link->n_moments == SOAK_MAX_MOMENTS) why = "too many at a time";
    if (why != NULL) {
        soak_hide(row, 1, why);
        return;
    }
    struct soak_moment *m = &link->moment[link->n_moments++];
    *m = (struct soak_moment){
        .kind = note->kind, .fault = note->fault, .from_ns = note->t_ns, .to_ns = INT64_MAX, .for_ms = note->for_ms};
    if (note->fault >= 1 && note->fault <= link->soak->faults.n) m->what = link->soak->faults.fault[note->fault - 1];
}

static void hide_moment(struct soak_link *link, uint32_t i, const char *why)
{
    soak_hide(&link->row[link->moment[i].kind], 1, why);
    link->moment[i] = link->moment[--link->n_moments];
}

void soak_heard_head(struct soak_link *link, const struct fault_note *note)
{
    link->ask.others++;
    if (!note->ended) {
        add_moment(link, note);
        return;
    }
    for (uint32_t i = link->n_moments; i-- > 0;) {
        if (link->moment[i].fault != note->fault || link->moment[i].to_ns != INT64_MAX) continue;
        link->moment[i].to_ns = note->t_ns;
        if (note->kind == FAULT_PPS_JITTER && note->n == 0) hide_moment(link, i, "no PPS came while the fault lasted");
    }
}

/* ---- what the client saw */

static void see_moment(struct soak_link *link, struct soak_moment *m)
{
    link->row[m->kind].noticed++;
    *m = link->moment[--link->n_moments];
}

/* Notes as noticed all faults of a kind that were at work between two times. */
static void see_kind(struct soak_link *link, enum fault_kind kind, int64_t from_ns, int64_t to_ns)
{
    for (uint32_t i = link->n_moments; i-- > 0;) {
        struct soak_moment *m = &link->moment[i];
        if (m->kind == kind && m->from_ns <= to_ns && m->to_ns >= from_ns) see_moment(link, m);
    }
}

int soak_saw_power_go(struct soak_link *link, int64_t before_ns)
{
    for (uint32_t i = 0; i < link->n_moments; i++) {
        struct soak_moment *m = &link->moment[i];
        if (m->kind != FAULT_POWER_CYCLE || m->from_ns > before_ns) continue;
        see_moment(link, m);
        return 1;
    }
    return 0;
}

/* Whether a fault was over before this first frame, so that it can't be noticed. The event that ends a slow boot still
 * shows it. */
static int is_before(const struct soak_moment *m, const struct scanhead_frame *frame)
{
    const int ends_boot = frame->type == SCANHEAD_EVENT && frame->event == SCANHEAD_EV_STATE;
    if (m->kind == FAULT_POWER_CYCLE) return m->from_ns < frame->t_ns;
    return m->kind == FAULT_SLOW_BOOT && !ends_boot && frame->t_ns - m->from_ns >= (int64_t)(1e6 * m->for_ms);
}

void soak_head_begins(struct soak_link *link, const struct scanhead_frame *frame)
{
    for (uint32_t i = link->n_moments; i-- > 0;)
        if (is_before(&link->moment[i], frame)) hide_moment(link, i, "it was before the client had a frame");
}

void soak_saw_state(struct soak_link *link, const char *state)
{
    pthread_mutex_lock(&link->lock);
    if (strcmp(state, "boot") == 0) see_kind(link, FAULT_SLOW_BOOT, INT64_MIN, INT64_MAX);
    if (strcmp(state, "fault") == 0) see_kind(link, FAULT_SELF_TEST, INT64_MIN, INT64_MAX);
    pthread_mutex_unlock(&link->lock);
}

/* Notices a boot that took as long as its fault said, and a self-test that failed. */
static void take_state(struct soak_link *link, const struct scanhead_frame *frame)
{
    if (frame->event_value[0] == HEAD_FAULT) see_kind(link, FAULT_SELF_TEST, INT64_MIN, frame->t_ns);
    for (uint32_t i = link->n_moments; i-- > 0 && frame->event_value[1] == HEAD_BOOT;) {
        struct soak_moment *m = &link->moment[i];
        if (m->kind == FAULT_SLOW_BOOT && frame->t_ns - m->from_ns >= (int64_t)(1e6 * m->for_ms)) see_moment(link, m);
    }
}

/* Hides faults that were over before the client knew a time of day, since it has no earlier one to compare with. */
static void hide_clock(struct soak_link *link, int64_t at_ns)
{
    for (uint32_t i = link->n_moments; i-- > 0;) {
        const struct soak_moment *m = &link->moment[i];
        const int is_over = (m->kind == FAULT_CLOCK_JUMP && m->from_ns <= at_ns) ||
                            ((m->kind == FAULT_CLOCK_STOP || m->kind == FAULT_CLOCK_DRIFT) && m->to_ns <= at_ns);
        if (is_over) hide_moment(link, i, "it was before the client had a time");
    }
}

/* Compares how far the head's clock and device time went since the last event that had both. */
static void take_time(struct soak_link *link, int64_t at_ns, int64_t gps_ns)
{
    struct soak_times *t = &link->times;
    if (gps_ns == 0) return;
    const double by_s = 1e-9 * (double)((gps_ns - t->gps_ns) - (at_ns - t->at_ns));
    for (uint32_t i = link->n_moments; i-- > 0 && t->have;) {
        struct soak_moment *m = &link->moment[i];
        if (m->from_ns > at_ns || m->to_ns < t->at_ns) continue;
        const double jump_s = m->what.jump_s;
        const int seen = (m->kind == FAULT_CLOCK_JUMP && fabs(by_s - jump_s) < 0.5 * fabs(jump_s)) ||
                         (m->kind == FAULT_CLOCK_STOP && by_s < -STEP_S) ||
                         (m->kind == FAULT_CLOCK_DRIFT && fabs(by_s) > GAIN_S && fabs(by_s) < STEP_S);
        if (seen) see_moment(link, m);
    }
    if (!t->have) hide_clock(link, at_ns);
    t->have = 1;
    t->at_ns = at_ns;
    t->gps_ns = gps_ns;
}

/* Notices that no PPS came for PPS_WITHIN_S since the last one, or since the first frame. */
static void miss_pps(struct soak_link *link, int64_t at_ns)
{
    const int64_t last_ns = link->times.pps_ns;
    if (1e-9 * (double)(at_ns - last_ns) > PPS_WITHIN_S) see_kind(link, FAULT_PPS_LOST, last_ns, at_ns);
}

/* A client can't miss pulses from before its first frame. */
static void hide_pps(struct soak_link *link, int64_t first_ns)
{
    for (uint32_t i = link->n_moments; i-- > 0;)
        if (link->moment[i].kind == FAULT_PPS_LOST && link->moment[i].from_ns < first_ns)
            hide_moment(link, i, "it was before the client had a frame");
}

/* Notices a PPS pulse whose distance from the one before it is wrong by as much as the fault says. */
static void see_jitter(struct soak_link *link, int64_t at_ns, int64_t gps_s)
{
    const struct soak_times *t = &link->times;
    const double off_s = fabs(1e-9 * (double)(at_ns - t->pps_ns) - (double)(gps_s - t->pps_gps_s));
    for (uint32_t i = link->n_moments; i-- > 0;) {
        struct soak_moment *m = &link->moment[i];
        const double late_s = 1e-3 * m->for_ms;
        if (m->kind == FAULT_PPS_JITTER && m->from_ns <= at_ns && fabs(off_s - late_s) < 0.25 * late_s)
            see_moment(link, m);
    }
}

static void take_pps(struct soak_link *link, const struct scanhead_frame *frame)
{
    struct soak_times *t = &link->times;
    const int64_t at_ns = (int64_t)frame->event_value[1];
    const int64_t leap_s = (int64_t)frame->event_value[2] - (int64_t)frame->event_value[0];
    miss_pps(link, at_ns);
    if (!t->have_pps) hide_pps(link, t->pps_ns);
    if (t->have_pps && leap_s != t->leap_s) see_kind(link, FAULT_LEAP_SECOND, INT64_MIN, at_ns);
    if (t->have_pps) see_jitter(link, at_ns, (int64_t)frame->event_value[2]);
    t->have_pps = 1;
    t->pps_ns = at_ns;
    t->pps_gps_s = (int64_t)frame->event_value[2];
    t->leap_s = leap_s;
}

/* ---- the PTP follower, by the states of its port and its offset */

/* A lost master shows as the port state LISTENING, also for up to an Announce interval after the master is back. */
static int shows_ptp(const struct soak_link *link, const struct soak_moment *m, int64_t at_ns,
                     const struct native_telemetry *t)
{
    const int64_t announce_ns = INT64_C(1000000) * link->soak->cfg->time.ptp.announce_ms;
    const int is_near = m->from_ns <= at_ns && (m->to_ns > at_ns || at_ns - m->to_ns <= announce_ns);
    switch (m->kind) {
    case FAULT_PTP_LOST:
        return is_near && t->ptp_port == NATIVE_PTP_LISTENING;
    case FAULT_PTP_FAULTY:
        return is_near && t->ptp_port == NATIVE_PTP_FAULTY;
    case FAULT_PTP_GRANDMASTER:
        return is_near && t->ptp_grandmaster == m->what.grandmaster;
    case FAULT_PTP_STEP:
        return is_near && fabs((double)t->ptp_offset_ns) >= 0.5 * fabs(m->what.ns);
    default:
        return 0;
    }
}

static void take_ptp(struct soak_link *link, int64_t at_ns, const struct native_telemetry *t)
{
    for (uint32_t i = link->n_moments; i-- > 0;)
        if (shows_ptp(link, &link->moment[i], at_ns, t)) see_moment(link, &link->moment[i]);
}

static void head_take_telemetry(struct soak_link *link, const struct scanhead_frame *frame)
{
    struct native_telemetry t;
    if (native_decode_telemetry(frame->payload, frame->payload_len, &t) == SH_OK) take_ptp(link, frame->t_ns, &t);
}

static void head_take_event(struct soak_link *link, const struct scanhead_frame *frame)
{
    const int64_t a = (int64_t)frame->event_value[1], b = (int64_t)frame->event_value[2];
    if (frame->event == SCANHEAD_EV_STATE) take_state(link, frame);
    if (frame->event == SCANHEAD_EV_TIME || frame->event == SCANHEAD_EV_SCAN_START) take_time(link, a, b);
    if (frame->event == SCANHEAD_EV_TIME) miss_pps(link, a);
    if (frame->event == SCANHEAD_EV_PTP)
        take_ptp(link, a,
                 &(struct native_telemetry){.ptp_port = (uint32_t)(frame->event_value[0] & 255),
                                            .ptp_grandmaster = frame->event_value[2]});
    if (frame->event != SCANHEAD_EV_PPS) return;
    take_time(link, a, b * 1000000000);
    take_pps(link, frame);
}

/* ---- the mirror and the laser, by the points of one frame */

static int is_all_empty(struct soak_link *link, const struct scanhead_frame *frame)
{
    struct scanhead_point p;
    for (uint32_t i = 0; i < frame->n_points; i++)
        if (scanhead_points(link->sh, frame, i, &p, 1) != 1 || p.echo_count != 0) return 0;
    return frame->n_points != 0;
}

/* Returns the rate of the mirror's encoder, rad/s; NaN: not known. */
static double turn_rate(struct soak_link *link, const struct scanhead_frame *frame)
{
    struct scanhead_point first, last;
    if (frame->n_points < 2 || scanhead_points(link->sh, frame, 0, &first, 1) != 1 ||
        scanhead_points(link->sh, frame, frame->n_points - 1, &last, 1) != 1 || last.t_ns <= first.t_ns)
        return (double)NAN;
    return remainder(last.mirror_rad - first.mirror_rad, 2.0 * M_PI) / (1e-9 * (double)(last.t_ns - first.t_ns));
}

static int is_seen_in(struct soak_link *link, const struct soak_moment *m, const struct scanhead_frame *frame,
                      double rate)
{
    const double usual = link->usual_rate, share = rate / usual;
    switch (m->kind) {
    case FAULT_MIRROR_SLOW:
        return fabs(share - m->what.factor) < 0.25 * fabs(1.0 - m->what.factor);
    case FAULT_MIRROR_STUCK:
        return fabs(share) < 0.01;
    case FAULT_MIRROR_WOBBLE: /* the threshold is a quarter of the largest change of rate */
        return fabs(rate - usual) > 0.25 * 2.0 * M_PI * m->what.hz * fabs(m->what.deg) * M_PI / 180.0;
    case FAULT_LASER_OFF:
        return is_all_empty(link, frame);
    default:
        return 0;
    }
}

static int is_of_mirror(const struct soak_moment *m)
{
    return m->kind == FAULT_MIRROR_SLOW || m->kind == FAULT_MIRROR_STUCK || m->kind == FAULT_MIRROR_WOBBLE;
}

/* Keeps the rate at which the mirror turns without a fault. Hides faults of the mirror from before that rate is known:
 * there was nothing to compare them with. */
static void take_usual_rate(struct soak_link *link, int64_t t_ns, double rate)
{
    for (uint32_t i = 0; i < link->n_moments; i++)
        if (is_of_mirror(&link->moment[i]) && link->moment[i].from_ns <= t_ns && t_ns < link->moment[i].to_ns) return;
    for (uint32_t i = link->n_moments; i-- > 0;)
        if (is_of_mirror(&link->moment[i]) && link->moment[i].to_ns <= t_ns)
            hide_moment(link, i, "the fault was over before the client knew the mirror's usual rate");
    link->usual_rate = rate;
}

static void head_take_points(struct soak_link *link, const struct scanhead_frame *frame)
{
    /* A scan that begins anew shows that power was away, even to a client that was not connected when it went. */
    if (link->have_pulse && frame->pulse0 < link->pulse0) soak_saw_power_go(link, frame->t_ns);
    link->have_pulse = 1;
    link->pulse0 = frame->pulse0;
    if (link->n_moments == 0 && link->usual_rate != 0.0) return;
    const double rate = turn_rate(link, frame);
    if (link->usual_rate == 0.0 && isfinite(rate)) take_usual_rate(link, frame->t_ns, rate);
    for (uint32_t i = link->n_moments; i-- > 0;) {
        struct soak_moment *m = &link->moment[i];
        if (m->from_ns <= frame->t_ns && frame->t_ns < m->to_ns && is_seen_in(link, m, frame, rate))
            see_moment(link, m);
    }
}

void soak_saw_inside(struct soak_link *link, const struct scanhead_frame *frame)
{
    pthread_mutex_lock(&link->lock);
    if (link->frames == 1) link->times.pps_ns = frame->t_ns;
    if (frame->type == SCANHEAD_EVENT) head_take_event(link, frame);
    if (frame->type == SCANHEAD_TELEMETRY) head_take_telemetry(link, frame);
    if (frame->type == SCANHEAD_POINTS) head_take_points(link, frame);
    pthread_mutex_unlock(&link->lock);
}

/* ---- at the end */

/* Returns NULL where it must be noticed. */
static const char *why_unseen(const struct soak_link *link, enum fault_kind kind)
{
    return kind == FAULT_SLOW_BOOT && link->soak->realtime ? NULL : unseen[kind];
}

int soak_is_head_seen(struct soak_link *link)
{
    pthread_mutex_lock(&link->lock);
    uint32_t n = 0;
    for (uint32_t i = 0; i < link->n_moments; i++)
        n += link->moment[i].kind == FAULT_SLOW_BOOT || why_unseen(link, link->moment[i].kind) == NULL;
    pthread_mutex_unlock(&link->lock);
    return n == 0;
}

void soak_judge_head(struct soak_link *link)
{
    for (uint32_t i = 0; i < link->n_moments; i++) {
        const enum fault_kind kind = link->moment[i].kind;
        const char *why = why_unseen(link, kind);
        if (why != NULL)
            soak_hide(&link->row[kind], 1, why);
        else
            link->row[kind].missed++;
    }
    link->n_moments = 0;
}
