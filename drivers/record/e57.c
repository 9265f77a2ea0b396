/* .e57: ASTM E2807, one data3D per scan: points in the head's frame as counts of the stream's scale, and the
 * pose that takes them to the recording's frame (station_pose.h). Intensity is the reflectance in dB; row and
 * column are shot and line. The label is a field of an extension, which readers pass over that don't know it.
 *
 * A binary section is a header and packets; in a packet each field has a stream of its own, of as many bits
 * per record as its range needs. All packets but the last hold a number of records that is a multiple of 8,
 * so that no stream of bits runs across packets. The XML section, which says where everything is, comes last;
 * then headers are written over. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/bytes.h"
#include "drivers/protocol/crc32c.h"
#include "drivers/record/e57_pages.h"
#include "drivers/record/e57_xml.h"
#include "drivers/record/recorder.h"

enum {
    FILE_HEADER_LEN = 48,
    SECTION_HEADER_LEN = 32,
    PACKET_HEADER_LEN = 6,
    PACKET_RECORDS = 1920,  /* a multiple of 8; their packet is shorter than 64 KiB */
    PACKET_COLOURED = 1792, /* likewise, with colours */
    PACKET_MAX = 65536,
};
enum stream {
    X,
    Y,
    Z,
    INVALID,
    INTENSITY,
    NO_INTENSITY,
    RED,
    GREEN,
    BLUE,
    TIME,
    RETURN,
    RETURNS,
    ROW,
    COLUMN,
    LABEL,
    N_STREAMS
};
static const unsigned stream_bits[N_STREAMS] = {32, 32, 32, 2, 16, 1, 8, 8, 8, 64, 4, 4, 32, 32, 16};

struct e57 {
    struct recorder base;
    struct e57_pages pages;
    struct e57_facts facts;
    struct e57_scan *scan; /* the present one */
    unsigned n;            /* records in the streams */
    uint8_t stream[N_STREAMS][PACKET_RECORDS * 8];
    uint8_t packet[PACKET_MAX];
};

static int e57_begin(void *rec, struct sh_err *err)
{
    static const uint8_t blank[FILE_HEADER_LEN];
    struct e57 *e = rec;
    e->facts.track = &e->base.track;
    e->facts.empty_shots = e->base.options.empty_shots;
    e->pages.file = &e->base.file;
    return e57_put(&e->pages, blank, sizeof blank, err);
}

static int has_stream(const struct e57 *e, int s)
{
    if (s == INVALID) return e->facts.empty_shots;
    return s < RED || s > BLUE || e->base.track.has_colours;
}

/* The records gathered so far. */
static int put_packet(struct e57 *e, struct sh_err *err)
{
    uint16_t n_streams = 0;
    for (int s = 0; s < N_STREAMS; s++)
        n_streams = (uint16_t)(n_streams + has_stream(e, s));
    uint8_t *len_at = e->packet + PACKET_HEADER_LEN, *at = len_at + 2 * n_streams;
    for (int s = 0; s < N_STREAMS; s++) {
        if (!has_stream(e, s)) continue;
        size_t len = ((size_t)e->n * stream_bits[s] + 7) / 8;
        le_put16(len_at, (uint16_t)len);
        len_at += 2;
        memcpy(at, e->stream[s], len);
        at += len;
    }
    while ((at - e->packet) % 4 != 0)
        *at++ = 0;
    size_t packet_len = (size_t)(at - e->packet);
    e->packet[0] = 1; /* a data packet */
    e->packet[1] = 0;
    le_put16(e->packet + 2, (uint16_t)(packet_len - 1));
    le_put16(e->packet + 4, n_streams);
    e->scan->n_records += e->n;
    e->scan->crc = crc32c(e->scan->crc, e->packet, packet_len);
    e->n = 0;
    return e57_put(&e->pages, e->packet, packet_len, err);
}

static int end_scan(struct e57 *e, struct sh_err *err)
{
    if (e->scan == NULL) return 0;
    int rc = e->n > 0 || e->scan->n_records == 0 ? put_packet(e, err) : 0;
    e->scan->section_len = e57_logical(&e->pages) - e->scan->section;
    e->scan = NULL;
    return rc;
}

