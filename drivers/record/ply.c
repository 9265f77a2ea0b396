/* SPDX-License-Identifier: MIT */
/* .ply: one vertex per echo. The format is described in the header's own comments.
 *
 * Positions are in the stream's CRS (geo), or in the scene frame (polar), as scanhead_to_scene has it.
 *
 * The header comes first in the file but is known last (count, names, losses). When the first points arrive,
 * the number of surfaces is known, so room is left for the header. So no byte of the points is written twice,
 * which matters at 100 MB/s. Names that don't fit after all (longer than heads send) are left out and reported.
 * Until the end a first header marks the file as incomplete, for a repair (ply_repair.c). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "drivers/protocol/native.h"
#include "drivers/record/ply_columns.h"
#include "drivers/record/ply_repair.h"
#include "drivers/record/recorder.h"

enum { ROW_MOST = 128, TEXT_LEN = 512 };

_Static_assert(3 * 8 + 8 + 4 + 8 + 2 + 2 + 2 + 8 + 8 + 3 <= ROW_MOST && ROW_MOST <= TEXT_LEN, "room for a row");

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
    ply->facts.columns = ply_columns_there(&ply->base.track, ply->base.options.columns); /* until points have come */
    if (ply->base.options.n_heads > 1) ply->facts.more_heads = ply->base.options.n_heads - 1;
    return 0;
}

/* Makes the header from the facts known by now, in the length of its room. */
static int make_header(struct ply *ply, int incomplete, char **text, size_t *len, struct sh_err *err)
{
    uint64_t n_left_out;
    ply->facts.incomplete = incomplete;
    const int rc = ply_header_make(&ply->facts, ply->header_len, text, len, &n_left_out, err);
    if (rc == 0 && !incomplete)
        recorder_report(&ply->base, n_left_out,
                        "names of surfaces and heads left out; the header has no room for them");
    return rc;
}

/* Makes room for the header with what is known of the names. */
static int ply_make_room(struct ply *ply, uint32_t n_surfaces, struct sh_err *err)
{
    char *text;
    size_t len;
    ply->header_len = ply_header_reserve(&ply->facts, n_surfaces);
    if (ply->header_len == 0) return sh_fail(err, SH_ENOMEM, "%s: no memory for the header", ply->base.file.path);
    ply->begun = 1;
    int rc = make_header(ply, 1, &text, &len, err);
    if (rc != 0) return rc;
    rc = outfile_write(&ply->base.file, text, len, err);
    free(text);
    return rc;
}

static int write_header(struct ply *ply, int incomplete, struct sh_err *err)
{
    char *text;
    size_t len;
    int rc = outfile_flush(&ply->base.file, err);
    if (rc == 0) rc = make_header(ply, incomplete, &text, &len, err);
    if (rc != 0) return rc;
    rc = outfile_patch(&ply->base.file, 0, text, len, err);
    free(text);
    return rc;
}

/* A row of the file; the recorder's `columns` say which members are written. */
struct vertex {
    double xyz[3];
    const struct track_points *points;
    int i; /* in them */
    unsigned station;
    double frame;
    const struct scanhead_attribute *attribute;
    double deviation;
    const uint8_t *rgb;
};

static inline uint8_t *put_length(uint8_t *to, double v, int as_float)
{
    if (as_float)
        le_put_float(to, (float)v);
    else
        le_put_double(to, v);
    return to + (as_float ? 4 : 8);
}

/* Returns the end of the row. Inlined with known columns, it has no branches. */
static inline __attribute__((always_inline)) uint8_t *put_columns(uint8_t *to, const struct vertex *v, unsigned columns)
{
    const struct track_points *p = v->points;
    const int i = v->i;
    const int as_float = (columns & PLY_FLOAT) != 0;
    for (int k = 0; k < 3; k++)
        to = put_length(to, v->xyz[k], as_float);
    if ((columns & PLY_RANGE) != 0) to = put_length(to, p->range_m[i], as_float);
    if ((columns & PLY_REFLECTANCE) != 0) {
        le_put_float(to, (float)p->reflectance_db[i]);
        to += 4;
    }
    if ((columns & PLY_TIME) != 0) to = put_length(to, (double)p->t_ns[i] / 1e9, 0);
    if ((columns & PLY_ECHO) != 0) {
        to[0] = p->echo[i];
        to[1] = p->echo_count[i];
        to += 2;
    }
    if ((columns & PLY_LABEL) != 0) {
        le_put16(to, p->label[i]);
        to += 2;
    }
    if ((columns & PLY_STATION) != 0) {
        le_put16(to, (uint16_t)v->station);
        to += 2;
    }
    return to;
}

