/* SPDX-License-Identifier: MIT */
/* The judge of a soak compares the faults of each frame with the client's view. A client that is wrong must show. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "drivers/host/scanhead.h"
#include "drivers/protocol/native.h"
#include "firmware_sim/app/studio/soak/clean.h"
#include "firmware_sim/app/studio/soak/frame.h"
#include "firmware_sim/app/studio/soak/head.h"
#include "firmware_sim/app/studio/soak/judge.h"
#include "firmware_sim/app/studio/soak/ledger.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/app/studio/soak/row.h"
#include "firmware_sim/app/studio/soak/sheet.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/fault/fault.h"

enum { FIRST = 1000, N_FRAMES = 200, TICK_NS = 1000000, PAYLOAD = 20 };

static struct config cfg;

/* A link whose client is this test. */
static struct soak *make(void)
{
    struct soak *soak = calloc(1, sizeof *soak);
    assert_non_null(soak);
    soak->cfg = &cfg;
    soak->realtime = 1;
    soak->n_links = 1;
    pthread_mutex_init(&soak->clean.lock, NULL);
    soak->clean.ring = calloc(SOAK_RING, sizeof *soak->clean.ring);
    struct soak_link *link = &soak->link[0];
    pthread_mutex_init(&link->lock, NULL);
    link->soak = soak;
    link->number = 1;
    link->usable = 1;
    link->fact = calloc(SOAK_RING, sizeof *link->fact);
    assert_true(soak->clean.ring != NULL && link->fact != NULL);
    soak_saw_open(link);
    /* The verdict needs these beside the links. */
    strcpy(soak->clean.idn, "a,b,c,d");
    strcpy(soak->clean.state, "scanning");
    soak->stats.have_hash = 1;
    return soak;
}

static void end(struct soak *soak)
{
    free(soak->clean.ring);
    free(soak->link[0].fact);
    free(soak);
}

/* Makes a frame of the stream. damage: changes its payload, with a right checksum. */
static struct scanhead_frame frame_of(uint32_t seq, uint8_t damage, uint8_t raw[NATIVE_HEADER_LEN + PAYLOAD])
{
    memset(raw, 0, NATIVE_HEADER_LEN + PAYLOAD);
    memcpy(raw + 12, &(uint32_t){seq ^ damage}, 4); /* stands for the checksum */
    memcpy(raw + 24, &seq, 4);
    return (struct scanhead_frame){.type = SCANHEAD_LINE_END,
                                   .seq = seq,
                                   .t_ns = (int64_t)seq * TICK_NS,
                                   .raw = raw,
                                   .raw_len = NATIVE_HEADER_LEN + PAYLOAD};
}

static void send_clean(struct soak *soak)
{
    for (uint32_t seq = FIRST; seq < FIRST + N_FRAMES; seq++) {
        uint8_t raw[NATIVE_HEADER_LEN + PAYLOAD];
        const struct scanhead_frame frame = frame_of(seq, 0, raw);
        const soak_seq at = soak_seq_of(soak, seq);
        soak->clean.ring[at % SOAK_RING] = (struct soak_clean_frame){
            .seq = at, .digest = soak_digest(&frame), .t_ns = frame.t_ns, .len = (uint32_t)frame.raw_len, .there = 1};
    }
}

static void see(struct soak *soak, uint32_t seq, uint8_t damage, double late_ms)
{
    uint8_t raw[NATIVE_HEADER_LEN + PAYLOAD];
    const struct scanhead_frame frame = frame_of(seq, damage, raw);
    soak_saw_frame(&soak->link[0], &frame, frame.t_ns + (int64_t)(1e6 * late_ms));
}

static void notice(struct soak *soak, enum scanhead_notice_kind kind, uint32_t seq, uint64_t n)
{
    const struct scanhead_notice it = {.kind = kind, .seq = seq, .n = n, .t_ns = (int64_t)(seq - 1) * TICK_NS};
    soak_saw_notice(&soak->link[0], &it);
}

