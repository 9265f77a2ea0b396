/* The ring of slots: its states one by one, then all its threads at once. */
#include "tests/common/cases.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <string.h>

#include "firmware_sim/loop/ring.h"

enum { AHEAD = 6, QUEUE = 4, SLOT_BYTES = 1000 };

static struct ring ring;
static uint8_t buf[2048];

static int open_ring(void **state)
{
    (void)state;
    struct sh_err err;
    return ring_create(&ring, AHEAD, QUEUE, SLOT_BYTES, &err);
}

static int close_ring(void **state)
{
    (void)state;
    ring_free(&ring);
    return 0;
}

static void put(struct ring_slot *slot, const char *text)
{
    memcpy(slot->bytes, text, strlen(text));
    slot->len = (uint32_t)strlen(text);
    slot->n_frames = 1;
}

static void publish(uint64_t tick, const char *text)
{
    struct ring_slot *slot = ring_claim(&ring, tick);
    assert_non_null(slot);
    put(slot, text);
    assert_true(ring_ready(&ring, slot, tick));
    assert_ptr_equal(ring_peek(&ring, tick), slot);
    slot->first_seq = 100 + (uint32_t)tick;
    ring_release(&ring, tick);
}

static enum ring_read read_tick(uint64_t tick, const char *expected)
{
    uint32_t len = 0, n_frames = 0, first_seq = 0;
    enum ring_read result = ring_read(&ring, 3, tick, buf, sizeof buf, &len, &n_frames, &first_seq);
    if (result == RING_READ && expected != NULL) {
        assert_int_equal(len, strlen(expected));
        assert_memory_equal(buf, expected, len);
        assert_int_equal(n_frames, 1);
        assert_int_equal(first_seq, 100 + tick);
    }
    return result;
}

static void a_tick_is_read_once_it_is_released(void **state)
{
    (void)state;
    assert_int_equal(read_tick(0, NULL), RING_NONE);
    assert_null(ring_peek(&ring, 0));
    struct ring_slot *slot = ring_claim(&ring, 0);
    assert_non_null(slot);
    put(slot, "zero");
    slot->first_seq = 100;
    assert_null(ring_peek(&ring, 0));
    assert_int_equal(read_tick(0, NULL), RING_NONE);
    assert_true(ring_ready(&ring, slot, 0));
    assert_ptr_equal(ring_peek(&ring, 0), slot);
    assert_int_equal(read_tick(0, NULL), RING_NONE);
    ring_release(&ring, 0);
    assert_int_equal(read_tick(0, "zero"), RING_READ);
    assert_int_equal(read_tick(0, "zero"), RING_READ); /* by any number of readers */
    assert_int_equal(read_tick(1, NULL), RING_NONE);
}

static void ticks_become_ready_in_any_order(void **state)
{
    (void)state;
    struct ring_slot *zero = ring_claim(&ring, 0), *one = ring_claim(&ring, 1);
    assert_true(zero != NULL && one != NULL && zero != one && zero->bytes != one->bytes);
    put(one, "one");
    assert_true(ring_ready(&ring, one, 1));
    assert_null(ring_peek(&ring, 0));
    put(zero, "zero");
    assert_true(ring_ready(&ring, zero, 0));
    ring_release(&ring, 0);
    assert_int_equal(read_tick(1, NULL), RING_NONE);
    ring_release(&ring, 1);
    one->first_seq = 101;
    assert_int_equal(read_tick(1, "one"), RING_READ);
}

static void only_the_last_ticks_are_kept(void **state)
{
    (void)state;
    for (uint64_t tick = 0; tick < 100; tick++) {
        publish(tick, "text");
        for (uint64_t old = 0; old <= tick; old++)
            assert_int_equal(read_tick(old, "text"), old + QUEUE > tick ? RING_READ : RING_LOST);
    }
    /* what is old but not yet overwritten twice over: a reader has as long again to finish a copy */
    assert_true(ring.n_slots >= AHEAD + 2 * QUEUE);
}

static void a_tick_lost_before_its_claim_is_not_filled(void **state)
{
    (void)state;
    publish(0, "zero");
    assert_true(ring_lose(&ring, 1));
    assert_null(ring_claim(&ring, 1));
    assert_int_equal(read_tick(1, NULL), RING_LOST);
    assert_int_equal(read_tick(2, NULL), RING_NONE);
    publish(2, "two");
    assert_int_equal(read_tick(2, "two"), RING_READ);
}

static void a_tick_lost_while_it_is_filled_is_not_read(void **state)
{
    (void)state;
    struct ring_slot *slot = ring_claim(&ring, 0);
    assert_non_null(slot);
    put(slot, "late");
    assert_true(ring_lose(&ring, 0));
    assert_int_equal(read_tick(0, NULL), RING_LOST);
    assert_true(atomic_load(&slot->busy));
    assert_false(ring_ready(&ring, slot, 0));
    assert_false(atomic_load(&slot->busy));
    assert_null(ring_peek(&ring, 0));
    assert_int_equal(read_tick(0, NULL), RING_LOST);
    for (uint64_t tick = 1; tick <= ring.n_slots; tick++) /* its slot is used again */
        publish(tick, "text");
    assert_int_equal(read_tick(ring.n_slots, "text"), RING_READ);
}

