/* SPDX-License-Identifier: MIT */
#include "firmware_sim/config/load.h"
#include "firmware_sim/device/fault_desk.h"

#include <stdio.h>
#include <string.h>

const char *fault_desk_why_not(const struct fault *fault)
{
    return fault_place_of(fault->kind) == FAULT_AT_MOMENT
               ? "it is a fault in the head, but a recording has no head; allowed are faults on the wire and of links"
               : NULL;
}

static int add_fault(void *owner, const char *text, uint32_t *number, char *why, size_t len)
{
    const struct fault_desk *desk = owner;
    struct fault fault;
    struct sh_err err;
    int rc = config_read_fault(desk->cfg, text, &fault, &err);
    if (rc == SH_OK && desk->no_head && fault_desk_why_not(&fault) != NULL)
        rc = sh_fail(&err, SH_EINPUT, "%s: %s", fault_names[fault.kind], fault_desk_why_not(&fault));
    if (rc == SH_OK) rc = fault_board_add(desk->board, &fault, desk->now_ns, number, &err);
    if (rc == SH_OK) return 0;
    snprintf(why, len, "%s", err.text);
    return -1;
}

static uint32_t remove_fault(void *owner, uint32_t number)
{
    const struct fault_desk *desk = owner;
    return fault_board_end(desk->board, number, desk->now_ns);
}

static int count_injected(void *owner, uint32_t number, uint64_t *n)
{
    struct fault_board *board = ((struct fault_desk *)owner)->board;
    *n = fault_board_injected(board, number);
    return number <= fault_board_last(board) ? 0 : -1;
}

static void list_faults(void *owner, char *text, size_t len)
{
    struct fault_entry entry[FAULT_MAX];
    uint32_t n, i = 0;
    size_t used = 0;
    text[0] = '\0';
    fault_board_copy(((struct fault_desk *)owner)->board, entry, &n);
    for (; i < n; i++) {
        char one[64];
        const size_t size = (size_t)snprintf(one, sizeof one, "%s%u %s", i > 0 ? ", " : "", entry[i].number,
                                             fault_names[entry[i].fault.kind]);
        if (used + size + sizeof ", and 32 more" > len) break;
        memcpy(text + used, one, size + 1);
        used += size;
    }
    if (i < n) snprintf(text + used, len - used, ", and %u more", n - i);
}

static int add_none(void *owner, const char *text, uint32_t *number, char *why, size_t len)
{
    (void)owner, (void)text, (void)why, (void)len;
    *number = 0;
    return 0;
}

static uint32_t remove_none(void *owner, uint32_t number)
{
    (void)owner;
    return number;
}

const struct command_faults fault_desk_commands = {add_fault, remove_fault, count_injected, list_faults};
const struct command_faults fault_desk_queries = {add_none, remove_none, count_injected, list_faults};
