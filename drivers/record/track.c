/* SPDX-License-Identifier: MIT */
#include "drivers/record/track_inside.h"

#include <math.h>

#include "core/wide.h"
#include "drivers/protocol/native.h"

int track_start_gps(const struct track *track, double *gps_s)
{
    if (scanhead_gps_time(track->sh, 0, gps_s) != 0) return 0;
    *gps_s += 1e9; /* adjusted standard GPS time is that much less */
    return 1;
}

/* With coordinates in steps of this, 32 bits hold the path of a moving head up to 200 km from the anchor. */
static const double MOVING_SCALE_M = 1e-4;

static int will_have_colours(const struct track *t)
{
    if (!t->ops->wants_colours) return 0;
    return t->colour.given ? t->colour.scale.mode != COLOUR_NONE : scanhead_has_colours(t->sh) == 1;
}

static int check_sent(const struct track *t, int did, int does, const char *what, struct sh_err *err)
{
    if (!t->begun || did == does) return SH_OK;
    return sh_fail(err, SH_EFORMAT, "%s: the stream continued %s %s; a file holds one kind", t->path,
                   did ? "without" : "with", what);
}

/* Notes which frames beside those of points are wanted and sent. Fails if that has changed since the first points.
 * Waveforms may come and go: any client can switch them, also within a scan. */
static int take_sent(struct track *t, struct sh_err *err)
{
    const struct scanhead *sh = t->sh;
    const int attributes = t->ops->wants_attributes && scanhead_has_attributes(sh) == 1;
    const int deviations = attributes && scanhead_has_deviations(sh) == 1;
    const int colours = will_have_colours(t);
    int rc = check_sent(t, t->has_attributes, attributes, "attributes", err);
    if (rc == SH_OK) rc = check_sent(t, t->has_deviations, deviations, "deviations", err);
    if (rc == SH_OK) rc = check_sent(t, t->has_colours, colours, "colours", err);
    if (rc != SH_OK) return rc;
    t->has_attributes = attributes;
    t->has_deviations = deviations;
    t->has_colours = colours;
    t->has_waves = t->ops->wants_waves && scanhead_has_waves(sh) == 1;
    return SH_OK;
}

static int check_info(struct track *t, struct sh_err *err)
{
    const struct scanhead_info *info = &t->info;
    int crs = info->geo ? info->crs : NATIVE_CRS_LOCAL, epsg = info->geo ? info->epsg : 0;
    int geoid = info->geo && info->geoid_heights;
    if (t->begun && (t->crs != crs || t->epsg != epsg))
        return sh_fail(err, SH_EFORMAT, "%s: the stream changed from EPSG %d to %d; a file holds one CRS", t->path,
                       t->epsg, epsg);
    if (t->begun && t->geoid_heights != geoid)
        return sh_fail(err, SH_EFORMAT, "%s: the stream changed to other heights (%s); a file holds one kind", t->path,
                       geoid ? "geoid" : "ellipsoid");
    if (t->begun && (t->moving != info->moving || t->stops != info->stop))
        return sh_fail(err, SH_EFORMAT, "%s: the stream changed to a head that %s; a file holds one kind", t->path,
                       info->moving ? "moves"
                       : info->stop ? "stops on a trajectory"
                                    : "stands still");
    if (info->station > UINT16_MAX)
        return sh_fail(err, SH_EFORMAT, "%s: station %u; a file holds stations up to 65535", t->path, info->station);
    const int rc = take_sent(t, err);
    if (rc != SH_OK) return rc;
    t->crs = crs;
    t->epsg = epsg;
    t->geoid_heights = geoid;
    t->moving = info->moving;
    t->stops = info->stop;
    t->scale_m = info->moving && info->scale_m > 0 && info->scale_m < MOVING_SCALE_M ? MOVING_SCALE_M : info->scale_m;
    t->begun = 1;
    if (t->named == NULL || info->n_surfaces > t->n_named) {
        t->named = t->sh;
        t->n_named = info->n_surfaces;
    }
    return 0;
}