static void set_start(struct e57 *e)
{
    double *s = &e->scan->start_gps_s;
    e->scan->have_start = track_start_gps(&e->base.track, s);
    /* A time that is not known is not written. It is part of the scan's guid all the same, with this
     * value. */
    if (!e->scan->have_start) *s += 1e9;
}

static int begin_scan(void *rec, struct sh_err *err)
{
    static const uint8_t blank[SECTION_HEADER_LEN];
    struct e57 *e = rec;
    const struct scanhead_info *info = &e->base.track.info;
    int rc = end_scan(e, err);
    if (rc != 0) return rc;
    if (!(info->scale_m > 0))
        return sh_fail(err, SH_EFORMAT, "%s: the stream's scale is %g m; an E57 file needs one above 0",
                       e->base.file.path, info->scale_m);
    struct e57_scan *more = realloc(e->facts.scan, (e->facts.n_scans + 1) * sizeof *more);
    if (more == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory for another scan", e->base.file.path);
    e->facts.scan = more;
    e->scan = &more[e->facts.n_scans++];
    memset(e->scan, 0, sizeof *e->scan);
    e->scan->section = e57_logical(&e->pages);
    e->scan->number = e->facts.n_scans;
    e->scan->station = info->station;
    e->scan->pose = e->base.track.pose;
    e->scan->scale_m = e->base.track.scale_m;
    snprintf(e->scan->idn, sizeof e->scan->idn, "%s", info->idn);
    snprintf(e->scan->profile, sizeof e->scan->profile, "%s", info->profile);
    set_start(e);
    return e57_put(&e->pages, blank, sizeof blank, err);
}

/* The low `bits` of v as record i of a stream; a byte holds several, from its low end. */
static void put_bits(uint8_t *stream, unsigned bits, unsigned i, unsigned v)
{
    unsigned at = i * bits;
    if (at % 8 == 0) stream[at / 8] = 0;
    stream[at / 8] |= (uint8_t)(v << at % 8);
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
                "%s: a point at (%.3f %.3f %.3f) from the head is beyond the %.0f m of 32 bits in steps of %g "
                "m; give the head a coarser output.scale_m",
                e->base.file.path, p[0], p[1], p[2], 2147483647 * s->scale_m, s->scale_m);
        n[i] = (int32_t)counts;
    }
    for (int i = 0; i < 3; i++) {
        if (s->n_points == 0 || n[i] < s->min[i]) s->min[i] = n[i];
        if (s->n_points == 0 || n[i] > s->max[i]) s->max[i] = n[i];
        le_put32(e->stream[X + i] + 4 * (size_t)e->n, (uint32_t)n[i] ^ 0x80000000u); /* counted from the minimum */
    }
    s->n_points++;
    return 0;
}

static int put_place(struct e57 *e, const struct scanhead_point *point, struct sh_err *err)
{
    double p[3] = {point->x, point->y, point->z};
    int empty = point->echo_count == 0;
    put_bits(e->stream[INVALID], 2, e->n, empty ? 2 : 0);
    if (empty) {
        for (int i = 0; i < 3; i++)
            le_put32(e->stream[X + i] + 4 * (size_t)e->n, 0x80000000u);
        return 0;
    }
    if (e->base.track.info.geo) station_pose_reverse(&e->base.track.pose, p);
    return put_xyz(e, p, err);
}

static void put_intensity(struct e57 *e, double reflectance_db)
{
    struct e57_scan *s = e->scan;
    int none = isnan(reflectance_db);
    int16_t cdb = none ? 0 : (int16_t)lrint(reflectance_db * 100);
    le_put16(e->stream[INTENSITY] + 2 * (size_t)e->n, (uint16_t)(cdb + 32768));
    put_bits(e->stream[NO_INTENSITY], 1, e->n, none ? 1 : 0);
    if (none) return;
    if (!s->have_intensity || cdb < s->intensity_min_cdb) s->intensity_min_cdb = cdb;
    if (!s->have_intensity || cdb > s->intensity_max_cdb) s->intensity_max_cdb = cdb;
    s->have_intensity = 1;
}

