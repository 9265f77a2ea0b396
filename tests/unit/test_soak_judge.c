/* SPDX-License-Identifier: MIT */
/* The judge of a soak compares the faults of each frame with the client's view. It has to notice a wrong client. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "drivers/protocol/native.h"
#include "firmware_sim/app/studio/soak/frame.h"
#include "firmware_sim/app/studio/soak/head.h"
#include "firmware_sim/app/studio/soak/judge.h"
#include "firmware_sim/app/studio/soak/row.h"
#include "tests/unit/soak_rig.h"

static void test_a_clean_stream_is_good(void **state)
{
    (void)state;
    struct soak *soak = soak_rig_make();
    send_clean(soak);
    see_others(soak, FIRST, HIT + 1);
    assert_int_equal(finish(soak), 0);
    assert_int_equal(soak->link[0].frames, N_FRAMES);
    soak_rig_end(soak);
}

static void test_a_drop(void **state)
{
    (void)state;
    struct soak *soak = soak_rig_make();
    struct soak_row *row = inject(soak, FAULT_DROP, 0, 0, "");
    notice(soak, SCANHEAD_NOTICE_GAP, HIT, 1);
    assert_int_equal(finish(soak), 0);
    assert_int_equal(row->noticed, 1);
    assert_int_equal(row->lost, 1);
    soak_rig_end(soak);

    soak = soak_rig_make(); /* without a gap */
    row = inject(soak, FAULT_DROP, 0, 0, "");
    assert_true(finish(soak) != 0);
    assert_int_equal(row->missed, 1);
    soak_rig_end(soak);

    soak = soak_rig_make(); /* it came all the same */
    row = inject(soak, FAULT_DROP, 0, 0, "");
    see(soak, HIT, 0, 0.0);
    assert_true(finish(soak) != 0);
    assert_int_equal(row->missed, 1);
    soak_rig_end(soak);

    soak = soak_rig_make(); /* the gap is elsewhere: another frame is lost, without a fault */
    row = inject(soak, FAULT_DROP, 0, 0, "");
    notice(soak, SCANHEAD_NOTICE_GAP, HIT - 1, 1);
    assert_true(finish(soak) != 0);
    assert_int_equal(row->missed, 1);
    soak_rig_end(soak);
}

static void test_a_resealed_flip(void **state)
{
    (void)state;
    struct soak *soak = soak_rig_make();
    struct soak_row *row = inject(soak, FAULT_FLIP, 1, 0, "resealed");
    see(soak, HIT, 1, 0.0);
    assert_int_equal(finish(soak), 0);
    assert_int_equal(row->accepted, 1);
    assert_int_equal(row->noticed, 0);
    soak_rig_end(soak);

    soak = soak_rig_make(); /* two of them in one frame */
    row = inject(soak, FAULT_FLIP, 1, 0, "resealed");
    const struct fault_note another = note_of(FAULT_FLIP, 1, 0, "resealed");
    soak_heard(soak, &another);
    see(soak, HIT, 1, 0.0);
    assert_int_equal(finish(soak), 0);
    assert_true(row->injected == 2 && row->accepted == 2);
    soak_rig_end(soak);

    soak = soak_rig_make(); /* the library refused it */
    row = inject(soak, FAULT_FLIP, 1, 0, "resealed");
    notice(soak, SCANHEAD_NOTICE_GAP, HIT, 1);
    assert_int_equal(finish(soak), 0);
    assert_int_equal(row->noticed, 1);
    assert_int_equal(row->accepted, 0);
    soak_rig_end(soak);

    soak = soak_rig_make(); /* the client has the clean frame: nothing was flipped */
    row = inject(soak, FAULT_FLIP, 1, 0, "resealed");
    see(soak, HIT, 0, 0.0);
    assert_true(finish(soak) != 0);
    assert_int_equal(row->missed, 1);
    soak_rig_end(soak);

    soak = soak_rig_make(); /* another frame is the one that differs */
    row = inject(soak, FAULT_FLIP, 1, 0, "resealed");
    see(soak, HIT, 1, 0.0);
    see(soak, HIT + 1, 1, 0.0);
    assert_true(finish(soak) != 0);
    assert_int_equal(soak->link[0].wrong_plain, 1);
    soak_rig_end(soak);
}

