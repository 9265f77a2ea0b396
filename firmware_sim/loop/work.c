#include "firmware_sim/loop/work.h"

#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/native_encode.h"

struct worker {
    const struct site *site;
    struct caster *caster;
    struct cast_counters counted; /* of the caster, as far as slots have them */
    struct line_block block;
    struct cast_setup setup;
    uint32_t setup_station; /* 1 + the station that setup is for; 0: none yet */
    size_t stretch;         /* of a moving head's path, that setup is for */
    size_t anchored;        /* the one whose anchor went out last */
    /* a moving head: its poses for the pulses at hand, and as they go out */
    struct pose_knot knot[NATIVE_MAX_POSES];
    struct native_pose pose[NATIVE_MAX_POSES];
};

enum {
    MAX_DT_NS = (1 << 24) - 1, /* a point's time within its frame has 24 bits */
    OVERHEAD_BYTES = 24576,    /* events, descriptor, anchor, names, telemetry of one tick, generously */
    LINE_END_BYTES = 128,
};

int worker_create(const struct site *site, struct worker **out, struct sh_err *err)
{
    *out = NULL;
    struct worker *worker = calloc(1, sizeof *worker);
    if (worker == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    worker->site = site;
    uint32_t n = device_tick_pulses(site->cfg);
    int rc = caster_create(&worker->caster, err);
    if (rc == SH_OK) rc = line_block_alloc(&worker->block, n * site_points_per_pulse(site), err);
    if (rc == SH_OK && site->cfg->output.attributes) rc = line_block_alloc_attributes(&worker->block, err);
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
    line_block_free(&worker->block);
    free(worker);
}

uint32_t worker_slot_bytes(const struct site *site)
{
    const struct config *cfg = site->cfg;
    /* Each line part is a frame of its own. */
    uint32_t poses = config_head_moves(&cfg->platform) ? NATIVE_MAX_FRAME : 0;
    uint32_t n_points = device_tick_pulses(cfg) * site_points_per_pulse(site), lines = device_tick_lines(cfg);
    uint32_t attributes = 0;
    if (cfg->output.attributes)
        attributes = (uint32_t)native_attributes_bound(n_points) +
                     lines * (uint32_t)(NATIVE_HEADER_LEN + NATIVE_ATTRIBUTES_HEAD_LEN);
    return OVERHEAD_BYTES + poses + attributes + (uint32_t)native_points_bound(n_points) +
           lines * (LINE_END_BYTES + NATIVE_HEADER_LEN + NATIVE_POINTS_HEAD_LEN);
}

static void added(struct ring_slot *slot, size_t len, uint32_t frames)
{
    slot->len += (uint32_t)len;
    if (len != 0) slot->n_frames += frames;
}

static void surface_name(void *ctx, uint32_t label, const char **object, const char **material)
{
    const struct scene_surface *surface = site_surface(ctx, label);
    *object = surface->object;
    *material = surface->material;
}

static void fill_heads(struct worker *worker, const struct device_work *work, struct ring_slot *slot, uint32_t cap)
{
    for (uint32_t i = 0; i < work->n_events_before; i++)
        added(slot, native_encode_event(slot->bytes + slot->len, cap - slot->len, &work->event[i], work->t_ns, 0), 1);
    if (work->describe) {
        int flags = work->describe_flags;
        added(slot,
              native_encode_descriptor(slot->bytes + slot->len, cap - slot->len, &work->descriptor, work->t_ns, flags),
              1);
        added(slot, native_encode_anchor(slot->bytes + slot->len, cap - slot->len, &work->anchor, work->t_ns, flags),
              1);
    }
    struct native_names names = {work->surfaces_first, work->surfaces_n, surface_name, (void *)(uintptr_t)worker->site};
    while (names.n != 0) {
        size_t len = native_encode_surfaces(slot->bytes + slot->len, cap - slot->len, 8192, &names, work->t_ns);
        if (len == 0) break;
        added(slot, len, 1);
    }
}

static uint32_t frames_in(const uint8_t *bytes, size_t len)
{
    uint32_t n = 0;
    for (size_t at = 0; at < len; n++)
        at += native_frame_len(bytes + at);
    return n;
}

/* All poses from the last at or before the first pulse to the first at or behind the last one. Of a trajectory with
 * more than a frame holds (pulses far apart) only some: what goes out is what is cast with in any case. */
static uint32_t choose_knots(struct worker *worker, int64_t from_ns, int64_t to_ns)
{
    const struct site *site = worker->site;
    const struct pose_knot *knot = site->knot;
    size_t lo = 0, hi = site->n_knots;
    while (hi - lo > 1) {
        size_t mid = lo + (hi - lo) / 2;
        if (knot[mid].t_ns <= from_ns)
            lo = mid;
        else
            hi = mid;
    }
    for (hi = lo; hi + 1 < site->n_knots && knot[hi].t_ns < to_ns;)
        hi++;
    size_t stride = (hi - lo) / (NATIVE_MAX_POSES - 2) + 1;
    uint32_t n = 0;
    for (size_t i = lo; i < hi; i += stride)
        worker->knot[n++] = knot[i];
    worker->knot[n++] = knot[hi];
    if (n == 1 || knot[hi].t_ns < to_ns) { /* behind its end the head stands */
        worker->knot[n] = knot[hi];
        worker->knot[n++].t_ns = to_ns > knot[hi].t_ns ? to_ns : knot[hi].t_ns + 1;
    }
    return n;
}

static void take_poses(struct worker *worker, const struct device_work *work, struct ring_slot *slot, uint32_t cap)
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
    added(slot,
          native_encode_poses(slot->bytes + slot->len, cap - slot->len, worker->pose, setup->n_knots, work->t_ns, 0),
          1);
}

