/* SPDX-License-Identifier: MIT */
#include "firmware_sim/device/ptp.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/rng.h"
#include "firmware_sim/device/events.h"
#include "firmware_sim/device/head_clock.h"
#include "firmware_sim/device/head_faults.h"
#include "firmware_sim/device/journal.h"

static const int64_t PPT = 1000000000000, MS_NS = 1000000;
/* Until a master is selected pmc shows these. */
enum { CLASS_OF_NONE = 255, ACCURACY_OF_NONE = 0xfe };

static const char *const port_names[] = {
    [NATIVE_PTP_NONE] = "NONE",           [NATIVE_PTP_INITIALIZING] = "INITIALIZING", [NATIVE_PTP_FAULTY] = "FAULTY",
    [NATIVE_PTP_LISTENING] = "LISTENING", [NATIVE_PTP_UNCALIBRATED] = "UNCALIBRATED", [NATIVE_PTP_SLAVE] = "SLAVE",
};

void ptp_init(struct ptp *ptp, const struct config_ptp *cfg, uint64_t seed)
{
    ptp->cfg = cfg->follower ? cfg : NULL;
    ptp->key = rng_key(seed, RNG_PTP);
}

/* ---- reports to telemetry and events */

static void ptp_keep(struct ptp *ptp, int64_t t_ns)
{
    ptp->now.from_ns = t_ns;
    ptp->kept[ptp->n++ % PTP_KEPT] = ptp->now;
}

static void ptp_say(struct ptp *ptp, const char *text)
{
    const struct ptp_status *now = &ptp->now;
    char line[160];
    device_push_event(ptp->events, NATIVE_EV_PTP, (uint64_t)now->port + 256 * (uint64_t)now->servo,
                      (uint64_t)now->from_ns, now->grandmaster, text);
    snprintf(line, sizeof line, "ptp: t_ns %" PRId64 ", %s", now->from_ns, text);
    if (ptp->journal != NULL) journal_note(ptp->journal, line);
}

/* A new state of the port, of the servo, or of both. why: the event of the port's state machine. */
static void set_state(struct ptp *ptp, int64_t t_ns, enum native_ptp_port port, enum native_ptp_servo servo,
                      const char *why)
{
    const struct ptp_status was = ptp->now;
    char text[96];
    int len = 0;
    ptp->now.port = port;
    ptp->now.servo = servo;
    ptp_keep(ptp, t_ns);
    if (port != was.port)
        len = snprintf(text, sizeof text, "%s to %s on %s", port_names[was.port], port_names[port], why);
    if (servo != was.servo)
        len += snprintf(text + len, sizeof text - (size_t)len, "%sservo s%d to s%d", len != 0 ? ", " : "",
                        (int)was.servo, (int)servo);
    if (len != 0) ptp_say(ptp, text);
}

const struct ptp_status *ptp_at(const struct ptp *ptp, int64_t t_ns)
{
    const uint32_t kept = ptp->n < PTP_KEPT ? ptp->n : PTP_KEPT;
    const struct ptp_status *at = NULL;
    for (uint32_t i = 1; i <= kept && (at == NULL || at->from_ns > t_ns); i++)
        at = &ptp->kept[(ptp->n - i) % PTP_KEPT];
    return at;
}

void ptp_text(const struct ptp_status *status, char text[PTP_TEXT_LEN])
{
    const uint64_t id = status->grandmaster;
    snprintf(text, PTP_TEXT_LEN, "%s,s%d,%" PRId64 ",%" PRId64 ",%06x.%04x.%06x,%u,0x%02x,%d", port_names[status->port],
             (int)status->servo, status->offset_ns, status->delay_ns, (unsigned)(id >> 40),
             (unsigned)(id >> 24 & 0xffff), (unsigned)(id & 0xffffff), status->clock_class, status->clock_accuracy,
             status->utc_valid);
}

/* ---- injected faults */

/* Returns the next fault of a kind in the list, after `before`, that holds at device time t_ns. NULL: there is none. */
static const struct head_fault *ptp_next(const struct ptp *ptp, enum fault_kind kind, int64_t t_ns,
                                         const struct head_fault *before)
{
    const struct head_fault *f = before;
    while ((f = head_faults_next(ptp->faults, kind, f)) != NULL)
        if (t_ns >= f->begin_ns && t_ns < f->until_ns) break;
    return f;
}

static int holds(const struct ptp *ptp, enum fault_kind kind, int64_t t_ns)
{
    return ptp_next(ptp, kind, t_ns, NULL) != NULL;
}

