/* SPDX-License-Identifier: MIT */
#include "firmware_sim/command/head.h"

/* One row per state, one column per event. NO: the event is refused and the state stays. A movement that was
 * given up may still end (SPUN_UP after STOP): that event is refused. FAIL is taken in every state with
 * power. While the mirror turns, RESET brakes it first. During the self test there is nothing to reset yet. */
enum { NO = -1 };

#define OFF  HEAD_OFF
#define BOOT HEAD_BOOT
#define IDLE HEAD_IDLE
#define UP   HEAD_SPIN_UP
#define SCAN HEAD_SCANNING
#define DOWN HEAD_SPIN_DOWN
#define FLT  HEAD_FAULT

/* clang-format off */
static const signed char next_state[HEAD_N_STATES][HEAD_N_EVENTS] = {
    /*                  PON   POFF  BOOTED  START  SPUN_UP  STOP  DONE  SPUN_DOWN  FAIL  RESET */
    [HEAD_OFF]       = {BOOT, OFF,  NO,     NO,    NO,      NO,   NO,   NO,        NO,   NO},
    [HEAD_BOOT]      = {NO,   OFF,  IDLE,   NO,    NO,      NO,   NO,   NO,        FLT,  NO},
    [HEAD_IDLE]      = {NO,   OFF,  NO,     UP,    NO,      NO,   NO,   NO,        FLT,  IDLE},
    [HEAD_SPIN_UP]   = {NO,   OFF,  NO,     NO,    SCAN,    DOWN, NO,   NO,        FLT,  DOWN},
    [HEAD_SCANNING]  = {NO,   OFF,  NO,     NO,    NO,      DOWN, DOWN, NO,        FLT,  DOWN},
    [HEAD_SPIN_DOWN] = {NO,   OFF,  NO,     NO,    NO,      NO,   NO,   IDLE,      FLT,  DOWN},
    [HEAD_FAULT]     = {NO,   OFF,  NO,     NO,    NO,      NO,   NO,   NO,        FLT,  IDLE},
};
/* clang-format on */

static const char *const state_names[HEAD_N_STATES] = {"off",      "boot",      "idle", "spin-up",
                                                       "scanning", "spin-down", "fault"};

int head_next_state(enum head_state state, enum head_event event)
{
    /* The unsigned casts catch negative values too, whatever type the compiler gave the enums. */
    if ((unsigned)state >= HEAD_N_STATES || (unsigned)event >= HEAD_N_EVENTS) return NO;
    return next_state[state][event];
}

const char *head_state_name(enum head_state state)
{
    return (unsigned)state < HEAD_N_STATES ? state_names[state] : "unknown";
}
