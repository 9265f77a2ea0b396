/* SPDX-License-Identifier: MIT */
/* .e57: ASTM E2807, one data3D per scan: points in the head's frame as counts of the stream's scale, and the
 * pose that takes them to the recording's coordinate frame (station_pose.h). Intensity is the reflectance in dB; row
 * and column are shot and line. The label is a field of an extension, which readers that don't know it skip.
 *
 * A binary section is a header and packets (e57_packet.h). The XML section, which says where everything is, comes last.
 * Then headers are overwritten, the file's own as the last: a file with a header is whole. Until then a note before
 * each scan (e57_note.h) has what a repair needs. A packet spans no more than 0.1 s of device time. So little is
 * missing at any moment, and the same stream still gives the same bytes. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "core/grow.h"
#include "drivers/record/e57_end.h"
#include "drivers/record/e57_note.h"
#include "drivers/record/e57_packet.h"
#include "drivers/record/recorder.h"

static const int64_t PACKET_NS = 100000000;

struct e57 {
    struct recorder base;
    struct e57_pages pages;
    struct e57_facts facts;
    struct e57_scan *scan; /* the present one */
    struct e57_packet gathered;
    int64_t t0_ns; /* of the first record in `gathered` */
    uint8_t packet[E57_PACKET_MAX];
};

static int e57_begin(void *rec, struct sh_err *err)
{
    static const uint8_t blank[E57_FILE_HEADER_LEN];
    struct e57 *e = rec;
    e->facts.empty_shots = e->base.options.empty_shots;
    e->pages.file = &e->base.file;
    return e57_put(&e->pages, blank, sizeof blank, err);
}

/* The first n of the records gathered so far. */
static int put_packet(struct e57 *e, unsigned n, struct sh_err *err)
{
    const size_t len = e57_packet_make(&e->gathered, &e->facts, n, e->packet);
    e57_packet_count(e->packet, len, &e->facts, e->scan);
    return e57_put(&e->pages, e->packet, len, err);
}

static int end_scan(struct e57 *e, struct sh_err *err)
{
    if (e->scan == NULL) return 0;
    const unsigned n = e->gathered.n;
    int rc = n > 0 || e->scan->n_records == 0 ? put_packet(e, n, err) : 0;
    e->scan->section_len = e57_logical(&e->pages) - e->scan->section;
    e->scan = NULL;
    return rc;
}

static void set_start(struct e57 *e)
{
    e->scan->have_start = track_start_gps(&e->base.track, &e->scan->start_gps_s);
}

/* The note, and the place of the section's header. */
static int put_begin(struct e57 *e, struct sh_err *err)
{
    static const uint8_t blank[E57_NOTE_LEN], section[E57_SECTION_HEADER_LEN] = {1}; /* a compressed vector */
    uint8_t note[E57_NOTE_LEN];
    struct e57_scan *s = e->scan;
    const uint64_t at = e57_logical(&e->pages);
    s->note = e57_note_place(at);
    s->section = s->note + sizeof note;
    e57_note_put(&e->facts, s, note);
    int rc = outfile_reserve(&e->base.file, E57_XML_ROOM + e->facts.n_scans * (uint64_t)E57_XML_ROOM_SCAN, err);
    if (rc == 0) rc = e57_put(&e->pages, blank, (size_t)(s->note - at), err);
    if (rc == 0) rc = e57_put(&e->pages, note, sizeof note, err);
    return rc != 0 ? rc : e57_put(&e->pages, section, sizeof section, err);
}

static int begin_scan(void *rec, struct sh_err *err)
{
    struct e57 *e = rec;
    const struct scanhead_info *info = &e->base.track.info;
    int rc = end_scan(e, err);
    if (rc != 0) return rc;
    if (!(info->scale_m > 0))
        return sh_fail(err, SH_EFORMAT, "%s: the stream's scale is %g m; an E57 file needs one above 0",
                       e->base.file.path, info->scale_m);
    rc = station_pose_check(&e->base.track.pose, e->base.file.path, err);
    if (rc != 0) return rc;
    if (!resize(&e->facts.scan, e->facts.n_scans + (size_t)1, sizeof *e->facts.scan))
        return sh_fail(err, SH_ENOMEM, "%s: no memory for another scan", e->base.file.path);
    e->scan = &e->facts.scan[e->facts.n_scans++];
    memset(e->scan, 0, sizeof *e->scan);
    e->scan->number = e->facts.n_scans;
    e->scan->station = info->station;
    e->scan->pose = e->base.track.pose;
    e->scan->scale_m = e->base.track.scale_m;
    snprintf(e->scan->idn, sizeof e->scan->idn, "%s", info->idn);
    snprintf(e->scan->profile, sizeof e->scan->profile, "%s", info->profile);
    set_start(e);
    e->facts.epsg = e->base.track.epsg;
    e->facts.geoid_heights = e->base.track.geoid_heights;
    e->facts.has_colours = e->base.track.has_colours;
    return put_begin(e, err);
}

/* The time may come late. */
static int find_start(struct e57 *e, struct sh_err *err)
{
    uint8_t note[E57_NOTE_LEN];
    if (e->scan->have_start) return 0;
    set_start(e);
    if (!e->scan->have_start) return 0;
    e57_note_put(&e->facts, e->scan, note);
    return e57_patch(&e->pages, e->scan->note, note, sizeof note, err);
}

