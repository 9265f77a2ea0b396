#include "firmware_sim/device/device_state.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void device_push_event(struct device *device, enum native_event_code code, uint64_t a, uint64_t b, uint64_t c,
                       const char *text)
{
    if (device->n_pending == DEVICE_MAX_PENDING) {
        device->pending_dropped++;
        return;
    }
    struct native_event *event = &device->pending[device->n_pending++];
    *event = (struct native_event){.code = (uint32_t)code, .a = a, .b = b, .c = c};
    snprintf(event->text, sizeof event->text, "%s", text != NULL ? text : "");
}

static void note_change(struct device *device, uint64_t tick, enum head_state state)
{
    if (device->n_changes == DEVICE_MAX_CHANGES) {
        memmove(device->change, device->change + 1, (DEVICE_MAX_CHANGES - 1) * sizeof device->change[0]);
        device->n_changes--;
    }
    device->change[device->n_changes].tick = tick;
    device->change[device->n_changes++].state = state;
}

enum head_state device_visible_state(const struct device *device, uint64_t released)
{
    enum head_state state = HEAD_OFF;
    for (uint32_t i = 0; i < device->n_changes; i++)
        if (device->change[i].tick <= released) state = device->change[i].state;
    return state;
}

static uint64_t ticks_of(const struct device *device, double s)
{
    return (uint64_t)ceil(s * (double)device->tick_hz - 1e-9);
}

void device_transition(struct device *device, enum head_event event, uint64_t tick)
{
    const struct config_profile *profile = &device->site->cfg->profile;
    int next = head_next_state(device->state, event);
    if (next < 0 || (enum head_state)next == device->state) return;
    enum head_state before = device->state;
    device->state = (enum head_state)next;
    note_change(device, tick, device->state);
    device_push_event(device, NATIVE_EV_STATE, (uint64_t)device->state, (uint64_t)before, 0,
                      head_state_name(device->state));
    uint64_t from = tick > device->next_tick ? tick : device->next_tick;
    switch (device->state) {
    case HEAD_BOOT:
        device->due_tick = tick + ticks_of(device, profile->boot_s);
        break;
    case HEAD_SPIN_UP: /* counted from the command, but never before the first tick that is still open */
        device->due_tick = tick + ticks_of(device, profile->spin_up_s);
        if (device->due_tick < device->next_tick) device->due_tick = device->next_tick;
        break;
    case HEAD_SPIN_DOWN:
        device->due_tick = from + ticks_of(device, profile->spin_down_s);
        break;
    default:
        device->due_tick = UINT64_MAX;
    }
}

static void begin_scan(struct device *device, uint64_t tick)
{
    struct schedule_spec spec;
    device_fill_spec(device, &spec);
    schedule_start(&device->segment, &spec);
    device->scanning = 1;
    device->stop_requested = 0;
    device->scan++;
    device->scan_tick0 = tick;
    device->pulse_next = 0;
    device->scan_lost0 = atomic_load(&device->counters.lost_pulses);
    device->station = device->cmd.settings.station - 1;
    device->stretch = site_stretch_at(device->site, 0);
    device->describe = 1;
    device->anchor_lost = 0;
    device->cmd.frames_done = 0;
    device->live.next = 0;
    device_push_event(device, NATIVE_EV_SCAN_START, device->scan, tick * (uint64_t)device->tick_ns,
                      (uint64_t)device_gps_ns(device, (int64_t)tick * device->tick_ns), "");
    if (device->options.start && device->options.duration_s > 0.0 && device->scan == 1)
        device->end_tick = tick + ticks_of(device, device->options.duration_s);
}

/* Timed transitions that are due at the tick. */
static void run_timers(struct device *device, uint64_t tick)
{
    while (device->due_tick <= tick) {
        device->due_tick = UINT64_MAX;
        if (device->state == HEAD_BOOT) {
            device_transition(device, HEAD_EV_BOOTED, tick);
            if (device->options.start) device_transition(device, HEAD_EV_START, tick);
        } else if (device->state == HEAD_SPIN_UP) {
            device_transition(device, HEAD_EV_SPUN_UP, tick);
            begin_scan(device, tick);
        } else if (device->state == HEAD_SPIN_DOWN) {
            device_transition(device, HEAD_EV_SPUN_DOWN, tick);
        }
    }
}