static int64_t sum_ns(const struct ptp *ptp, enum fault_kind kind, int64_t t_ns)
{
    const struct head_fault *f = NULL;
    int64_t sum = 0;
    while ((f = ptp_next(ptp, kind, t_ns, f)) != NULL)
        sum += llround(f->fault.ns);
    return sum;
}

/* Finds the fault that describes the grandmaster with this identity. Of several, the last one in the list counts. NULL:
 * there is none. */
static const struct head_fault *fault_of(const struct ptp *ptp, uint64_t identity, int64_t t_ns)
{
    const struct head_fault *f = NULL, *last = NULL;
    while ((f = ptp_next(ptp, FAULT_PTP_GRANDMASTER, t_ns, f)) != NULL)
        if (f->fault.grandmaster == identity) last = f;
    return last;
}

/* Returns the identity of the best grandmaster. Of several faults, the last one in the list decides. */
static uint64_t best_master(const struct ptp *ptp, int64_t t_ns)
{
    const struct head_fault *f = NULL;
    uint64_t identity = ptp->cfg->grandmaster;
    while ((f = ptp_next(ptp, FAULT_PTP_GRANDMASTER, t_ns, f)) != NULL)
        identity = f->fault.grandmaster;
    return identity;
}

/* ---- the servo */

static void correct(struct ptp *ptp, int64_t t_ns, int64_t rate_ppt, int64_t step_ns)
{
    const struct head_clock_change change = {.jump_ns = step_ns, .gain_ppt = rate_ppt - ptp->rate_ppt};
    if (change.jump_ns != 0 || change.gain_ppt != 0) head_clock_change(ptp->clock, t_ns, &change);
    ptp->rate_ppt = rate_ppt;
}

static int64_t ptp_limit(const struct ptp *ptp, head_clock_wide rate_ppt)
{
    const int64_t most_ppt = llround(1e6 * ptp->cfg->max_ppm);
    return rate_ppt > most_ppt ? most_ppt : rate_ppt < -most_ppt ? -most_ppt : (int64_t)rate_ppt;
}

static int is_beyond(int64_t offset_ns, uint64_t threshold_ns)
{
    return threshold_ns != 0 && (uint64_t)llabs(offset_ns) > threshold_ns;
}

/* The second sample: the clock's own rate is known. */
static enum native_ptp_servo take_rate(struct ptp *ptp, int64_t t_ns, int64_t offset_ns)
{
    const head_clock_wide gained_ns = offset_ns - ptp->sample_offset_ns;
    const int jumps = is_beyond(offset_ns, ptp->cfg->step_threshold_ns) ||
                      (!ptp->has_locked && is_beyond(offset_ns, ptp->cfg->first_step_threshold_ns));
    ptp->estimate_ppt = ptp_limit(ptp, ptp->estimate_ppt - gained_ns * PPT / (t_ns - ptp->sample_ns));
    ptp->n_samples = 2;
    ptp->has_locked = 1;
    correct(ptp, t_ns, ptp->estimate_ppt, jumps ? -offset_ns : 0);
    return jumps ? NATIVE_PTP_JUMP : NATIVE_PTP_LOCKED;
}

/* The PI controller of ptp.h, with 3/10 and 7/10 of the offset per interval. Where the rate is at its limit, the
 * estimate stays as it is: otherwise it would wind up. */
static enum native_ptp_servo take_locked(struct ptp *ptp, int64_t t_ns, int64_t offset_ns)
{
    const head_clock_wide per_interval = (head_clock_wide)offset_ns * PPT, whole = 10 * ptp->cfg->sync_ms * MS_NS;
    const head_clock_wide estimate_ppt = ptp->estimate_ppt - 3 * per_interval / whole,
                          rate_ppt = estimate_ppt - 7 * per_interval / whole;
    const int64_t limited_ppt = ptp_limit(ptp, rate_ppt);
    if (is_beyond(offset_ns, ptp->cfg->step_threshold_ns)) {
        ptp->n_samples = 0;
        return NATIVE_PTP_UNLOCKED;
    }
    if (rate_ppt == limited_ppt) ptp->estimate_ppt = (int64_t)estimate_ppt;
    correct(ptp, t_ns, limited_ppt, 0);
    return NATIVE_PTP_LOCKED;
}