static void a_tick_that_is_ready_is_not_lost(void **state)
{
    (void)state;
    struct ring_slot *slot = ring_claim(&ring, 0);
    assert_non_null(slot);
    put(slot, "zero");
    slot->first_seq = 100;
    assert_true(ring_ready(&ring, slot, 0));
    assert_false(ring_lose(&ring, 0));
    assert_int_equal(read_tick(0, NULL), RING_NONE);
    ring_release(&ring, 0);
    assert_int_equal(read_tick(0, "zero"), RING_READ);
}

static void what_does_not_fit_is_not_copied(void **state)
{
    (void)state;
    publish(0, "0123456789");
    uint32_t len = 0, n_frames = 0, first_seq = 0;
    memset(buf, 'x', sizeof buf);
    assert_int_equal(ring_read(&ring, 0, 0, buf, 9, &len, &n_frames, &first_seq), RING_READ);
    assert_int_equal(len, 10);
    assert_int_equal(buf[0], 'x');
    assert_int_equal(ring_read(&ring, 0, 0, buf, 10, &len, &n_frames, &first_seq), RING_READ);
    assert_memory_equal(buf, "0123456789x", 11);
}

static void a_claimed_slot_is_empty(void **state)
{
    (void)state;
    for (uint64_t tick = 0; tick < 3 * ring.n_slots; tick++) {
        struct ring_slot *slot = ring_claim(&ring, tick);
        assert_non_null(slot);
        assert_true(slot->len == 0 && slot->n_frames == 0 && slot->n_marks == 0 && slot->tail.echoes == 0 &&
                    slot->first_seq == 0);
        assert_true(slot->n_fired == 0 && slot->n_cast == 0 && slot->n_echoes == 0 && slot->n_lines == 0);
        assert_true(slot->n_crowded == 0 && slot->n_faint == 0 && slot->n_unfit == 0 && slot->tail.crowded == 0);
        memset(slot->bytes, 0xff, SLOT_BYTES);
        slot->len = slot->n_frames = slot->n_marks = slot->tail.echoes = 1;
        slot->n_fired = slot->n_cast = slot->n_echoes = slot->n_lines = 1;
        slot->n_crowded = slot->n_faint = slot->n_unfit = slot->tail.crowded = 1;
        assert_true(ring_ready(&ring, slot, tick));
        ring_release(&ring, tick);
    }
}

static _Atomic int claimed;

static void *claim_one(void *arg)
{
    struct ring_slot *slot = ring_claim(&ring, *(uint64_t *)arg);
    atomic_store(&claimed, slot != NULL ? 1 : -1);
    return NULL;
}

/* Starts the claim, lets it run a thousand times as long as it needs, and sees that it waits; then lets go
 * what holds it. */
static void check_claim_waits(uint64_t tick, _Atomic uint64_t *hazard, _Atomic int *busy)
{
    pthread_t thread;
    atomic_store(&claimed, 0);
    assert_int_equal(pthread_create(&thread, NULL, claim_one, &tick), 0);
    for (int i = 0; i < 20000; i++)
        sched_yield();
    int early = atomic_load(&claimed);
    if (hazard != NULL) atomic_store(hazard, 0);
    if (busy != NULL) atomic_store(busy, 0);
    pthread_join(thread, NULL);
    assert_int_equal(early, 0);
    assert_int_equal(atomic_load(&claimed), 1);
}

/* A reader in the middle of a copy, and a caster that still writes for a tick long lost. */
static void a_slot_in_use_is_not_claimed(void **state)
{
    (void)state;
    for (uint64_t tick = 0; tick < ring.n_slots; tick++)
        publish(tick, "text");
    atomic_store(&ring.hazard[5], 0 + 1);
    check_claim_waits(ring.n_slots, &ring.hazard[5], NULL);
    struct ring_slot *slot = ring_peek(&ring, 1);
    assert_non_null(slot);
    atomic_store(&slot->busy, 1);
    check_claim_waits(ring.n_slots + 1, NULL, &slot->busy);
    atomic_store(&ring.hazard[5], 3 + 1); /* of another slot: no reason to wait */
    assert_non_null(ring_claim(&ring, ring.n_slots + 2));
}

/* ---- all threads at once. Two casters fill slots with what only a tick's number tells; the pacing thread
 * releases them, numbers their frames, and gives up what is not ready where the test says so; it waits for
 * two of the readers, as in the pace `fast`, and not for the third. */
enum { TICKS = 120000, CASTERS = 2, READERS = 3, SLOW = 2 };

static struct {
    pthread_mutex_t claim_lock;
    uint64_t next_tick; /* under claim_lock */
    _Atomic uint64_t cursor[READERS];
    _Atomic int done;
    uint8_t head_lost[TICKS]; /* by the pacing thread, before the tick is released */
    _Atomic uint64_t bad;
    uint64_t got[READERS], too_old[READERS], lost_by_head[READERS];
} all;

