/* SPDX-License-Identifier: MIT */
/* The pose that a step may carry. */
#include <math.h>
#include <string.h>

#include "core/vec3.h"
#include "firmware_sim/command/call.h"
#include "firmware_sim/command/command.h"
#include "firmware_sim/command/decimal.h"
#include "firmware_sim/command/parse.h"
#include "firmware_sim/command/row.h"
#include "firmware_sim/command/site_pose.h"

static const struct {
    const char *name;
    double most; /* of its absolute value */
} parts[6] = {{"x", 1e9}, {"y", 1e9}, {"z", 1e9}, {"roll", 360.0}, {"pitch", 90.0}, {"heading", 360.0}};

/* Reads the number at text, which a comma or the end follows. Returns the place after it; NULL: there is no number. */
static const char *step_pose_take_number(const char *text, double *value)
{
    struct command_decimal decimal;
    text += strspn(text, " \t");
    const char *end = command_parse_decimal(text, &decimal);
    if (end == NULL || (*end != ',' && *end != '\0')) return NULL;
    *value = command_decimal_to_double(&decimal);
    return end;
}

int command_take_pose(struct command_call *call)
{
    const char *p = call->pose, *header = call->row->header;
    if (!call->dev->pose_allowed)
        return command_fail(call, CMD_E_SETTINGS, "a pose in %s needs platform.kind: live", header);
    for (int i = 0; i < 6; i++) {
        double *value = &call->out->pose[i];
        const char *end = step_pose_take_number(p, value);
        if (end == NULL) {
            char clip[COMMAND_CLIP_LEN];
            command_clip(clip, p, strcspn(p, ","));
            return command_fail(call, CMD_E_DATA_TYPE, "%s: %s is not a number: '%s'", header, parts[i].name, clip);
        }
        if (!(fabs(*value) <= parts[i].most))
            return command_fail(call, CMD_E_RANGE, "%s: %s %.9g, allowed %g to %g", header, parts[i].name, *value,
                                -parts[i].most, parts[i].most);
        if ((*end == ',') != (i < 5))
            return command_fail(call, i < 5 ? CMD_E_MISSING : CMD_E_NOT_ALLOWED,
                                "%s takes a time, or a time and x, y, z, roll, pitch, heading", header);
        p = end + 1;
    }
    if (vec3_distance(call->out->pose, call->dev->pose_centre_m) > call->dev->pose_reach_m)
        return command_fail(call, CMD_E_RANGE, "%s: the pose is more than platform.reach_m, %g m, from the station",
                            header, call->dev->pose_reach_m);
    call->out->have_pose = 1;
    return 0;
}
