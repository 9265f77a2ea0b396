/* SPDX-License-Identifier: MIT */
/* .ply: one vertex per echo, and with the option empty_shots one per shot without echo. The format is described in the
 * header's own comments.
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
#include "core/decimal.h"
#include "drivers/protocol/native.h"
#include "drivers/record/ply_columns.h"
#include "drivers/record/recorder.h"

enum { TEXT_LEN = 512, TEXT_ROOM = 9 * DECIMAL_FIXED_ROOM + 9 * DECIMAL_GENERAL_ROOM };

struct ply {
    struct recorder base;
    struct ply_facts facts;
    size_t header_len;                              /* bytes of the room for the header; 0: it is not made yet */
    struct ply_head last;                           /* of the present scan */
    uint64_t n_heads_beyond;                        /* that the facts have no room for */
    double time_s[TRACK_BATCH], frame[TRACK_BATCH]; /* of the batch, where they are columns */
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
    ply->base.track.no_empty = !ply->base.options.empty_shots;
    if (ply->base.options.n_heads > 1) ply->facts.more_heads = ply->base.options.n_heads - 1;
    return 0;
}

/* Writes the header from the facts known by now, in the length of its room. */
static int write_header(struct ply *ply, int incomplete, struct sh_err *err)
{
    struct outfile *file = &ply->base.file;
    char *text;
    size_t len;
    uint64_t n_left_out;
    int rc = outfile_flush(file, err);
    ply->facts.incomplete = incomplete;
    if (rc == 0) rc = ply_header_make(&ply->facts, ply->header_len, &text, &len, &n_left_out, err);
    if (rc != 0) return rc;
    if (!incomplete)
        recorder_report(&ply->base, n_left_out + ply->n_heads_beyond,
                        "names of surfaces and heads left out; the header has no room for them");
    if (!incomplete) recorder_report(&ply->base, ply_count_unnamed(&ply->base.track), PLY_UNNAMED);
    rc = file->written == 0 ? outfile_write(file, text, len, err) : outfile_patch(file, 0, text, len, err);
    free(text);
    return rc;
}

/* Makes room for the header with what is known of the names. */
static int ply_make_room(struct ply *ply, uint32_t n_surfaces, struct sh_err *err)
{
    ply->header_len = ply_header_reserve(&ply->facts, n_surfaces);
    if (ply->header_len == 0) return sh_fail(err, SH_ENOMEM, "%s: no memory for the header", ply->base.file.path);
    return write_header(ply, 1, err);
}

/* ---- binary rows, a column at a time */

struct ply_rows {
    uint8_t *to; /* the column's place in the first row */
    size_t len;  /* of a row */
    int n;
};

/* Puts columns side by side. Where the number of columns is a constant, the compiler can unroll the inner loop. */
static inline __attribute__((always_inline)) void put_doubles(struct ply_rows *rows, const double *const *v,
                                                              int columns)
{
    const size_t len = rows->len;
    uint8_t *to = rows->to;
    for (int i = 0; i < rows->n; i++, to += len)
        for (int k = 0; k < columns; k++)
            le_put_double(to + 8 * k, v[k][i]);
    rows->to += 8 * columns;
}

static void put_floats(struct ply_rows *rows, const double *v)
{
    const size_t len = rows->len;
    uint8_t *to = rows->to;
    for (int i = 0; i < rows->n; i++, to += len)
        le_put_float(to, (float)v[i]);
    rows->to += 4;
}

/* Puts x, y, z and, where it is a column, range. */
static void put_lengths(struct ply_rows *rows, const struct track_points *p, unsigned columns)
{
    const double *const v[4] = {p->x, p->y, p->z, p->range_m};
    const int has_range = (columns & PLY_RANGE) != 0;
    for (int k = 0; k < 3 + has_range && (columns & PLY_FLOAT) != 0; k++)
        put_floats(rows, v[k]);
    if ((columns & PLY_FLOAT) != 0) return;
    if (has_range)
        put_doubles(rows, v, 4);
    else
        put_doubles(rows, v, 3);
}

