/* SPDX-License-Identifier: MIT */
/* The ring of slots, with all its threads at once. */
#include "core/monotonic.h"
#include "tests/common/cases.h"
#include "tests/common/thorough.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <string.h>

#include "tests/unit/ring_rig.h"

/* Two casters fill slots with contents that depend only on the tick's number. The pacing thread releases them, numbers
 * their frames, and gives up late ones where the test says so. The pacing thread waits for two of the readers, as in
 * the pace `fast`, and not for the slow ones. One of the slow ones reads slots in place. Slots grow all the while. For
 * one tick in seven caster and pacing thread race: 5,700 times, so that an error in one of 1,900 races is seen in 95 of
 * 100 runs.
 *
 * Each wait is a sched_yield(), which takes milliseconds where other processes want both processors. So the run ends
 * early once LONG_S have passed, but not before the slow readers have lost ticks. */
enum { TICKS = SANITIZED ? 20000 : 40000 };
enum { CASTERS = 2, READERS = 4, SLOW = 2, LOOKING = 3, MAX_BYTES = 3 * SLOT_BYTES, LONG_S = 20 };

static struct {
    pthread_mutex_t claim_lock;
    uint64_t next_tick; /* under claim_lock */
    _Atomic uint64_t cursor[READERS];
    _Atomic uint64_t end;     /* ticks of this run */
    uint8_t head_lost[TICKS]; /* marked by the pacing thread, before the tick is released */
    _Atomic uint64_t bad, too_old[READERS];
    uint64_t got[READERS], lost_by_head[READERS];
} all;

static uint32_t len_of(uint64_t tick)
{
    return (uint32_t)(tick * 2654435761U % (MAX_BYTES - 4)) + 4;
}

static uint8_t byte_of(uint64_t tick, uint32_t i)
{
    return (uint8_t)((tick * 131 + i) * 0x9e3779b97f4a7c15ULL >> 56);
}

/* For these the caster and the pacing thread decide at the same time whether they are lost. */
static int is_raced(uint64_t tick)
{
    return tick % 7 == 3;
}

static void *caster_main(void *arg)
{
    (void)arg;
    uint8_t bytes[MAX_BYTES];
    for (;;) {
        struct ring_slot *slot = NULL;
        uint64_t tick = TICKS;
        pthread_mutex_lock(&all.claim_lock);
        if (all.next_tick >= atomic_load(&all.end)) {
            pthread_mutex_unlock(&all.claim_lock);
            return NULL;
        }
        if (all.next_tick < atomic_load(&ring.released) + AHEAD) {
            tick = all.next_tick++;
            slot = ring_claim(&ring, tick);
        }
        pthread_mutex_unlock(&all.claim_lock);
        if (slot == NULL) {
            sched_yield();
            continue;
        }
        while (is_raced(tick) && atomic_load(&ring.released) < tick && tick < atomic_load(&all.end))
            sched_yield();
        struct ring_tick made = {.bytes = bytes, .len = len_of(tick)};
        for (uint32_t i = 0; i < made.len; i++)
            bytes[i] = byte_of(tick, i);
        if (ring_put(slot, &made) != SH_OK) atomic_fetch_add(&all.bad, 1);
        ring_ready(slot, tick);
    }
}

static int readers_have_room(uint64_t tick)
{
    for (int r = 0; r < READERS; r++)
        if (r < SLOW && atomic_load(&all.cursor[r]) + QUEUE <= tick + 1) return 0;
    return 1;
}

static int have_seen_all(void)
{
    for (int r = SLOW; r < READERS; r++)
        if (atomic_load(&all.too_old[r]) == 0) return 0;
    return 1;
}

static void *pacer_main(void *arg)
{
    uint32_t *seq = arg;
    const int64_t long_ns = monotonic_ns() + LONG_S * INT64_C(1000000000);
    for (uint64_t tick = 0; tick < atomic_load(&all.end);) {
        if (have_seen_all() && monotonic_ns() > long_ns) {
            atomic_store(&all.end, tick);
            return NULL;
        }
        struct ring_slot *slot = ring_peek(&ring, tick);
        if (!readers_have_room(tick)) {
            sched_yield();
        } else if (slot != NULL) {
            slot->first_seq = *seq;
            slot->n_frames = 1 + (uint32_t)(tick % 5);
            memcpy(slot->tick.bytes, seq, sizeof *seq); /* as frames are sealed */
            *seq += slot->n_frames;
            ring_release(&ring, tick++);
        } else if (is_raced(tick)) {
            all.head_lost[tick] = 1;
            if (ring_lose(&ring, tick))
                tick++;
            else
                all.head_lost[tick] = 0;
        } else {
            sched_yield();
        }
    }
    return NULL;
}