static enum native_ptp_servo take_sample(struct ptp *ptp, int64_t t_ns, int64_t offset_ns)
{
    if (ptp->n_samples == 2) return take_locked(ptp, t_ns, offset_ns);
    if (ptp->n_samples == 1) return take_rate(ptp, t_ns, offset_ns);
    ptp->sample_ns = t_ns;
    ptp->sample_offset_ns = offset_ns;
    ptp->n_samples = 1;
    return NATIVE_PTP_UNLOCKED;
}

/* ---- messages and times */

static int has_master(const struct ptp *ptp)
{
    return ptp->now.port == NATIVE_PTP_UNCALIBRATED || ptp->now.port == NATIVE_PTP_SLAVE;
}

/* Whether the master that was selected is still on the network. */
static int is_there(const struct ptp *ptp, int64_t t_ns)
{
    const uint64_t identity = ptp->now.grandmaster;
    return identity == ptp->cfg->grandmaster || fault_of(ptp, identity, t_ns) != NULL;
}

/* An Announce of the selected master says what it is. */
static void hear_master(struct ptp *ptp, int64_t t_ns)
{
    const struct head_fault *f = fault_of(ptp, ptp->now.grandmaster, t_ns);
    ptp->now.clock_class = f != NULL ? f->fault.clock_class : ptp->cfg->clock_class;
    ptp->now.clock_accuracy = ptp->cfg->clock_accuracy;
    ptp->now.utc_valid = ptp->cfg->utc_valid;
    ptp->announce_ns = t_ns;
    ptp_keep(ptp, t_ns);
}

/* While another master is a candidate, the selected one goes on if it is still there. */
static void take_announce(struct ptp *ptp, int64_t t_ns)
{
    const uint64_t best = best_master(ptp, t_ns);
    if (ptp->is_faulty || holds(ptp, FAULT_PTP_LOST, t_ns)) return;
    if (has_master(ptp) && is_there(ptp, t_ns)) hear_master(ptp, t_ns);
    if (has_master(ptp) && best == ptp->now.grandmaster) {
        ptp->n_heard = 0;
        return;
    }
    ptp->n_heard = ptp->n_heard != 0 && ptp->candidate == best ? ptp->n_heard + 1 : 1;
    ptp->candidate = best;
    if (ptp->n_heard < PTP_ANNOUNCES_TO_SELECT) return;
    ptp->n_heard = 0;
    ptp->now.grandmaster = best;
    hear_master(ptp, t_ns);
    set_state(ptp, t_ns, NATIVE_PTP_UNCALIBRATED, ptp->now.servo, "RS_SLAVE");
}

static int64_t deviation_ns(const struct ptp *ptp, int64_t t_ns, uint64_t sync, uint32_t draw)
{
    const uint64_t most_ns = ptp->cfg->jitter_ns + (uint64_t)sum_ns(ptp, FAULT_PTP_JITTER, t_ns);
    return (int64_t)(rng_u64(ptp->key, rng_echo(sync, draw)) % (2 * most_ns + 1)) - (int64_t)most_ns;
}

static void take_sync(struct ptp *ptp, int64_t t_ns)
{
    const struct head_fault *f = fault_of(ptp, ptp->now.grandmaster, t_ns);
    const uint64_t number = (uint64_t)(t_ns / (ptp->cfg->sync_ms * MS_NS));
    if (!has_master(ptp) || !is_there(ptp, t_ns) || holds(ptp, FAULT_PTP_LOST, t_ns) ||
        holds(ptp, FAULT_PTP_NO_SYNC, t_ns))
        return;
    const int64_t master_ns = head_clock_true_ns(ptp->clock, t_ns) + sum_ns(ptp, FAULT_PTP_STEP, t_ns) +
                              (f != NULL ? llround(f->fault.ns) : 0);
    const int64_t asymmetry_ns = llround(ptp->cfg->asymmetry_ns) + sum_ns(ptp, FAULT_PTP_ASYMMETRY, t_ns);
    ptp->now.offset_ns =
        head_clock_ns(ptp->clock, t_ns) - master_ns + asymmetry_ns + deviation_ns(ptp, t_ns, number, 0);
    ptp->now.delay_ns = ptp->cfg->path_delay_ns + deviation_ns(ptp, t_ns, number, 1);
    const enum native_ptp_servo servo = take_sample(ptp, t_ns, ptp->now.offset_ns);
    const int is_locked = servo == NATIVE_PTP_LOCKED;
    set_state(ptp, t_ns, is_locked ? NATIVE_PTP_SLAVE : NATIVE_PTP_UNCALIBRATED, servo,
              is_locked ? "MASTER_CLOCK_SELECTED" : "SYNCHRONIZATION_FAULT");
}