static void put_echoes(struct ply_rows *rows, const struct track_points *p)
{
    const size_t len = rows->len;
    uint8_t *to = rows->to;
    for (int i = 0; i < rows->n; i++, to += len)
        le_put16(to, (uint16_t)(p->echo[i] | p->echo_count[i] << 8));
    rows->to += 2;
}

/* Where v is NULL, all rows have the same number. */
static void put_shorts(struct ply_rows *rows, const uint16_t *v, uint16_t same)
{
    const size_t len = rows->len;
    uint8_t *to = rows->to;
    for (int i = 0; i < rows->n; i++, to += len)
        le_put16(to, v != NULL ? v[i] : same);
    rows->to += 2;
}

static void put_attributes(struct ply_rows *rows, const struct scanhead_attribute *a)
{
    uint8_t *to = rows->to;
    for (int i = 0; i < rows->n; i++, to += rows->len) {
        le_put_float(to, (float)a[i].amplitude_db);
        le_put_float(to + 4, (float)a[i].width_ns);
    }
    rows->to += 8;
}

static void put_colours(struct ply_rows *rows, const uint8_t (*rgb)[3])
{
    uint8_t *to = rows->to;
    for (int i = 0; i < rows->n; i++, to += rows->len)
        memcpy(to, rgb[i], 3);
    rows->to += 3;
}

static void put_binary(struct ply *ply, struct ply_rows rows)
{
    const struct track *t = &ply->base.track;
    const struct track_points *p = &t->points;
    const unsigned columns = ply->facts.columns;
    put_lengths(&rows, p, columns);
    if ((columns & PLY_REFLECTANCE) != 0) put_floats(&rows, p->reflectance_db);
    if ((columns & PLY_TIME) != 0) put_doubles(&rows, (const double *const[]){ply->time_s}, 1);
    if ((columns & PLY_ECHO) != 0) put_echoes(&rows, p);
    if ((columns & PLY_LABEL) != 0) put_shorts(&rows, p->label, 0);
    if ((columns & PLY_STATION) != 0) put_shorts(&rows, NULL, (uint16_t)t->info.station);
    if ((columns & PLY_FRAME) != 0) put_doubles(&rows, (const double *const[]){ply->frame}, 1);
    if ((columns & PLY_ATTRIBUTES) != 0) put_attributes(&rows, t->attribute);
    if ((columns & PLY_DEVIATION) != 0) put_floats(&rows, t->deviation);
    if ((columns & PLY_COLOUR) != 0) put_colours(&rows, t->rgb);
}

/* ---- rows of text */

/* On the wire, micrometres (1e-11 degrees) are the finest scale. The units are 0.01 dB, nanoseconds for times, and
 * 0.01 ns for widths of echoes. So more digits would add nothing. NaN is written without a sign, since some readers
 * know only "nan". */
static char *put_number(char *to, unsigned decimals, double v)
{
    to = isnan(v) ? stpcpy(to, "nan") : decimal_put_fixed(to, v, decimals);
    *to++ = ' ';
    return to;
}

static char *put_whole(char *to, unsigned v)
{
    to = decimal_put_whole(to, v);
    *to++ = ' ';
    return to;
}

static char *put_frame(char *to, double v)
{
    to = isnan(v) ? stpcpy(to, "nan") : decimal_put_general(to, v, 9);
    *to++ = ' ';
    return to;
}

/* Writes point i as text. `row` has room for TEXT_ROOM bytes. Returns the end of the text, or NULL where the text has
 * TEXT_LEN bytes or more. */
