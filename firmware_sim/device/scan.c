/* SPDX-License-Identifier: MIT */
/* The scan program: the pulses and frames of each tick while a scan is on. Pulses are cast in packets of 16
 * (SCHEDULE_PACKET), and a tick ends between two packets where it can. */
#include <math.h>
#include <string.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/device/device_state.h"
#include "firmware_sim/device/frames.h"

/* Plans the site for the settings. The plan may fail although each setting was accepted: without memory, or because the
 * scan begins at another station. */
static int plan_scan(struct device *device, struct device_version **variant, uint64_t tick)
{
    const struct head_settings *settings = &device->cmd.settings;
    struct sh_err err;
    if (device_find_variant(device, settings, settings->station - 1, variant, &err) == SH_OK) return 1;
    command_queue_push(&device->cmd.queue, CMD_E_SETTINGS, err.text);
    device_push_error(&device->events, 0, CMD_E_SETTINGS, err.text);
    device_transition(device, HEAD_EV_FAIL, tick);
    return 0;
}

void device_count_duration(struct device *device, uint64_t tick)
{
    const struct device_journal *journal = &device->journal;
    const uint64_t most = journal->ends ? journal->replay[journal->n_replay].tick : UINT64_MAX;
    const int is_counted = device->scan.number > 1 || (device->scan.number == 0 && device->end_tick != most);
    if (!device->options.start || !(device->options.duration_s > 0.0) || is_counted) return;
    device->end_tick = tick + device_ticks_of(device, device->options.duration_s);
    if (device->end_tick > most) device->end_tick = most;
}

void device_begin_scan(struct device *device, uint64_t tick)
{
    struct schedule_spec spec;
    struct device_version *variant;
    if (!plan_scan(device, &variant, tick)) return;
    const struct site *site = variant != NULL ? variant->site : device->site;
    device->scan = (struct device_scan){.on = 1,
                                        .site = site,
                                        .variant = variant,
                                        .number = device->scan.number + 1,
                                        .settings = device->cmd.settings,
                                        .tick0 = tick,
                                        .station = device->cmd.settings.station - 1,
                                        .station_scan = ++device->station_scans[device->cmd.settings.station - 1],
                                        .stretch = site_stretch_at(device->site, 0),
                                        .describe = 1};
    device_fill_spec(&device->beam, site, &spec);
    schedule_start(&device->scan.segment, &spec);
    device->cmd.frames_done = 0;
    device->live.next = 0;
    device_push_event(&device->events, NATIVE_EV_SCAN_START, device->scan.number, tick * (uint64_t)device->tick_ns,
                      (uint64_t)device_gps_ns(device, (int64_t)tick * device->tick_ns), "");
    device_count_duration(device, tick);
}

uint32_t device_tick_pulses(const struct config *cfg)
{
    uint32_t n = (uint32_t)ceil((double)cfg->profile.prr_max_uhz * 1e-6 / cfg->loop.tick_hz);
    /* An eighth more to catch up. A tick may begin with all pulses of a firing sequence. */
    return n + n / 8 + 2 * SCHEDULE_PACKET + cfg->profile.emitter.n_beams;
}

uint32_t device_tick_lines(const struct config *cfg)
{
    const int64_t most_uhz = cfg->profile.lines_max_uhz;
    const double most_hz = 1e-6 * (double)(most_uhz + config_motor_uhz(fmax(cfg->head.motor_ppm, 0.0), most_uhz));
    return (uint32_t)ceil(most_hz / cfg->loop.tick_hz) + 2;
}

/* Returns the first pulse that has no room in this tick. When the rates rise suddenly, more pulses may be due than one
 * tick holds. An incomplete packet has then waited for up to 15 pulse periods of the old rate, and that time is counted
 * at the new rate. */
static uint64_t tick_room_end(const struct device *device)
{
    const struct schedule_segment *seg = &device->scan.segment;
    struct schedule_line line;
    uint64_t last_line = schedule_line_of(seg, device->scan.pulse_next) + device_tick_lines(device->site->cfg) - 1;
    schedule_get_line(seg, last_line, &line);
    uint64_t end = device->scan.pulse_next + device_tick_pulses(device->site->cfg);
    return line.pulse_end < end ? line.pulse_end : schedule_cut(seg, end);
}

