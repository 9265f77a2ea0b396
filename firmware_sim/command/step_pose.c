/* The pose that a step may carry. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/command/command_inside.h"

static const struct {
    const char *name;
    double most; /* of its absolute value */
} parts[6] = {{"x", 1e9}, {"y", 1e9}, {"z", 1e9}, {"roll", 360.0}, {"pitch", 90.0}, {"heading", 360.0}};

/* The number at text, up to a comma or the end; returns what follows, or NULL. */
static const char *take_number(const char *text, double *value)
{
    struct command_decimal decimal;
    text += strspn(text, " \t");
    const char *end = command_parse_decimal(text, &decimal);
    if (end == NULL || (*end != ',' && *end != '\0')) return NULL;
    *value = strtod(text, NULL);
    return end;
}

static int is_in_reach(const struct command_call *call)
{
    double d2 = 0.0;
    for (int i = 0; i < 3; i++) {
        double d = call->out->pose[i] - call->dev->pose_centre_m[i];
        d2 += d * d;
    }
    return d2 <= call->dev->pose_reach_m * call->dev->pose_reach_m;
}

int command_take_pose(struct command_call *call)
{
    const char *p = call->pose, *header = call->row->header;
    if (!call->dev->pose_allowed) {
        command_fail(call, CMD_E_SETTINGS, "a pose in %s needs platform.kind: live", header);
        return -1;
    }
    for (int i = 0; i < 6; i++) {
        double *value = &call->out->pose[i];
        const char *end = take_number(p, value);
        if (end == NULL) {
            char clip[COMMAND_CLIP_LEN];
            command_clip(clip, p, strcspn(p, ","));
            command_fail(call, CMD_E_DATA_TYPE, "%s: %s is not a number: '%s'", header, parts[i].name, clip);
            return -1;
        }
        if (!(fabs(*value) <= parts[i].most)) {
            command_fail(call, CMD_E_RANGE, "%s: %s %.9g, allowed %g to %g", header, parts[i].name, *value,
                         -parts[i].most, parts[i].most);
            return -1;
        }
        if ((*end == ',') != (i < 5)) {
            command_fail(call, i < 5 ? CMD_E_MISSING : CMD_E_NOT_ALLOWED,
                         "%s takes a time, or a time and x, y, z, roll, pitch, heading", header);
            return -1;
        }
        p = end + 1;
    }
    if (!is_in_reach(call)) {
        command_fail(call, CMD_E_RANGE, "%s: the pose is more than platform.reach_m, %g m, from the station", header,
                     call->dev->pose_reach_m);
        return -1;
    }
    call->out->have_pose = 1;
    return 0;
}