static void test_duplicates_and_late_frames(void **state)
{
    (void)state;
    for (int right = 0; right < 2; right++) {
        struct soak *soak = soak_rig_make();
        struct soak_row *row = inject(soak, FAULT_DUPLICATE, 2, 0, "");
        see(soak, HIT, 0, 0.0);
        for (int i = 0; i < 1 + right; i++)
            notice(soak, SCANHEAD_NOTICE_REPEATED, HIT, 1);
        assert_int_equal(finish(soak) == 0, right);
        assert_int_equal(row->noticed, right);
        soak_rig_end(soak);

        soak = soak_rig_make(); /* two copies were sent: a third one is as wrong as none */
        row = inject(soak, FAULT_DUPLICATE, 2, 0, "");
        see(soak, HIT, 0, 0.0);
        for (int i = 0; i < (right ? 2 : 3); i++)
            notice(soak, SCANHEAD_NOTICE_REPEATED, HIT, 1);
        assert_int_equal(finish(soak) == 0, right);
        assert_int_equal(row->noticed, right);
        soak_rig_end(soak);

        soak = soak_rig_make();
        row = inject(soak, FAULT_REORDER, 1, 0, "");
        notice(soak, SCANHEAD_NOTICE_GAP, HIT, 1);
        if (right) notice(soak, SCANHEAD_NOTICE_LATE, HIT, 1);
        assert_int_equal(finish(soak) == 0, right);
        assert_int_equal(row->noticed, right);
        soak_rig_end(soak);

        soak = soak_rig_make();
        row = inject(soak, FAULT_STALL, 0, 40.0, "");
        see(soak, HIT, 0, right ? 40.0 : 20.0);
        assert_int_equal(finish(soak) == 0, right);
        assert_int_equal(row->noticed, right);
        soak_rig_end(soak);
    }
}

static void test_bytes(void **state)
{
    (void)state;
    static const uint64_t n[] = {16, 15, 17}; /* as injected; too few; one more than any fault explains */
    for (size_t i = 0; i < sizeof n / sizeof *n; i++) {
        struct soak *soak = soak_rig_make();
        struct soak_row *row = inject(soak, FAULT_GARBAGE, 16, 0, "");
        notice(soak, SCANHEAD_NOTICE_BAD_BYTES, HIT, n[i]);
        see(soak, HIT, 0, 0.0);
        assert_int_equal(finish(soak) == 0, i == 0);
        assert_int_equal(row->noticed, i != 1);
        soak_rig_end(soak);
    }
}

/* A frame that was cut to 30 bytes gives exactly 30 bad ones. */
static void test_cut_bytes(void **state)
{
    (void)state;
    static const uint64_t n[] = {30, 29, NATIVE_HEADER_LEN + PAYLOAD};
    for (size_t i = 0; i < sizeof n / sizeof *n; i++) {
        struct soak *soak = soak_rig_make();
        struct soak_row *row = inject(soak, FAULT_TRUNCATE, 18, 0, "");
        notice(soak, SCANHEAD_NOTICE_BAD_PAYLOAD, HIT, n[i]);
        notice(soak, SCANHEAD_NOTICE_GAP, HIT, 1);
        assert_int_equal(finish(soak) == 0, i == 0);
        assert_int_equal(row->noticed, 1);
        soak_rig_end(soak);
    }
}

static void test_connections(void **state)
{
    (void)state;
    struct soak *soak = soak_rig_make();
    struct soak_row *row = inject(soak, FAULT_DISCONNECT, 0, 0, "");
    soak_saw_end(&soak->link[0]);
    soak_saw_open(&soak->link[0]);
    assert_int_equal(finish(soak), 0); /* HIT came while there was no session */
    assert_int_equal(row->noticed, 1);
    assert_int_equal(soak->link[0].away, 1);
    soak_rig_end(soak);

    soak = soak_rig_make(); /* it went on */
    row = inject(soak, FAULT_DISCONNECT, 0, 0, "");
    see(soak, HIT, 0, 0.0);
    assert_true(finish(soak) != 0);
    assert_int_equal(row->missed, 1);
    soak_rig_end(soak);

    soak = soak_rig_make(); /* this fault was not asked for */
    send_clean(soak);
    see_others(soak, FIRST, HIT);
    assert_int_equal(soak->link[0].in_session, 1);
    soak_saw_end(&soak->link[0]);
    assert_int_equal(soak->link[0].in_session, 0);
    soak_saw_open(&soak->link[0]);
    assert_int_equal(soak->link[0].in_session, 0); /* it begins with its first frame */
    assert_true(finish(soak) != 0);
    soak_rig_end(soak);
}

