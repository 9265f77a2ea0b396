/* .ply: one vertex per echo. The format is described in the header's own comments.
 *
 * Positions are in the stream's CRS (geo), or in the scene frame (polar), as scanhead_to_scene has it.
 *
 * The header comes first in the file but is known last (count, names, losses). When the first points arrive,
 * the number of surfaces is known, so room is left for the header. So no byte of the points is written twice,
 * which matters at 100 MB/s. If the header outgrows its room after all, the points are copied once to where
 * it ends. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "drivers/protocol/bytes.h"
#include "drivers/protocol/native.h"
#include "drivers/record/ply_columns.h"
#include "drivers/record/recorder.h"

enum { RECORD_LEN = 4 * 8 + 4 + 8 + 1 + 1 + 2 + 2, FRAME_LEN = 8, ATTRIBUTES_LEN = 8, COLOUR_LEN = 3, TEXT_LEN = 512 };

struct ply {
    struct recorder base;
    struct ply_facts facts;
    int begun;         /* room for the header is made */
    size_t header_len; /* bytes of that room */
};

static int ply_begin(void *rec, struct sh_err *err)
{
    struct ply *ply = rec;
    (void)err;
    ply->facts.track = &ply->base.track;
    ply->facts.ascii = ply->base.options.ascii;
    ply->facts.empty_shots = ply->base.options.empty_shots;
    ply->facts.scalar_names = ply->base.options.scalar_names;
    ply->facts.colour = ply->base.options.colour;
    return 0;
}

/* Makes room for the header with what is known of the names. */
static int make_room(struct ply *ply, uint32_t n_surfaces, struct sh_err *err)
{
    static const char blank[4096];
    ply->header_len = ply_header_reserve(&ply->facts, n_surfaces);
    if (ply->header_len == 0) return sh_fail(err, SH_ENOMEM, "%s: no memory for the header", ply->base.file.path);
    ply->begun = 1;
    int rc = 0;
    for (size_t left = ply->header_len; left > 0 && rc == 0;) {
        size_t n = left < sizeof blank ? left : sizeof blank;
        rc = outfile_write(&ply->base.file, blank, n, err);
        left -= n;
    }
    return rc;
}

/* A vertex, with what the file has properties for. */
struct vertex {
    struct scanhead_point point;
    unsigned station;
    const double *frame;                        /* NULL where there is no such property */
    const struct scanhead_attribute *attribute; /* likewise */
    int has_colour;
    uint8_t rgb[3];
};

static size_t put_binary(uint8_t *to, const struct vertex *v)
{
    const struct scanhead_point *p = &v->point;
    size_t len = RECORD_LEN;

    le_put_double(to, p->x);
    le_put_double(to + 8, p->y);
    le_put_double(to + 16, p->z);
    le_put_double(to + 24, p->range_m);
    le_put_float(to + 32, (float)p->reflectance_db);
    le_put_double(to + 36, (double)p->t_ns / 1e9);
    to[44] = p->echo;
    to[45] = p->echo_count;
    le_put16(to + 46, p->label);
    le_put16(to + 48, (uint16_t)v->station);
    if (v->frame != NULL) {
        le_put_double(to + len, *v->frame);
        len += FRAME_LEN;
    }
    if (v->attribute != NULL) {
        le_put_float(to + len, (float)v->attribute->amplitude_db);
        le_put_float(to + len + 4, (float)v->attribute->width_ns);
        len += ATTRIBUTES_LEN;
    }
    if (!v->has_colour) return len;
    memcpy(to + len, v->rgb, COLOUR_LEN);
    return len + COLOUR_LEN;
}

/* Micrometres (1e-11 degrees) are the finest scale of the wire, 0.01 dB and nanoseconds its units: more
 * digits would say nothing. "nan" without a sign, as some readers know no other. */
static size_t put_number(char *to, size_t room, int digits, double v)
{
    int n = isnan(v) ? snprintf(to, room, "nan ") : snprintf(to, room, "%.*f ", digits, v);
    return n > 0 && (size_t)n < room ? (size_t)n : room;
}

/* The length, or more than TEXT_LEN where numbers are absurdly long. */
static size_t put_ascii(char *to, const struct vertex *v, int degrees)
{
    const struct scanhead_point *p = &v->point;
    const int flat = degrees ? 12 : 6;
    const struct {
        double v;
        int digits;
    } number[] = {{p->x, flat},    {p->y, flat},           {p->z, 6},
                  {p->range_m, 6}, {p->reflectance_db, 2}, {(double)p->t_ns / 1e9, 9}};
    size_t n = 0;
    for (size_t i = 0; i < sizeof number / sizeof number[0] && n < TEXT_LEN; i++)
        n += put_number(to + n, TEXT_LEN - n, number[i].digits, number[i].v);
    if (n >= TEXT_LEN) return TEXT_LEN + 1;
    n += (size_t)snprintf(to + n, TEXT_LEN - n, "%u %u %u %u ", p->echo, p->echo_count, p->label, v->station);
    if (v->frame != NULL && n < TEXT_LEN)
        n += (size_t)(isnan(*v->frame) ? snprintf(to + n, TEXT_LEN - n, "nan ")
                                       : snprintf(to + n, TEXT_LEN - n, "%.9g ", *v->frame));
    if (v->attribute != NULL && n < TEXT_LEN) n += put_number(to + n, TEXT_LEN - n, 2, v->attribute->amplitude_db);
    if (v->attribute != NULL && n < TEXT_LEN) n += put_number(to + n, TEXT_LEN - n, 2, v->attribute->width_ns);
    if (v->has_colour && n < TEXT_LEN)
        n += (size_t)snprintf(to + n, TEXT_LEN - n, "%u %u %u ", v->rgb[0], v->rgb[1], v->rgb[2]);
    if (n >= TEXT_LEN) return TEXT_LEN + 1;
    to[n - 1] = '\n'; /* the blank after the last number */
    return n;
}

