/* SPDX-License-Identifier: MIT */
/* .poses.csv: the true poses of the head, to compare with those that a registration or a trajectory program finds.
 *
 * A head that stands has one row per scan. The pose takes points from the head's frame to the frame of the
 * recordings beside it (station_pose.h). At a stop the row has the frame scalar, too. Where the recordings
 * are geodetic, the position is NaN and the axes are east, north, up.
 *
 * A head that moves has one row per pose, each time once, in the scene frame, with times since the scan's
 * start. So the file is a trajectory file (core/pose.h). Lines of comment say where poses are missing, and how
 * the scene frame lies in the CRS of the geo layout.
 *
 * Scans are numbered from 1 on in the file, as in .waves.csv and .e57. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/decimal.h"
#include "drivers/protocol/native.h"
#include "drivers/record/csv_repair.h"
#include "drivers/record/recorder.h"

enum { BATCH = 64, LINE = 512 };

struct pose_file {
    struct recorder base;
    /* of a head that moves */
    uint32_t n_scans;
    int is_due;                /* SCAN_START of another scan than that of the last points came, and no pose after it */
    const struct scanhead *sh; /* of the present scan */
    uint32_t scan, station;    /* of the present scan, as its head numbers them */
    int64_t last_ns;           /* written last */
};

enum title { STATIONS, STOPS, MOVING };

static const char *const title[] = {[STATIONS] = "scan,station,epsg,x_m,y_m,z_m,qw,qx,qy,qz,lat_deg,lon_deg,height_m\n",
                                    [STOPS] =
                                        "scan,station,epsg,x_m,y_m,z_m,qw,qx,qy,qz,lat_deg,lon_deg,height_m,frame\n",
                                    [MOVING] = "scan,t_s,x_m,y_m,z_m,qw,qx,qy,qz,frame,flags\n",
                                    NULL};

static int put_station(void *rec, struct sh_err *err)
{
    struct pose_file *file = rec;
    const struct track *t = &file->base.track;
    double q[4], p[3];
    char row[LINE];
    if (t->info.moving) return SH_OK;
    int rc = station_pose_check(&t->pose, file->base.file.path, err);
    if (rc != SH_OK) return rc;
    memcpy(p, t->pose.shift_m, sizeof p);
    if (t->crs == NATIVE_CRS_GEODETIC) p[0] = p[1] = p[2] = NAN;
    station_pose_quaternion(&t->pose, q);
    int n = snprintf(row, sizeof row, "%u,%u,%d,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g",
                     t->n_scans, t->info.station, t->epsg, p[0], p[1], p[2], q[0], q[1], q[2], q[3], t->info.lat_deg,
                     t->info.lon_deg, t->info.height_m);
    if (t->info.stop) n += snprintf(row + n, sizeof row - (size_t)n, ",%.9g", t->info.frame);
    row[n++] = '\n';
    rc = csv_put_title(&file->base.file, title[t->info.stop ? STOPS : STATIONS], err);
    return rc != SH_OK ? rc : outfile_write(&file->base.file, row, (size_t)n, err);
}

static int pose_file_put(struct pose_file *file, const struct scanhead_pose *p, struct sh_err *err)
{
    char line[2 * LINE], *at = decimal_put_whole(line, file->n_scans);
    *at++ = ',';
    at = decimal_put_fixed(at, 1e-9 * (double)p->t_ns, 9);
    *at++ = ',';
    at = decimal_put_cells(at, p->position_m, 3, 15);
    at = decimal_put_cells(at, p->quat, 4, 17);
    at = decimal_put_cells(at, &p->frame, 1, 9);
    at += sprintf(at, "%d\n", p->flags);
    return outfile_write(&file->base.file, line, (size_t)(at - line), err);
}

