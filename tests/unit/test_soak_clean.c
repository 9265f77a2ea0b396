/* SPDX-License-Identifier: MIT */
/* The clean reader of a soak: which frames it keeps, the numbers of 64 bits, the head's answers, and its end. The
 * library is the test's. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/bytes.h"
#include "firmware_sim/app/studio/record/offline.h"
#include "firmware_sim/app/studio/soak/clean.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/base/clock.h"

static struct soak *soak;
static struct scanhead *const handle = (struct scanhead *)&soak;
static const struct scanhead_frame *frames; /* a type of 0 ends them; of -1: nothing came */
static int n_next, connect_rc, n_closed, hashes, n_asked, answers, n_sleeps, n_next_in_sleep;

int offline_connect(const char *who, struct link_spec *link, struct scanhead **sh, struct sh_err *err)
{
    assert_true(strcmp(who, "the clean reader") == 0 && link == &soak->clean.link);
    *sh = handle;
    return connect_rc < 0 ? sh_fail(err, connect_rc, "no pair") : connect_rc;
}

/* Every link here has a connection. */
void soak_saw_none(struct soak_link *link, soak_seq top)
{
    assert_non_null(link);
    assert_int_equal(top, soak->clean.top);
}

int scanhead_next(struct scanhead *sh, struct scanhead_frame *frame, int timeout_ms)
{
    if (sh != handle || timeout_ms != 50) return SCANHEAD_EINPUT;
    *frame = frames[n_next];
    if (frame->type == 0) return SCANHEAD_ECLOSED;
    return frames[n_next++].type == -1 ? SCANHEAD_ETIMEOUT : SCANHEAD_OK;
}

/* The answers' bits: the identity's, and the state's. */
int scanhead_command(struct scanhead *sh, const char *command, char *reply, size_t reply_len, int timeout_ms)
{
    const int is_state = strcmp(command, "HEAD:STATe?") == 0;
    if (sh != handle || timeout_ms != 5000 || reply_len != (is_state ? 64U : 256U)) return SCANHEAD_EINPUT;
    if (!is_state && strcmp(command, "*IDN?") != 0) return SCANHEAD_EINPUT;
    n_asked++;
    strcpy(reply, is_state ? "scanning" : "a,b,c,d");
    return (answers >> is_state & 1) != 0 ? SCANHEAD_OK : SCANHEAD_ETIMEOUT;
}

void scanhead_hash_start(struct scanhead *sh)
{
    hashes += sh == handle;
}

void scanhead_hash_hex(const struct scanhead *sh, char hex[65])
{
    strcpy(hex, sh == handle ? "12ab" : "");
}

const char *scanhead_error(const struct scanhead *sh)
{
    return sh == handle ? "it is gone" : "";
}

void scanhead_get_stats(const struct scanhead *sh, struct scanhead_stats *stats)
{
    *stats = (struct scanhead_stats){.reader_lost = sh == handle ? 9 : 0};
}

void scanhead_close(struct scanhead *sh)
{
    n_closed += sh == handle;
}

int64_t clock_now_ns(void)
{
    return 1;
}

/* The reader sleeps only while a client is far behind. At the third time the client has caught up. */
void clock_sleep_until_ns(int64_t t_ns)
{
    (void)t_ns;
    n_next_in_sleep += n_next;
    if (++n_sleeps == 3) soak->link[0].reached = soak->clean.top;
}

static int make(void **state)
{
    (void)state;
    soak = calloc(1, sizeof *soak);
    n_next = n_closed = hashes = n_asked = 0;
    answers = 3;
    connect_rc = 5;
    return soak != NULL ? 0 : -1;
}

static int end(void **state)
{
    (void)state;
    soak_clean_close(soak);
    assert_true(n_closed == 1 && soak->clean.sh == NULL && soak->clean.ring == NULL);
    free(soak);
    return 0;
}

static void read_all(const struct scanhead_frame *all)
{
    struct sh_err err;
    frames = all;
    assert_int_equal(soak_clean_open(soak, &err), SH_OK);
    assert_true(soak->clean.link.waits == LINK_WAITS_YES && hashes == 1);
    assert_int_equal(soak_clean_start(soak, &err), SH_OK);
    assert_int_equal(soak->clean.running, 1);
    soak_clean_join(soak);
    assert_int_equal(soak->clean.running, 0);
}