/* Points behind it are about another place (site_georef). */
static void move_anchor(struct worker *worker, const struct device_work *work, size_t stretch, struct ring_slot *slot,
                        uint32_t cap)
{
    struct native_anchor anchor;
    if (stretch == worker->anchored) return;
    worker->anchored = stretch;
    if (worker->site->station[work->station].leg == NULL) return;
    device_fill_anchor(worker->site, work->station, stretch, &anchor);
    added(slot, native_encode_anchor(slot->bytes + slot->len, cap - slot->len, &anchor, work->t_ns, 0), 1);
}

/* Where the path of a moving head enters another stretch: what is needed for pulse k and those that follow on it,
 * before the one that is returned. */
static uint64_t enter_stretch(struct worker *worker, const struct device_work *work, uint64_t k, uint64_t end,
                              struct ring_slot *slot, uint32_t cap)
{
    const struct site *site = worker->site;
    if (!site->moving) return end;
    size_t stretch = site_stretch_at(site, schedule_time_ns(&work->segment, k));
    if (stretch != worker->stretch) site_enter(site, work->station, stretch, &worker->setup);
    worker->stretch = stretch;
    move_anchor(worker, work, stretch, slot, cap);
    if (site->stretch[stretch].until_ns == INT64_MAX) return end;
    uint64_t next = schedule_pulse_at(&work->segment, site->stretch[stretch].until_ns);
    return next < end ? next : end;
}

/* What a cast has added to the caster's counters. */
static void count_hits(struct worker *worker, uint32_t echoes, struct ring_slot *slot)
{
    struct cast_counters now, *was = &worker->counted;
    caster_get_counters(worker->caster, &now);
    const struct ring_hits hits = {.echoes = echoes,
                                   .crowded = (uint32_t)(now.crowded - was->crowded),
                                   .faint = (uint32_t)(now.faint - was->faint),
                                   .unfit = (uint32_t)(now.unfit - was->unfit)};
    *was = now;
    slot->n_echoes += hits.echoes;
    slot->n_crowded += hits.crowded;
    slot->n_faint += hits.faint;
    slot->n_unfit += hits.unfit;
    ring_hits_add(&slot->tail, &hits);
}

static void cast_run(struct worker *worker, const struct device_work *work, const struct schedule_line *line,
                     uint64_t k, uint64_t end, struct ring_slot *slot, uint32_t cap)
{
    uint64_t longest = (uint64_t)(MAX_DT_NS / (work->segment.ns_quot + 1));
    if (longest == 0) longest = 1;
    while (k < end) {
        struct schedule_run run;
        uint64_t stop = enter_stretch(worker, work, k, end, slot, cap);
        uint64_t n = stop - k < longest ? stop - k : longest;
        schedule_get_run(&work->segment, line, k, (uint32_t)n, &run);
        uint32_t echoes = caster_cast(worker->caster, &worker->setup, &run, &worker->block);
        count_hits(worker, echoes, slot);
        uint8_t *at = slot->bytes + slot->len;
        size_t len = native_encode_points(at, cap - slot->len, &worker->block, work->scan_t0_ns);
        added(slot, len, frames_in(at, len));
        slot->n_cast += n;
        k += n;
    }
}