/* Poses are in the scene frame. If the points are in a CRS, comments say how the scene frame lies in it. */
static int put_scene_in_crs(struct pose_file *file, const struct scanhead_info *info, struct sh_err *err)
{
    char text[4 * LINE];
    const double *p = info->station_m, *r = info->axes;
    static const char *const to[] = {[NATIVE_CRS_ECEF] = "ECEF X Y Z",
                                     [NATIVE_CRS_UTM] = "easting, northing, height",
                                     [NATIVE_CRS_GEODETIC] = "east, north, up"};
    if (!info->geo || info->crs == NATIVE_CRS_LOCAL) return SH_OK;
    int n = snprintf(text, sizeof text,
                     "# poses are in the scene frame, points recorded beside them in EPSG %d\n"
                     "# scene point x_m,y_m,z_m is at lat_deg,lon_deg,ellipsoidal height_m: %.15g,%.15g,%.15g: "
                     "%.15g,%.15g,%.15g\n"
                     "# scene axes to %s, row by row, where the path begins: "
                     "%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n",
                     info->epsg, p[0], p[1], p[2], info->lat_deg, info->lon_deg, info->height_m, to[info->crs], r[0],
                     r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]);
    return outfile_write(&file->base.file, text, (size_t)n, err);
}

/* A scan's number alone does not show that the scan is new: another head, or one that has started again, numbers its
 * scans from 1 on. A new descriptor does not show it either: settings may change within a scan, whose poses then go
 * on. */
static int is_new_scan(const struct pose_file *file, const struct scanhead *sh, const struct scanhead_info *info)
{
    return file->n_scans == 0 || file->is_due || sh != file->sh || info->scan != file->scan ||
           info->station != file->station;
}

static int put_poses(struct pose_file *file, struct scanhead *sh, const struct scanhead_frame *frame,
                     struct sh_err *err)
{
    struct scanhead_pose pose[BATCH];
    struct scanhead_info info;
    int n, rc = csv_put_title(&file->base.file, title[MOVING], err);
    if (rc != SH_OK || scanhead_get_info(sh, &info) != SCANHEAD_OK) return rc; /* the poses' scan is not known yet */
    if (file->n_scans == 0) rc = put_scene_in_crs(file, &info, err);
    if (is_new_scan(file, sh, &info)) {
        file->n_scans++;
        file->last_ns = INT64_MIN;
    }
    file->is_due = 0;
    file->sh = sh;
    file->scan = info.scan;
    file->station = info.station;
    for (uint32_t first = 0; (n = scanhead_poses(sh, frame, first, pose, BATCH)) > 0 && rc == SH_OK;
         first += (uint32_t)n) {
        static const char gap[] = "# poses are missing here\n";
        if (first == 0 && file->last_ns != INT64_MIN && pose[0].t_ns > file->last_ns)
            rc = outfile_write(&file->base.file, gap, sizeof gap - 1, err);
        for (int i = 0; i < n && rc == SH_OK; i++) {
            if (pose[i].t_ns <= file->last_ns) continue;
            rc = pose_file_put(file, &pose[i], err);
            file->last_ns = pose[i].t_ns;
        }
    }
    return rc;
}

static int pose_file_frame(void *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct pose_file *file = rec;
    if (frame->type == SCANHEAD_POSES) return put_poses(file, sh, frame, err);
    file->is_due |= frame->type == SCANHEAD_EVENT && frame->event == SCANHEAD_EV_SCAN_START &&
                    !track_is_late_start(&file->base.track, frame);
    return track_frame(&file->base.track, sh, frame, err);
}

static int pose_file_finish(void *rec, struct sh_err *err)
{
    return csv_put_title(&((struct pose_file *)rec)->base.file, title[STATIONS], err);
}

/* ---- repair */

static int pose_file_repair(struct repair *r, struct sh_err *err)
{
    static const struct csv_format format = {title, "0123456789+-.einfa,", "poses", "file of poses", LINE};
    return csv_repair(r, &format, err);
}

const struct recorder_ops recorder_poses = {
    .ending = ".poses.csv",
    .size = sizeof(struct pose_file),
    .track = {.scan = put_station},
    .frame = pose_file_frame,
    .finish = pose_file_finish,
    .repair = pose_file_repair,
};