/* The digest of a frame is the checksum of its payload, then that of its header (bytes 24 and 12). */
static void frames_are_kept(void **state)
{
    uint8_t raw[32] = {0};
    struct soak_clean_frame kept;
    (void)state;
    le_put32(raw + 12, 0x11223344);
    le_put32(raw + 24, 0x55667788);
    const struct scanhead_frame all[] = {
        {.type = SCANHEAD_LINE_END, .seq = 7, .t_ns = 100, .raw = raw, .raw_len = 30},
        {.type = SCANHEAD_EVENT, .seq = 0, .t_ns = 150, .raw = raw, .raw_len = 31, .flags = SCANHEAD_LOCAL},
        {.type = -1},
        {.type = SCANHEAD_POINTS, .seq = 8, .t_ns = 200, .raw = raw, .raw_len = 32},
        {.type = SCANHEAD_POINTS, .seq = 9, .t_ns = 300, .raw = raw, .raw_len = 33},
        {0}};
    read_all(all);
    const soak_seq first = (UINT64_C(1) << 32) + 7;
    for (int i = 0; i < 3; i++) {
        assert_int_equal(soak_clean_get(soak, first + (soak_seq)i, &kept), 1);
        assert_true(kept.seq == first + (soak_seq)i && kept.digest == 0x5566778811223344);
        assert_true(kept.t_ns == (i + 1) * 100 && kept.len == (i == 0 ? 30U : 31U + (unsigned)i));
    }
    assert_int_equal(soak_clean_get(soak, first + 3, &kept), 0);
    assert_int_equal(soak_clean_get(soak, first - 1, &kept), 0);
    assert_int_equal(soak_clean_get(soak, first + SOAK_RING, &kept), 0); /* it has the same place */
    assert_int_equal(soak_clean_top(soak), first + 2);
    assert_int_equal(soak_clean_t_ns(soak), 300);
    const struct soak_clean *c = &soak->clean;
    assert_true(c->frames == 3 && c->points_frames == 2 && c->first_points_ns == 200 && c->reader_lost == 9);
    assert_string_equal(c->sha256, "12ab");
    assert_string_equal(c->failed, "it is gone");
    assert_int_equal(n_asked, 0);
}

/* At the soak's end the stream ends, which is no failure. */
static void the_end_of_a_soak(void **state)
{
    static const struct scanhead_frame none[] = {{0}};
    (void)state;
    atomic_store(&soak->phase, SOAK_ENDS);
    read_all(none);
    assert_string_equal(soak->clean.failed, "");
}

/* While a client is far behind, the reader reads nothing, but asks where that is wanted. */
static void a_client_far_behind(void **state)
{
    static uint8_t raw[32];
    const struct scanhead_frame all[] = {
        {.type = SCANHEAD_POINTS, .seq = 7, .t_ns = 100, .raw = raw, .raw_len = (32 << 20) + 1},
        {.type = SCANHEAD_POINTS, .seq = 8, .t_ns = 200, .raw = raw, .raw_len = 32},
        {0}};
    struct soak_link *link = &soak->link[0];
    (void)state;
    pthread_mutex_init(&link->lock, NULL);
    link->usable = link->is_open = 1;
    soak->n_links = 1;
    atomic_store(&soak->clean.want_health, 1);
    n_sleeps = n_next_in_sleep = 0;
    read_all(all);
    assert_true(n_sleeps == 3 && n_next_in_sleep == 3 && soak->clean.frames == 2);
    assert_true(n_asked == 2 && soak->clean.bytes == (32 << 20) + 33);
}

/* It asks once, when the soak wants it. Without an answer the text is empty. */
static void the_heads_answers(void **state)
{
    static const struct scanhead_frame waits[] = {{.type = -1}, {.type = -1}, {0}};
    (void)state;
    for (answers = 0; answers < 4; answers++) {
        n_next = hashes = n_asked = 0;
        atomic_store(&soak->clean.want_health, 1);
        const int is_so = answers;
        read_all(waits);
        assert_true(n_asked == 2 && atomic_load(&soak->clean.want_health) == 2);
        assert_string_equal(soak->clean.idn, (is_so & 1) != 0 ? "a,b,c,d" : "");
        assert_string_equal(soak->clean.state, (is_so & 2) != 0 ? "scanning" : "");
        if (is_so < 3) {
            soak_clean_close(soak);
            n_closed = 0;
        }
    }
}

/* Numbers on the wire wrap, and those of 64 bits do not: each is the one nearest to the last that was seen. */
static void numbers(void **state)
{
    static const uint64_t BASE = UINT64_C(1) << 32;
    struct sh_err err;
    (void)state;
    assert_int_equal(soak_seq_of(soak, 10), BASE + 10); /* the first one sets the base */
    assert_int_equal(soak_seq_of(soak, 9), BASE + 9);
    assert_int_equal(soak_seq_of(soak, 0x7fffffff), BASE + 0x7fffffff);
    assert_int_equal(soak_seq_of(soak, 0xffffffff), BASE - 1);
    atomic_store(&soak->base, 2 * BASE - 2);
    assert_int_equal(soak_seq_of(soak, 3), 2 * BASE + 3);
    assert_int_equal(soak_seq_of(soak, 0xfffffff0), 2 * BASE - 16);
    connect_rc = SH_EIO;
    assert_int_equal(soak_clean_open(soak, &err), SH_EIO);
    assert_int_equal(hashes, 0);
    soak_clean_join(soak); /* there is no thread */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(frames_are_kept, make, end),
        cmocka_unit_test_setup_teardown(the_end_of_a_soak, make, end),
        cmocka_unit_test_setup_teardown(a_client_far_behind, make, end),
        cmocka_unit_test_setup_teardown(the_heads_answers, make, end),
        cmocka_unit_test_setup_teardown(numbers, make, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