/* Writes the line-end frame. Its number of echoes is filled in at release: blocks may come from several ticks. */
static void end_line(const struct worker *worker, const struct device_work *work, const struct schedule_line *line,
                     uint64_t end, struct ring_slot *slot, uint32_t cap)
{
    const struct schedule_segment *seg = &work->segment;
    const struct cast_setup *setup = &worker->setup;
    int partial = end < line->pulse_end;
    uint64_t cast_end = line->cast_end < end ? line->cast_end : end;
    uint64_t cast_here = cast_end > line->cast0 ? cast_end - line->cast0 : 0;
    uint64_t last =
        end > seg->k0 ? end - 1 : end; /* stopped at once after a change of settings: there is no nearer pulse */
    double mirror_turn = schedule_mirror_turn(seg, last), pan_turn = schedule_pan_turn(seg, last);
    if (setup->detect != NULL && setup->detect->instrument != NULL)
        instrument_read(setup->detect->instrument, 1, &mirror_turn, &pan_turn);
    struct ring_mark *mark = &slot->mark[slot->n_marks++];
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
    mark->frame_at = slot->len;
    mark->before = slot->tail;
    mark->scan_t0_ns = work->scan_t0_ns;
    slot->tail = (struct ring_hits){0};
    slot->n_lines++;
    added(slot, native_encode_line_end(slot->bytes + slot->len, cap - slot->len, &mark->end, work->scan_t0_ns), 1);
}

static void fill_pulses(struct worker *worker, const struct device_work *work, struct ring_slot *slot, uint32_t cap)
{
    if (worker->setup_station != work->station + 1) {
        site_cast_setup(worker->site, work->station, &worker->setup);
        worker->setup_station = work->station + 1;
        worker->stretch = SIZE_MAX;
    }
    worker->anchored = work->stretch;
    worker->setup.echoes = (enum beam_select)work->echoes;
    if (worker->site->n_movers != 0)
        site_move(worker->site,
                  site_mover_time(worker->site, work->station, 1e-9 * (double)(work->t_ns - work->scan_t0_ns)),
                  &worker->setup);
    take_poses(worker, work, slot, cap);
    for (uint64_t k = work->pulse0; k < work->pulse_end;) {
        struct schedule_line line;
        schedule_get_line(&work->segment, schedule_line_of(&work->segment, k), &line);
        uint64_t end = line.pulse_end < work->pulse_end ? line.pulse_end : work->pulse_end;
        uint64_t cast0 = k > line.cast0 ? k : line.cast0;
        uint64_t cast_end = end < line.cast_end ? end : line.cast_end;
        if (cast0 < cast_end) cast_run(worker, work, &line, cast0, cast_end, slot, cap);
        slot->n_fired += end - k;
        if (end == line.pulse_end) end_line(worker, work, &line, end, slot, cap);
        k = end;
    }
    if (worker->site->moving && work->pulse_end > work->pulse0) /* in the blind part of a line, too */
        move_anchor(worker, work, site_stretch_at(worker->site, schedule_time_ns(&work->segment, work->pulse_end - 1)),
                    slot, cap);
    if (!work->cut_short) return;
    /* The line that was stopped in, be some of its pulses in this tick or all in earlier ones. */
    struct schedule_line line;
    schedule_get_line(&work->segment, schedule_line_of(&work->segment, work->pulse_end), &line);
    if (line.begin < work->pulse_end) end_line(worker, work, &line, work->pulse_end, slot, cap);
}

void worker_fill(struct worker *worker, const struct device_work *work, struct ring_slot *slot, uint32_t slot_bytes)
{
    slot->wake = work->wake;
    fill_heads(worker, work, slot, slot_bytes);
    if (work->scanning) fill_pulses(worker, work, slot, slot_bytes);
    for (uint32_t i = work->n_events_before; i < work->n_events; i++)
        added(slot,
              native_encode_event(slot->bytes + slot->len, slot_bytes - slot->len, &work->event[i], work->t_ns, 0), 1);
    if (work->telemetry)
        added(slot,
              native_encode_telemetry(slot->bytes + slot->len, slot_bytes - slot->len, &work->telemetry_frame,
                                      work->t_ns, 0),
              1);
}

uint64_t worker_count_cast(const struct device_work *work, uint64_t *first)
{
    uint64_t n = 0;
    *first = UINT64_MAX;
    if (!work->scanning) return 0;
    for (uint64_t k = work->pulse0; k < work->pulse_end;) {
        struct schedule_line line;
        schedule_get_line(&work->segment, schedule_line_of(&work->segment, k), &line);
        uint64_t end = line.pulse_end < work->pulse_end ? line.pulse_end : work->pulse_end;
        uint64_t cast0 = k > line.cast0 ? k : line.cast0;
        uint64_t cast_end = end < line.cast_end ? end : line.cast_end;
        if (cast0 < cast_end) n += cast_end - cast0;
        if (cast0 < cast_end && *first == UINT64_MAX) *first = cast0;
        k = end;
    }
    return n;
}
