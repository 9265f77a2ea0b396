/* .ply: one vertex per echo. The format is described in the header's own comments.
 *
 * Positions are in the stream's CRS (geo), or in the scene frame (polar), as scanhead_to_scene has it.
 *
 * The header comes first in the file but is known last (count, names, losses). When the first points arrive
 * the head has told how many surfaces there are, so room is left for the header: no byte of the points is
 * written twice, which matters at 100 MB/s. Should the header outgrow its room after all, the points are
 * copied behind it once. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "drivers/host/outfile.h"
#include "drivers/host/ply_header.h"
#include "drivers/host/recorder_list.h"
#include "drivers/protocol/bytes.h"
#include "drivers/protocol/native.h"

enum { RECORD_LEN = 4 * 8 + 4 + 8 + 1 + 1 + 2 + 2, FRAME_LEN = 8, BATCH = 256, TEXT_LEN = 512 };

struct ply {
    struct outfile file;
    struct recorder_options options;
    struct ply_facts facts;
    struct ply_names names;
    int begun;         /* room for the header is made */
    size_t header_len; /* bytes of that room */
    struct scanhead_point batch[BATCH];
    double frame[BATCH]; /* of a moving head: frame scalar */
};

static int ply_open(const char *path, const struct recorder_options *options, void **rec, struct sh_err *err)
{
    struct ply *ply = calloc(1, sizeof *ply);
    if (ply == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
    ply->options = *options;
    ply->facts.ascii = options->ascii;
    ply->facts.empty_shots = options->empty_shots;
    int rc = outfile_open(&ply->file, path, err);
    if (rc != 0) {
        free(ply);
        return rc;
    }
    *rec = ply;
    return 0;
}

/* Makes room for the header with what is known of the names. */
static int begin(struct ply *ply, const struct scanhead *sh, uint32_t n_surfaces, struct sh_err *err)
{
    int rc = ply_names_grow(&ply->names, n_surfaces, err);
    for (uint32_t i = 0; rc == 0 && i < n_surfaces; i++) {
        const char *object, *material;
        if (scanhead_surface(sh, i, &object, &material)) rc = ply_names_set(&ply->names, i, object, material, err);
    }
    if (rc != 0) return rc;
    ply->header_len = ply_header_reserve(&ply->facts, &ply->names);
    if (ply->header_len == 0) return sh_fail(err, SH_ENOMEM, "%s: no memory for the header", ply->file.path);
    ply->begun = 1;
    static const char blank[4096];
    for (size_t left = ply->header_len; left > 0 && rc == 0;) {
        size_t n = left < sizeof blank ? left : sizeof blank;
        rc = outfile_write(&ply->file, blank, n, err);
        left -= n;
    }
    return rc;
}

/* One file holds points of one CRS. */
static int check_info(struct ply *ply, const struct scanhead_info *info, struct sh_err *err)
{
    struct ply_facts *facts = &ply->facts;
    int crs = info->geo ? info->crs : 0, epsg = info->geo ? info->epsg : 0;
    int geoid = info->geo && info->geoid_heights;
    if (facts->have_crs && (facts->crs != crs || facts->epsg != epsg))
        return sh_fail(err, SH_EFORMAT, "%s: the stream went from EPSG %d to %d; a PLY file holds one CRS",
                       ply->file.path, facts->epsg, epsg);
    if (facts->have_crs && facts->geoid_heights != geoid)
        return sh_fail(err, SH_EFORMAT, "%s: the stream went to other heights (%s); a PLY file holds one kind",
                       ply->file.path, geoid ? "geoid" : "ellipsoid");
    if (info->station > 0xffff)
        return sh_fail(err, SH_EFORMAT, "%s: station %u; a PLY file holds stations up to 65535", ply->file.path,
                       info->station);
    if (facts->have_crs && facts->moving != info->moving)
        return sh_fail(err, SH_EFORMAT, "%s: the stream went on with a head that %s; a PLY file holds either",
                       ply->file.path, info->moving ? "moves" : "stands still");
    facts->moving = info->moving;
    facts->have_crs = 1;
    facts->crs = crs;
    facts->epsg = epsg;
    facts->geoid_heights = geoid;
    snprintf(facts->idn, sizeof facts->idn, "%s", info->idn);
    snprintf(facts->profile, sizeof facts->profile, "%s", info->profile);
    return 0;
}

/* frame: NULL where there is no such property. */
static size_t put_binary(uint8_t *to, const struct scanhead_point *p, unsigned station, const double *frame)
{
    le_put_double(to, p->x);
    le_put_double(to + 8, p->y);
    le_put_double(to + 16, p->z);
    le_put_double(to + 24, p->range_m);
    le_put_float(to + 32, (float)p->reflectance_db);
    le_put_double(to + 36, (double)p->t_ns / 1e9);
    to[44] = p->echo;
    to[45] = p->echo_count;
    le_put16(to + 46, p->label);
    le_put16(to + 48, (uint16_t)station);
    if (frame == NULL) return RECORD_LEN;
    le_put_double(to + RECORD_LEN, *frame);
    return RECORD_LEN + FRAME_LEN;
}

/* Micrometres (1e-11 degrees) are the finest scale of the wire, 0.01 dB and nanoseconds its units: more digits would
 * say nothing. "nan" without a sign, as some readers know no other. */
static size_t put_number(char *to, size_t room, int digits, double v)
{
    int n = isnan(v) ? snprintf(to, room, "nan ") : snprintf(to, room, "%.*f ", digits, v);
    return n > 0 && (size_t)n < room ? (size_t)n : room;
}

/* The length, or more than TEXT_LEN where numbers are absurdly long. */
static size_t put_ascii(char *to, const struct scanhead_point *p, int degrees, unsigned station, const double *frame)
{
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
    n += (size_t)snprintf(to + n, TEXT_LEN - n, "%u %u %u %u", p->echo, p->echo_count, p->label, station);
    if (frame != NULL && n < TEXT_LEN) n += (size_t)snprintf(to + n, TEXT_LEN - n, " %.9g", *frame);
    if (n >= TEXT_LEN) return TEXT_LEN + 1;
    to[n++] = '\n';
    return n;
}

static int put_batch(struct ply *ply, const struct scanhead_info *info, int n, struct sh_err *err)
{
    uint8_t *to = outfile_room(&ply->file, BATCH * TEXT_LEN, err);
    if (to == NULL) return SH_EIO;
    size_t used = 0;
    for (int i = 0; i < n; i++) {
        struct scanhead_point *p = &ply->batch[i];
        if (p->echo_count == 0 && !ply->options.empty_shots) continue;
        if (p->echo_count != 0 && isnan(p->x)) { /* no pose: counted, not guessed */
            ply->facts.n_without_pose++;
            continue;
        }
        const double *frame = info->moving ? &ply->frame[i] : NULL;
        size_t len = ply->options.ascii ? put_ascii((char *)to + used, p, ply->facts.crs == 3, info->station, frame)
                                        : put_binary(to + used, p, info->station, frame);
        if (len > TEXT_LEN)
            return sh_fail(err, SH_EFORMAT, "%s: a coordinate beyond all measure: %g %g %g", ply->file.path, p->x, p->y,
                           p->z);
        used += len;
        ply->facts.n_vertices++;
    }
    outfile_used(&ply->file, used);
    return 0;
}

/* Positions of the geo layout need no pose, the frame scalar does. */
static void set_geo_frames(struct ply *ply, struct scanhead *sh, const struct scanhead_info *info, int n)
{
    struct scanhead_pose pose;
    for (int i = 0; i < n && info->geo && info->moving; i++)
        ply->frame[i] = scanhead_pose(sh, ply->batch[i].t_ns, &pose) == SCANHEAD_OK ? pose.frame : 0.0;
}

static int put_points(struct ply *ply, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct scanhead_info info;
    if (scanhead_get_info(sh, &info) != 0) {
        ply->facts.n_unplaced += frame->n_points;
        return 0;
    }
    int rc = check_info(ply, &info, err);
    if (rc == 0 && !ply->begun) rc = begin(ply, sh, info.n_surfaces, err);
    for (uint32_t first = 0; rc == 0 && first < frame->n_points;) {
        int n = scanhead_points(sh, frame, first, ply->batch, BATCH);
        if (n < 0) return sh_fail(err, n, "%s: %s", ply->file.path, scanhead_error(sh));
        if (!info.geo && scanhead_to_scene(sh, ply->batch, (uint32_t)n, ply->frame) < 0)
            return sh_fail(err, SH_EFORMAT, "%s: %s", ply->file.path, scanhead_error(sh));
        set_geo_frames(ply, sh, &info, n);
        rc = put_batch(ply, &info, n, err);
        first += (uint32_t)n;
    }
    return rc;
}

struct naming {
    struct ply *ply;
    struct sh_err *err;
    int rc;
};

static void take_name(void *ctx, uint32_t label, const char *object, const char *material)
{
    struct naming *naming = ctx;
    if (naming->rc == 0) naming->rc = ply_names_set(&naming->ply->names, label, object, material, naming->err);
}

static int ply_frame(void *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct ply *ply = rec;
    scanhead_get_stats(sh, &ply->facts.stats);
    if (frame->type == SCANHEAD_POINTS) return put_points(ply, sh, frame, err);
    if (frame->type != SCANHEAD_SURFACES) return 0;
    struct naming naming = {ply, err, 0};
    native_decode_surfaces(frame->payload, frame->payload_len, take_name, &naming);
    return naming.rc;
}

/* The header outgrew its room: the points move behind it, block by block from the end. */
static int move_points(struct ply *ply, size_t header_len, struct sh_err *err)
{
    enum { BLOCK = 1 << 16 };
    struct outfile *file = &ply->file;
    size_t shift = header_len - ply->header_len;
    uint64_t end = file->written;
    uint8_t *block = malloc(BLOCK);
    if (block == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to move its points", file->path);
    int rc = 0;
    while (rc == 0 && end > ply->header_len) {
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

static int finish(struct ply *ply, struct sh_err *err)
{
    int rc = outfile_flush(&ply->file, err);
    char *header;
    size_t len;
    if (rc == 0) rc = ply_header_make(&ply->facts, &ply->names, ply->header_len, &header, &len, err);
    if (rc != 0) return rc;
    if (len > ply->header_len) rc = move_points(ply, len, err);
    if (rc == 0) rc = outfile_patch(&ply->file, 0, header, len, err);
    free(header);
    return rc;
}

static int ply_close(void *rec, int keep, struct sh_err *err)
{
    struct ply *ply = rec;
    int rc = keep ? finish(ply, err) : 0;
    int closed = outfile_close(&ply->file, keep && rc == 0, 0, err);
    ply_names_free(&ply->names);
    free(ply);
    return rc != 0 ? rc : closed;
}

const struct recorder_ops recorder_ply = {".ply", ply_open, ply_frame, ply_close};
