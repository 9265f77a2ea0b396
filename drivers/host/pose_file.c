#include "drivers/host/pose_file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/host/outfile.h"

enum { BATCH = 64, LINE = 512 };

struct pose_file {
    struct outfile out;
    int begun;
    uint32_t scan;
    int64_t last_ns; /* written last */
};

static const char title[] = "scan,t_s,x_m,y_m,z_m,qw,qx,qy,qz,frame,flags\n";

int pose_file_open(const char *path, struct pose_file **out, struct sh_err *err)
{
    *out = calloc(1, sizeof **out);
    if (*out == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
    int rc = outfile_open(&(*out)->out, path, err);
    if (rc != SH_OK) {
        free(*out);
        *out = NULL;
        return rc;
    }
    return outfile_write(&(*out)->out, title, sizeof title - 1, err);
}

static int put(struct pose_file *file, const struct scanhead_pose *p, struct sh_err *err)
{
    char line[LINE];
    int n = snprintf(line, sizeof line, "%u,%.9f,%.15g,%.15g,%.15g,%.17g,%.17g,%.17g,%.17g,%.9g,%d\n", file->scan,
                     1e-9 * (double)p->t_ns, p->position_m[0], p->position_m[1], p->position_m[2], p->quat[0],
                     p->quat[1], p->quat[2], p->quat[3], p->frame, p->flags);
    return outfile_write(&file->out, line, (size_t)n, err);
}

int pose_file_frame(struct pose_file *file, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct scanhead_pose pose[BATCH];
    struct scanhead_info info;
    int n, rc = SH_OK;
    if (scanhead_get_info(sh, &info) != SCANHEAD_OK) return SH_OK; /* whose scan it is isn't known yet */
    if (!file->begun || info.scan != file->scan) file->last_ns = INT64_MIN;
    file->begun = 1;
    file->scan = info.scan;
    for (uint32_t first = 0; (n = scanhead_poses(sh, frame, first, pose, BATCH)) > 0 && rc == SH_OK;
         first += (uint32_t)n) {
        static const char gap[] = "# poses are missing here\n";
        if (first == 0 && file->last_ns != INT64_MIN && pose[0].t_ns > file->last_ns)
            rc = outfile_write(&file->out, gap, sizeof gap - 1, err);
        for (int i = 0; i < n && rc == SH_OK; i++) {
            if (pose[i].t_ns <= file->last_ns) continue;
            rc = put(file, &pose[i], err);
            file->last_ns = pose[i].t_ns;
        }
    }
    return rc;
}

int pose_file_close(struct pose_file *file, int keep, struct sh_err *err)
{
    if (file == NULL) return SH_OK;
    int rc = outfile_close(&file->out, keep, 0, err);
    free(file);
    return rc;
}
