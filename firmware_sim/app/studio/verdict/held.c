/* SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/app/studio/verdict/held.h"

/* States of /proc/net/tcp (tcp_states.h of Linux): the client's end is open, or it has only not closed yet. */
enum { STATE_ESTABLISHED = 1, STATE_CLOSE_WAIT = 8 };

static int is_held(unsigned port)
{
    FILE *table = fopen("/proc/net/tcp", "r");
    char line[256];
    int held = 0;
    while (table != NULL && !held && fgets(line, sizeof line, table) != NULL) {
        unsigned local, state;
        if (sscanf(line, " %*u: %*8x:%4x %*8x:%*4x %2x", &local, &state) == 2)
            held = local == port && (state == STATE_ESTABLISHED || state == STATE_CLOSE_WAIT);
    }
    if (table != NULL) fclose(table);
    return held;
}

int held_any(struct watch *watch)
{
    int held = 0;
    pthread_mutex_lock(&watch->lock);
    for (size_t i = 0; i < watch->n_broken && !held; i++) {
        const char *port = strrchr(watch->broken[i].peer, ':');
        if (watch->broken[i].back_ns == 0 && port != NULL) held = is_held((unsigned)strtoul(port + 1, NULL, 10));
    }
    pthread_mutex_unlock(&watch->lock);
    return held;
}
