/* SPDX-License-Identifier: MIT */
/* SITE:POSE: reports where a station stands, and moves it. Also the pose that TIME:STEP may carry. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "core/vec3.h"
#include "firmware_sim/command/call.h"
#include "firmware_sim/command/command.h"
#include "firmware_sim/command/decimal.h"
#include "firmware_sim/command/parse.h"
#include "firmware_sim/command/row.h"
#include "firmware_sim/command/site_pose.h"

enum { PARTS = 6 };

struct part {
    const char *name, *unit;
    double most; /* of its absolute value */
};
/* The limits are those of a station's keys (stations[] in firmware_sim/config/place_rows.h). */
static const struct part parts[PARTS] = {{"x", "M", 1e9},           {"y", "M", 1e9},      {"z", "M", 1e9},
                                         {"heading", "DEG", 360.0}, {"pitch", "DEG", 90}, {"roll", "DEG", 180.0}};
static const struct part of_step[PARTS] = {{"x", "M", 1e9},        {"y", "M", 1e9},      {"z", "M", 1e9},
                                           {"roll", "DEG", 360.0}, {"pitch", "DEG", 90}, {"heading", "DEG", 360.0}};

static int fail_number(struct command_call *call, const char *name, const char *field)
{
    char clip[COMMAND_CLIP_LEN];
    command_clip(clip, field, strlen(field));
    return command_fail(call, CMD_E_DATA_TYPE, "%s: %s is not a number: '%s'", call->row->header, name, clip);
}

/* 63 characters have room for 17 digits, a sign, a point, an exponent and a unit. */
static int site_pose_take_number(struct command_call *call, const struct part *part, const char *field, size_t len,
                                 double *value)
{
    struct command_decimal decimal;
    if (len >= COMMAND_FIELD_LEN)
        return command_fail(call, CMD_E_RANGE, "%s: %s has %zu characters, allowed up to %d", call->row->header,
                            part->name, len, COMMAND_FIELD_LEN - 1);
    const char *unit = command_parse_decimal(field, &decimal);
    if (unit == NULL) return fail_number(call, part->name, field);
    if (*unit != '\0' && strcasecmp(unit, part->unit) != 0) {
        char clip[COMMAND_CLIP_LEN];
        if (strchr("+-.0123456789", *unit) != NULL) return fail_number(call, part->name, field);
        command_clip(clip, unit, strlen(unit));
        return command_fail(call, CMD_E_SUFFIX, "'%s'; %s of %s takes %s", clip, part->name, call->row->header,
                            part->unit);
    }
    *value = command_decimal_to_double(&decimal) + 0.0; /* without -0 */
    if (fabs(*value) <= part->most) return 0;
    char text[COMMAND_DOUBLE_LEN];
    command_print_double(text, sizeof text, *value);
    return command_fail(call, CMD_E_RANGE, "%s: %s %s, allowed %.10g to %.10g %s", call->row->header, part->name, text,
                        -part->most, part->most, part->unit[0] == 'M' ? "m" : "deg");
}

static int take_station(struct command_call *call, const char *field, size_t len, uint32_t *station)
{
    struct command_decimal decimal;
    int64_t value = 0;
    const uint32_t n = call->dev->limits.n_stations;
    const char *end = len < COMMAND_FIELD_LEN ? command_parse_decimal(field, &decimal) : NULL;
    if (end == NULL || *end != '\0') return fail_number(call, "station", field);
    const int whole = command_decimal_to_int(&decimal, 0, &value) == COMMAND_FIT_EXACT;
    *station = (uint32_t)value;
    if (whole && value >= 1 && value <= n) return 0;
    return command_fail(call, CMD_E_RANGE, "%s: station %.20s, allowed %s1 to %u", call->row->header, field,
                        whole ? "" : "whole numbers ", n);
}

/* Prints the fewest digits that read back as the same number. */
static size_t print_number(char *text, size_t room, double value)
{
    int digits = 15;
    do
        snprintf(text, room, "%.*g", digits, value);
    while (strtod(text, NULL) != value && digits++ < 17);
    return strlen(text);
}

static int reply_place(struct command_call *call, const double v[PARTS])
{
    char text[PARTS * 32];
    size_t len = 0;
    for (int i = 0; i < PARTS; i++) {
        if (i > 0) text[len++] = ',';
        len += print_number(text + len, sizeof text - len, v[i]);
    }
    return command_reply(call, "%s", text);
}