static void put_index(struct e57 *e, const struct scanhead_point *p, uint32_t row)
{
    struct e57_scan *s = e->scan;
    unsigned number = p->echo > 0 ? p->echo - 1u : 0;
    int first = s->n_records == 0 && e->n == 0;
    if (first || row < s->row_min) s->row_min = row;
    if (first || row > s->row_max) s->row_max = row;
    if (first || e->base.track.line < s->column_min) s->column_min = e->base.track.line;
    if (first || e->base.track.line > s->column_max) s->column_max = e->base.track.line;
    if (number > s->return_max) s->return_max = number;
    put_bits(e->stream[RETURN], 4, e->n, number);
    put_bits(e->stream[RETURNS], 4, e->n, p->echo_count);
    le_put32(e->stream[ROW] + 4 * (size_t)e->n, row);
    le_put32(e->stream[COLUMN] + 4 * (size_t)e->n, e->base.track.line);
}

static int e57_points(void *rec, int n, struct sh_err *err)
{
    struct e57 *e = rec;
    const unsigned most = e->base.track.has_colours ? PACKET_COLOURED : PACKET_RECORDS;
    if (!e->scan->have_start) set_start(e); /* the time may come late */
    for (int i = 0; i < n; i++) {
        const struct scanhead_point *p = &e->base.track.point[i];
        if (p->echo_count == 0 && !e->facts.empty_shots) continue;
        int rc = put_place(e, p, err);
        if (rc != 0) return rc;
        put_intensity(e, p->reflectance_db);
        le_put_double(e->stream[TIME] + 8 * (size_t)e->n, (double)p->t_ns / 1e9);
        for (int c = 0; c < 3 && e->base.track.has_colours; c++)
            e->stream[RED + c][e->n] = e->base.track.rgb[i][c];
        put_index(e, p, e->base.track.row[i]);
        le_put16(e->stream[LABEL] + 2 * (size_t)e->n, p->label);
        if (++e->n == most) rc = put_packet(e, err);
        if (rc != 0) return rc;
    }
    return 0;
}

static int patch_headers(struct e57 *e, uint64_t xml, size_t xml_len, struct sh_err *err)
{
    uint8_t header[FILE_HEADER_LEN] = "ASTM-E57";
    le_put32(header + 8, 1);
    le_put64(header + 16, e->pages.n_full * E57_PAGE);
    le_put64(header + 24, e57_physical(xml));
    le_put64(header + 32, xml_len);
    le_put64(header + 40, E57_PAGE);
    int rc = e57_patch(&e->pages, 0, header, sizeof header, err);
    for (uint32_t i = 0; rc == 0 && i < e->facts.n_scans; i++) {
        const struct e57_scan *s = &e->facts.scan[i];
        uint8_t section[SECTION_HEADER_LEN] = {1}; /* a compressed vector; no index of its packets */
        le_put64(section + 8, s->section_len);
        le_put64(section + 16, e57_physical(s->section + SECTION_HEADER_LEN));
        rc = recorder_check_stop(&e->base, err); /* a page is read and written for each */
        if (rc == 0) rc = e57_patch(&e->pages, s->section, section, sizeof section, err);
    }
    return rc;
}

static int e57_finish_file(void *rec, struct sh_err *err)
{
    struct e57 *e = rec;
    char *xml;
    size_t len;
    int rc = end_scan(e, err);
    if (rc == 0) rc = e57_xml(&e->facts, &xml, &len, err);
    if (rc != 0) return rc;
    uint64_t at = e57_logical(&e->pages);
    rc = e57_put(&e->pages, xml, len, err);
    if (rc == 0) rc = e57_finish(&e->pages, err);
    if (rc == 0) rc = patch_headers(e, at, len, err);
    free(xml);
    return rc;
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
    .release = e57_release,
};