static uint8_t *put_binary(uint8_t *to, const struct vertex *v, unsigned columns)
{
    to = put_columns(to, v, columns);
    if ((columns & PLY_FRAME) != 0) to = put_length(to, v->frame, 0);
    if ((columns & PLY_ATTRIBUTES) != 0) {
        le_put_float(to, (float)v->attribute->amplitude_db);
        le_put_float(to + 4, (float)v->attribute->width_ns);
        to += 8;
    }
    if ((columns & PLY_DEVIATION) != 0) {
        le_put_float(to, (float)v->deviation);
        to += 4;
    }
    if ((columns & PLY_COLOUR) == 0) return to;
    memcpy(to, v->rgb, 3);
    return to + 3;
}

/* Micrometres (1e-11 degrees) are the finest scale of the wire, 0.01 dB and nanoseconds its units: more
 * digits would say nothing. "nan" without a sign, as some readers know no other. */
static size_t put_number(char *to, size_t room, int digits, double v)
{
    int n = isnan(v) ? snprintf(to, room, "nan ") : snprintf(to, room, "%.*f ", digits, v);
    return n > 0 && (size_t)n < room ? (size_t)n : room;
}

/* Returns the end of the row, or NULL if numbers are too long for it. */
static uint8_t *put_ascii(uint8_t *row, const struct vertex *v, unsigned columns, int degrees)
{
    const struct track_points *p = v->points;
    const int flat = degrees ? 12 : 6;
    char *to = (char *)row;
    size_t n = 0;
    struct {
        double v;
        int digits;
    } number[8] = {{v->xyz[0], flat}, {v->xyz[1], flat}, {v->xyz[2], 6}};
    size_t k = 3;
#define TAKE(part, value, places) \
    if ((columns & (part)) != 0) number[k].v = (value), number[k++].digits = (places)
    TAKE(PLY_RANGE, p->range_m[v->i], 6);
    TAKE(PLY_REFLECTANCE, p->reflectance_db[v->i], 2);
    TAKE(PLY_TIME, (double)p->t_ns[v->i] / 1e9, 9);
    for (size_t i = 0; i < k && n < TEXT_LEN; i++)
        n += put_number(to + n, TEXT_LEN - n, number[i].digits, number[i].v);
    if (n >= TEXT_LEN) return NULL;
    if ((columns & PLY_ECHO) != 0) n += (size_t)snprintf(to + n, TEXT_LEN - n, "%u %u ", p->echo[v->i], p->echo_count[v->i]);
    if ((columns & PLY_LABEL) != 0 && n < TEXT_LEN) n += (size_t)snprintf(to + n, TEXT_LEN - n, "%u ", p->label[v->i]);
    if ((columns & PLY_STATION) != 0 && n < TEXT_LEN) n += (size_t)snprintf(to + n, TEXT_LEN - n, "%u ", v->station);
    if ((columns & PLY_FRAME) != 0 && n < TEXT_LEN)
        n += (size_t)(isnan(v->frame) ? snprintf(to + n, TEXT_LEN - n, "nan ")
                                      : snprintf(to + n, TEXT_LEN - n, "%.9g ", v->frame));
    k = 0;
    TAKE(PLY_ATTRIBUTES, v->attribute->amplitude_db, 2);
    TAKE(PLY_ATTRIBUTES, v->attribute->width_ns, 2);
    TAKE(PLY_DEVIATION, v->deviation, 3);
#undef TAKE
    for (size_t i = 0; i < k && n < TEXT_LEN; i++)
        n += put_number(to + n, TEXT_LEN - n, number[i].digits, number[i].v);
    if ((columns & PLY_COLOUR) != 0 && n < TEXT_LEN)
        n += (size_t)snprintf(to + n, TEXT_LEN - n, "%u %u %u ", v->rgb[0], v->rgb[1], v->rgb[2]);
    if (n >= TEXT_LEN) return NULL;
    to[n - 1] = '\n'; /* the blank after the last number */
    return row + n;
}

