/* SPDX-License-Identifier: MIT */
/* The device's time of day: PPS, the answers to TIME: queries, and the GNSS receiver that it follows. */
#include <stdio.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/device/clock_faults.h"
#include "firmware_sim/device/device_state.h"

int device_power_up(void *self, int64_t now_ns, const char **warning, struct sh_err *err)
{
    struct device *device = self;
    pthread_mutex_lock(&device->lock); /* a client may ask for the time already */
    int rc = head_clock_power_up(&device->clock, now_ns, err);
    device->date.zero_ns = head_clock_ns(&device->clock, 0); /* the system's clock was not known before */
    pthread_mutex_unlock(&device->lock);
    *warning = device->clock.warning[0] != '\0' ? device->clock.warning : NULL;
    return rc;
}

int64_t device_gps_ns(const struct device *device, int64_t t_ns)
{
    return device->clock.source != EPOCH_NONE ? utc_gps_ns(head_clock_ns(&device->clock, t_ns)) : 0;
}

/* Whether a pulse comes in the tick at t_ns. found: the second at *edge_ns begins in it. An injected fault makes pulses
 * late. */
static int find_pulse(struct device *device, struct device_late_pulse *late, int found, int64_t t_ns, int64_t *edge_ns,
                      int64_t *tai_s)
{
    const int64_t late_ns = found ? device_pulse_late_ns(&device->head_faults, *edge_ns) : 0;
    if (late->t_ns < t_ns) late->waits = 0; /* power was gone when it came */
    if (late_ns > 0) {
        if (late == &device->late_own) device_count_clock_fault(&device->head_faults, FAULT_PPS_JITTER, *edge_ns);
        *late = (struct device_late_pulse){1, *edge_ns + late_ns, *tai_s};
    }
    if (!late->waits || late->t_ns >= t_ns + device->tick_ns) return found && late_ns == 0;
    late->waits = 0;
    *edge_ns = late->t_ns;
    *tai_s = late->tai_s;
    return 1;
}

static int has_pulses(const struct device *device, int64_t t_ns)
{
    return device->clock.source != EPOCH_NONE && device->site->cfg->gnss.pps &&
           !device_has_clock_fault(&device->head_faults, FAULT_PPS_LOST, t_ns);
}

void device_say_pps(struct device *device, uint64_t tick)
{
    const struct head_clock *clock = &device->clock;
    int64_t t_ns = (int64_t)tick * device->tick_ns, edge_ns = 0, tai_s = 0;
    if (clock->source == EPOCH_NONE) return;
    int found = head_clock_edge(clock, t_ns, t_ns + device->tick_ns, &edge_ns, &tai_s);
    if (found) device_count_clock_fault(&device->head_faults, FAULT_PPS_LOST, edge_ns);
    if (found) found = has_pulses(device, edge_ns);
    if (!find_pulse(device, &device->late_own, found, t_ns, &edge_ns, &tai_s)) return;
    int64_t tai_ns = tai_s * UTC_SECOND_NS;
    char text[UTC_TEXT_LEN];
    struct utc_time utc;
    utc_from_tai(&clock->table, tai_ns, &utc);
    utc_format(&utc, 0, text);
    device_push_event(&device->events, NATIVE_EV_PPS,
                      (uint64_t)(utc_posix_from_tai(&clock->table, tai_ns) / UTC_SECOND_NS), (uint64_t)edge_ns,
                      (uint64_t)(utc_gps_ns(tai_ns) / UTC_SECOND_NS), text);
}

static struct pps_moment moment_at(const struct device *device, int64_t t_ns)
{
    return (struct pps_moment){t_ns, head_clock_ns(&device->clock, t_ns)};
}

/* A head that was synchronised before the run (gnss.cold: off) has the time of its own clock at the first power-up,
 * if pulses and sentences come then. At later power-ups it has no time. */