static void run_replay(struct device *device, uint64_t tick)
{
    while (device->replay_at < device->n_replay && device->replay[device->replay_at].tick <= tick) {
        const struct journal_entry *entry = &device->replay[device->replay_at++];
        struct command_result result;
        device_do_command(device, 0, entry->line, (uint64_t)(entry->t_ns / device->tick_ns), &result);
    }
}

/* The event each time, the error once per episode: a second without a loss ends one. */
static void say_overrun(struct device *device, uint64_t tick)
{
    uint64_t ticks = atomic_load(&device->counters.lost_ticks);
    if (ticks == device->lost_said) return;
    uint64_t pulses = atomic_load(&device->counters.lost_pulses);
    uint64_t first = device->lost_first != UINT64_MAX ? device->lost_first : device->pulse_next;
    char text[96];
    uint64_t more = pulses - device->lost_pulses_said;
    snprintf(text, sizeof text, "%llu pulses in %llu ticks not computed in time", (unsigned long long)more,
             (unsigned long long)(ticks - device->lost_said));
    device_push_event(device, NATIVE_EV_OVERRUN, first, more, ticks - device->lost_said, text);
    if (device->overrun_tick == 0 || tick - device->overrun_tick > device->tick_hz)
        command_queue_push(&device->cmd.queue, CMD_E_PULSES, text);
    device->overrun_tick = tick;
    device->lost_said = ticks;
    device->lost_pulses_said = pulses;
    device->lost_first = UINT64_MAX;
}

uint32_t device_tick_pulses(const struct config *cfg)
{
    uint32_t n = (uint32_t)ceil((double)cfg->profile.prr_max_uhz * 1e-6 / cfg->loop.tick_hz);
    return n + n / 8 + 2 * SCHEDULE_PACKET; /* an eighth: to catch up with */
}

uint32_t device_tick_lines(const struct config *cfg)
{
    return (uint32_t)ceil((double)cfg->profile.lines_max_uhz * 1e-6 / cfg->loop.tick_hz) + 2;
}

/* First pulse that is too many for this tick. When the rates jump up, what is due since the last cut, up to 15 pulses
 * at the old rate, comes at the new one and may fill several ticks. */
static uint64_t tick_room_end(const struct device *device)
{
    const struct schedule_segment *seg = &device->segment;
    struct schedule_line line;
    uint64_t last_line = schedule_line_of(seg, device->pulse_next) + device_tick_lines(device->site->cfg) - 1;
    schedule_get_line(seg, last_line, &line);
    uint64_t end = device->pulse_next + device_tick_pulses(device->site->cfg);
    return line.pulse_end < end ? line.pulse_end : schedule_cut(seg, end);
}

/* Pulses of this tick; ends the scan when it is complete or was told to stop. Returns 1 when the scan is over. */
static int claim_pulses(struct device *device, uint64_t tick, struct device_work *work)
{
    struct schedule_segment *seg = &device->segment;
    int64_t since = (int64_t)(tick - device->scan_tick0) * device->tick_ns;
    int stop = device->stop_requested || device->ending || tick >= device->end_tick;
    work->scanning = 1;
    work->scan_t0_ns = (int64_t)device->scan_tick0 * device->tick_ns;
    work->segment = *seg;
    work->station = device->station;
    work->stretch = device->stretch;
    work->echoes = device->cmd.settings.echoes;
    work->pulse0 = device->pulse_next;
    /* A stop keeps what was fired before this tick began; else the cut leaves whole packets for the next tick. */
    int64_t path_end_ns = device_path_end_ns(device), until_ns = stop ? since : since + device->tick_ns;
    int arrives = path_end_ns <= until_ns; /* at the end of a trajectory */
    uint64_t due = schedule_pulse_at(seg, arrives ? path_end_ns : until_ns);
    uint64_t room_end = tick_room_end(device);
    if (due > room_end) {
        due = room_end;
        arrives = 0;
    }
    uint64_t end = stop || arrives ? due : schedule_cut(seg, due);
    int done = due >= seg->end_pulse && !stop;
    if (done || end > seg->end_pulse) end = seg->end_pulse;
    if (end < work->pulse0) end = work->pulse0;
    work->pulse_end = device->pulse_next = end;
    if (end > work->pulse0) device->stretch = site_stretch_at(device->site, schedule_time_ns(seg, end - 1));
    work->cut_short = (stop || arrives) && end < seg->end_pulse;
    device_take_poses(device, work);
    struct schedule_line line;
    schedule_get_line(seg, schedule_line_of(seg, end), &line);
    device->cmd.frames_done = end >= seg->end_pulse && seg->spec.frames != 0 ? seg->spec.frames : line.frame;
    return done || stop || arrives;
}