/* Counts the pulses of the tick: in the work, in the scan and in total. */
static void count_pulses(struct device *device, struct device_work *work)
{
    const struct schedule_segment *seg = &work->segment;
    work->scan = device->scan.number;
    work->n_cast = 0;
    work->cast0 = UINT64_MAX;
    for (uint64_t k = work->pulse0; k < work->pulse_end;) {
        struct schedule_line line;
        schedule_get_line(seg, schedule_line_of(seg, k), &line);
        uint64_t end = line.pulse_end < work->pulse_end ? line.pulse_end : work->pulse_end;
        uint64_t first = k > line.cast0 ? k : line.cast0, cast_end = end < line.cast_end ? end : line.cast_end;
        if (first < cast_end) {
            work->n_cast += cast_end - first;
            if (work->cast0 == UINT64_MAX) work->cast0 = first;
        }
        k = end;
    }
    device->scan.cast += work->n_cast;
    atomic_fetch_add(&device->counters.fired, work->pulse_end - work->pulse0);
    atomic_fetch_add(&device->counters.cast, work->n_cast);
}

/* Returns the time from the scan's start after which it ends at the latest, by the option scan_s or by the end of its
 * path. The scan may end earlier by its number of frames. */
static int64_t scan_end_ns(const struct device *device)
{
    int64_t path_end_ns = device_path_end_ns(device);
    if (!(device->options.scan_s > 0.0)) return path_end_ns;
    int64_t end_ns = llround(1e9 * device->options.scan_s);
    return end_ns < path_end_ns ? end_ns : path_end_ns;
}

/* A client that grants time and moves a live platform gets all pulses of a grant within that grant. In all other cases
 * an incomplete packet waits for the next tick, so that the stream is the same at any pace. Only where the scan ends,
 * or a fault begins or ends, it goes out at once. */
static int is_lock_step(const struct device *device)
{
    const struct config *cfg = device->site->cfg;
    return cfg->loop.pace == PACE_STEP && cfg->platform.kind == PLATFORM_LIVE;
}

/* Claims the pulses of this tick. Returns 1 when the scan is over: it is complete, its time is over, or it was told to
 * stop. */
static int claim_pulses(struct device *device, uint64_t tick, struct device_work *work)
{
    struct schedule_segment *seg = &device->scan.segment;
    int64_t since = (int64_t)(tick - device->scan.tick0) * device->tick_ns;
    int stop = device->scan.stop_requested || device->ending || tick >= device->end_tick;
    work->scanning = 1;
    work->site = device->scan.site;
    work->variant = device_use(device->scan.variant);
    work->scan_t0_ns = (int64_t)device->scan.tick0 * device->tick_ns;
    work->station = device->scan.station;
    work->station_scan = device->scan.station_scan;
    work->stretch = device->scan.stretch;
    work->echoes = device->scan.settings.echoes;
    work->waves = device->scan.settings.waves;
    work->pulse0 = device->scan.pulse_next;
    /* After a stop all pulses that fired before this tick go out. Otherwise the cut leaves an incomplete packet for the
     * next tick. */
    int64_t end_ns = scan_end_ns(device), until_ns = stop ? since : since + device->tick_ns;
    int ends = end_ns <= until_ns; /* within this tick */
    if (ends) until_ns = end_ns;
    device_turn_beam(&device->beam, until_ns);
    work->segment = *seg;
    work->prr_uhz = device->scan.prr_uhz;
    work->disturbance.on = device->beam.now.on;
    if (work->disturbance.on) work->disturbance = device->beam.now;
    uint64_t due = schedule_pulse_at(seg, until_ns);
    const uint64_t edge = device->beam.edge, room_end = tick_room_end(device), most = edge < room_end ? edge : room_end;
    if (due > most) {
        due = most;
        ends = 0;
    }
    uint64_t end = stop || ends || due == edge || is_lock_step(device) ? due : schedule_cut(seg, due);
    int done = due >= seg->end_pulse && !stop;
    if (done || end > seg->end_pulse) end = seg->end_pulse;
    if (end < work->pulse0) end = work->pulse0;
    work->pulse_end = device->scan.pulse_next = end;
    count_pulses(device, work);
    if (end > work->pulse0) device->scan.stretch = site_stretch_at(device->site, schedule_time_ns(seg, end - 1));
    work->cut_short = (stop || ends) && end < seg->end_pulse;
    device_take_poses(device, work);
    struct schedule_line line; /* of the next pulse, or of the last where no more come */
    /* After SCAN:FRAMes was lowered, `end` may be above end_pulse. */
    const int is_whole = end >= seg->end_pulse && seg->spec.frames != 0;
    schedule_get_line(seg, schedule_line_of(seg, is_whole ? end - 1 : end), &line);
    device->cmd.frames_done = (uint64_t)line.frame + (uint64_t)is_whole;
    return done || stop || ends;
}

