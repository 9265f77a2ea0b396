/* .poses.csv: where the head truly stood, one row per scan: what a registration has to find. The pose takes points from
 * the head's frame to the frame of the recordings beside it (pose.h). */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "drivers/host/outfile.h"
#include "drivers/host/recorder_list.h"
#include "drivers/host/track.h"

struct poses {
    struct outfile file;
    struct track track;
};

static int poses_open(const char *path, const struct recorder_options *options, void **rec, struct sh_err *err)
{
    static const char head[] = "scan,station,epsg,x_m,y_m,z_m,qw,qx,qy,qz,lat_deg,lon_deg,height_m\n";
    (void)options;
    struct poses *poses = calloc(1, sizeof *poses);
    if (poses == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
    int rc = outfile_open(&poses->file, path, err);
    if (rc != 0) {
        free(poses);
        return rc;
    }
    poses->track.path = poses->file.path;
    *rec = poses;
    return outfile_write(&poses->file, head, sizeof head - 1, err); /* into the buffer: does not fail */
}

static int poses_scan(void *rec, struct sh_err *err)
{
    struct poses *poses = rec;
    const struct track *t = &poses->track;
    double q[4];
    char row[512];
    pose_quaternion(&t->pose, q);
    int n = snprintf(row, sizeof row, "%u,%u,%d,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n",
                     t->n_scans, t->info.station, track_epsg(t), t->pose.shift_m[0], t->pose.shift_m[1],
                     t->pose.shift_m[2], q[0], q[1], q[2], q[3], t->info.lat_deg, t->info.lon_deg, t->info.height_m);
    return outfile_write(&poses->file, row, (size_t)n, err);
}

static int poses_frame(void *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    static const struct track_ops ops = {poses_scan, NULL};
    struct poses *poses = rec;
    return track_frame(&poses->track, sh, frame, &ops, poses, err);
}

static int poses_close(void *rec, int keep, struct sh_err *err)
{
    struct poses *poses = rec;
    int rc = outfile_close(&poses->file, keep, err);
    free(poses);
    return rc;
}

const struct recorder_ops recorder_poses = {".poses.csv", poses_open, poses_frame, poses_close};