static uint8_t *put_ascii(uint8_t *row, const struct ply *ply, int i)
{
    const struct track *t = &ply->base.track;
    const struct track_points *p = &t->points;
    const unsigned columns = ply->facts.columns, flat = t->crs == NATIVE_CRS_GEODETIC ? 12 : 6;
    char *to = (char *)row;
    to = put_number(to, flat, p->x[i]);
    to = put_number(to, flat, p->y[i]);
    to = put_number(to, 6, p->z[i]);
    if ((columns & PLY_RANGE) != 0) to = put_number(to, 6, p->range_m[i]);
    if ((columns & PLY_REFLECTANCE) != 0) to = put_number(to, 2, p->reflectance_db[i]);
    if ((columns & PLY_TIME) != 0) to = put_number(to, 9, ply->time_s[i]);
    if ((columns & PLY_ECHO) != 0) to = put_whole(put_whole(to, p->echo[i]), p->echo_count[i]);
    if ((columns & PLY_LABEL) != 0) to = put_whole(to, p->label[i]);
    if ((columns & PLY_STATION) != 0) to = put_whole(to, t->info.station);
    if ((columns & PLY_FRAME) != 0) to = put_frame(to, ply->frame[i]);
    if ((columns & PLY_ATTRIBUTES) != 0) {
        to = put_number(to, 2, t->attribute[i].amplitude_db);
        to = put_number(to, 2, t->attribute[i].width_ns);
    }
    if ((columns & PLY_DEVIATION) != 0) to = put_number(to, 3, t->deviation[i]);
    for (int c = 0; c < 3 && (columns & PLY_COLOUR) != 0; c++)
        to = put_whole(to, t->rgb[i][c]);
    if (to - (char *)row >= TEXT_LEN) return NULL;
    to[-1] = '\n'; /* the blank after the last number */
    return (uint8_t *)to;
}

/* Writes n rows and moves *to on. SH_EFORMAT: a coordinate is too long; the rows before it count. */
static int put_text_rows(struct ply *ply, int n, uint8_t **to, struct sh_err *err)
{
    const struct track_points *p = &ply->base.track.points;
    for (int i = 0; i < n; i++) {
        uint8_t *end = put_ascii(*to, ply, i);
        if (end == NULL) return outfile_fail_huge(&ply->base.file, (const double[3]){p->x[i], p->y[i], p->z[i]}, err);
        *to = end;
        ply->facts.n_vertices++;
    }
    return SH_OK;
}

/* Takes the GPS time of the first scan's start, which may come after its first points. Returns 1 when it has just
 * come. */
static int set_gps(struct ply *ply)
{
    struct ply_facts *facts = &ply->facts;
    if (facts->have_gps || ply->base.track.n_scans != 1) return 0;
    facts->have_gps = track_start_gps(&ply->base.track, &facts->gps_s);
    return facts->have_gps;
}

/* A float is rounded by up to 2^-24 of a number: 0.06 mm at 1 km from the origin of a scene, but 0.3 m at a UTM
 * northing of 5,000 km. */
static const double FLOAT_MOST_M = 1000, FLOAT_PART = 0x1p-24;