/* The time may come late. */
static void set_gps(struct ply *ply)
{
    struct ply_facts *facts = &ply->facts;
    if (facts->have_gps || ply->base.track.n_scans != 1) return;
    facts->have_gps = track_start_gps(&ply->base.track, &facts->gps_s);
}

/* Room for the header is made when the number of surfaces is known. */
static int ply_scan(void *rec, struct sh_err *err)
{
    struct ply *ply = rec;
    const struct scanhead_info *info = &ply->base.track.info;
    struct ply_facts *facts = &ply->facts;
    snprintf(facts->idn, sizeof facts->idn, "%s", info->idn);
    snprintf(facts->profile, sizeof facts->profile, "%s", info->profile);
    return ply->begun ? 0 : make_room(ply, info->n_surfaces, err);
}

/* Point i of the batch, placed; 0: it is left out. */
static int take_vertex(struct ply *ply, int i, struct vertex *v)
{
    struct track *t = &ply->base.track;
    struct scanhead_point *p = &v->point;
    *v = (struct vertex){.point = t->point[i], .station = t->info.station};
    if (p->echo_count == 0 && !ply->facts.empty_shots) return 0;
    if (t->info.moving || t->info.stop) v->frame = t->info.moving ? &t->frame[i] : &t->info.frame;
    if (t->has_attributes) v->attribute = &t->attribute[i];
    v->has_colour = ply->facts.colour != COLOUR_NONE;
    if (v->has_colour) colour_of(ply->facts.colour, p, v->rgb);
    if (t->info.geo) return 1;
    double xyz[3] = {p->x, p->y, p->z};
    station_pose_forward(&t->pose, xyz);
    p->x = xyz[0];
    p->y = xyz[1];
    p->z = xyz[2];
    return p->echo_count == 0 || !track_is_nowhere(t, p->x, p->y, p->z);
}

static int ply_points(void *rec, int n, struct sh_err *err)
{
    struct ply *ply = rec;
    const int degrees = ply->base.track.crs == NATIVE_CRS_GEODETIC;
    int rc = 0;
    uint8_t *to = outfile_room(&ply->base.file, TRACK_BATCH * TEXT_LEN, err);
    if (to == NULL) return SH_EIO;
    size_t used = 0;
    set_gps(ply);
    for (int i = 0; i < n; i++) {
        struct vertex v;
        if (!take_vertex(ply, i, &v)) continue;
        size_t len = ply->facts.ascii ? put_ascii((char *)to + used, &v, degrees) : put_binary(to + used, &v);
        if (len > TEXT_LEN) {
            rc = recorder_fail_huge(&ply->base, (double[]){v.point.x, v.point.y, v.point.z}, err);
            break;
        }
        used += len;
        ply->facts.n_vertices++;
    }
    outfile_used(&ply->base.file, used); /* also before a failure: the file may be kept */
    return rc;
}

static int ply_frame(void *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct ply *ply = rec;
    scanhead_get_stats(sh, &ply->facts.stats);
    return track_frame(&ply->base.track, sh, frame, err);
}

/* The header outgrew its room: the points move to where it ends, block by block from the end. */
static int move_points(struct ply *ply, size_t header_len, struct sh_err *err)
{
    enum { BLOCK = 1 << 16 };
    struct outfile *file = &ply->base.file;
    size_t shift = header_len - ply->header_len;
    uint64_t end = file->written;
    uint8_t *block = malloc(BLOCK);
    if (block == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to move its points", file->path);
    int rc = 0;
    while (rc == 0 && end > ply->header_len && (rc = recorder_check_stop(&ply->base, err)) == 0) {
        size_t n = end - ply->header_len < BLOCK ? (size_t)(end - ply->header_len) : BLOCK;
        end -= n;
        if (pread(file->fd, block, n, (off_t)end) != (ssize_t)n)
            rc = sh_fail(err, SH_EIO, "%s: cannot read back: %s", file->part, strerror(errno));
        else
            rc = outfile_patch(file, end + shift, block, n, err);
    }
    free(block);
    return rc;
}

static int ply_finish(void *rec, struct sh_err *err)
{
    struct ply *ply = rec;
    int rc = outfile_flush(&ply->base.file, err);
    ply->facts.n_without_attributes = ply->base.track.missing.n_without_attributes;
    ply->facts.n_unplaced = ply->base.track.missing.n_unplaced;
    ply->facts.n_without_pose = ply->base.track.missing.n_without_pose;
    char *header;
    size_t len;
    if (rc == 0) rc = ply_header_make(&ply->facts, ply->header_len, &header, &len, err);
    if (rc != 0) return rc;
    if (len > ply->header_len) rc = move_points(ply, len, err);
    if (rc == 0) rc = outfile_patch(&ply->base.file, 0, header, len, err);
    free(header);
    return rc;
}

const struct recorder_ops recorder_ply = {
    .ending = ".ply",
    .size = sizeof(struct ply),
    .track = {.scan = ply_scan, .points = ply_points, .wants_attributes = 1},
    .begin = ply_begin,
    .frame = ply_frame,
    .finish = ply_finish,
};
