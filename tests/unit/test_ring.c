/* SPDX-License-Identifier: MIT */
/* The ring of slots: its states one by one. */
#include "tests/common/cases.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "tests/unit/ring_rig.h"

static uint8_t buf[2048];

static void put(struct ring_slot *slot, const char *text)
{
    char bytes[64];
    snprintf(bytes, sizeof bytes, "%s", text);
    struct ring_tick tick = {.bytes = (uint8_t *)bytes, .len = (uint32_t)strlen(text)};
    assert_int_equal(ring_put(slot, &tick), SH_OK);
}

static void publish(uint64_t tick, const char *text)
{
    struct ring_slot *slot = ring_claim(&ring, tick);
    assert_non_null(slot);
    put(slot, text);
    assert_true(ring_ready(slot, tick));
    assert_ptr_equal(ring_peek(&ring, tick), slot);
    slot->first_seq = 100 + (uint32_t)tick;
    slot->n_frames = 1;
    ring_release(&ring, tick);
}

static enum ring_read read_tick(uint64_t tick, const char *expected)
{
    struct ring_copy copy = {.buf = buf, .cap = sizeof buf};
    enum ring_read result = ring_read(&ring, 3, tick, &copy);
    if (result == RING_READ && expected != NULL) {
        assert_int_equal(copy.len, strlen(expected));
        assert_memory_equal(buf, expected, copy.len);
        assert_int_equal(copy.n_frames, 1);
        assert_int_equal(copy.first_seq, 100 + tick);
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
    slot->n_frames = 1;
    assert_null(ring_peek(&ring, 0));
    assert_int_equal(read_tick(0, NULL), RING_NONE);
    assert_true(ring_ready(slot, 0));
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
    assert_true(zero != NULL && one != NULL && zero != one && zero->store != one->store);
    put(one, "one");
    assert_true(ring_ready(one, 1));
    assert_null(ring_peek(&ring, 0));
    put(zero, "zero");
    assert_true(ring_ready(zero, 0));
    ring_release(&ring, 0);
    assert_int_equal(read_tick(1, NULL), RING_NONE);
    ring_release(&ring, 1);
    one->first_seq = 101;
    one->n_frames = 1;
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
    /* Old ticks are still in their slots for a while, and a reader may take so long to finish a copy. */
    assert_true(ring.n_slots >= AHEAD + QUEUE + SPARE);
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
    assert_false(ring_ready(slot, 0));
    assert_false(atomic_load(&slot->busy));
    assert_null(ring_peek(&ring, 0));
    assert_int_equal(read_tick(0, NULL), RING_LOST);
    for (uint64_t tick = 1; tick <= ring.n_slots; tick++) /* its slot is used again */
        publish(tick, "text");
    assert_int_equal(read_tick(ring.n_slots, "text"), RING_READ);
}

/* Casters are so late that the ring has come round: the slot of their tick says that a later tick is lost. If they
 * filled the slot, that later tick would be neither released nor lost. */
static void a_tick_lost_a_round_ago_is_not_filled(void **state)
{
    (void)state;
    const uint64_t late = 2 * ring.n_slots + 3;
    for (uint64_t tick = 0; tick < late; tick++)
        assert_true(ring_lose(&ring, tick));
    for (uint64_t tick = 0; tick < late; tick++)
        assert_null(ring_claim(&ring, tick));
    publish(late, "text"); /* and the next one is whole */
    assert_int_equal(read_tick(late, NULL), RING_READ);
}

/* The same for a tick that a caster is filling. */
static void a_tick_lost_a_round_ago_is_not_ready(void **state)
{
    (void)state;
    struct ring_slot *slot = ring_claim(&ring, 0);
    assert_non_null(slot);
    for (uint64_t tick = 0; tick <= ring.n_slots; tick++)
        assert_true(ring_lose(&ring, tick));
    put(slot, "late");
    assert_false(ring_ready(slot, 0));
    assert_null(ring_peek(&ring, 0));
    assert_null(ring_claim(&ring, ring.n_slots));
}

static void a_tick_that_is_ready_is_not_lost(void **state)
{
    (void)state;
    struct ring_slot *slot = ring_claim(&ring, 0);
    assert_non_null(slot);
    put(slot, "zero");
    slot->first_seq = 100;
    slot->n_frames = 1;
    assert_true(ring_ready(slot, 0));
    assert_false(ring_lose(&ring, 0));
    assert_int_equal(read_tick(0, NULL), RING_NONE);
    ring_release(&ring, 0);
    assert_int_equal(read_tick(0, "zero"), RING_READ);
}

static void what_does_not_fit_is_not_copied(void **state)
{
    (void)state;
    publish(0, "0123456789");
    struct ring_copy copy = {.buf = buf, .cap = 9};
    memset(buf, 'x', sizeof buf);
    assert_int_equal(ring_read(&ring, 0, 0, &copy), RING_READ);
    assert_int_equal(copy.len, 10);
    assert_int_equal(buf[0], 'x');
    copy.cap = 10;
    assert_int_equal(ring_read(&ring, 0, 0, &copy), RING_READ);
    assert_memory_equal(buf, "0123456789x", 11);
}

static void a_claimed_slot_is_empty(void **state)
{
    (void)state;
    static const struct ring_tick none;
    static struct ring_mark mark[1];
    struct ring_tick full = {.bytes = buf, .len = SLOT_BYTES, .broken = 1, .mark = mark, .n_marks = 1};
    full.n_fired = full.n_cast = full.n_lines = 1;
    full.hits = full.tail = (struct ring_hits){1, 1, 1, 1, 1, 1};
    for (uint64_t tick = 0; tick < 3 * ring.n_slots; tick++) {
        struct ring_slot *slot = ring_claim(&ring, tick);
        assert_non_null(slot);
        assert_memory_equal(&slot->tick, &none, sizeof none);
        assert_true(slot->n_frames == 0 && slot->first_seq == 0);
        assert_int_equal(ring_put(slot, &full), SH_OK);
        slot->n_frames = slot->first_seq = 1;
        assert_true(ring_ready(slot, tick));
        ring_release(&ring, tick);
    }
}

static uint64_t longer_slots(void)
{
    uint64_t n = 0;
    for (uint64_t i = 0; i < ring.n_slots; i++)
        n += ring.slot[i].longer != NULL;
    return n;
}

/* The size of a ring follows its contents: room for usual ticks, and for longer ones while they are in it. */
static void a_slot_is_as_long_as_its_tick(void **state)
{
    (void)state;
    enum { LONG = 40 * SLOT_BYTES };
    static uint8_t text[LONG], got[LONG];
    static struct ring_mark mark[2];
    assert_in_range(ring.slot[0].store_room, SLOT_BYTES, SLOT_BYTES + 1024);
    for (uint32_t i = 0; i < LONG; i++)
        text[i] = (uint8_t)(i * 2654435761U >> 24);
    mark[0].frame_at = 7;
    mark[1].frame_at = LONG - 1;
    for (uint64_t tick = 0; tick < 3 * ring.n_slots; tick++) {
        /* Lengths are odd, as marks are aligned by themselves. */
        const int is_long = tick / ring.n_slots == 1; /* the second round */
        struct ring_tick made = {.bytes = text, .len = is_long ? LONG - 1 : 3, .mark = mark, .n_marks = 2};
        struct ring_slot *slot = ring_claim(&ring, tick);
        const uint64_t before = longer_slots();
        assert_int_equal(ring_put(slot, &made), SH_OK);
        assert_int_equal(longer_slots(), is_long ? before + 1 : tick < ring.n_slots ? 0 : before - 1);
        assert_memory_equal(slot->tick.mark, mark, sizeof mark);
        assert_true(ring_ready(slot, tick));
        ring_release(&ring, tick);
        struct ring_copy copy = {.buf = got, .cap = LONG};
        assert_int_equal(ring_read(&ring, 0, tick, &copy), RING_READ);
        assert_int_equal(copy.len, made.len);
        assert_memory_equal(got, text, copy.len);
    }
    assert_int_equal(longer_slots(), 0);
}

/* A tick that is written in place keeps its bytes and marks while its room grows, from nothing on. */
static void a_tick_grows_in_its_slot(void **state)
{
    (void)state;
    enum { STEPS = 200 };
    static struct ring_mark mark[3] = {{.frame_at = 1}, {.frame_at = 2}, {.frame_at = 3}};
    struct ring_slot own = {0}; /* a slot without a store */
    struct ring_slot *const slots[] = {ring_claim(&ring, 0), &own};
    for (int i = 0; i < 2; i++) {
        struct ring_tick *tick = &slots[i]->tick;
        ring_begin(slots[i]);
        tick->mark = mark;
        tick->n_marks = 3;
        for (uint32_t step = 1; step <= STEPS; step++) {
            size_t room;
            assert_int_equal(ring_grow(slots[i], step, &room), SH_OK);
            assert_true(room >= step);
            memset(tick->bytes + tick->len, (int)step, step);
            tick->len += step;
        }
        assert_int_equal(ring_end(slots[i]), SH_OK);
        assert_true(slots[i]->longer != NULL && slots[i]->longer_room < tick->len + sizeof mark + 2048);
        assert_memory_equal(tick->mark, mark, sizeof mark);
        for (uint32_t step = 1, at = 0; step <= STEPS; at += step++)
            assert_true(tick->bytes[at] == (uint8_t)step && tick->bytes[at + step - 1] == (uint8_t)step);
    }
    free(own.longer);
}

/* The tick is then released without frames, and says that its line has a gap. The next one that fits is whole. */
static void without_memory_a_tick_is_empty(void **state)
{
    (void)state;
#ifdef SH_SANITIZE
    skip(); /* a sanitizer's allocator stops the program instead */
#endif
    enum { TOO_LONG = 1 << 28 };
    struct rlimit was, now, kept;
    struct ring_tick made = {.bytes = calloc(1, TOO_LONG), .len = TOO_LONG, .n_cast = 5};
    assert_non_null(made.bytes);
    struct ring_slot *slot = ring_claim(&ring, 0);
    assert_int_equal(getrlimit(RLIMIT_AS, &was), 0);
    now = (struct rlimit){.rlim_cur = TOO_LONG, .rlim_max = was.rlim_max}; /* less than there is already */
    assert_int_equal(setrlimit(RLIMIT_AS, &now), 0);
    assert_int_equal(getrlimit(RLIMIT_AS, &kept), 0);
    if (kept.rlim_cur != now.rlim_cur) { /* QEMU's user mode has this limit for itself */
        free(made.bytes);
        skip();
    }
    int rc = ring_put(slot, &made);
    assert_int_equal(setrlimit(RLIMIT_AS, &was), 0);
    free(made.bytes);
    assert_int_equal(rc, SH_ENOMEM);
    assert_true(slot->tick.broken && slot->tick.len == 0 && slot->tick.n_cast == 0 && slot->tick.n_marks == 0);
    assert_true(ring_ready(slot, 0));
    slot->first_seq = 100;
    ring_release(&ring, 0);
    struct ring_copy copy = {.buf = buf, .cap = sizeof buf};
    assert_int_equal(ring_read(&ring, 0, 0, &copy), RING_READ);
    assert_true(copy.len == 0 && copy.n_frames == 0 && copy.first_seq == 100);
    for (uint64_t tick = 1; tick <= ring.n_slots; tick++)
        publish(tick, "text");
    assert_int_equal(read_tick(ring.n_slots, "text"), RING_READ);
}

static _Atomic int claimed;
static _Atomic int64_t begun_ns; /* processor time of the thread when it began its claim */

static int64_t ran_ns(clockid_t processor)
{
    struct timespec t;
    assert_int_equal(clock_gettime(processor, &t), 0);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

static void *claim_one(void *arg)
{
    atomic_store(&begun_ns, ran_ns(CLOCK_THREAD_CPUTIME_ID));
    struct ring_slot *slot = ring_claim(&ring, *(uint64_t *)arg);
    atomic_store(&claimed, slot != NULL ? 1 : -1);
    return NULL;
}

/* Starts the claim, lets it have a hundred times the processor time that it needs, and sees that it waits. Then the
 * check releases the hold. */
static void check_claim_waits(uint64_t tick, _Atomic uint64_t *hazard, _Atomic int *busy)
{
    enum { ENOUGH_NS = 100000 };
    pthread_t thread;
    clockid_t processor;
    atomic_store(&claimed, 0);
    atomic_store(&begun_ns, 0);
    assert_int_equal(pthread_create(&thread, NULL, claim_one, &tick), 0);
    assert_int_equal(pthread_getcpuclockid(thread, &processor), 0);
    while (begun_ns == 0 || (claimed == 0 && ran_ns(processor) < begun_ns + ENOUGH_NS))
        sched_yield();
    int early = atomic_load(&claimed);
    if (hazard != NULL) atomic_store(hazard, 0);
    if (busy != NULL) atomic_store(busy, 0);
    pthread_join(thread, NULL);
    assert_int_equal(early, 0);
    assert_int_equal(atomic_load(&claimed), 1);
}

/* A reader is in the middle of a copy, and a caster still writes for a tick long lost. */
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

/* Each count is added to the same count of the sum. */
static void hits_add_up(void **state)
{
    const struct ring_hits a = {1, 20, 300, 4000, 50000, 600000}, b = {2, 30, 400, 5000, 60000, 700000};
    struct ring_hits sum = {0};
    (void)state;
    ring_hits_add(&sum, &a);
    ring_hits_add(&sum, &b);
    assert_true(sum.echoes == 3 && sum.empty == 50 && sum.crowded == 700 && sum.faint == 9000);
    assert_true(sum.unfit == 110000 && sum.lost_samples == 1300000);
}

int main(void)
{
#define WITH_RING(test) cmocka_unit_test_setup_teardown(test, open_ring, close_ring)
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(hits_add_up),
        WITH_RING(a_tick_is_read_once_it_is_released),
        WITH_RING(ticks_become_ready_in_any_order),
        WITH_RING(only_the_last_ticks_are_kept),
        WITH_RING(a_tick_lost_before_its_claim_is_not_filled),
        WITH_RING(a_tick_lost_while_it_is_filled_is_not_read),
        WITH_RING(a_tick_lost_a_round_ago_is_not_filled),
        WITH_RING(a_tick_lost_a_round_ago_is_not_ready),
        WITH_RING(a_tick_that_is_ready_is_not_lost),
        WITH_RING(what_does_not_fit_is_not_copied),
        WITH_RING(a_claimed_slot_is_empty),
        WITH_RING(a_slot_is_as_long_as_its_tick),
        WITH_RING(a_tick_grows_in_its_slot),
        WITH_RING(without_memory_a_tick_is_empty),
        WITH_RING(a_slot_in_use_is_not_claimed),
    };
    return cmocka_run_group_tests_name("ring", tests, NULL, NULL);
}
