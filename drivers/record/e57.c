/* SPDX-License-Identifier: MIT */
/* .e57: ASTM E2807, one data3D per scan: points in the head's frame as counts of the stream's scale, and the
 * pose that takes them to the recording's coordinate frame (station_pose.h). Intensity is the reflectance in dB; row
 * and column are shot and line. The label is a field of an extension, which readers that don't know it skip.
 *
 * A binary section is a header and packets (e57_packet.h). The XML section, which says where everything is, comes last.
 * Then headers are overwritten, the file's own as the last: a file with a header is whole. Until then a note before
 * each scan (e57_note.h) has what a repair needs. A packet ends after 0.1 s of device time, with the next multiple of 8
 * records. So little is missing at any moment, and the same stream still gives the same bytes. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/vecmath.h"
#include "drivers/protocol/native.h"
#include "drivers/record/e57_end.h"
#include "drivers/record/e57_note.h"
#include "drivers/record/e57_records.h"
#include "drivers/record/recorder.h"

static const int64_t PACKET_NS = 100000000;

struct e57 {
    struct recorder base;
    struct e57_pages pages;
    struct e57_facts facts;
    struct e57_scan *scan; /* the present one */
    struct e57_packet gathered;
    int64_t t0_ns; /* of the first record in `gathered` */
};

static int e57_begin(void *rec, struct sh_err *err)
{
    static const uint8_t blank[E57_FILE_HEADER_LEN];
    struct e57 *e = rec;
    e->facts.empty_shots = e->base.options.empty_shots;
    e->pages.file = &e->base.file;
    e->base.track.spared = TRACK_RANGE;
    e->base.track.no_empty = !e->facts.empty_shots;
    return e57_put(&e->pages, blank, sizeof blank, err);
}

/* Writes the records gathered so far as a packet. */
static int put_packet(struct e57 *e, struct sh_err *err)
{
    size_t len;
    const uint8_t *packet = e57_packet_make(&e->gathered, &e->facts, &len);
    e57_packet_count(packet, len, &e->facts, e->scan);
    return e57_put(&e->pages, packet, len, err);
}

static int end_scan(struct e57 *e, struct sh_err *err)
{
    if (e->scan == NULL) return 0;
    int rc = e->gathered.n > 0 || e->scan->n_records == 0 ? put_packet(e, err) : 0;
    e->scan->section_len = e57_logical(&e->pages) - e->scan->section;
    e->scan = NULL;
    return rc;
}

static void set_start(struct e57 *e)
{
    e->scan->have_start = track_start_gps(&e->base.track, &e->scan->start_gps_s);
}

/* Writes the note, and keeps the place of the section's header. */
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
    e57_packet_begin(&e->gathered, &e->facts);
    return put_begin(e, err);
}

/* The time may come after the scan's first points. The note is then written again. */
static int find_start(struct e57 *e, struct sh_err *err)
{
    uint8_t note[E57_NOTE_LEN];
    if (e->scan->have_start) return 0;
    set_start(e);
    if (!e->scan->have_start) return 0;
    e57_note_put(&e->facts, e->scan, note);
    return e57_patch(&e->pages, e->scan->note, note, sizeof note, err);
}

static int fail_far(const struct e57 *e, const double p[3], struct sh_err *err)
{
    return sh_fail(
        err, SH_EFORMAT,
        "%s: a point at (%.3f %.3f %.3f) from the head is beyond the %.0f m that 32 bits hold in steps of %g "
        "m; give the head a coarser output.scale_m",
        e->base.file.path, p[0], p[1], p[2], 2147483647 * e->scan->scale_m, e->scan->scale_m);
}

/* Returns whether the packet has to end before a point of this time. Each packet but the last one ends where all
 * streams have whole bytes. */
static int is_due(const struct e57 *e, unsigned n, int64_t t_ns)
{
    return n > 0 && n % 8 == 0 && native_since_ns(t_ns, e->t0_ns) >= PACKET_NS;
}

VEC_CLONES static int64_t find_latest(const int64_t *restrict t_ns, int n)
{
    int64_t latest = t_ns[0];
    for (int i = 1; i < n; i++)
        latest = t_ns[i] > latest ? t_ns[i] : latest;
    return latest;
}

/* Returns how many of the n points from i on go into the present packet: at least 1. */
static int count_run(const struct e57 *e, int i, int n)
{
    const struct e57_packet *g = &e->gathered;
    const int64_t *t_ns = e->base.track.points.t_ns + i;
    const int room = (int)(g->most - g->n);
    int k = 1;
    if (n > room) n = room;
    if (native_since_ns(find_latest(t_ns, n), e->t0_ns) < PACKET_NS) return n;
    while (k < n && !is_due(e, g->n + (unsigned)k, t_ns[k]))
        k++;
    return k;
}

static int put_run(struct e57 *e, int i, int n, struct sh_err *err)
{
    double far_m[3];
    if (e57_records_put(&e->gathered, &e->facts, &e->base.track, i, n, far_m) != 0) return fail_far(e, far_m, err);
    return e->gathered.n == e->gathered.most ? put_packet(e, err) : 0;
}

static int e57_points(void *rec, int n, struct sh_err *err)
{
    struct e57 *e = rec;
    int rc = find_start(e, err);
    for (int i = 0, run; rc == 0 && i < n; i += run) {
        const int64_t t_ns = e->base.track.points.t_ns[i];
        if (is_due(e, e->gathered.n, t_ns)) rc = put_packet(e, err);
        if (e->gathered.n == 0) e->t0_ns = t_ns;
        run = count_run(e, i, n - i);
        if (rc == 0) rc = put_run(e, i, run, err);
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