static void set_pose(struct track *t)
{
    static const struct station_pose same = {{0, 0, 0}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    if (t->info.moving && !t->info.geo)
        t->pose = same;
    else
        station_pose_of(&t->info, &t->pose);
}

/* A scan of the file begins with a descriptor that is no repetition, pulses that go back, another station or scan, or a
 * SCAN_START with another start. Any of these will do, since frames may be lost. Such a descriptor also comes when
 * settings change within a scan: rows and columns stand for other angles then, and scales may be others. */
static int begins_scan(const struct track *t, const struct scanhead_frame *frame)
{
    return t->n_scans == 0 || t->state.new_scan || frame->pulse0 < t->state.last_pulse0 ||
           t->info.station != t->state.last_station || t->info.scan != t->state.last_scan;
}

/* Returns the nearest whole number; UINT32_MAX for larger figures, infinity and NaN. */
static uint32_t whole_u32(double v)
{
    return v <= 0 ? 0 : v < UINT32_MAX ? (uint32_t)llround(v) : UINT32_MAX;
}

/* A pan sweep has a whole number of lines, and one line where the pan does not turn (core/schedule.h). The lengths of
 * lines differ by one pulse at most. */
static void set_limits(struct track *t, const struct native_descriptor *d)
{
    const double lines_hz = 1e-6 * (double)d->lines_uhz, prr_hz = 1e-6 * (double)d->prr_uhz;
    const double sweep_s =
        d->pan_udeg_s > 0 ? ((double)d->pan_stop_udeg - (double)d->pan_start_udeg) / (double)d->pan_udeg_s : 0;
    t->emitter.kind = SCANHEAD_EMIT_LINE;
    t->cast_share =
        d->sweep_udeg != 0 ? fabs(((double)d->line_stop_udeg - (double)d->line_start_udeg) / (double)d->sweep_udeg) : 1;
    if (!(t->cast_share < 1)) t->cast_share = 1;
    t->max_pulses = lines_hz > 0 && prr_hz > 0 ? whole_u32(ceil(prr_hz / lines_hz) + 1) : UINT32_MAX;
    t->max_lines = d->frames > 0 ? whole_u32(d->frames * (ceil(fabs(sweep_s) * lines_hz) + 1)) : UINT32_MAX;
}

/* Adds what the emitter frame says, and the descriptor does not. */
static void set_emitter_limits(struct track *t)
{
    if (scanhead_get_emitter(t->sh, &t->emitter) != 0) return;
    const struct scanhead_emitter *e = &t->emitter;
    if (e->kind == SCANHEAD_EMIT_SPHERE && t->max_lines != UINT32_MAX)
        t->max_lines = whole_u32((double)t->max_lines * e->rings);
}

/* Returns the number, in the scan, of the pulse that is fired at t_ns. Times are rounded down to whole nanoseconds, so
 * it is the last pulse whose time is not later. */
static uint64_t firing_at(const struct scanhead_emitter *e, uint64_t t_ns)
{
    const u128 num = e->sequence_ns_num, den = e->sequence_ns_den, end = ((u128)t_ns + 1) * den;
    if (num == 0) return 0;
    const u128 sequence = (end - 1) / num;
    uint64_t i = 0;
    while (i + 1 < e->n_beams && sequence * num + e->beam[i + 1].offset_ns * den < end)
        i++;
    return (uint64_t)sequence * e->n_beams + i;
}

/* The end of a line says where the next one begins. A line in which settings changed goes on at its angle, which the
 * phase knows. Where neither is known, the row is computed from the times in the frame. The row is then right as long
 * as the pulse rate is that of the descriptor. */
static uint64_t first_row(const struct track *t, const struct scanhead_frame *frame)
{
    if (t->state.have_next_line && t->state.next_line == frame->scan_line && t->state.next_line_pulse0 <= frame->pulse0)
        return frame->pulse0 - t->state.next_line_pulse0;
    if (t->emitter.kind == SCANHEAD_EMIT_BEAMS && frame->line_t0_ns >= 0) {
        const uint64_t first = firing_at(&t->emitter, (uint64_t)frame->line_t0_ns);
        return first < frame->pulse0 ? frame->pulse0 - first : 0;
    }
    uint64_t row;
    if (track_phase_row(&t->state.phase, frame->scan_line, frame->pulse0, &row)) return row;
    double since_s = 1e-9 * ((double)frame->scan_t0_ns - (double)frame->line_t0_ns);
    return whole_u32(since_s * t->info.prr_hz);
}

/* Positions of the geo layout need no pose. The frame scalar does; it is NaN where the pose was lost. */
static void set_geo_frames(struct track *t, int n)
{
    struct scanhead_pose pose;
    for (int i = 0; i < n; i++)
        t->frame[i] = scanhead_pose(t->sh, t->points.t_ns[i], &pose) == SCANHEAD_OK ? pose.frame : NAN;
}

/* Returns how many points are left, or a negative error. */
static int place_moving(struct track *t, int n, struct sh_err *err)
{
    uint16_t index[TRACK_BATCH];
    int kept = 0;
    if (t->info.geo) {
        set_geo_frames(t, n);
        return n;
    }
    const int lost = track_to_scene(t, n);
    if (lost < 0) return sh_fail(err, lost, "%s: %s", t->path, scanhead_error(t->sh));
    for (int i = 0; i < n; i++) {
        if (t->points.echo_count[i] != 0 && isnan(t->points.x[i])) {
            t->missing.n_without_pose++;
            continue;
        }
        index[kept++] = (uint16_t)i;
    }
    if (kept < n) track_pick(t, index, kept);
    return kept;
}

static void count_unheld(struct track *t, int n)
{
    if (t->ops->wants_attributes || scanhead_has_attributes(t->sh) != 1) return;
    for (int i = 0; i < n; i++)
        t->missing.n_attributes_unheld += t->points.echo_count[i] != 0;
}

/* Takes the present batch: n points of the frame, from `first` on. */
static int take_batch(struct track *t, uint32_t first, int n, struct sh_err *err)
{
    for (int i = 0; i < n && track_waits(t); i++)
        t->index[i] = first + (uint32_t)i;
    int kept = t->info.moving ? place_moving(t, n, err) : n;
    if (kept < 0) return kept;
    kept = track_leave_out(t, kept);
    count_unheld(t, kept);
    t->waited = 0;
    if (!track_waits(t)) return track_give(t, kept, err);
    track_keep(t, kept);
    return 0;
}

static int begin_scan(struct track *t, struct sh_err *err)
{
    set_pose(t);
    t->n_scans++;
    t->state.new_scan = 0;
    if (t->ops->metres && t->crs == NATIVE_CRS_GEODETIC)
        return sh_fail(err, SH_EFORMAT,
                       "%s: this format holds metres, and output.crs is geodetic; allowed local, ecef, utm, or "
                       ".las, .ply",
                       t->path);
    int rc = t->has_colours && t->colour.given ? colour_check(t->colour.scale.mode, t, err) : 0;
    if (rc != 0) return rc;
    return t->ops->scan != NULL ? t->ops->scan(t->rec, err) : 0;
}

/* Takes all points of the frame. row is that of the first one. */
static int take_batches(struct track *t, const struct scanhead_frame *frame, uint64_t row, struct sh_err *err)
{
    const struct scanhead_columns to = track_columns_to(t);
    int rc = 0;
    for (uint32_t first = 0; rc == 0 && first < frame->n_points;) {
        int n = scanhead_columns(t->sh, frame, first, &to, TRACK_BATCH);
        if (n < 0) return sh_fail(err, n, "%s: %s", t->path, scanhead_error(t->sh));
        row = track_number_rows(t, row, n);
        rc = take_batch(t, first, n, err);
        first += (uint32_t)n;
    }
    return rc;
}

static int track_take_points(struct track *t, const struct scanhead_frame *frame, struct sh_err *err)
{
    int rc = track_flush(t, err);
    if (rc != 0) return rc;
    if (scanhead_get_info(t->sh, &t->info) != 0) {
        t->missing.n_unplaced += frame->n_points;
        return 0;
    }
    int begins = begins_scan(t, frame);
    rc = check_info(t, err);
    t->line = frame->scan_line;
    t->sweep = frame->scan_frame;
    t->t0_ns = frame->scan_t0_ns;
    if (begins && !t->state.new_scan) track_phase_restart(&t->state.phase); /* its descriptor was lost */
    if (rc == 0 && begins) rc = begin_scan(t, err);
    t->state.last_pulse0 = frame->pulse0;
    t->state.last_station = t->info.station;
    t->state.last_scan = t->info.scan;
    t->state.last_begin_ns = native_since_ns(frame->t_ns, frame->scan_t0_ns);
    uint64_t row = first_row(t, frame);
    if (rc == 0) rc = track_begin_waiting(t, frame, row, err);
    if (rc == 0 && row > UINT32_MAX - frame->n_points)
        rc = sh_fail(err, SH_EFORMAT, "%s: line %u has more than 2^32 pulses", t->path, t->line);
    return rc == 0 && t->ops->points != NULL ? take_batches(t, frame, row, err) : rc;
}

static void take_line_end(struct track *t, const struct scanhead_frame *frame)
{
    struct line_end end;
    t->state.have_next_line = native_decode_line_end(frame->payload, frame->payload_len, &end) == 0;
    if (!t->state.have_next_line) return;
    t->state.next_line = end.line + 1;
    t->state.next_line_pulse0 = end.pulse0 + end.n_fired;
    track_phase_line(&t->state.phase, t->state.next_line, t->state.next_line_pulse0);
}

static void take_descriptor(struct track *t, const struct scanhead_frame *frame)
{
    struct track_state *s = &t->state;
    struct native_descriptor d;
    const int repeats = (frame->flags & SCANHEAD_REPEAT) != 0;
    if (!repeats) {
        s->new_scan = 1;
        s->have_next_line = 0;
    }
    if (native_decode_descriptor(frame->payload, frame->payload_len, &d) != 0) return;
    set_limits(t, &d);
    if (repeats && s->phase.den != 0) return;
    if (s->changes)
        track_phase_change(&s->phase, s->change_pulse, d.prr_uhz, d.lines_uhz);
    else
        track_phase_start(&s->phase, d.prr_uhz, d.lines_uhz);
    s->changes = 0;
}

/* A scan with another start is another one, also where it has the number of the last one and its first descriptor was
 * lost. The event of the scan at hand can come after its first points. */
static void take_scan_start(struct track *t, const struct scanhead_frame *frame)
{
    if ((int64_t)frame->event_value[1] == t->state.last_begin_ns) return;
    t->state.new_scan = 1;
    t->state.have_next_line = 0;
    track_phase_restart(&t->state.phase);
}

/* Where a scan begins, the head sends SCAN_START before the descriptor, and where settings change, SETTINGS. */
static void take_event(struct track *t, const struct scanhead_frame *frame)
{
    if (frame->event != SCANHEAD_EV_SETTINGS && frame->event != SCANHEAD_EV_SCAN_START) return;
    t->state.changes = frame->event == SCANHEAD_EV_SETTINGS;
    t->state.change_pulse = frame->event_value[0];
    if (!t->state.changes) take_scan_start(t, frame);
}

int track_is_late_start(const struct track *track, const struct scanhead_frame *start)
{
    const int64_t begin_ns = track->state.last_begin_ns;
    return track->n_scans != 0 && (int64_t)start->event_value[1] == begin_ns &&
           native_since_ns(start->t_ns, begin_ns) > track->t0_ns;
}

int track_frame(struct track *t, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    t->sh = sh;
    if (frame->type == SCANHEAD_POINTS) return track_take_points(t, frame, err);
    if (frame->type == SCANHEAD_ATTRIBUTES) return track_attributes(t, frame, err);
    if (frame->type == SCANHEAD_COLOURS) return track_colours(t, frame, err);
    if (frame->type == SCANHEAD_WAVES) return track_waves(t, frame, err);
    if (frame->type == SCANHEAD_LINE_END) {
        take_line_end(t, frame);
        return t->has_waves ? track_flush(t, err) : 0;
    }
    if (frame->type == SCANHEAD_DESCRIPTOR) take_descriptor(t, frame);
    if (frame->type == SCANHEAD_EMITTER) set_emitter_limits(t);
    if (frame->type == SCANHEAD_EVENT) take_event(t, frame);
    return 0;
}
