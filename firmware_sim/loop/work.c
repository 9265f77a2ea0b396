/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/work.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/rng.h"
#include "drivers/protocol/native_encode.h"
#include "drivers/protocol/native_waves.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/work_inside.h"
#include "firmware_sim/site/waves.h"

enum {
    MAX_DT_NS = (1 << 24) - 1, /* a point's time within its frame has 24 bits */
    OVERHEAD_BYTES = 24576,    /* upper bound of events, descriptor, anchor, names and telemetry in one tick */
    LINE_END_BYTES = 128,
    FIXED_BYTES = 512,  /* no frame of a fixed length is longer */
    NAMES_BYTES = 8192, /* most names in one frame */
};

int worker_create(const struct site *site, struct worker **out, struct sh_err *err)
{
    *out = NULL;
    struct worker *worker = calloc(1, sizeof *worker);
    if (worker == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    worker->site = site;
    const uint32_t n_pulses = device_tick_pulses(site->cfg), n_points = n_pulses * site_most_points_per_pulse(site);
    int rc = caster_create(&worker->caster, err);
    if (rc == SH_OK) rc = site_make_block(site, n_pulses, n_points, worker->caster, &worker->block, err);
    worker->waves = worker->block.waves;
    if (rc != SH_OK) {
        worker_free(worker);
        return rc;
    }
    *out = worker;
    return SH_OK;
}

void worker_free(struct worker *worker)
{
    if (worker == NULL) return;
    caster_free(worker->caster);
    worker->block.waves = worker->waves;
    line_block_free(&worker->block);
    free(worker);
}

/* Returns the bytes of so many points, lines and waveforms. Each part of a line is a stream frame of its own. */
static uint32_t line_bytes(const struct config *cfg, uint32_t n_points, uint32_t lines, struct site_wave_room waves)
{
    uint32_t bytes =
        (uint32_t)native_points_bound(n_points) + lines * (LINE_END_BYTES + NATIVE_HEADER_LEN + NATIVE_POINTS_HEAD_LEN);
    if (cfg->output.attributes)
        bytes += (uint32_t)native_attributes_bound(n_points) +
                 lines * (uint32_t)(NATIVE_HEADER_LEN + NATIVE_ATTRIBUTES_HEAD_LEN);
    if (cfg->output.colour != COLOUR_NONE)
        bytes +=
            (uint32_t)native_colours_bound(n_points) + lines * (uint32_t)(NATIVE_HEADER_LEN + NATIVE_COLOURS_HEAD_LEN);
    if (waves.windows != 0)
        bytes += (uint32_t)native_waves_bound(n_points, waves.windows, waves.samples) +
                 lines * (uint32_t)(NATIVE_HEADER_LEN + NATIVE_WAVES_HEAD_LEN);
    return bytes;
}

uint32_t worker_tick_bytes(const struct site *site)
{
    const struct config *cfg = site->cfg;
    uint32_t poses = config_head_moves(&cfg->platform) ? NATIVE_MAX_FRAME : 0;
    const uint32_t n_pulses = device_tick_pulses(cfg);
    uint32_t frames = device_tick_lines(cfg);
    if (site->n_movers != 0) frames += SCHEDULE_PACKET + cfg->profile.emitter.n_beams; /* move_meshes */
    return OVERHEAD_BYTES + poses +
           line_bytes(cfg, n_pulses * site_most_points_per_pulse(site), frames, site_wave_room(site, n_pulses));
}

uint32_t worker_usual_bytes(const struct site *site)
{
    const struct head_settings *set = &site->cfg->head.settings;
    double tick_uhz = 1e6 * site->cfg->loop.tick_hz;
    uint32_t n_points = (uint32_t)ceil((double)set->prr_uhz / tick_uhz) + SCHEDULE_PACKET;
    return line_bytes(site->cfg, n_points, (uint32_t)ceil((double)set->lines_uhz / tick_uhz),
                      site_usual_waves(site, n_points));
}

/* The place of the next frame. */
struct place {
    uint8_t *at;
    size_t room; /* 0: there is no memory */
};

static struct place place_for(struct worker *worker, size_t bytes)
{
    struct place place = {NULL, 0};
    if (!worker->no_memory && ring_grow(worker->slot, bytes, &place.room) != SH_OK) worker->no_memory = 1;
    if (!worker->no_memory) place.at = worker->slot->tick.bytes + worker->slot->tick.len;
    return place;
}

static void added(struct worker *worker, size_t len)
{
    worker->slot->tick.len += (uint32_t)len;
}

static void surface_name(void *ctx, uint32_t label, const char **object, const char **material)
{
    const struct scene_surface *surface = site_surface(ctx, label);
    *object = surface->object;
    *material = surface->material;
}

static void add_telemetry(struct worker *worker, const struct device_work *work)
{
    const struct place to = place_for(worker, FIXED_BYTES);
    added(worker, native_encode_telemetry(to.at, to.room, &work->telemetry_frame, work->t_ns, 0));
}

static void add_event(struct worker *worker, const struct device_work *work, uint32_t i)
{
    if (work->event[i].code == NATIVE_EV_SCAN_END) add_telemetry(worker, work);
    const struct place to = place_for(worker, FIXED_BYTES);
    added(worker, native_encode_event(to.at, to.room, &work->event[i], work->t_ns, 0));
}

static void add_anchor(struct worker *worker, const struct native_anchor *anchor, int64_t t_ns, int flags)
{
    const struct place to = place_for(worker, FIXED_BYTES);
    added(worker, native_encode_anchor(to.at, to.room, anchor, t_ns, flags));
}

static void add_descriptor(struct worker *worker, const struct device_work *work)
{
    const struct place to = place_for(worker, FIXED_BYTES);
    added(worker, native_encode_descriptor(to.at, to.room, &work->descriptor, work->t_ns, work->describe_flags));
}

static void add_emitter(struct worker *worker, const struct device_work *work)
{
    const struct native_emitter *emitter = &work->emitter;
    const struct place to = place_for(worker, FIXED_BYTES + (size_t)emitter->n_beams * NATIVE_BEAM_LEN);
    added(worker, native_encode_emitter(to.at, to.room, emitter, work->beam, work->t_ns, work->describe_flags));
}

static void add_names(struct worker *worker, const struct device_work *work)
{
    struct native_names names = {work->surfaces_first, work->surfaces_n, surface_name, (void *)(uintptr_t)worker->site};
    while (names.n != 0) {
        const struct place to = place_for(worker, NATIVE_HEADER_LEN + NAMES_BYTES);
        const size_t len = native_encode_surfaces(to.at, to.room, NAMES_BYTES, &names, work->t_ns);
        if (len == 0) break;
        added(worker, len);
    }
}

static void fill_heads(struct worker *worker, const struct device_work *work)
{
    for (uint32_t i = 0; i < work->n_events_before; i++)
        add_event(worker, work, i);
    if (work->describe) {
        add_descriptor(worker, work);
        if (work->emitter.kind != NATIVE_EMIT_LINE) add_emitter(worker, work);
        add_anchor(worker, &work->anchor, work->t_ns, work->describe_flags);
    }
    add_names(worker, work);
}

/* All poses from the last one at or before the first pulse to the first one at or after the last pulse. A
 * trajectory may have more of them than a frame holds, when pulses are far apart. Then only some are chosen.
 * The poses that are sent are always those that pulses are cast with. */
static uint32_t choose_knots(struct worker *worker, int64_t from_ns, int64_t to_ns)
{
    const struct site *site = worker->site;
    const struct pose_knot *knot = site->knot;
    size_t lo = pose_find_knot(knot, site->n_knots, from_ns), hi;
    for (hi = lo; hi + 1 < site->n_knots && knot[hi].t_ns < to_ns;)
        hi++;
    size_t stride = (hi - lo) / (NATIVE_MAX_POSES - 2) + 1;
    uint32_t n = 0;
    for (size_t i = lo; i < hi; i += stride)
        worker->knot[n++] = knot[i];
    worker->knot[n++] = knot[hi];
    if (n == 1 || knot[hi].t_ns < to_ns) { /* after its end the head stands */
        worker->knot[n] = knot[hi];
        worker->knot[n++].t_ns = to_ns > knot[hi].t_ns ? to_ns : knot[hi].t_ns + 1;
    }
    return n;
}

static void take_poses(struct worker *worker, const struct device_work *work)
{
    if (!worker->site->moving || work->pulse_end == work->pulse0) return;
    struct cast_setup *setup = &worker->setup;
    setup->knot = worker->knot;
    setup->n_knots = work->n_poses;
    if (work->n_poses != 0)
        memcpy(worker->knot, work->pose, work->n_poses * sizeof *work->pose);
    else
        setup->n_knots = choose_knots(worker, schedule_time_ns(&work->segment, work->pulse0),
                                      schedule_time_ns(&work->segment, work->pulse_end - 1));
    for (uint32_t i = 0; i < setup->n_knots; i++) {
        const struct pose_knot *k = &worker->knot[i];
        struct native_pose *p = &worker->pose[i];
        *p = (struct native_pose){.t_ns = k->t_ns, .frame = k->frame, .flags = k->flags};
        memcpy(p->position_m, k->pose.position_m, sizeof p->position_m);
        memcpy(p->quat, k->pose.quat, sizeof p->quat);
    }
    const struct place to =
        place_for(worker, NATIVE_HEADER_LEN + NATIVE_POSES_HEAD_LEN + (size_t)setup->n_knots * NATIVE_POSE_LEN);
    added(worker, native_encode_poses(to.at, to.room, worker->pose, setup->n_knots, work->t_ns, 0));
}

/* Writes an anchor: the points that follow are relative to another place (site_georef). */
static void move_anchor(struct worker *worker, const struct device_work *work, size_t stretch)
{
    struct native_anchor anchor;
    if (stretch == worker->anchored) return;
    worker->anchored = stretch;
    if (work->site->station[work->station].on_stretch == NULL) return;
    device_fill_anchor(work->site, work->station, stretch, &anchor);
    add_anchor(worker, &anchor, work->t_ns, 0);
}

/* Prepares what pulse k needs on its stretch of a moving head's path. Returns the first pulse on another
 * stretch, or end. */
static uint64_t enter_stretch(struct worker *worker, const struct device_work *work, uint64_t k, uint64_t end)
{
    const struct site *site = work->site;
    if (!site->moving) return end;
    size_t stretch = site_stretch_at(site, schedule_time_ns(&work->segment, k));
    if (stretch != worker->stretch) site_enter(site, work->station, stretch, &worker->setup);
    worker->stretch = stretch;
    move_anchor(worker, work, stretch);
    if (site->stretch[stretch].until_ns == INT64_MAX) return end;
    uint64_t next = schedule_pulse_at(&work->segment, site->stretch[stretch].until_ns);
    return next < end ? next : end;
}

/* Adds to the tick what a cast has added to the caster's counters. */
static void count_hits(struct worker *worker, uint32_t echoes)
{
    struct cast_counters now, *was = &worker->counted;
    caster_get_counters(worker->caster, &now);
    const struct ring_hits hits = {.echoes = echoes,
                                   .empty = worker->block.n_points - echoes,
                                   .crowded = (uint32_t)(now.crowded - was->crowded),
                                   .faint = (uint32_t)(now.faint - was->faint),
                                   .unfit = (uint32_t)(now.unfit - was->unfit),
                                   .lost_samples = (uint32_t)(now.lost_samples - was->lost_samples)};
    *was = now;
    ring_hits_add(&worker->slot->tick.hits, &hits);
    ring_hits_add(&worker->slot->tick.tail, &hits);
}

void worker_get_part(const struct schedule_segment *segment, uint64_t k, uint64_t end, struct worker_part *part)
{
    struct schedule_line *line = &part->line;
    schedule_get_line(segment, schedule_line_of(segment, k), line);
    part->end = line->pulse_end < end ? line->pulse_end : end;
    part->cast0 = k > line->cast0 ? k : line->cast0;
    part->cast_end = part->end < line->cast_end ? part->end : line->cast_end;
}

/* Writes the block's points and all that belongs to them. */
static void add_points(struct worker *worker, const struct device_work *work)
{
    const struct line_block *block = &worker->block;
    struct site_wave_room waves = {0};
    if (block->waves != NULL) waves = (struct site_wave_room){block->waves->n + 1, block->waves->n_samples};
    const struct place to = place_for(worker, line_bytes(work->site->cfg, block->n_points, 0, waves));
    added(worker, native_encode_points(to.at, to.room, block, work->scan_t0_ns));
}

/* Puts moving meshes where they are at the start of pulse k's own tick of device time: the pulse may have waited for
 * its packet, and be claimed with a later tick. So where a mesh is depends on the pulse's time alone. Returns the first
 * pulse of the next such tick, or end. At a stop meshes stand still. */
static uint64_t move_meshes(struct worker *worker, const struct device_work *work, uint64_t k, uint64_t end)
{
    const struct site *site = worker->site;
    if (site->n_movers == 0) return end;
    const int64_t tick_ns = 1000000000 / llround(site->cfg->loop.tick_hz);
    const int64_t from_ns = schedule_time_ns(&work->segment, k) / tick_ns * tick_ns;
    site_move(site, work->station, 1e-9 * (double)from_ns, &worker->setup);
    if (site->stop != NULL) return end;
    const uint64_t next = schedule_pulse_at(&work->segment, from_ns + tick_ns);
    return next < end ? next : end;
}

static void cast_run(struct worker *worker, const struct device_work *work, const struct worker_part *part)
{
    uint64_t k = part->cast0, end = part->cast_end;
    const uint64_t longest = schedule_longest_run(&work->segment, MAX_DT_NS);
    while (k < end) {
        struct schedule_run run;
        uint64_t stop = move_meshes(worker, work, k, enter_stretch(worker, work, k, end));
        uint64_t n = stop - k < longest ? stop - k : longest;
        schedule_get_run(&work->segment, &part->line, k, (uint32_t)n, &run);
        if (work->disturbance.on && work->disturbance.stuck)
            schedule_hold_run(&work->segment, work->disturbance.stuck_turn, &run);
        count_hits(worker, caster_cast(worker->caster, &worker->setup, &run, &worker->block));
        add_points(worker, work);
        worker->slot->tick.n_cast += n;
        k += n;
    }
}

/* The angles of the axes at a pulse, in turns. */
static void find_angles(const struct device_work *work, uint64_t k, double *mirror_turn, double *pan_turn)
{
    const struct schedule_segment *seg = &work->segment;
    const struct device_disturbance *disturbance = &work->disturbance;
    *mirror_turn = schedule_mirror_turn(seg, k);
    *pan_turn = schedule_pan_turn(seg, k);
    if (!disturbance->on) return;
    cast_wobble(&disturbance->cast, schedule_time_ns(seg, k), mirror_turn, pan_turn);
    if (!disturbance->stuck) return;
    if (seg->spec.emitter != NULL) /* beams */
        *pan_turn = disturbance->stuck_turn + seg->spec.emitter->firing[k % seg->spec.emitter->n_beams].pan_turn;
    else
        *mirror_turn = disturbance->stuck_turn;
}

/* Writes the line-end frame. The frame's number of echoes is filled in at release: blocks may come from several
 * ticks. */
static void end_line(struct worker *worker, const struct device_work *work, const struct schedule_line *line,
                     uint64_t end)
{
    const struct schedule_segment *seg = &work->segment;
    const struct cast_setup *setup = &worker->setup;
    int partial = end < line->pulse_end;
    uint64_t cast_end = line->cast_end < end ? line->cast_end : end;
    uint64_t cast_here = cast_end > line->cast0 ? cast_end - line->cast0 : 0;
    uint64_t last = end > seg->k0 ? end - 1 : end; /* stopped right after a change of settings: use pulse `end` */
    double mirror_turn, pan_turn;
    find_angles(work, last, &mirror_turn, &pan_turn);
    if (setup->detect != NULL && setup->detect->instrument != NULL)
        instrument_read(setup->detect->instrument, 1, &mirror_turn, &pan_turn);
    struct ring_tick *tick = &worker->slot->tick;
    struct ring_mark *mark = &tick->mark[tick->n_marks++];
    mark->end = (struct line_end){.frame = line->frame,
                                  .line = (uint32_t)line->line,
                                  .pulse0 = line->begin,
                                  .n_fired = (uint32_t)(end - line->begin),
                                  .n_cast = (uint32_t)(line->cast_before + cast_here),
                                  .t0_ns = line->begin_ns,
                                  .t1_ns = schedule_time_ns(seg, end),
                                  .mirror_count = instrument_encoder_count(mirror_turn, setup->mirror_counts),
                                  .pan_count = instrument_encoder_count(pan_turn, setup->pan_counts),
                                  .status = partial               ? (uint32_t)LINE_PARTIAL
                                            : line->last_of_frame ? (uint32_t)LINE_LAST_OF_FRAME
                                                                  : 0U};
    mark->frame_at = tick->len;
    mark->before = tick->tail;
    mark->scan_t0_ns = work->scan_t0_ns;
    tick->tail = (struct ring_hits){0};
    tick->n_lines++;
    const struct place to = place_for(worker, LINE_END_BYTES);
    added(worker, native_encode_line_end(to.at, to.room, &mark->end, work->scan_t0_ns));
}

void worker_take_setup(struct worker *worker, const struct device_work *work)
{
    if (work->version != NULL) worker->site = device_site_of(work->version);
    if (!work->scanning) return;
    if (worker->setup_station != work->station + 1 || worker->setup_scan != work->scan) {
        site_cast_setup(work->site, work->station, &worker->setup);
        worker->setup_station = work->station + 1;
        worker->setup_scan = work->scan;
        worker->stretch = SIZE_MAX;
        worker_forget(worker); /* the pulses of each scan count from 0 */
    }
    worker->setup.sight = worker->site->station[work->station].sight; /* it may be new since the last scan */
    worker->setup.echoes = (enum beam_select)work->echoes;
    site_set_program(work->site, work->prr_uhz, &worker->setup);
    worker->setup.disturbance = work->disturbance.on ? &work->disturbance.cast : NULL;
    worker->setup.scan_key = rng_scan(work->station + 1, work->station_scan);
}

static void fill_pulses(struct worker *worker, const struct device_work *work)
{
    worker->anchored = work->stretch;
    worker->block.waves = work->waves != 0 ? worker->waves : NULL;
    take_poses(worker, work);
    struct worker_part part;
    for (uint64_t k = work->pulse0; k < work->pulse_end; k = part.end) {
        worker_get_part(&work->segment, k, work->pulse_end, &part);
        if (part.cast0 < part.cast_end) cast_run(worker, work, &part);
        worker->slot->tick.n_fired += part.end - k;
        if (part.end == part.line.pulse_end) end_line(worker, work, &part.line, part.end);
    }
    if (worker->site->moving && work->pulse_end > work->pulse0) /* also in the blind part of a line */
        move_anchor(worker, work, site_stretch_at(worker->site, schedule_time_ns(&work->segment, work->pulse_end - 1)));
    if (!work->cut_short) return;
    /* The line that was stopped. The line's pulses are in this tick or in earlier ones. */
    struct schedule_line line;
    schedule_get_line(&work->segment, schedule_line_of(&work->segment, work->pulse_end), &line);
    if (line.begin < work->pulse_end) end_line(worker, work, &line, work->pulse_end);
}

int worker_fill(struct worker *worker, const struct device_work *work, struct ring_slot *slot)
{
    worker_take_setup(worker, work);
    worker->slot = slot;
    worker->no_memory = 0;
    ring_begin(slot);
    slot->tick.mark = worker->mark;
    fill_heads(worker, work);
    if (work->scanning) {
        slot->tick.scan = work->scan;
        fill_pulses(worker, work);
    }
    for (uint32_t i = work->n_events_before; i < work->n_events; i++)
        add_event(worker, work, i);
    if (work->telemetry) add_telemetry(worker, work);
    return worker->no_memory ? ring_break(slot) : ring_end(slot);
}