static int put_xyz(struct e57 *e, const double p[3], struct sh_err *err)
{
    struct e57_scan *s = e->scan;
    int32_t n[3];
    for (int i = 0; i < 3; i++) {
        double counts = rint(p[i] / s->scale_m);
        if (!(fabs(counts) <= INT32_MAX))
            return sh_fail(
                err, SH_EFORMAT,
                "%s: a point at (%.3f %.3f %.3f) from the head is beyond the %.0f m that 32 bits hold in steps of %g "
                "m; give the head a coarser output.scale_m",
                e->base.file.path, p[0], p[1], p[2], 2147483647 * s->scale_m, s->scale_m);
        n[i] = (int32_t)counts;
    }
    for (int i = 0; i < 3; i++)
        le_put32(e->gathered.stream[E57_X + i] + 4 * (size_t)e->gathered.n, (uint32_t)n[i] ^ 0x80000000u);
    return 0;
}

static int put_place(struct e57 *e, int at, struct sh_err *err)
{
    struct e57_packet *g = &e->gathered;
    const struct track_points *points = &e->base.track.points;
    double p[3] = {points->x[at], points->y[at], points->z[at]};
    int empty = points->echo_count[at] == 0;
    e57_put_bits(g->stream[E57_INVALID], 2, g->n, empty ? 2 : 0);
    if (empty) {
        for (int i = 0; i < 3; i++)
            le_put32(g->stream[E57_X + i] + 4 * (size_t)g->n, 0x80000000u);
        return 0;
    }
    if (e->base.track.info.geo) station_pose_reverse(&e->base.track.pose, p);
    return put_xyz(e, p, err);
}

static void put_figures(struct e57_packet *g, const struct track_points *p, int i)
{
    const int none = isnan(p->reflectance_db[i]);
    const int16_t cdb = none ? 0 : (int16_t)lrint(p->reflectance_db[i] * 100);
    le_put16(g->stream[E57_INTENSITY] + 2 * (size_t)g->n, (uint16_t)(cdb + 32768));
    e57_put_bits(g->stream[E57_NO_INTENSITY], 1, g->n, none ? 1 : 0);
    le_put_double(g->stream[E57_TIME] + 8 * (size_t)g->n, (double)p->t_ns[i] / 1e9);
    e57_put_bits(g->stream[E57_RETURN], 4, g->n, p->echo[i] > 0 ? p->echo[i] - 1u : 0);
    e57_put_bits(g->stream[E57_RETURNS], 4, g->n, p->echo_count[i]);
    le_put16(g->stream[E57_LABEL] + 2 * (size_t)g->n, p->label[i]);
}

static int put_record(struct e57 *e, int i, struct sh_err *err)
{
    const struct track *t = &e->base.track;
    struct e57_packet *g = &e->gathered;
    int rc = put_place(e, i, err);
    if (rc != 0) return rc;
    put_figures(g, &t->points, i);
    for (int c = 0; c < 3 && t->has_colours; c++)
        g->stream[E57_RED + c][g->n] = t->rgb[i][c];
    le_put32(g->stream[E57_ROW] + 4 * (size_t)g->n, t->row[i]);
    le_put32(g->stream[E57_COLUMN] + 4 * (size_t)g->n, t->line);
    g->n++;
    return 0;
}

static int e57_points(void *rec, int n, struct sh_err *err)
{
    struct e57 *e = rec;
    const unsigned most = e->facts.has_colours ? E57_PACKET_COLOURED : E57_PACKET_RECORDS;
    int rc = find_start(e, err);
    for (int i = 0; rc == 0 && i < n; i++) {
        const struct track_points *p = &e->base.track.points;
        const unsigned whole = e->gathered.n & ~7u; /* what a packet may hold that is not the last one */
        if (p->echo_count[i] == 0 && !e->facts.empty_shots) continue;
        if (whole > 0 && p->t_ns[i] - e->t0_ns >= PACKET_NS) rc = put_packet(e, whole, err);
        if (e->gathered.n == 0) e->t0_ns = p->t_ns[i];
        if (rc == 0) rc = put_record(e, i, err);
        if (rc == 0 && e->gathered.n == most) rc = put_packet(e, most, err);
    }
    return rc;
}

static int e57_finish_file(void *rec, struct sh_err *err)
{
    struct e57 *e = rec;
    int rc = end_scan(e, err);
    return rc == 0 ? e57_end(&e->pages, &e->facts, e->base.options.report, err) : rc;
}

static int e57_save(void *rec, struct sh_err *err)
{
    return e57_keep_page(&((struct e57 *)rec)->pages, err);
}

static void e57_release(void *rec)
{
    free(((struct e57 *)rec)->facts.scan);
}

const struct recorder_ops recorder_e57 = {
    .ending = ".e57",
    .size = sizeof(struct e57),
    .track = {.scan = begin_scan, .points = e57_points, .metres = 1, .wants_colours = 1},
    .begin = e57_begin,
    .finish = e57_finish_file,
    .save = e57_save,
    .repair = e57_repair,
    .release = e57_release,
};