/* The client sees all frames but one, which is `hit`. */
static void see_others(struct soak *soak, uint32_t from, uint32_t to)
{
    for (uint32_t seq = from; seq < to; seq++)
        see(soak, seq, 0, 0.0);
}

enum { HIT = FIRST + 100 };

static struct fault_note note_of(enum fault_kind kind, uint64_t n, double for_ms, const char *text)
{
    struct fault_note note = {.fault = 1,
                              .kind = kind,
                              .t_ns = (int64_t)HIT * TICK_NS,
                              .link = 1,
                              .session = 1,
                              .number = 5,
                              .has_seq = 1,
                              .seq = HIT,
                              .type = SCANHEAD_POINTS,
                              .byte = 30,
                              .n = n,
                              .for_ms = for_ms};
    snprintf(note.text, sizeof note.text, "%s", text);
    return note;
}

static struct soak_row *inject(struct soak *soak, enum fault_kind kind, uint64_t n, double for_ms, const char *text)
{
    const struct fault_note note = note_of(kind, n, for_ms, text);
    send_clean(soak);
    see_others(soak, FIRST, HIT);
    soak_heard(soak, &note);
    return &soak->link[0].row[text[0] != '\0' ? SOAK_RESEALED : (int)kind];
}

/* Sees the rest. Returns how many reasons for a bad verdict there are. */
static uint32_t finish(struct soak *soak)
{
    see_others(soak, HIT + 1, FIRST + N_FRAMES);
    soak_judge(&soak->link[0], 1);
    soak_conclude(soak);
    return soak->n_failures;
}

static void test_a_clean_stream_is_good(void **state)
{
    (void)state;
    struct soak *soak = make();
    send_clean(soak);
    see_others(soak, FIRST, HIT + 1);
    assert_int_equal(finish(soak), 0);
    assert_int_equal(soak->link[0].frames, N_FRAMES);
    end(soak);
}

static void test_a_drop(void **state)
{
    (void)state;
    struct soak *soak = make();
    struct soak_row *row = inject(soak, FAULT_DROP, 0, 0, "");
    notice(soak, SCANHEAD_NOTICE_GAP, HIT, 1);
    assert_int_equal(finish(soak), 0);
    assert_int_equal(row->noticed, 1);
    assert_int_equal(row->lost, 1);
    end(soak);

    soak = make(); /* without a gap */
    row = inject(soak, FAULT_DROP, 0, 0, "");
    assert_true(finish(soak) != 0);
    assert_int_equal(row->missed, 1);
    end(soak);

    soak = make(); /* it came all the same */
    row = inject(soak, FAULT_DROP, 0, 0, "");
    see(soak, HIT, 0, 0.0);
    assert_true(finish(soak) != 0);
    assert_int_equal(row->missed, 1);
    end(soak);

    soak = make(); /* the gap is elsewhere: another frame is lost, without a fault */
    row = inject(soak, FAULT_DROP, 0, 0, "");
    notice(soak, SCANHEAD_NOTICE_GAP, HIT - 1, 1);
    assert_true(finish(soak) != 0);
    assert_int_equal(row->missed, 1);
    end(soak);
}

