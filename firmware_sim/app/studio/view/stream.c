/* SPDX-License-Identifier: MIT */
/* Points and meshes of a .shs. The file's frames go through drivers/record/track.h, as for recorders, and grids are
 * those of drivers/record/mesh_grid.c. */
#include "firmware_sim/app/studio/view/stream.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/grow.h"
#include "core/of_file.h"
#include "core/pose.h"
#include "drivers/host/scanhead.h"
#include "drivers/protocol/native.h"
#include "firmware_sim/replay/recording.h"

/* ---- a scan begins */

static int place_station(struct viewed_stream *s, struct sh_err *err)
{
    const struct track *t = &s->track;
    double quat[4];
    struct viewed_station *station = viewed_add_station(s->v, t->info.station, err);
    if (station == NULL) return SH_ENOMEM;
    if (t->info.moving) return SH_OK;
    station->placed = 1;
    memcpy(station->p_m, t->pose.shift_m, sizeof station->p_m);
    pose_from_matrix(t->pose.rotation, quat);
    pose_to_angles(quat, &station->heading_rad, &station->pitch_rad, &station->roll_rad);
    return SH_OK;
}

/* Returns 0 where points of this track have no mesh. For coordinates in degrees the reason is a text of its own. Else
 * it is that of mesh_grid_check, without the path at its beginning and without the allowed formats at its end. */
static int check_mesh(struct viewed_stream *s)
{
    struct sh_err why = {0};
    const struct track *t = &s->track;
    const char *text = why.text;
    const size_t path_len = strlen(t->path);
    if (t->crs == NATIVE_CRS_GEODETIC)
        sh_fail(&why, SH_EFORMAT, "a mesh needs metres, and this recording's coordinates are degrees");
    else if (mesh_grid_check(t, &why) == SH_OK)
        return 1;
    if (strncmp(text, t->path, path_len) == 0 && strncmp(text + path_len, ": ", 2) == 0) text += path_len + 2;
    const char *end = strstr(text, "; allowed");
    const int len = end != NULL ? (int)(end - text) : (int)strlen(text);
    snprintf(s->v->why_no_mesh, sizeof s->v->why_no_mesh, "%.*s", len, text);
    return 0;
}

static int begin_scan(void *ctx, struct sh_err *err)
{
    struct viewed_stream *s = ctx;
    const struct track *t = &s->track;
    int rc = viewed_end_grid(s, err);
    if (rc != SH_OK) return rc;
    s->no_mesh = !check_mesh(s);
    snprintf(s->v->idn, sizeof s->v->idn, "%s", t->info.idn);
    snprintf(s->v->profile, sizeof s->v->profile, "%s", t->info.profile);
    s->v->points.epsg = t->epsg;
    mesh_grid_begin(&s->grid, t, 0);
    return place_station(s, err);
}

/* ---- points come */

static int stream_make_room(struct viewed_stream *s, struct sh_err *err)
{
    struct cloud *p = &s->v->points;
    if (p->n < s->room) return SH_OK;
    if (p->n == UINT32_MAX)
        return sh_fail(err, SH_EINPUT, "%s: at most %u points can be shown", s->v->path, UINT32_MAX);
    if (s->has == 0) {
        s->has = 1u << CLOUD_RANGE | 1u << CLOUD_REFLECTANCE | 1u << CLOUD_TIME | 1u << CLOUD_LABEL |
                 1u << CLOUD_STATION | 1u << CLOUD_ECHO | 1u << CLOUD_ECHO_COUNT;
        if (s->track.has_attributes) s->has |= 1u << CLOUD_AMPLITUDE;
        if (s->track.has_colours) s->has |= 1u << CLOUD_RGB;
    }
    size_t room = s->room + s->room / 2 + 65536;
    if (room > UINT32_MAX) room = UINT32_MAX;
    int rc = cloud_make_room(p, room, s->has, err);
    if (rc == SH_OK) s->room = room;
    return rc;
}

static void put_point(struct viewed_stream *s, int i, const double xyz_m[3])
{
    const struct track *t = &s->track;
    const struct track_points *from = &t->points;
    struct cloud *p = &s->v->points;
    const size_t n = p->n++;
    memcpy(p->xyz_m[n], xyz_m, sizeof p->xyz_m[n]);
    p->range_m[n] = (float)from->range_m[i];
    p->reflectance_db[n] = (float)from->reflectance_db[i];
    p->time_s[n] = 1e-9 * (double)from->t_ns[i];
    p->label[n] = from->label[i];
    p->station[n] = (uint16_t)t->info.station;
    p->echo[n] = from->echo[i];
    p->echo_count[n] = from->echo_count[i];
    if (p->amplitude_db != NULL) p->amplitude_db[n] = (float)t->attribute[i].amplitude_db;
    if (p->rgb != NULL) memcpy(p->rgb[n], t->rgb[i], sizeof p->rgb[n]);
}

/* The first echo of a shot is in the grid, where the pose is known. */
static int put_into_grid(struct viewed_stream *s, int i, const double xyz_m[3], struct sh_err *err)
{
    struct track *t = &s->track;
    if (s->no_mesh || t->points.echo[i] > 1) return SH_OK;
    if (!mesh_grid_takes(&s->grid, t, i)) {
        int rc = viewed_end_grid(s, err);
        if (rc != SH_OK) return rc;
        mesh_grid_begin(&s->grid, t, 0);
    }
    if (!grow(&s->at, &s->room_at, (size_t)s->grid.n + 1, sizeof *s->at))
        return sh_fail(err, SH_ENOMEM, "%s: no memory for a grid of %u points", s->v->path, s->grid.n);
    s->at[s->grid.n] = (uint32_t)s->v->points.n - 1;
    int is_in = mesh_grid_add(&s->grid, t, i, xyz_m, err);
    return is_in < 0 ? is_in : SH_OK;
}