/* The time may come late. 1: now. */
static int set_gps(struct ply *ply)
{
    struct ply_facts *facts = &ply->facts;
    if (facts->have_gps || ply->base.track.n_scans != 1) return 0;
    facts->have_gps = track_start_gps(&ply->base.track, &facts->gps_s);
    return facts->have_gps;
}

/* A float steps by 6e-8 of a number: enough about the origin of a scene, and metres on the Earth. */
static const double FLOAT_MOST_M = 1000, FLOAT_PART = 0x1p-24;

static int fail_float(const char *path, double most, struct sh_err *err)
{
    return sh_fail(err, SH_EINPUT,
                   "%s: coordinates of %.0f m as float would be wrong by up to %.2g m; allowed without float, and for "
                   "stations within %g m of the origin",
                   path, most, most * FLOAT_PART, FLOAT_MOST_M);
}

static double largest(const double p[3])
{
    return fmax(fabs(p[0]), fmax(fabs(p[1]), fabs(p[2])));
}

static int check_float(const char *path, unsigned columns, int in_degrees, const double place_m[3], struct sh_err *err)
{
    if ((columns & PLY_FLOAT) == 0) return 0;
    if (in_degrees)
        return sh_fail(err, SH_EINPUT, "%s: degrees as float would be wrong by metres; allowed without float", path);
    const double most = largest(place_m);
    return most <= FLOAT_MOST_M ? 0 : fail_float(path, most, err);
}

static int ply_fits(const char *path, const struct recorder_options *options, const struct recorder_scan *first,
                    const struct recorder_scan *scan, struct sh_err *err)
{
    static const double way[3] = {0, 0, 0}; /* a moving head's places in the scene frame are known at the end */
    (void)first;
    return check_float(path, options->columns, scan->in_degrees, scan->moves && !scan->is_geo ? way : scan->place_m,
                       err);
}

/* The places of a moving head are not known before. Its points may be as far from it as those of a station. */
static int check_floats_on_the_way(const struct ply *ply, int n, struct sh_err *err)
{
    const struct track *t = &ply->base.track;
    double most = 0;
    if ((ply->facts.columns & PLY_FLOAT) == 0 || !t->info.moving) return 0;
    for (int i = 0; i < n; i++)
        most = fmax(most, largest((const double[3]){t->points.x[i], t->points.y[i], t->points.z[i]}));
    return most <= FLOAT_MOST_M + t->info.range_max_m ? 0 : fail_float(ply->base.file.path, most, err);
}

/* Room for the header is made when the number of surfaces is known. */
static int ply_scan(void *rec, struct sh_err *err)
{
    struct ply *ply = rec;
    const struct scanhead_info *info = &ply->base.track.info;
    struct ply_facts *facts = &ply->facts;
    facts->columns = ply_columns_there(&ply->base.track, ply->base.options.columns);
    struct ply_head head = {.station = info->station};
    snprintf(head.idn, sizeof head.idn, "%s", info->idn);
    snprintf(head.profile, sizeof head.profile, "%s", info->profile);
    const struct ply_head *last = facts->n_heads > 0 ? &facts->head[facts->n_heads - 1] : NULL;
    const int same = last != NULL && strcmp(last->idn, head.idn) == 0 && strcmp(last->profile, head.profile) == 0;
    const int is_new = !same && facts->n_heads < PLY_MAX_HEADS;
    if (is_new) facts->head[facts->n_heads++] = head;
    int rc = check_float(ply->base.file.path, facts->columns, ply->base.track.crs == NATIVE_CRS_GEODETIC,
                         ply->base.track.pose.shift_m, err);
    set_gps(ply);
    if (rc == 0 && !ply->begun) return ply_make_room(ply, info->n_surfaces, err);
    return rc == 0 && is_new ? write_header(ply, 1, err) : rc;
}

