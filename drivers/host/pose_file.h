/* The poses of a moving head as a CSV file: ground truth beside a recording. One line per pose, each time once:
 *   scan,t_s,x_m,y_m,z_m,qw,qx,qy,qz,frame,flags
 * in the scene frame, times since the scan's start. Gaps, where frames were lost, are lines of comment. */
#ifndef DRIVERS_HOST_POSE_FILE_H
#define DRIVERS_HOST_POSE_FILE_H

#include "core/err.h"
#include "drivers/host/scanhead.h"

struct pose_file;

int pose_file_open(const char *path, struct pose_file **out, struct sh_err *err);
/* A frame of SCANHEAD_POSES. */
int pose_file_frame(struct pose_file *file, struct scanhead *sh, const struct scanhead_frame *frame,
                    struct sh_err *err);
/* Syncs and renames, as outfile_close does; file may be NULL. */
int pose_file_close(struct pose_file *file, int keep, struct sh_err *err);

#endif