static int is_repeated(const struct device *device, uint64_t tick)
{
    uint64_t since = tick - device->scan_tick0;
    return device->scanning && ((since != 0 && since % device->tick_hz == 0) || device->anchor_lost);
}

static void describe(struct device *device, uint64_t tick, struct device_work *work)
{
    uint64_t since = tick - device->scan_tick0;
    if (device->describe || is_repeated(device, tick)) {
        work->describe = 1;
        work->describe_flags = device->describe ? 0 : NATIVE_REPEAT;
        device_fill_descriptor(device, &work->descriptor);
        device_fill_anchor(device->site, device->station, device->stretch, &work->anchor);
        device->describe = device->anchor_lost = 0;
    }
    /* All names at the scan's start, then round and round for those who join late. */
    uint32_t n = device->site->n_surfaces;
    uint64_t chunks = (n + DEVICE_SURFACES_A_FRAME - 1) / DEVICE_SURFACES_A_FRAME;
    uint64_t period = device->tick_hz >= 4 ? device->tick_hz / 4 : 1;
    if (since < chunks || since % period == 0) {
        uint64_t chunk = since < chunks ? since : since / period % chunks;
        work->surfaces_first = (uint32_t)chunk * DEVICE_SURFACES_A_FRAME;
        uint32_t left = n - work->surfaces_first;
        work->surfaces_n = left < DEVICE_SURFACES_A_FRAME ? left : DEVICE_SURFACES_A_FRAME;
    }
}

static void take_events(struct device *device, struct device_work *work)
{
    uint32_t n = DEVICE_MAX_EVENTS - work->n_events;
    if (n > device->n_pending) n = device->n_pending;
    memcpy(work->event + work->n_events, device->pending, n * sizeof device->pending[0]);
    memmove(device->pending, device->pending + n, (device->n_pending - n) * sizeof device->pending[0]);
    work->n_events += n;
    device->n_pending -= n;
    if (device->pending_dropped != 0 && device->n_pending < DEVICE_MAX_PENDING) {
        char text[96];
        snprintf(text, sizeof text, "%u events had no room", device->pending_dropped);
        device->pending_dropped = 0;
        device_push_event(device, NATIVE_EV_ERROR, (uint64_t)(int64_t)CMD_E_QUEUE, 0, 0, text);
    }
}

static void end_scan(struct device *device, uint64_t tick)
{
    uint64_t lost = atomic_load(&device->counters.lost_pulses) - device->scan_lost0;
    int stopped = device->stop_requested;
    device->scanning = 0;
    device->scan_end_tick = tick;
    device->stop_requested = 0;
    device_push_event(device, NATIVE_EV_SCAN_END, device->scan, device->pulse_next, lost, "");
    device_transition(device, stopped ? HEAD_EV_STOP : HEAD_EV_DONE, tick);
    if (device->options.one_scan) device->over = 1;
}