/* A fault strikes before the client's first frame, or while it has no session. */
static void test_faults_without_a_session(void **state)
{
    (void)state;
    for (int had_one = 0; had_one < 2; had_one++) {
        struct soak *soak = soak_rig_make();
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
        soak_rig_end(soak);
    }
}

/* A boot that no client saw is a miss in real time only: else it may be over before a client is there. */
static void test_boots(void **state)
{
    (void)state;
    const struct fault_note note = {.kind = FAULT_SLOW_BOOT, .fault = 1, .for_ms = 700.0};
    for (int realtime = 0; realtime < 2; realtime++)
        for (int seen = 0; seen < 2; seen++) {
            struct soak *soak = soak_rig_make();
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
            soak_rig_end(soak);
        }
}

/* Reports of the board and of the library come before the client reads the frame. They judge no frame that the client
 * has still to read. A report that finds no room in the ledger, which is half of it ahead, makes the verdict bad. */
static void test_a_client_that_lags(void **state)
{
    (void)state;
    for (int too_far = 0; too_far < 2; too_far++) {
        const uint32_t ahead = HIT - 1 + SOAK_RING / 2 - !too_far; /* the client has read HIT - 1 last */
        struct soak *soak = soak_rig_make();
        struct soak_link *link = &soak->link[0];
        struct soak_row *row = inject(soak, FAULT_DROP, 0, 0, "");
        struct fault_note note = note_of(FAULT_DROP, 0, 0, "");
        note.seq = ahead;
        soak_heard(soak, &note);
        notice(soak, SCANHEAD_NOTICE_GAP, ahead + 1 - !too_far, 1); /* the library is as far ahead */
        notice(soak, SCANHEAD_NOTICE_GAP, HIT, 1);
        assert_int_equal(link->too_far, 2 * too_far);
        assert_int_equal(finish(soak), too_far);
        if (too_far)
            assert_string_equal(soak->failures[0],
                                "a client was too far behind the head, so not all could be compared");
        assert_true(row->injected == 2 && row->noticed == 1 && row->hidden == 1 && row->missed == 0);
        assert_string_equal(row->why, too_far ? "the client was too far behind it" : "it was the last before the end");
        assert_true(link->frames == N_FRAMES - 1 && link->lost_plain == 0 && link->unknown == 0);
        soak_rig_end(soak);
    }
}

/* Without a session the head does not wait, and the next session begins anywhere. Its faults find room. */
static void test_a_session_far_on(void **state)
{
    enum { FAR = HIT + 3 * SOAK_RING };
    (void)state;
    struct soak *soak = soak_rig_make();
    struct soak_link *link = &soak->link[0];
    struct fault_note note = note_of(FAULT_DROP, 0, 0, "");
    struct soak_row *row = inject(soak, FAULT_DISCONNECT, 0, 0, "");
    soak_saw_end(link);
    note.seq = FAR; /* the head may write before the client knows that it has a connection */
    soak_heard(soak, &note);
    soak->clean.top = soak_seq_of(soak, FAR);
    soak_saw_open(link);
    note.seq = FAR + 2;
    soak_heard(soak, &note);
    see(soak, FAR + 1, 0, 0.0);
    notice(soak, SCANHEAD_NOTICE_GAP, FAR + 2, 1);
    see(soak, FAR + 3, 0, 0.0);
    soak_judge(link, 1);
    assert_true(link->too_far == 0 && row->noticed == 1 && link->lost_plain == 0);
    assert_true(link->row[FAULT_DROP].noticed == 1 && link->row[FAULT_DROP].hidden == 1);
    assert_string_equal(link->row[FAULT_DROP].why, "there was no session then");
    soak_rig_end(soak);
}

/* The numbers on the wire wrap; those of the ledger go on. */
static void test_numbers_wrap(void **state)
{
    (void)state;
    struct soak *soak = soak_rig_make();
    const soak_seq before = soak_seq_of(soak, UINT32_MAX);
    assert_int_equal(soak_seq_of(soak, 0), before + 1);
    assert_int_equal(soak_seq_of(soak, UINT32_MAX - 5), before - 5);
    soak_rig_end(soak);
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
        cmocka_unit_test(test_a_client_that_lags),
        cmocka_unit_test(test_a_session_far_on),
        cmocka_unit_test(test_numbers_wrap),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