static uint32_t len_of(uint64_t tick)
{
    return (uint32_t)(tick * 2654435761U % (SLOT_BYTES - 4)) + 4;
}

static uint8_t byte_of(uint64_t tick, uint32_t i)
{
    return (uint8_t)((tick * 131 + i) * 0x9e3779b97f4a7c15ULL >> 56);
}

/* Of these the caster and the pacing thread decide at the same time whether they are lost. */
static int is_raced(uint64_t tick)
{
    return tick % 7 == 3;
}

static void *caster_main(void *arg)
{
    (void)arg;
    for (;;) {
        struct ring_slot *slot = NULL;
        uint64_t tick = TICKS;
        pthread_mutex_lock(&all.claim_lock);
        if (all.next_tick >= TICKS) {
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
        while (is_raced(tick) && atomic_load(&ring.released) < tick)
            sched_yield();
        slot->len = len_of(tick);
        slot->n_frames = 1 + (uint32_t)(tick % 5);
        for (uint32_t i = 0; i < slot->len; i++)
            slot->bytes[i] = byte_of(tick, i);
        ring_ready(&ring, slot, tick);
    }
}

static int readers_have_room(uint64_t tick)
{
    for (int r = 0; r < READERS; r++)
        if (r != SLOW && atomic_load(&all.cursor[r]) + QUEUE <= tick + 1) return 0;
    return 1;
}

static void *pacer_main(void *arg)
{
    uint32_t *seq = arg;
    for (uint64_t tick = 0; tick < TICKS;) {
        struct ring_slot *slot = ring_peek(&ring, tick);
        if (!readers_have_room(tick)) {
            sched_yield();
        } else if (slot != NULL) {
            slot->first_seq = *seq;
            memcpy(slot->bytes, seq, sizeof *seq); /* as frames are sealed */
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
    atomic_store(&all.done, 1);
    return NULL;
}

static int is_whole(uint64_t tick, const uint8_t *bytes, uint32_t len, uint32_t n_frames, uint32_t first_seq)
{
    uint32_t sealed;
    memcpy(&sealed, bytes, sizeof sealed);
    int whole = len == len_of(tick) && n_frames == 1 + tick % 5 && sealed == first_seq;
    for (uint32_t i = 4; i < len && whole; i++)
        whole = bytes[i] == byte_of(tick, i);
    return whole;
}

static void *reader_main(void *arg)
{
    int me = (int)(intptr_t)arg;
    uint8_t bytes[SLOT_BYTES];
    uint32_t next_seq = 0;
    for (uint64_t tick = 0; tick < TICKS;) {
        uint32_t len, n_frames, first_seq;
        switch (ring_read(&ring, me, tick, bytes, sizeof bytes, &len, &n_frames, &first_seq)) {
        case RING_NONE:
            sched_yield();
            continue;
        case RING_LOST:
            if (all.head_lost[tick])
                all.lost_by_head[me]++;
            else
                all.too_old[me]++;
            break;
        case RING_READ:
            all.got[me]++;
            if (!is_whole(tick, bytes, len, n_frames, first_seq) || first_seq < next_seq) atomic_fetch_add(&all.bad, 1);
            if (me != SLOW && first_seq != next_seq) atomic_fetch_add(&all.bad, 1);
            next_seq = first_seq + n_frames;
            for (int i = 0; me == SLOW && i < 20; i++)
                sched_yield();
            break;
        }
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
    uint64_t head_lost = 0;
    for (int i = 0; i < TICKS; i++)
        head_lost += all.head_lost[i];
    print_message("# %u ticks, %u lost by the head; the slow reader got %u\n", (unsigned)TICKS, (unsigned)head_lost,
                  (unsigned)all.got[SLOW]);
    assert_true(atomic_load(&all.bad) == 0);
    for (int i = 0; i < READERS; i++) {
        assert_true(all.got[i] + all.too_old[i] + all.lost_by_head[i] == TICKS);
        assert_true(all.lost_by_head[i] == head_lost);
        if (i != SLOW) assert_true(all.too_old[i] == 0); /* they were waited for */
    }
    assert_true(all.got[SLOW] > 0 && all.too_old[SLOW] > 0);
}

int main(void)
{
#define WITH_RING(test) cmocka_unit_test_setup_teardown(test, open_ring, close_ring)
    const struct CMUnitTest tests[] = {
        WITH_RING(a_tick_is_read_once_it_is_released),
        WITH_RING(ticks_become_ready_in_any_order),
        WITH_RING(only_the_last_ticks_are_kept),
        WITH_RING(a_tick_lost_before_its_claim_is_not_filled),
        WITH_RING(a_tick_lost_while_it_is_filled_is_not_read),
        WITH_RING(a_tick_that_is_ready_is_not_lost),
        WITH_RING(what_does_not_fit_is_not_copied),
        WITH_RING(a_claimed_slot_is_empty),
        WITH_RING(a_slot_in_use_is_not_claimed),
        WITH_RING(no_tick_is_torn_with_all_threads_at_work),
    };
    return cmocka_run_group_tests_name("ring", tests, NULL, NULL);
}