static void test_a_resealed_flip(void **state)
{
    (void)state;
    struct soak *soak = make();
    struct soak_row *row = inject(soak, FAULT_FLIP, 1, 0, "resealed");
    see(soak, HIT, 1, 0.0);
    assert_int_equal(finish(soak), 0);
    assert_int_equal(row->accepted, 1);
    assert_int_equal(row->noticed, 0);
    end(soak);

    soak = make(); /* two of them in one frame */
    row = inject(soak, FAULT_FLIP, 1, 0, "resealed");
    const struct fault_note another = note_of(FAULT_FLIP, 1, 0, "resealed");
    soak_heard(soak, &another);
    see(soak, HIT, 1, 0.0);
    assert_int_equal(finish(soak), 0);
    assert_true(row->injected == 2 && row->accepted == 2);
    end(soak);

    soak = make(); /* the library refused it */
    row = inject(soak, FAULT_FLIP, 1, 0, "resealed");
    notice(soak, SCANHEAD_NOTICE_GAP, HIT, 1);
    assert_int_equal(finish(soak), 0);
    assert_int_equal(row->noticed, 1);
    assert_int_equal(row->accepted, 0);
    end(soak);

    soak = make(); /* the client has the clean frame: nothing was flipped */
    row = inject(soak, FAULT_FLIP, 1, 0, "resealed");
    see(soak, HIT, 0, 0.0);
    assert_true(finish(soak) != 0);
    assert_int_equal(row->missed, 1);
    end(soak);

    soak = make(); /* another frame is the one that differs */
    row = inject(soak, FAULT_FLIP, 1, 0, "resealed");
    see(soak, HIT, 1, 0.0);
    see(soak, HIT + 1, 1, 0.0);
    assert_true(finish(soak) != 0);
    assert_int_equal(soak->link[0].wrong_plain, 1);
    end(soak);
}

static void test_duplicates_and_late_frames(void **state)
{
    (void)state;
    for (int right = 0; right < 2; right++) {
        struct soak *soak = make();
        struct soak_row *row = inject(soak, FAULT_DUPLICATE, 2, 0, "");
        see(soak, HIT, 0, 0.0);
        for (int i = 0; i < 1 + right; i++)
            notice(soak, SCANHEAD_NOTICE_REPEATED, HIT, 1);
        assert_int_equal(finish(soak) == 0, right);
        assert_int_equal(row->noticed, right);
        end(soak);

        soak = make(); /* two copies were sent: a third one is as wrong as none */
        row = inject(soak, FAULT_DUPLICATE, 2, 0, "");
        see(soak, HIT, 0, 0.0);
        for (int i = 0; i < (right ? 2 : 3); i++)
            notice(soak, SCANHEAD_NOTICE_REPEATED, HIT, 1);
        assert_int_equal(finish(soak) == 0, right);
        assert_int_equal(row->noticed, right);
        end(soak);

        soak = make();
        row = inject(soak, FAULT_REORDER, 1, 0, "");
        notice(soak, SCANHEAD_NOTICE_GAP, HIT, 1);
        if (right) notice(soak, SCANHEAD_NOTICE_LATE, HIT, 1);
        assert_int_equal(finish(soak) == 0, right);
        assert_int_equal(row->noticed, right);
        end(soak);

        soak = make();
        row = inject(soak, FAULT_STALL, 0, 40.0, "");
        see(soak, HIT, 0, right ? 40.0 : 20.0);
        assert_int_equal(finish(soak) == 0, right);
        assert_int_equal(row->noticed, right);
        end(soak);
    }
}

static void test_bytes(void **state)
{
    (void)state;
    static const uint64_t n[] = {16, 15, 17}; /* as injected; too few; one more than any fault explains */
    for (size_t i = 0; i < sizeof n / sizeof *n; i++) {
        struct soak *soak = make();
        struct soak_row *row = inject(soak, FAULT_GARBAGE, 16, 0, "");
        notice(soak, SCANHEAD_NOTICE_BAD_BYTES, HIT, n[i]);
        see(soak, HIT, 0, 0.0);
        assert_int_equal(finish(soak) == 0, i == 0);
        assert_int_equal(row->noticed, i != 1);
        end(soak);
    }
}

/* A frame that was cut to 30 bytes gives exactly 30 bad ones. */
static void test_cut_bytes(void **state)
{
    (void)state;
    static const uint64_t n[] = {30, 29, NATIVE_HEADER_LEN + PAYLOAD};
    for (size_t i = 0; i < sizeof n / sizeof *n; i++) {
        struct soak *soak = make();
        struct soak_row *row = inject(soak, FAULT_TRUNCATE, 18, 0, "");
        notice(soak, SCANHEAD_NOTICE_BAD_PAYLOAD, HIT, n[i]);
        notice(soak, SCANHEAD_NOTICE_GAP, HIT, 1);
        assert_int_equal(finish(soak) == 0, i == 0);
        assert_int_equal(row->noticed, 1);
        end(soak);
    }
}