int device_is_repeated(const struct device *device, uint64_t tick)
{
    uint64_t since = tick - device->scan.tick0;
    if (!device->scan.on)
        return device->machine.state >= HEAD_IDLE && (tick % device->tick_hz == 0 || device->scan.anchor_lost);
    return (since != 0 && since % device->tick_hz == 0) || device->scan.anchor_lost;
}

/* Stored settings may need a site of their own. Where that can't be planned, the scan's start says why. */
void device_before_scans(struct device *device)
{
    const struct head_settings *settings = &device->cmd.settings;
    struct device_scan *scan = &device->scan;
    struct schedule_spec spec;
    struct sh_err err;
    device_end_beam(&device->beam, 0);
    scan->settings = *settings;
    scan->station = settings->station - 1;
    if (device_find_variant(device, settings, scan->station, &scan->variant, &err) != SH_OK) scan->variant = NULL;
    scan->site = scan->variant != NULL ? scan->variant->site : device->site;
    device_fill_spec(&device->beam, scan->site, &spec);
    schedule_start(&scan->segment, &spec);
    scan->stretch = site_stretch_at(device->site, 0);
}

void device_describe(struct device *device, struct device_work *work)
{
    const struct head_settings *settings = &device->scan.settings; /* at rest those of the last scan (PROTOCOL.md) */
    work->describe = 1;
    work->describe_flags = device->scan.describe ? 0 : NATIVE_REPEAT;
    device_fill_descriptor(&device->scan, device->idn, settings->waves, &work->descriptor);
    device_fill_emitter(&device->scan, settings->echoes, &work->emitter, work->beam);
    device_fill_anchor(device->scan.site, device->scan.station, device->scan.stretch, &work->anchor);
    device->scan.describe = device->scan.anchor_lost = 0;
}

void device_describe_now(struct device *device, struct device_work *work)
{
    memset(work, 0, sizeof *work);
    pthread_mutex_lock(&device->lock);
    const struct device_scan was = device->scan;
    device->scan.describe = 0;
    device_describe(device, work);
    device->scan = was;
    work->t_ns = (int64_t)device->next_tick * device->tick_ns;
    work->site = device->site; /* no station moves before the first tick is claimed */
    pthread_mutex_unlock(&device->lock);
}

static void scan_describe(struct device *device, uint64_t tick, struct device_work *work)
{
    uint64_t since = tick - device->scan.tick0;
    if (device->scan.describe || device_is_repeated(device, tick)) device_describe(device, work);
    /* Send all names at the scan's start, then over and over for readers that join late. */
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

/* Ticks before this one may yet be lost. So the event has the pulses that were cast, and its release subtracts those
 * that were delivered (stream.c). */
static void end_scan(struct device *device, uint64_t tick)
{
    int stopped = device->scan.stop_requested;
    device_end_beam(&device->beam, (int64_t)(tick - device->scan.tick0) * device->tick_ns);
    device->scan.on = 0;
    device->scan.end_tick = tick;
    device->scan.stop_requested = 0;
    device_push_event(&device->events, NATIVE_EV_SCAN_END, device->scan.number, device->scan.pulse_next,
                      device->scan.cast, "");
    device_transition(device, stopped ? HEAD_EV_STOP : HEAD_EV_DONE, tick);
    if (device->options.one_scan) device->over = 1;
}

void device_claim_scan(struct device *device, uint64_t tick, struct device_work *work)
{
    scan_describe(device, tick, work);
    if (!claim_pulses(device, tick, work)) return;
    end_scan(device, tick + 1);
    device_take_events(&device->events, work);
}
