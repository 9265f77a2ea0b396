/* SPDX-License-Identifier: MIT */
#include "firmware_sim/command/time_server.h"

#include <stdio.h>
#include <string.h>

#include "firmware_sim/command/call.h"
#include "firmware_sim/command/command.h"
#include "firmware_sim/command/parse.h"
#include "firmware_sim/command/row.h"
#include "firmware_sim/command/setting.h"

static const char *const roles[] = {"NONE", "CLIENT", "SERVER"}, *const interfaces[] = {"ETH", "CAN"};
enum { LONGEST_UPDATE_S = 86400, FARTHEST_H = 12 };

static int fail_recorded(struct command_call *call)
{
    return command_fail(call, CMD_E_SETTINGS, "%s: %s", call->row->header, call->dev->recorded);
}

int command_shift_query(struct command_call *call)
{
    return command_reply(call, "%lld", (long long)call->dev->shift_ns);
}

int command_shift_change(struct command_call *call)
{
    const int64_t most_ns = INT64_C(4600000000000000000); /* 145 years; ntp.h has room for twice as much */
    int64_t shift_ns;
    if (call->dev->recorded != NULL) return fail_recorded(call);
    if (command_value_in_range(call, -most_ns, most_ns, &shift_ns) != 0) return -1;
    call->dev->shift_ns = shift_ns;
    return command_accept(call, COMMAND_CLOCK);
}

static int reply_state(struct command_call *call)
{
    const struct command_time_answers *a = &call->dev->answers;
    return command_reply(call, "%s,%lld,%lld,%lld,%llu,%llu,%llu", a->state != NULL ? a->state : "OFF",
                         (long long)a->max_offset_ns, (long long)a->offset_ns, (long long)a->delay_ns,
                         (unsigned long long)a->good, (unsigned long long)a->refused, (unsigned long long)a->none);
}

int command_server_query(struct command_call *call)
{
    const struct command_time_server *s = &call->dev->server;
    const uint8_t *a = s->address;
    char clip[COMMAND_CLIP_LEN];
    if (command_word_matches("STATe", call->param)) return reply_state(call);
    command_clip(clip, call->param, strlen(call->param));
    if (call->param[0] != '\0')
        return command_fail(call, CMD_E_NOT_ALLOWED, "%s? takes no parameter but STATe, not '%s'", call->row->header,
                            clip);
    return command_reply(call, "%s,%u.%u.%u.%u,%u,%d,%s", roles[s->role], a[0], a[1], a[2], a[3], s->update_s,
                         s->zone_h, interfaces[s->interface]);
}

/* Returns the index of a word; n: it is none of them. */
static uint32_t find_word(const char *const words[], uint32_t n, const char *word)
{
    uint32_t i = 0;
    while (i < n && !command_word_matches(words[i], word))
        i++;
    return i;
}

void command_server_set(struct command_device *dev, const struct command_time_server *server)
{
    const uint32_t n_roles = dev->server.n_roles + (server->role != dev->server.role);
    dev->server = *server;
    dev->server.n_roles = n_roles;
}

int command_server_change(struct command_call *call)
{
    struct command_time_server s = {0};
    unsigned a[4], update_s;
    char role[8], interface[8];
    int end = 0, zone_h;
    const int n = sscanf(call->param, "%7[A-Za-z] , %3u.%3u.%3u.%3u , %6u , %3d , %7[A-Za-z]%n", role, &a[0], &a[1],
                         &a[2], &a[3], &update_s, &zone_h, interface, &end);
    if (n != 8 || call->param[end] != '\0')
        return command_fail(call, CMD_E_DATA_TYPE, "%s takes a role, an address, s, h and an interface, as %s",
                            call->row->header, "CLIENT,127.0.0.1,600,0,ETH");
    s.role = find_word(roles, 3, role);
    s.interface = find_word(interfaces, 2, interface);
    if (s.role == 3 || s.interface == 2 || a[0] > 255 || a[1] > 255 || a[2] > 255 || a[3] > 255 || update_s < 1 ||
        update_s > LONGEST_UPDATE_S || zone_h < -FARTHEST_H || zone_h > FARTHEST_H)
        return command_fail(call, CMD_E_RANGE,
                            "%s: allowed are NONE, CLIENT, SERVER; 0 to 255; 1 to %d s; -%d to %d h; ETH, CAN",
                            call->row->header, LONGEST_UPDATE_S, FARTHEST_H, FARTHEST_H);
    if (call->dev->recorded != NULL) return fail_recorded(call);
    if (s.role == COMMAND_TIME_CLIENT && !call->dev->asks_server && call->session != 0)
        return command_fail(call, CMD_E_SETTINGS, "%s CLIENT needs the pace realtime, and no journal that is replayed",
                            call->row->header);
    for (int i = 0; i < 4; i++)
        s.address[i] = (uint8_t)a[i];
    s.update_s = update_s;
    s.zone_h = zone_h;
    command_server_set(call->dev, &s);
    return command_accept(call, COMMAND_SERVER);
}