static void lose_master(struct ptp *ptp, int64_t t_ns)
{
    ptp->n_heard = 0;
    set_state(ptp, t_ns, NATIVE_PTP_LISTENING, ptp->now.servo, "ANNOUNCE_RECEIPT_TIMEOUT_EXPIRES");
}

static void take_port_fault(struct ptp *ptp, int64_t t_ns)
{
    const int is_faulty = holds(ptp, FAULT_PTP_FAULTY, t_ns);
    if (is_faulty == ptp->is_faulty) return;
    ptp->is_faulty = is_faulty;
    ptp->n_heard = 0;
    set_state(ptp, t_ns, is_faulty ? NATIVE_PTP_FAULTY : NATIVE_PTP_LISTENING, ptp->now.servo,
              is_faulty ? "FAULT_DETECTED" : "INIT_COMPLETE");
}

/* ---- ticks */

static int64_t least_of(int64_t a_ns, int64_t b_ns)
{
    return a_ns < b_ns ? a_ns : b_ns;
}

/* Returns the first multiple of an interval that is not before a time. */
static int64_t next_multiple(int64_t t_ns, int64_t interval_ns)
{
    const int64_t rest_ns = t_ns % interval_ns;
    return rest_ns == 0 ? t_ns : t_ns + interval_ns - rest_ns;
}

static int64_t lost_at(const struct ptp *ptp)
{
    return ptp->announce_ns + PTP_INTERVALS_TO_LOSE * ptp->cfg->announce_ms * MS_NS;
}

/* Returns the first moment in [t_ns, end_ns) at which something may happen; or end_ns. */
static int64_t next_moment(const struct ptp *ptp, int64_t t_ns, int64_t end_ns)
{
    const struct head_fault *f = NULL;
    int64_t next_ns = least_of(end_ns, next_multiple(t_ns, ptp->cfg->announce_ms * MS_NS));
    next_ns = least_of(next_ns, next_multiple(t_ns, ptp->cfg->sync_ms * MS_NS));
    if (has_master(ptp) && lost_at(ptp) >= t_ns) next_ns = least_of(next_ns, lost_at(ptp));
    if (ptp->is_faulty != holds(ptp, FAULT_PTP_FAULTY, t_ns)) return t_ns; /* it has changed while power was off */
    while ((f = head_faults_next(ptp->faults, FAULT_PTP_FAULTY, f)) != NULL) {
        if (f->begin_ns >= t_ns) next_ns = least_of(next_ns, f->begin_ns);
        if (f->until_ns >= t_ns) next_ns = least_of(next_ns, f->until_ns);
    }
    return next_ns;
}

/* An Announce at the very moment at which its master would be lost is in time. */
static void take_moment(struct ptp *ptp, int64_t t_ns)
{
    take_port_fault(ptp, t_ns);
    if (t_ns % (ptp->cfg->announce_ms * MS_NS) == 0) take_announce(ptp, t_ns);
    if (has_master(ptp) && t_ns >= lost_at(ptp)) lose_master(ptp, t_ns);
    if (t_ns % (ptp->cfg->sync_ms * MS_NS) == 0) take_sync(ptp, t_ns);
}

/* Without power the follower is gone, and with it its correction: the oscillator runs on alone. */
static void change_power(struct ptp *ptp, int64_t t_ns, int is_up)
{
    if (ptp->n == 0 || !is_up) {
        correct(ptp, t_ns, 0, 0);
        ptp->estimate_ppt = 0;
        ptp->n_samples = ptp->has_locked = 0;
        ptp->n_heard = 0;
        ptp->is_faulty = 0;
        ptp->now = (struct ptp_status){
            .port = NATIVE_PTP_INITIALIZING, .clock_class = CLASS_OF_NONE, .clock_accuracy = ACCURACY_OF_NONE};
        ptp_keep(ptp, t_ns);
    }
    ptp->is_up = is_up;
    if (is_up) set_state(ptp, t_ns, NATIVE_PTP_LISTENING, NATIVE_PTP_UNLOCKED, "INIT_COMPLETE");
}

void ptp_run(struct ptp *ptp, int64_t t_ns, int64_t end_ns, int is_up)
{
    if (ptp->cfg == NULL) return;
    if (ptp->n == 0 || is_up != ptp->is_up) change_power(ptp, t_ns, is_up);
    if (!is_up) return;
    for (int64_t at_ns = t_ns; (at_ns = next_moment(ptp, at_ns, end_ns)) < end_ns; at_ns++)
        take_moment(ptp, at_ns);
}