static int stream_take_points(void *ctx, int n, struct sh_err *err)
{
    struct viewed_stream *s = ctx;
    struct track *t = &s->track;
    int rc = SH_OK;
    for (int i = 0; rc == SH_OK && i < n; i++) {
        const struct track_points *p = &t->points;
        double xyz_m[3] = {p->x[i], p->y[i], p->z[i]};
        if (p->echo_count[i] == 0) {
            s->v->n_empty++;
            continue;
        }
        if (!t->info.geo) station_pose_forward(&t->pose, xyz_m);
        if (!viewed_can_show(t->epsg, xyz_m)) {
            t->missing.n_nowhere++;
            continue;
        }
        rc = stream_make_room(s, err);
        if (rc != SH_OK) return rc;
        put_point(s, i, xyz_m);
        rc = put_into_grid(s, i, xyz_m, err);
    }
    return rc;
}

/* ---- frames */

static int frames_lost(const struct scanhead_stats *stats)
{
    return stats->seq_lost + stats->reader_lost + stats->dropped + stats->refused + stats->bad_payload +
               stats->bad_bytes !=
           0;
}

static int read_frames(struct viewed_stream *s, struct scanhead *sh, struct sh_err *err)
{
    enum { FRAMES_BETWEEN_LOOKS = 256 };
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    int rc = SH_OK;
    scanhead_get_stats(sh, &stats);
    for (uint64_t k = 0; rc == SH_OK; k++) {
        if (k % FRAMES_BETWEEN_LOOKS == 0) {
            sh_progress(s->report, "reading the recording", (double)stats.bytes / s->file_bytes);
            if ((rc = sh_check_stop(s->report, err)) != SH_OK) return rc;
        }
        rc = scanhead_next(sh, &frame, -1);
        if (rc == SCANHEAD_ECLOSED) return SH_OK;
        if (rc != SCANHEAD_OK) return sh_fail(err, rc == SCANHEAD_EFORMAT ? SH_EINPUT : rc, "%s", scanhead_error(sh));
        scanhead_get_stats(sh, &stats); /* a gap right before the frame counts, too */
        recording_count(&s->counts, &frame, frames_lost(&stats));
        rc = track_frame(&s->track, sh, &frame, err);
    }
    return rc;
}

static void look_for_losses(struct viewed_stream *s, struct scanhead *sh)
{
    struct scanhead_stats stats;
    struct viewed *v = s->v;
    const struct track_missing *m = &s->track.missing;
    const struct recording_counts *c = &s->counts;
    char refused[80] = "";
    scanhead_get_stats(sh, &stats);
    if (stats.refused != 0)
        snprintf(refused, sizeof refused, ", %llu frames left out for their contents or version",
                 (unsigned long long)stats.refused);
    v->n_left_out = m->n_unplaced + m->n_without_pose + m->n_nowhere;
    v->complete =
        !c->within && c->scans > 0 && c->lost == 0 && c->missing == 0 && c->unknown == 0 && !frames_lost(&stats);
    if (!v->complete)
        sh_warn(s->report, "%s: not complete: %llu pulses lost by the head, %s%llu did not arrive, %llu bad bytes%s%s",
                v->path, (unsigned long long)c->lost, c->unknown != 0 ? "at least " : "",
                (unsigned long long)c->missing, (unsigned long long)stats.bad_bytes, refused,
                c->within || c->scans == 0 ? "; it ends in the middle of a scan" : "");
}

static int take_names(struct viewed_stream *s, const struct scanhead *sh, struct sh_err *err)
{
    const char *object, *material;
    int rc = SH_OK;
    for (uint32_t label = 0; rc == SH_OK && label < SCANHEAD_NO_LABEL; label++)
        if (scanhead_surface(sh, label, &object, &material))
            rc = viewed_add_surface(s->v, label, object, material, err);
    return rc;
}

static int open_stream(struct viewed_stream *s, struct scanhead **sh, struct sh_err *err)
{
    struct stat st;
    if (stat(s->v->path, &st) == 0) s->file_bytes = (double)st.st_size;
    return recording_open_file(s->v->path, sh, err);
}

int viewed_load_stream(struct viewed *v, const struct sh_report *report, struct sh_err *err)
{
    static const struct track_ops ops = {
        .scan = begin_scan, .points = stream_take_points, .wants_attributes = 1, .wants_colours = 1};
    struct viewed_stream *s = calloc(1, sizeof *s);
    struct scanhead *sh = NULL;
    if (s == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to read it", v->path);
    *s = (struct viewed_stream){.v = v, .report = report, .track = {.path = v->path, .ops = &ops, .rec = s}};
    int rc = open_stream(s, &sh, err);
    if (rc == SH_OK) rc = read_frames(s, sh, err);
    if (rc == SH_OK) rc = track_flush(&s->track, err);
    if (rc == SH_OK) rc = viewed_end_grid(s, err);
    if (rc == SH_OK) rc = take_names(s, sh, err);
    if (rc == SH_OK && v->points.n > 0) rc = cloud_make_room(&v->points, v->points.n, s->has, err); /* frees the rest */
    if (rc == SH_OK) look_for_losses(s, sh);
    if (rc == SH_OK && v->n_meshes == 0 && v->why_no_mesh[0] == '\0')
        snprintf(v->why_no_mesh, sizeof v->why_no_mesh, "no four points lie in neighbouring rows and lines");
    if (v->n_meshes > 0) v->why_no_mesh[0] = '\0';
    track_free(&s->track);
    mesh_grid_free(&s->grid);
    free(s->at);
    free(s);
    scanhead_close(sh);
    return sh_of_file(rc, err);
}