int device_claim(struct device *device, uint64_t released, struct device_work *work)
{
    (void)released;
    pthread_mutex_lock(&device->lock);
    /* What is still to be said has a tick more. */
    if (device->over && device->n_pending == 0 && device->lost_said == atomic_load(&device->counters.lost_ticks)) {
        pthread_mutex_unlock(&device->lock);
        return 1;
    }
    uint64_t tick = device->next_tick;
    memset(work, 0, offsetof(struct device_work, event));
    work->describe = work->scanning = work->telemetry = work->cut_short = work->wake = 0;
    work->surfaces_n = work->n_poses = 0;
    work->tick = tick;
    work->t_ns = (int64_t)tick * device->tick_ns;
    run_replay(device, tick);
    run_timers(device, tick);
    say_overrun(device, tick);
    device_say_pps(device, tick);
    if (is_repeated(device, tick)) device_say_time(device, tick); /* who joins now knows it before the first point */
    take_events(device, work);
    work->n_events_before = work->n_events;
    if (device->scanning) {
        describe(device, tick, work);
        if (claim_pulses(device, tick, work)) {
            end_scan(device, tick + 1);
            take_events(device, work);
        }
    }
    if (tick % device->tick_hz == 0) {
        work->telemetry = 1;
        device_fill_telemetry(device, tick, &work->telemetry_frame);
    }
    work->wake = gnss_count(&device->gnss, work->t_ns) != gnss_count(&device->gnss, work->t_ns + device->tick_ns);
    if (device->ending || tick >= device->end_tick) device->over = 1;
    device->next_tick = tick + 1;
    pthread_mutex_unlock(&device->lock);
    return 0;
}

/* Events of a lost tick go before those that came later. An overrun event is taken back instead: the next one tells its
 * losses together with this one, so that a long overload can't fill the room for events. */
static void take_back(struct device *device, const struct device_work *work)
{
    uint32_t n = 0;
    struct native_event event[DEVICE_MAX_EVENTS];
    for (uint32_t i = 0; i < work->n_events; i++) {
        const struct native_event *e = &work->event[i];
        if (e->code != NATIVE_EV_OVERRUN) {
            event[n++] = *e;
            continue;
        }
        device->lost_pulses_said -= e->b;
        device->lost_said -= e->c;
        if (e->b != 0 && e->a < device->lost_first) device->lost_first = e->a;
    }
    uint32_t room = DEVICE_MAX_PENDING - device->n_pending;
    if (n > room) device->pending_dropped += n - room;
    if (n > room) n = room;
    memmove(device->pending + n, device->pending, device->n_pending * sizeof device->pending[0]);
    memcpy(device->pending, event, n * sizeof event[0]);
    device->n_pending += n;
}

void device_lost(struct device *device, const struct device_work *work, uint64_t n_cast, uint64_t first_cast)
{
    pthread_mutex_lock(&device->lock);
    atomic_fetch_add(&device->counters.lost_pulses, n_cast);
    atomic_fetch_add(&device->counters.lost_ticks, 1);
    if (first_cast < device->lost_first) device->lost_first = first_cast;
    take_back(device, work);
    if (work->describe && work->describe_flags == 0 && device->scanning) device->describe = 1;
    if (work->scanning && work->stretch != device->stretch) device->anchor_lost = 1; /* maybe not in this tick */
    pthread_mutex_unlock(&device->lock);
}

int device_is_idle(struct device *device)
{
    pthread_mutex_lock(&device->lock);
    int still = device->state == HEAD_IDLE || device->state == HEAD_FAULT || device->state == HEAD_OFF;
    int idle = still && device->due_tick == UINT64_MAX && device->n_pending == 0 && !device->ending && !device->over &&
               device->replay_at == device->n_replay && device->end_tick == UINT64_MAX;
    pthread_mutex_unlock(&device->lock);
    return idle;
}

void device_end(struct device *device)
{
    pthread_mutex_lock(&device->lock);
    device->ending = 1;
    pthread_mutex_unlock(&device->lock);
}

struct device_counters *device_counters(struct device *device)
{
    return &device->counters;
}

uint64_t device_scans(struct device *device)
{
    pthread_mutex_lock(&device->lock);
    uint64_t scans = device->scan;
    pthread_mutex_unlock(&device->lock);
    return scans;
}

double device_tick_ns(const struct device *device)
{
    return (double)device->tick_ns;
}
