/* SPDX-License-Identifier: MIT */
#include "firmware_sim/command/scan_replay.h"

#include <math.h>
#include <string.h>

#include "firmware_sim/command/call.h"
#include "firmware_sim/command/command.h"
#include "firmware_sim/command/decimal.h"
#include "firmware_sim/command/parse.h"
#include "firmware_sim/command/row.h"

static const double SLOWEST = 0.01, FASTEST = 1000.0;
static const double LONGEST_S = 1e9; /* of a recording whose length is not known */

/* Cuts a time of whole ns to the digits of a reply. If the length were rounded up, a client that sends it back as the
 * time of a seek would be refused: it would be beyond the end. */
static double whole_us(double s)
{
    return 1e-6 * (double)(llround(1e9 * s) / 1000);
}

int command_replay_query(struct command_call *call)
{
    const struct command_replay *r = &call->dev->replay;
    if (call->param[0] != '\0')
        return command_fail(call, CMD_E_NOT_ALLOWED, "%s? takes no parameter", call->row->header);
    if (!r->is_there) return command_reply(call, "NONE");
    return command_reply(call, "%s,%.6f,%.6f,%.10g,%s", r->plays ? "PLAYING" : "IDLE", whole_us(r->position_s),
                         whole_us(r->length_s), r->speed, r->loop ? "ON" : "OFF");
}

/* Reads a number of at least 0. An empty field leaves the value. */
static int take_number(struct command_call *call, const char *name, const char *field, double most, double *value)
{
    struct command_decimal decimal;
    char clip[COMMAND_CLIP_LEN];
    if (field[0] == '\0') return 0;
    const char *end = command_parse_decimal(field, &decimal);
    command_clip(clip, field, strlen(field));
    if (end == NULL || *end != '\0')
        return command_fail(call, CMD_E_DATA_TYPE, "%s: the %s is not a number: '%s'", call->row->header, name, clip);
    *value = command_decimal_to_double(&decimal);
    if (*value >= 0.0 && *value <= most) return 0;
    return command_fail(call, CMD_E_RANGE, "%s: %s %s, allowed 0 to %.10g", call->row->header, name, clip, most);
}

static int check_speed(struct command_call *call, double speed)
{
    const struct command_replay *r = &call->dev->replay;
    if (speed < 0.0 || speed == r->speed) return 0;
    if (r->fixed_speed != NULL)
        return command_fail(call, CMD_E_SETTINGS, "%s: the speed is 1: %s", call->row->header, r->fixed_speed);
    if (speed == 0.0 || speed >= SLOWEST) return 0;
    return command_fail(call, CMD_E_RANGE, "%s: speed %.10g, allowed 0 (it pauses) and %.10g to %.10g",
                        call->row->header, speed, SLOWEST, FASTEST);
}

static int take_loop(struct command_call *call, const char *field, int *loop)
{
    char clip[COMMAND_CLIP_LEN];
    if (field[0] == '\0') return 0;
    *loop = command_word_matches("ON", field);
    if (*loop || command_word_matches("OFF", field)) return 0;
    command_clip(clip, field, strlen(field));
    return command_fail(call, CMD_E_DATA_TYPE, "%s: the loop is ON or OFF, not '%s'", call->row->header, clip);
}

int command_replay_change(struct command_call *call)
{
    const struct command_replay *r = &call->dev->replay;
    struct command_replay_change to = {-1.0, -1.0, -1};
    char field[3][COMMAND_FIELD_LEN] = {"", "", ""};
    const char *rest = call->param;
    for (int i = 0; i < 3 && rest != NULL; i++) {
        size_t len;
        rest = command_take_field(rest, field[i], &len);
        if (len >= COMMAND_FIELD_LEN)
            return command_fail(call, CMD_E_RANGE, "%s: a value has %zu characters, allowed up to %d",
                                call->row->header, len, COMMAND_FIELD_LEN - 1);
    }
    if (rest != NULL)
        return command_fail(call, CMD_E_NOT_ALLOWED, "%s takes a time, a speed, and ON or OFF", call->row->header);
    const double most_s = r->length_s > 0.0 ? r->length_s : LONGEST_S;
    if (take_number(call, "time", field[0], most_s, &to.position_s) != 0 ||
        take_number(call, "speed", field[1], FASTEST, &to.speed) != 0 || take_loop(call, field[2], &to.loop) != 0)
        return -1;
    if (!r->is_there)
        return command_fail(call, CMD_E_SETTINGS, "%s needs a recording that is replayed", call->row->header);
    if (check_speed(call, to.speed) != 0) return -1;
    call->out->replay = to;
    return command_accept(call, COMMAND_REPLAY);
}
