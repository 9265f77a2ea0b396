#include "drivers/record/recorder.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "drivers/record/recorder_list.h"

static const struct recorder_ops *const recorders[] = {&recorder_ply,   &recorder_las,    &recorder_ptx, &recorder_e57,
                                                       &recorder_poses, &recorder_pcapng, &recorder_shs};

enum { N_RECORDERS = sizeof recorders / sizeof recorders[0] };

const struct recorder_ops *recorder_find(const char *path, struct sh_err *err)
{
    size_t len = strlen(path);
    char known[128] = "";
    for (size_t i = 0; i < N_RECORDERS; i++) {
        size_t n = strlen(recorders[i]->ending);
        if (len > n && strcasecmp(path + len - n, recorders[i]->ending) == 0) return recorders[i];
        snprintf(known + strlen(known), sizeof known - strlen(known), " %s", recorders[i]->ending);
    }
    sh_fail(err, SH_EINPUT, "%s: no recorder for this ending; known are%s", path, known);
    return NULL;
}