static void follow_from_power_up(struct device *device, int64_t t_ns)
{
    const struct pps_moment at = moment_at(device, t_ns);
    const struct config_gnss *c = &device->site->cfg->gnss;
    const int pulses = has_pulses(device, t_ns);
    const int sentences = c->nmea && !device_has_clock_fault(&device->head_faults, FAULT_NMEA_LOST, t_ns);
    const int warm = device->pps.n == 0 && pulses && sentences && !c->cold;
    pps_power_up(&device->pps, at, warm ? utc_posix_from_tai(&device->clock.table, at.head_ns) : 0, pulses);
}

/* Takes minutes and seconds as the sentence has them. A sentence with a wrong checksum isn't used. */
static void take_sentence(struct device *device, const struct receiver_sentence *sentence)
{
    const int64_t tai_ns = head_clock_true_ns(&device->clock, gnss_time_ns(&device->gnss, sentence->index));
    struct utc_time utc;
    if (sentence->is_spoilt) return;
    utc_from_tai(&device->clock.table, tai_ns, &utc);
    pps_take_sentence(&device->pps, moment_at(device, sentence->t_ns), utc.minute * 60 + utc.second);
}

/* Takes the sentences that have arrived before end_ns. At a pulse per second, end_ns is the time of the pulse. So a
 * sentence that arrives together with the pulse belongs to the second that begins. */
static void take_sentences(struct device *device, int64_t end_ns)
{
    const struct receiver_line *line = &device->line;
    for (; device->line_taken < line->n; device->line_taken++) {
        const struct receiver_sentence *next = &line->kept[device->line_taken % RECEIVER_KEPT];
        if (next->t_ns >= end_ns) return;
        take_sentence(device, next);
    }
}

void device_follow_receiver(struct device *device, uint64_t tick)
{
    const int64_t t_ns = (int64_t)tick * device->tick_ns, end_ns = t_ns + device->tick_ns;
    if (device->pps.n == 0 || device->power.on_tick == tick) follow_from_power_up(device, t_ns);
    device_check_phase(device, t_ns);
    if (device->clock.source == EPOCH_NONE) return;
    receiver_line_run(&device->line, &device->gnss, &device->head_faults, end_ns);
    const int64_t last_s = (head_clock_true_ns(&device->clock, end_ns) - 1) / UTC_SECOND_NS;
    int64_t tai_s = last_s, edge_ns = t_ns + last_s * UTC_SECOND_NS - head_clock_true_ns(&device->clock, t_ns);
    const int found = edge_ns >= t_ns && has_pulses(device, edge_ns);
    if (find_pulse(device, &device->late_received, found, t_ns, &edge_ns, &tai_s)) {
        take_sentences(device, edge_ns);
        pps_take(&device->pps, moment_at(device, edge_ns));
        device_hold_phase(device, edge_ns);
    }
    take_sentences(device, end_ns);
}

void device_follow_ptp(struct device *device, uint64_t tick)
{
    const int64_t t_ns = (int64_t)tick * device->tick_ns;
    const enum head_state state = device->machine.state;
    ptp_run(&device->ptp, t_ns, t_ns + device->tick_ns, state != HEAD_OFF && state != HEAD_BOOT);
}

void device_tell_time(const struct device *device, int64_t t_ns, struct native_telemetry *t)
{
    const struct head_clock *clock = &device->clock;
    const struct ptp_status *ptp = ptp_at(&device->ptp, t_ns);
    if (clock->source != EPOCH_NONE) t->utc_ns = utc_posix_from_tai(&clock->table, head_clock_ns(clock, t_ns));
    if (ptp == NULL) return;
    t->ptp_port = ptp->port;
    t->ptp_servo = ptp->servo;
    t->ptp_offset_ns = ptp->offset_ns;
    t->ptp_delay_ns = ptp->delay_ns;
    t->ptp_grandmaster = ptp->grandmaster;
    t->ptp_class = ptp->clock_class;
    t->ptp_accuracy = ptp->clock_accuracy;
    t->ptp_flags = ptp->utc_valid ? NATIVE_PTP_UTC_VALID : 0;
}

void device_say_time(struct device *device, uint64_t tick)
{
    int64_t t_ns = (int64_t)tick * device->tick_ns;
    if (device->clock.source == EPOCH_NONE) return;
    device_push_event(&device->events, NATIVE_EV_TIME, 0, (uint64_t)t_ns, (uint64_t)device_gps_ns(device, t_ns), "");
}

