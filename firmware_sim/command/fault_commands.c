/* SPDX-License-Identifier: MIT */
/* FAULt: the command lines for injected faults. The owner of the faults parses and stores them. */
#include <stdio.h>
#include <string.h>

#include "firmware_sim/command/call.h"
#include "firmware_sim/command/command.h"
#include "firmware_sim/command/decimal.h"
#include "firmware_sim/command/error_queue.h"
#include "firmware_sim/command/fault_commands.h"
#include "firmware_sim/command/parse.h"
#include "firmware_sim/command/row.h"

static int fail_no_faults(struct command_call *call)
{
    return command_fail(call, CMD_E_SETTINGS, "%s: this head has no faults", call->row->header);
}

int command_fault_add(struct command_call *call)
{
    struct command_device *dev = call->dev;
    char why[COMMAND_TEXT_LEN];
    uint32_t number;
    if (dev->faults == NULL) return fail_no_faults(call);
    if (call->param[0] != '{')
        return command_fail(call, CMD_E_DATA_TYPE, "%s takes a fault as {kind: drop, every: 10}", call->row->header);
    if (dev->faults->add(dev->faults_owner, call->param, &number, why, sizeof why) != 0)
        return command_fail(call, CMD_E_RANGE, "%s", why);
    call->out->effect = COMMAND_FAULTS;
    return command_reply(call, "%u", number);
}

/* Parses a fault's number, or ALL (0). No parameter means ALL. Returns -1 when it failed. */
static int fault_commands_take_number(struct command_call *call, int64_t *number)
{
    struct command_decimal decimal;
    char clip[COMMAND_CLIP_LEN];
    *number = 0;
    if (call->param[0] == '\0' || command_word_matches("ALL", call->param)) return 0;
    const char *rest = command_parse_decimal(call->param, &decimal);
    if (rest != NULL && *rest == '\0' && command_decimal_to_int(&decimal, 0, number) == COMMAND_FIT_EXACT &&
        *number >= 1 && *number <= UINT32_MAX)
        return 0;
    command_clip(clip, call->param, strlen(call->param));
    return command_fail(call, CMD_E_DATA_TYPE, "%s takes the number of a fault or ALL, not '%s'", call->row->header,
                        clip);
}

static int fail_no_such_fault(struct command_call *call, int64_t number)
{
    return command_fail(call, CMD_E_RANGE, "%s: there is no fault %u; FAULt:LIST? lists the faults", call->row->header,
                        (uint32_t)number);
}

int command_fault_clear(struct command_call *call)
{
    struct command_device *dev = call->dev;
    int64_t number;
    if (dev->faults == NULL) return fail_no_faults(call);
    if (fault_commands_take_number(call, &number) != 0) return -1;
    if (dev->faults->remove(dev->faults_owner, (uint32_t)number) == 0 && number != 0)
        return fail_no_such_fault(call, number);
    return command_accept(call, COMMAND_FAULTS);
}

int command_fault_injected(struct command_call *call)
{
    struct command_device *dev = call->dev;
    int64_t number;
    uint64_t n;
    if (dev->faults == NULL) return fail_no_faults(call);
    if (fault_commands_take_number(call, &number) != 0) return -1;
    if (dev->faults->injected(dev->faults_owner, (uint32_t)number, &n) != 0) return fail_no_such_fault(call, number);
    return command_reply(call, "%llu", (unsigned long long)n);
}

int command_fault_list(struct command_call *call)
{
    struct command_device *dev = call->dev;
    char text[COMMAND_MAX_REPLY];
    if (dev->faults == NULL) return fail_no_faults(call);
    dev->faults->list(dev->faults_owner, text, sizeof text);
    return command_reply(call, "%s", text[0] != '\0' ? text : "none");
}
