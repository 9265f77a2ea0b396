/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/player.h"

#include <string.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/loop_inside.h"

static int may_make(const struct loop *loop)
{
    const uint64_t next = loop->player.next_tick;
    if (next >= stream_released(&loop->stream) + loop->casters.ahead_ticks) return 0;
    return loop->cfg->loop.pace != PACE_STEP || next < atomic_load(&loop->stream.granted);
}

/* Puts the frames into the tick's slot. 0: the tick was given up meanwhile, or the slot has no room. Without room the
 * tick goes out empty: in the paces that wait, nobody would give it up. */
static int player_put(struct loop *loop, const struct ring_tick *tick, uint64_t number)
{
    struct ring_slot *slot = ring_claim(&loop->stream.ring, number);
    if (slot == NULL) return 0;
    if (ring_put(slot, tick) != SH_OK) {
        source_report(&loop->source, CMD_E_PULSES, "no memory for a tick");
        ring_ready(slot, number);
        return 0;
    }
    return ring_ready(slot, number);
}

/* In the paces that wait, the pacing thread is notified once per batch, as by casters. */
static void say_made(struct loop *loop, uint64_t *unsaid, uint64_t most)
{
    if (!loop->stream.waits || *unsaid < most) return;
    if (*unsaid != 0) stream_say_ready(&loop->stream);
    *unsaid = 0;
}

static void *player_main(void *arg)
{
    struct loop *loop = arg;
    struct player *player = &loop->player;
    struct ring_tick tick;
    uint64_t unsaid = 0;
    int again = 0;
    while (!atomic_load(&loop->stopping)) {
        enum loop_source_tick got = LOOP_SOURCE_IDLE;
        if (may_make(loop))
            got = loop->source.ops->next(loop->source.self, player->next_tick, loop->cfg->loop.pace == PACE_FAST, again,
                                         &tick);
        if (got == LOOP_SOURCE_OVER) break;
        if (got == LOOP_SOURCE_IDLE) {
            say_made(loop, &unsaid, 0);
            stream_wait_for_work(&loop->stream);
            continue;
        }
        again = !player_put(loop, &tick, player->next_tick);
        if (!loop->stream.waits) stream_say_late(&loop->stream, player->next_tick);
        player->next_tick++;
        if (again) atomic_fetch_add(&loop->stream.counters->late_blocks, 1);
        unsaid++;
        say_made(loop, &unsaid, loop->casters.ahead_ticks / 2 + 1);
    }
    atomic_store(&loop->final_tick, player->next_tick);
    stream_poke(&loop->stream);
    return NULL;
}

int player_start(struct loop *loop, struct sh_err *err)
{
    const int e = pthread_create(&loop->player.thread, NULL, player_main, loop);
    if (e != 0) return sh_fail(err, SH_EIO, "loop: no thread for the recording: %s", strerror(e));
    loop->player.running = 1;
    return SH_OK;
}

void player_join(struct loop *loop)
{
    if (loop->player.running) pthread_join(loop->player.thread, NULL);
    loop->player.running = 0;
}