/* Point i of the batch, placed; 0: it is left out. */
static inline int take_vertex(struct ply *ply, int i, struct vertex *v)
{
    struct track *t = &ply->base.track;
    const struct track_points *p = &t->points;
    if (p->echo_count[i] == 0 && !ply->facts.empty_shots) return 0;
    v->points = p;
    v->i = i;
    v->xyz[0] = p->x[i];
    v->xyz[1] = p->y[i];
    v->xyz[2] = p->z[i];
    if (t->info.geo) return 1;
    station_pose_forward(&t->pose, v->xyz);
    return p->echo_count[i] == 0 || !track_is_nowhere(t, v->xyz[0], v->xyz[1], v->xyz[2]);
}

/* Binary rows with the columns that every head's points have, which most recordings are made of. */
static inline __attribute__((always_inline)) uint8_t *put_rows(struct ply *ply, int n, uint8_t *to, unsigned columns)
{
    struct vertex v = {.station = ply->base.track.info.station};
    for (int i = 0; i < n; i++) {
        if (!take_vertex(ply, i, &v)) continue;
        to = put_columns(to, &v, columns);
        ply->facts.n_vertices++;
    }
    return to;
}

/* NULL: a coordinate is too long. What was put before that counts. */
static uint8_t *put_any_rows(struct ply *ply, int n, uint8_t **to, struct sh_err *err)
{
    const struct track *t = &ply->base.track;
    const unsigned columns = ply->facts.columns;
    const int degrees = t->crs == NATIVE_CRS_GEODETIC;
    struct vertex v = {.station = t->info.station};
    for (int i = 0; i < n; i++) {
        if (!take_vertex(ply, i, &v)) continue;
        v.frame = t->info.moving ? t->frame[i] : t->info.frame;
        v.attribute = &t->attribute[i];
        v.deviation = t->deviation[i];
        v.rgb = t->rgb[i];
        uint8_t *end = ply->facts.ascii ? put_ascii(*to, &v, columns, degrees) : put_binary(*to, &v, columns);
        if (end == NULL) {
            recorder_fail_huge(&ply->base, v.xyz, err);
            return NULL;
        }
        *to = end;
        ply->facts.n_vertices++;
    }
    return *to;
}

static int ply_points(void *rec, int n, struct sh_err *err)
{
    enum { USUAL = PLY_RANGE | PLY_REFLECTANCE | PLY_TIME | PLY_ECHO | PLY_LABEL | PLY_STATION };
    struct ply *ply = rec;
    int rc = set_gps(ply) ? write_header(ply, 1, err) : 0;
    uint8_t *from = rc == 0 ? outfile_room(&ply->base.file, TRACK_BATCH * TEXT_LEN, err) : NULL, *to = from;
    if (from == NULL) return rc != 0 ? rc : SH_EIO;
    rc = check_floats_on_the_way(ply, n, err);
    if (rc != 0) return rc;
    if (!ply->facts.ascii && ply->facts.columns == USUAL)
        to = put_rows(ply, n, to, USUAL);
    else if (!ply->facts.ascii && (ply->facts.columns & ~(unsigned)(USUAL | PLY_FLOAT)) == 0)
        to = put_rows(ply, n, to, ply->facts.columns);
    else if (put_any_rows(ply, n, &to, err) == NULL)
        rc = SH_EFORMAT;
    outfile_used(&ply->base.file, (size_t)(to - from)); /* also before a failure: the file may be kept */
    return rc;
}

static int ply_frame(void *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct ply *ply = rec;
    scanhead_get_stats(sh, &ply->facts.stats);
    return track_frame(&ply->base.track, sh, frame, err);
}

static int ply_finish(void *rec, struct sh_err *err)
{
    struct ply *ply = rec;
    ply->facts.n_without_attributes = ply->base.track.missing.n_without_attributes;
    ply->facts.n_unplaced = ply->base.track.missing.n_unplaced;
    ply->facts.n_without_pose = ply->base.track.missing.n_without_pose;
    const int rc = outfile_check(&ply->base.file, err); /* then the header goes on saying that the file is incomplete */
    return rc != 0 ? rc : write_header(ply, 0, err);
}

const struct recorder_ops recorder_ply = {
    .ending = ".ply",
    .size = sizeof(struct ply),
    .track = {.scan = ply_scan, .points = ply_points, .wants_attributes = 1, .wants_colours = 1},
    .fits = ply_fits,
    .begin = ply_begin,
    .frame = ply_frame,
    .finish = ply_finish,
    .repair = ply_repair,
};