static void test_connections(void **state)
{
    (void)state;
    struct soak *soak = make();
    struct soak_row *row = inject(soak, FAULT_DISCONNECT, 0, 0, "");
    soak_saw_end(&soak->link[0]);
    soak_saw_open(&soak->link[0]);
    assert_int_equal(finish(soak), 0); /* HIT came while there was no session */
    assert_int_equal(row->noticed, 1);
    assert_int_equal(soak->link[0].away, 1);
    end(soak);

    soak = make(); /* it went on */
    row = inject(soak, FAULT_DISCONNECT, 0, 0, "");
    see(soak, HIT, 0, 0.0);
    assert_true(finish(soak) != 0);
    assert_int_equal(row->missed, 1);
    end(soak);

    soak = make(); /* this fault was not asked for */
    send_clean(soak);
    see_others(soak, FIRST, HIT);
    soak_saw_end(&soak->link[0]);
    soak_saw_open(&soak->link[0]);
    assert_true(finish(soak) != 0);
    end(soak);
}

/* A fault strikes before the client's first frame, or while it has no session. */
static void test_faults_without_a_session(void **state)
{
    (void)state;
    for (int had_one = 0; had_one < 2; had_one++) {
        struct soak *soak = make();
        struct soak_link *link = &soak->link[0];
        const struct fault_note note = note_of(FAULT_DROP, 0, 0, "");
        send_clean(soak);
        if (had_one) {
            see_others(soak, FIRST, HIT);
            link->act[link->n_acts++] = (struct soak_act){FAULT_DISCONNECT, 0}; /* its end was asked for */
            link->row[FAULT_DISCONNECT].injected++;
            soak_saw_end(link);
        }
        soak_heard(soak, &note);
        if (had_one) soak_saw_open(link);
        assert_int_equal(finish(soak), 0);
        assert_true(link->row[FAULT_DROP].hidden == 1 && link->row[FAULT_DROP].missed == 0);
        assert_string_equal(link->row[FAULT_DROP].why, "there was no session then");
        assert_int_equal(link->away, 1);
        end(soak);
    }
}

/* A boot that no client saw is a miss in real time only: else it may be over before a client is there. */
static void test_boots(void **state)
{
    (void)state;
    const struct fault_note note = {.kind = FAULT_SLOW_BOOT, .fault = 1, .for_ms = 700.0};
    for (int realtime = 0; realtime < 2; realtime++)
        for (int seen = 0; seen < 2; seen++) {
            struct soak *soak = make();
            struct soak_link *link = &soak->link[0];
            soak->realtime = realtime;
            soak_heard_head(link, &note);
            if (seen) soak_saw_state(link, "boot");
            soak_judge_head(link);
            const struct soak_row *row = &link->row[FAULT_SLOW_BOOT];
            assert_int_equal(row->injected, 1);
            assert_int_equal(row->noticed, seen);
            assert_int_equal(row->missed, !seen && realtime);
            assert_int_equal(row->hidden, !seen && !realtime);
            end(soak);
        }
}

/* The numbers on the wire wrap; those of the ledger go on. */
static void test_numbers_wrap(void **state)
{
    (void)state;
    struct soak *soak = make();
    const soak_seq before = soak_seq_of(soak, UINT32_MAX);
    assert_int_equal(soak_seq_of(soak, 0), before + 1);
    assert_int_equal(soak_seq_of(soak, UINT32_MAX - 5), before - 5);
    end(soak);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_clean_stream_is_good),
        cmocka_unit_test(test_a_drop),
        cmocka_unit_test(test_a_resealed_flip),
        cmocka_unit_test(test_duplicates_and_late_frames),
        cmocka_unit_test(test_bytes),
        cmocka_unit_test(test_cut_bytes),
        cmocka_unit_test(test_connections),
        cmocka_unit_test(test_faults_without_a_session),
        cmocka_unit_test(test_boots),
        cmocka_unit_test(test_numbers_wrap),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