static int is_whole(uint64_t tick, const struct ring_copy *copy)
{
    uint32_t sealed;
    memcpy(&sealed, copy->buf, sizeof sealed);
    int whole = copy->len == len_of(tick) && copy->n_frames == 1 + tick % 5 && sealed == copy->first_seq;
    for (uint32_t i = 4; i < copy->len && whole; i++)
        whole = copy->buf[i] == byte_of(tick, i);
    return whole;
}

static void *reader_main(void *arg)
{
    int me = (int)(intptr_t)arg;
    uint8_t bytes[MAX_BYTES];
    struct ring_copy copy = {.buf = bytes, .cap = sizeof bytes};
    uint32_t next_seq = 0;
    for (uint64_t tick = 0; tick < atomic_load(&all.end);) {
        const enum ring_read got =
            me == LOOKING ? ring_look(&ring, me, tick, &copy) : ring_read(&ring, me, tick, &copy);
        switch (got) {
        case RING_NONE:
            sched_yield();
            continue;
        case RING_LOST:
            if (all.head_lost[tick])
                all.lost_by_head[me]++;
            else
                atomic_fetch_add(&all.too_old[me], 1);
            break;
        case RING_READ:
            all.got[me]++;
            for (int i = 0; me == LOOKING && i < 20; i++)
                sched_yield();
            if (!is_whole(tick, &copy) || copy.first_seq < next_seq) atomic_fetch_add(&all.bad, 1);
            if (me < SLOW && copy.first_seq != next_seq) atomic_fetch_add(&all.bad, 1);
            next_seq = copy.first_seq + copy.n_frames;
            for (int i = 0; me == SLOW && i < 20; i++)
                sched_yield();
            break;
        }
        ring_leave(&ring, me);
        atomic_store(&all.cursor[me], ++tick);
    }
    return NULL;
}

static void no_tick_is_torn_with_all_threads_at_work(void **state)
{
    (void)state;
    pthread_t caster[CASTERS], pacer, reader[READERS];
    uint32_t seq = 0;
    memset(&all, 0, sizeof all);
    atomic_store(&all.end, TICKS);
    pthread_mutex_init(&all.claim_lock, NULL);
    for (int i = 0; i < READERS; i++)
        assert_int_equal(pthread_create(&reader[i], NULL, reader_main, (void *)(intptr_t)i), 0);
    for (int i = 0; i < CASTERS; i++)
        assert_int_equal(pthread_create(&caster[i], NULL, caster_main, NULL), 0);
    assert_int_equal(pthread_create(&pacer, NULL, pacer_main, &seq), 0);
    for (int i = 0; i < CASTERS; i++)
        pthread_join(caster[i], NULL);
    pthread_join(pacer, NULL);
    for (int i = 0; i < READERS; i++)
        pthread_join(reader[i], NULL);
    pthread_mutex_destroy(&all.claim_lock);
    const uint64_t ticks = atomic_load(&all.end);
    uint64_t head_lost = 0;
    for (uint64_t i = 0; i < ticks; i++)
        head_lost += all.head_lost[i];
    print_message("# %u ticks, %u lost by the head; the slow readers got %u and %u\n", (unsigned)ticks,
                  (unsigned)head_lost, (unsigned)all.got[SLOW], (unsigned)all.got[LOOKING]);
    assert_true(atomic_load(&all.bad) == 0);
    for (int i = 0; i < READERS; i++) {
        assert_true(all.got[i] + all.too_old[i] + all.lost_by_head[i] == ticks);
        assert_true(all.lost_by_head[i] == head_lost);
        if (i < SLOW) assert_true(all.too_old[i] == 0); /* they were waited for */
    }
    for (int i = SLOW; i < READERS; i++)
        assert_true(all.got[i] > 0 && atomic_load(&all.too_old[i]) > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(no_tick_is_torn_with_all_threads_at_work, open_ring, close_ring),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