void device_set_time_texts(struct device *device)
{
    struct command_device *cmd = &device->cmd;
    const struct head_clock *clock = &device->clock;
    const struct ptp_status *ptp = ptp_at(&device->ptp, cmd->t_ns);
    cmd->utc[0] = cmd->gps[0] = cmd->ptp[0] = '\0';
    if (ptp != NULL) ptp_text(ptp, cmd->ptp);
    if (clock->source == EPOCH_NONE) return;
    int64_t tai_ns = head_clock_ns(clock, cmd->t_ns);
    struct utc_time utc;
    utc_from_tai(&clock->table, tai_ns, &utc);
    utc_format(&utc, 9, cmd->utc);
    struct utc_gps gps = utc_gps_week(tai_ns);
    snprintf(cmd->gps, sizeof cmd->gps, "%lld,%lld.%09lld", (long long)gps.week, (long long)(gps.ns / UTC_SECOND_NS),
             (long long)(gps.ns % UTC_SECOND_NS));
}

enum protocol_pps device_pps(void *self, int64_t t_ns, int64_t *hour_ns)
{
    struct device *device = self;
    pthread_mutex_lock(&device->lock);
    const enum protocol_pps state = pps_at(&device->pps, moment_at(device, t_ns), hour_ns);
    pthread_mutex_unlock(&device->lock);
    return state;
}

int64_t device_next_fix_ns(void *self, int64_t t_ns)
{
    struct device *device = self;
    pthread_mutex_lock(&device->lock);
    const int64_t next_ns = receiver_line_next_ns(&device->line, &device->gnss, t_ns);
    pthread_mutex_unlock(&device->lock);
    return next_ns;
}

/* Whether the head had power when a sentence arrived, and has had it since then up to t_ns. It remembers nothing over a
 * power cycle, and has no receiver while power is off. */
static int is_received(const struct device *device, int64_t arrived_ns, int64_t t_ns)
{
    return arrived_ns >= device_power_at(device, t_ns).t_ns;
}

/* Finds the head's poses around a time. 0: the head stands, or it has no pose. Just before the time a live platform may
 * have none yet. Just after it there may be one that is out of reach. */
static int take_track(struct device *device, int64_t t_ns, struct gnss_track *track)
{
    track->span_ns = 0;
    if (!device_head_pose(device, t_ns, &track->at)) return 0;
    track->before = track->after = track->at;
    if (device_head_pose(device, t_ns - GNSS_STEP_NS, &track->before)) track->span_ns += GNSS_STEP_NS;
    if (device_head_pose(device, t_ns + GNSS_STEP_NS, &track->after)) track->span_ns += GNSS_STEP_NS;
    return 1;
}

int device_fix(void *self, int64_t t_ns, struct nmea_fix *fix)
{
    struct device *device = self;
    struct receiver_sentence sentence;
    pthread_mutex_lock(&device->lock);
    const int found =
        receiver_line_last(&device->line, &device->gnss, t_ns, &sentence) && is_received(device, sentence.t_ns, t_ns);
    pthread_mutex_unlock(&device->lock);
    if (!found) return 0;
    struct gnss_track track;
    const int64_t at_ns = gnss_time_ns(&device->gnss, sentence.index);
    struct device_version *version;
    struct gnss gnss = device->gnss;
    struct head_clock clock;
    gnss.site = device_hold_site(device, &version); /* stations may move meanwhile */
    gnss.clock = &clock;
    pthread_mutex_lock(&device->lock);
    clock = device->clock; /* a copy: faults may change its table of leap seconds */
    uint32_t station = device->cmd.settings.station - 1;
    const int moves = take_track(device, at_ns, &track);
    pthread_mutex_unlock(&device->lock);
    gnss_fix(&gnss, sentence.index, station, moves ? &track : NULL, fix);
    device_give_back(version);
    if (sentence.is_void) fix->quality = 0;
    fix->is_spoilt = sentence.is_spoilt;
    return 1;
}