int command_place_query(struct command_call *call)
{
    char field[COMMAND_FIELD_LEN], which[COMMAND_FIELD_LEN];
    double limit[PARTS];
    size_t len, n;
    uint32_t station;
    enum command_value_kind kind = COMMAND_VALUE_NUMBER;
    const char *rest = command_take_field(call->param, field, &len);
    if (len == 0) return command_fail(call, CMD_E_MISSING, "%s? takes a station", call->row->header);
    int fits = 1;
    if (rest != NULL) {
        rest = command_take_field(rest, which, &n);
        fits = rest == NULL && command_parse_special(which, &kind);
    }
    if (!fits)
        return command_fail(call, CMD_E_NOT_ALLOWED, "%s? takes a station, and MIN, MAX or DEF", call->row->header);
    if (take_station(call, field, len, &station) != 0) return -1;
    if (call->dev->place == NULL)
        return command_fail(call, CMD_E_SETTINGS, "%s?: the place is not known", call->row->header);
    if (kind == COMMAND_VALUE_NUMBER) return reply_place(call, call->dev->place[station - 1].v);
    if (kind == COMMAND_VALUE_DEF) return reply_place(call, call->dev->first_place[station - 1].v);
    for (int i = 0; i < PARTS; i++)
        limit[i] = kind == COMMAND_VALUE_MIN ? -parts[i].most : parts[i].most;
    return reply_place(call, limit);
}

/* Reads station and place into call->out; returns -1 when it failed. */
static int take_parameters(struct command_call *call)
{
    struct command_result *out = call->out;
    enum command_value_kind kind;
    char field[COMMAND_FIELD_LEN];
    size_t len;
    const char *rest = command_take_field(call->param, field, &len);
    if (take_station(call, field, len, &out->station) != 0) return -1;
    for (int i = 0; i < PARTS; i++) {
        if (rest == NULL)
            return command_fail(call, CMD_E_MISSING, "%s takes station, x, y, z, heading, pitch, roll; %s is missing",
                                call->row->header, parts[i].name);
        rest = command_take_field(rest, field, &len);
        if (i == 0 && command_parse_special(field, &kind)) {
            if (kind != COMMAND_VALUE_DEF)
                return command_fail(call, CMD_E_DATA_TYPE, "%s: a place is six numbers or DEF, not '%.10s'",
                                    call->row->header, field);
            out->to_first = 1;
            break;
        }
        if (site_pose_take_number(call, &parts[i], field, len, &out->place.v[i]) != 0) return -1;
    }
    if (rest == NULL) return 0;
    return command_fail(call, CMD_E_NOT_ALLOWED, "%s takes station, x, y, z, heading, pitch, roll, or station, DEF",
                        call->row->header);
}

int command_place_change(struct command_call *call)
{
    const struct command_device *dev = call->dev;
    const char *header = call->row->header;
    if (take_parameters(call) != 0) return -1;
    const uint32_t station = call->out->station;
    if (dev->fixed != NULL) return command_fail(call, CMD_E_SETTINGS, "%s: %.90s", header, dev->fixed);
    if (head_is_elsewhere(&dev->limits, station))
        return command_fail(call, CMD_E_SETTINGS, "%s: station %u has another scanner", header, station);
    if (dev->state != HEAD_IDLE)
        return command_fail(call, CMD_E_SETTINGS, "%s is not possible in state %s", header,
                            head_state_name(dev->state));
    if (dev->moving != 0)
        return command_fail(call, CMD_E_SETTINGS, "%s: station %u is being moved", header, dev->moving);
    return command_accept(call, COMMAND_MOVE);
}

int command_take_pose(struct command_call *call)
{
    const char *header = call->row->header, *rest = call->pose;
    struct command_result *out = call->out;
    char field[COMMAND_FIELD_LEN];
    size_t len;
    if (!call->dev->pose_allowed)
        return command_fail(call, CMD_E_SETTINGS, "a pose in %s needs platform.kind: live", header);
    if (call->dev->poses_replayed)
        return command_fail(call, CMD_E_SETTINGS, "%s: a journal with poses is being replayed; allowed is a time alone",
                            header);
    for (int i = 0; i < PARTS && rest != NULL; i++) {
        rest = command_take_field(rest, field, &len);
        if (site_pose_take_number(call, &of_step[i], field, len, &out->pose[i]) != 0) return -1;
        if ((rest != NULL) != (i + 1 < PARTS))
            return command_fail(call, rest == NULL ? CMD_E_MISSING : CMD_E_NOT_ALLOWED,
                                "%s takes a time, or a time and x, y, z, roll, pitch, heading", header);
    }
    if (vec3_distance(out->pose, call->dev->pose_centre_m) > call->dev->pose_reach_m)
        return command_fail(call, CMD_E_RANGE, "%s: the pose is more than platform.reach_m, %g m, from the station",
                            header, call->dev->pose_reach_m);
    out->have_pose = 1;
    return 0;
}