static int fail_float(const char *path, double most, struct sh_err *err)
{
    return sh_fail(err, SH_EINPUT,
                   "%s: coordinates of %.0f m as float would be wrong by up to %.2g m; leave out float, which is "
                   "allowed for stations within %g m of the origin",
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
        return sh_fail(err, SH_EINPUT, "%s: degrees as float would be wrong by metres; leave out float", path);
    const double most = largest(place_m);
    return most <= FLOAT_MOST_M ? 0 : fail_float(path, most, err);
}

static int ply_fits(const char *path, const struct recorder_options *options, const struct recorder_scan *first,
                    const struct recorder_scan *scan, struct sh_err *err)
{
    static const double way[3] = {0, 0, 0}; /* a moving head's places in the scene frame are checked as they come */
    (void)first;
    return check_float(path, options->columns, scan->in_degrees, scan->moves && !scan->is_geo ? way : scan->place_m,
                       err);
}

/* The places of a moving head are not known before the scan. So its points are checked: they may be as far from the
 * origin as those of a station that is allowed. */
static int check_floats_on_the_way(const struct ply *ply, int n, struct sh_err *err)
{
    const struct track *t = &ply->base.track;
    double most = 0;
    if ((ply->facts.columns & PLY_FLOAT) == 0 || !t->info.moving) return 0;
    for (int i = 0; i < n; i++)
        most = fmax(most, largest((const double[3]){t->points.x[i], t->points.y[i], t->points.z[i]}));
    return most <= FLOAT_MOST_M + t->info.range_max_m ? 0 : fail_float(ply->base.file.path, most, err);
}

static unsigned columns_spared(unsigned columns)
{
    return ((columns & PLY_RANGE) != 0 ? 0 : TRACK_RANGE) | ((columns & PLY_REFLECTANCE) != 0 ? 0 : TRACK_REFLECTANCE) |
           ((columns & PLY_TIME) != 0 ? 0 : TRACK_TIME) | ((columns & PLY_LABEL) != 0 ? 0 : TRACK_LABEL);
}

/* Adds the scan's head to the header's facts, unless the scan before had the same head. Returns 1 if it was added. */
static int add_head(struct ply *ply)
{
    const struct scanhead_info *info = &ply->base.track.info;
    struct ply_facts *facts = &ply->facts;
    const struct ply_head before = ply->last;
    ply->last.station = info->station;
    snprintf(ply->last.idn, sizeof ply->last.idn, "%s", info->idn);
    snprintf(ply->last.profile, sizeof ply->last.profile, "%s", info->profile);
    sh_keep_line(ply->last.idn); /* a line break in a text would end its line of the header */
    sh_keep_line(ply->last.profile);
    if (facts->n_heads > 0 && strcmp(before.idn, ply->last.idn) == 0 && strcmp(before.profile, ply->last.profile) == 0)
        return 0;
    if (facts->n_heads == PLY_MAX_HEADS) {
        ply->n_heads_beyond++;
        return 0;
    }
    facts->head[facts->n_heads++] = ply->last;
    return 1;
}

/* Room for the header is made when the number of surfaces is known. */
static int ply_scan(void *rec, struct sh_err *err)
{
    struct ply *ply = rec;
    const struct scanhead_info *info = &ply->base.track.info;
    struct ply_facts *facts = &ply->facts;
    facts->columns = ply_columns_there(&ply->base.track, ply->base.options.columns);
    ply->base.track.spared = columns_spared(facts->columns);
    const int is_new = add_head(ply);
    int rc = check_float(ply->base.file.path, facts->columns, ply->base.track.crs == NATIVE_CRS_GEODETIC,
                         ply->base.track.pose.shift_m, err);
    set_gps(ply);
    if (rc == 0 && ply->header_len == 0) return ply_make_room(ply, info->n_surfaces, err);
    return rc == 0 && is_new ? write_header(ply, 1, err) : rc;
}

/* Moves the batch to its place in the scene. Returns how many points are left. */
static int place_points(struct ply *ply, int n)
{
    struct track *t = &ply->base.track;
    struct track_points *p = &t->points;
    if (t->info.geo) return n;
    station_pose_forward_all(&t->pose, n, p->x, p->y, p->z);
    return track_leave_out(t, n);
}

static void set_columns(struct ply *ply, int n)
{
    const struct track *t = &ply->base.track;
    if ((ply->facts.columns & PLY_TIME) != 0) track_seconds(t, n, ply->time_s);
    for (int i = 0; i < n && (ply->facts.columns & PLY_FRAME) != 0; i++)
        ply->frame[i] = t->info.moving ? t->frame[i] : t->info.frame;
}

static int ply_points(void *rec, int n, struct sh_err *err)
{
    struct ply *ply = rec;
    const size_t len = ply->facts.ascii ? TEXT_LEN : ply_row_len(ply->facts.columns);
    int rc = set_gps(ply) ? write_header(ply, 1, err) : 0;
    uint8_t *from = rc == 0 ? outfile_room(&ply->base.file, (size_t)n * len + TEXT_ROOM, err) : NULL, *to = from;
    if (from == NULL) return rc != 0 ? rc : SH_EIO;
    rc = check_floats_on_the_way(ply, n, err);
    if (rc != 0) return rc;
    n = place_points(ply, n);
    set_columns(ply, n);
    if (ply->facts.ascii) {
        rc = put_text_rows(ply, n, &to, err);
    } else {
        put_binary(ply, (struct ply_rows){.to = to, .len = len, .n = n});
        to += (size_t)n * len;
        ply->facts.n_vertices += (uint64_t)n;
    }
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
    return write_header(ply, 0, err);
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
