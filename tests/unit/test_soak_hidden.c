/* SPDX-License-Identifier: MIT */
/* Faults on the wire of a soak that no client can notice are hidden with a reason, and count neither as noticed nor as
 * missed. Faults beside another one, and faults after a session, are hidden, too. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "firmware_sim/app/studio/soak/judge.h"
#include "firmware_sim/app/studio/soak/row.h"
#include "tests/unit/soak_rig.h"

static void expect_hidden(const struct soak_row *row, uint64_t n, const char *why)
{
    if (row->hidden != n || row->noticed != 0 || row->missed != 0 || row->accepted != 0)
        fail_msg("%llu hidden, %llu noticed, %llu missed, not hidden: %s", (unsigned long long)row->hidden,
                 (unsigned long long)row->noticed, (unsigned long long)row->missed, why);
    assert_string_equal(row->why, why);
}

/* The frame comes as it was, and nothing is wrong. */
static void faults_that_change_nothing(void **state)
{
    static const char same[] = "the bytes are the same", no_byte[] = "the frame has no such byte: nothing was changed";
    static const struct {
        enum fault_kind kind;
        uint64_t n;
        double for_ms;
        int realtime;
        const char *why;
    } rows[] = {{FAULT_SHORT_PACKETS, 3, 0, 1, same},
                {FAULT_ENDPOINT_STALL, 0, 0, 1, "the library clears the halt: the bytes are the same"},
                {FAULT_SPLIT, 2, 0, 1, same},
                {FAULT_MERGE, 2, 0, 1, same},
                {FAULT_FLIP, 0, 0, 1, no_byte},
                {FAULT_TRUNCATE, 0, 0, 1, no_byte},
                {FAULT_STALL, 0, 9.9, 1, "shorter than 10 ms"},
                {FAULT_DELAY, 0, 40, 0, "no frame is late at this pace: only realtime has delays"},
                {FAULT_NO_REPLY, 0, 0, 1, "nobody waited for this reply"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct soak *soak = soak_rig_make();
        soak->realtime = rows[i].realtime;
        const struct soak_row *row = inject(soak, rows[i].kind, rows[i].n, rows[i].for_ms, "");
        see(soak, HIT, 0, 0.0);
        assert_int_equal(finish(soak), 0);
        assert_int_equal(row->injected, 1);
        expect_hidden(row, 1, rows[i].why);
        soak_rig_end(soak);
    }
}

static void a_fault_without_a_place(void **state)
{
    (void)state;
    struct soak *soak = soak_rig_make();
    struct soak_link *link = &soak->link[0];
    struct fault_note note = note_of(FAULT_DROP, 0, 0, "");
    note.has_seq = 0;
    soak_heard(soak, &note);
    expect_hidden(&link->row[FAULT_DROP], 1, "a frame for a single reader has no number");
    link->usable = 0;
    note = note_of(FAULT_FLIP, 1, 0, "");
    soak_heard(soak, &note);
    expect_hidden(&link->row[FAULT_FLIP], 1, "the link has no client here");
    note.link = 2; /* there is no such link */
    soak_heard(soak, &note);
    note.link = 1;
    note.ended = 1; /* the end of a fault is no further fault */
    soak_heard(soak, &note);
    assert_int_equal(link->row[FAULT_FLIP].injected, 1);
    assert_int_equal(link->ask.others, 2); /* these explain an odd reply */
    soak_rig_end(soak);
}

/* Only the client's first frame shows that a power cycle came before it. */
static void a_power_cycle_before_the_first_frame(void **state)
{
    (void)state;
    struct soak *soak = soak_rig_make();
    const struct soak_link *link = &soak->link[0];
    struct fault_note note = note_of(FAULT_POWER_CYCLE, 0, 0, "");
    note.has_seq = 0;
    note.link = note.session = 0;
    note.t_ns = 0;
    send_clean(soak);
    soak_heard(soak, &note);
    assert_int_equal(link->row[FAULT_POWER_CYCLE].hidden, 0);
    see(soak, FIRST, 0, 0.0);
    expect_hidden(&link->row[FAULT_POWER_CYCLE], 1, "it was before the client had a frame");
    soak_heard(soak, &note);
    see(soak, FIRST + 1, 0, 0.0);
    assert_int_equal(link->row[FAULT_POWER_CYCLE].hidden, 1);
    soak_rig_end(soak);
}

/* A frame that is dropped shows nothing else. */
static void faults_beside_a_drop(void **state)
{
    static const struct {
        enum fault_kind kind;
        const char *text, *why;
    } rows[] = {{FAULT_FLIP, "resealed", "the frame was destroyed besides"},
                {FAULT_DUPLICATE, "", "no copy of the frame was right"},
                {FAULT_REORDER, "", "the frame was destroyed besides"},
                {FAULT_STALL, "", "the frame did not come in its place"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct soak *soak = soak_rig_make();
        const struct soak_row *row = inject(soak, rows[i].kind, 1, 40, rows[i].text);
        const struct fault_note drop = note_of(FAULT_DROP, 0, 0, "");
        soak_heard(soak, &drop);
        notice(soak, SCANHEAD_NOTICE_GAP, HIT, 1);
        assert_int_equal(finish(soak), 0);
        expect_hidden(row, 1, rows[i].why);
        assert_true(soak->link[0].row[FAULT_DROP].noticed == 1 && soak->link[0].row[FAULT_DROP].lost == 1);
        soak_rig_end(soak);
    }
}

/* A frame that the library refuses for its content is hidden, too. Without a fault that destroys it, a missing frame is
 * a finding. */
static void faults_beside_a_refused_frame(void **state)
{
    static const struct {
        enum fault_kind kind;
        const char *why;
    } rows[] = {{FAULT_DUPLICATE, "no copy of the frame was right"},
                {FAULT_REORDER, "the frame was destroyed besides"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        for (int is_refused = 0; is_refused < 2; is_refused++) {
            struct soak *soak = soak_rig_make();
            const struct soak_row *row = inject(soak, rows[i].kind, 1, 0, "");
            const struct fault_note flip = note_of(FAULT_FLIP, 1, 0, "resealed");
            if (is_refused) soak_heard(soak, &flip);
            notice(soak, SCANHEAD_NOTICE_GAP, HIT, 1);
            assert_int_equal(finish(soak) == 0, is_refused);
            if (is_refused) expect_hidden(row, 1, rows[i].why);
            if (!is_refused) assert_true(row->missed == 1 && row->hidden == 0);
            soak_rig_end(soak);
        }
}

/* One frame was to overtake another. Where the overtaking frame is dropped, or held back itself, the order stays. */
static void nothing_overtakes(void **state)
{
    static const enum fault_kind others[] = {FAULT_DROP, FAULT_REORDER};
    (void)state;
    for (int i = 0; i < 2; i++) {
        struct soak *soak = soak_rig_make();
        const struct soak_row *row = inject(soak, FAULT_REORDER, 1, 0, "");
        struct fault_note next = note_of(others[i], 1, 0, "");
        next.seq = HIT + 1;
        soak_heard(soak, &next);
        see(soak, HIT, 0, 0.0);
        notice(soak, SCANHEAD_NOTICE_GAP, HIT + 1, 1);
        if (i == 1) notice(soak, SCANHEAD_NOTICE_LATE, HIT + 1, 1);
        see_others(soak, HIT + 2, FIRST + N_FRAMES);
        soak_judge(&soak->link[0], 1);
        if (i == 0) expect_hidden(row, 1, "those that overtook it were destroyed");
        if (i == 1) assert_true(row->hidden == 1 && row->noticed == 1 && row->missed == 0);
        soak_rig_end(soak);
    }
    struct soak *soak = soak_rig_make(); /* the next frame is there, so this one should be late */
    const struct soak_row *row = inject(soak, FAULT_REORDER, 1, 0, "");
    see(soak, HIT, 0, 0.0);
    finish(soak);
    assert_int_equal(row->missed, 1);
    soak_rig_end(soak);
}

static void what_came_last(void **state)
{
    (void)state;
    struct soak *soak = soak_rig_make();
    const struct soak_row *row = inject(soak, FAULT_DROP, 0, 0, "");
    soak_judge(&soak->link[0], 1); /* no frame came after it */
    expect_hidden(row, 1, "it was the last before the end");
    assert_int_equal(soak->link[0].lost_plain, 0);
    soak_rig_end(soak);
    soak = soak_rig_make(); /* a frame that is missing without a fault and without a gap */
    send_clean(soak);
    see_others(soak, FIRST, HIT);
    see_others(soak, HIT + 1, FIRST + N_FRAMES);
    soak_judge(&soak->link[0], 1);
    assert_int_equal(soak->link[0].lost_plain, 1);
    soak_rig_end(soak);
}

/* 64 acts are kept. The first one ends the session, and the others come too late for it. */
static void acts_after_the_end_of_a_session(void **state)
{
    (void)state;
    struct soak *soak = soak_rig_make();
    struct soak_row *row = inject(soak, FAULT_DISCONNECT, 0, 0, "");
    const struct fault_note note = note_of(FAULT_DISCONNECT, 0, 0, "");
    for (int i = 1; i <= SOAK_MAX_ACTS; i++)
        soak_heard(soak, &note);
    expect_hidden(row, 1, "too many at a time");
    soak_saw_end(&soak->link[0]);
    assert_true(row->noticed == 1 && row->hidden == SOAK_MAX_ACTS && row->injected == SOAK_MAX_ACTS + 1);
    assert_string_equal(row->why, "the session was over before it");
    soak_rig_end(soak);
}

/* A client that is turned away notices it, whether the link says so before or after. */
static void clients_are_turned_away(void **state)
{
    (void)state;
    const struct fault_note note = note_of(FAULT_REFUSE, 0, 0, "");
    struct soak *soak = soak_rig_make();
    struct soak_link *link = &soak->link[0];
    struct soak_row *row = &link->row[FAULT_REFUSE];
    soak_heard(soak, &note);
    soak_heard(soak, &note);
    soak_saw_no_open(link);
    assert_true(row->noticed == 1 && link->n_refusals == 1 && link->no_open_ns == 0);
    soak_saw_no_open(link);
    assert_true(row->noticed == 2 && link->n_refusals == 0);
    soak_saw_no_open(link); /* nobody was turned away, so far */
    assert_true(row->noticed == 2 && link->no_open_ns != 0);
    link->no_open_ns = INT64_MAX; /* however slow the machine is, this was just now */
    soak_heard(soak, &note);
    assert_true(row->noticed == 3 && link->n_refusals == 0 && link->no_open_ns == 0);
    link->no_open_ns = -INT64_C(1000000000); /* long ago: it has another reason */
    soak_heard(soak, &note);
    assert_true(row->noticed == 3 && link->n_refusals == 1);
    soak_saw_no_open(link);
    assert_true(row->noticed == 4 && link->n_refusals == 0);
    link->odd_closings = 1; /* a session ended without a reason, just now, and another one long ago */
    link->odd_ns = INT64_MAX;
    soak_heard(soak, &note);
    assert_true(row->noticed == 5 && link->n_refusals == 0 && link->odd_closings == 0);
    link->odd_closings = 1;
    link->odd_ns = link->no_open_ns = -INT64_C(1000000000);
    soak_heard(soak, &note);
    assert_true(row->noticed == 5 && link->n_refusals == 1 && link->odd_closings == 1);
    soak_saw_no_open(link);
    for (int i = 0; i <= SOAK_MAX_ACTS; i++)
        soak_heard(soak, &note);
    assert_true(link->n_refusals == SOAK_MAX_ACTS && row->hidden == 1);
    assert_string_equal(row->why, "too many at a time");
    soak_rig_end(soak);
}

/* The library refuses a frame for what it holds, and gives no gap for it. */
static void a_refused_frame_is_missing(void **state)
{
    (void)state;
    struct soak *soak = soak_rig_make();
    const struct soak_row *row = inject(soak, FAULT_FLIP, 1, 0, "resealed");
    notice(soak, SCANHEAD_NOTICE_REFUSED, HIT, 1);
    assert_int_equal(finish(soak), 0);
    assert_true(row->noticed == 1 && row->lost == 1);
    soak_rig_end(soak);
    soak = soak_rig_make(); /* one was refused, and two are not there: the other one has no reason */
    see(soak, FIRST, 0, 0.0);
    notice(soak, SCANHEAD_NOTICE_REFUSED, FIRST + 1, 1);
    notice(soak, SCANHEAD_NOTICE_REFUSED, FIRST, 1); /* this number came, so it is not missing */
    see(soak, FIRST + 3, 0, 0.0);
    uint32_t gaps = 0;
    for (uint32_t i = 0; i < SOAK_RING; i++)
        gaps += soak->link[0].fact[i].marks == SOAK_GAP;
    assert_int_equal(gaps, 1);
    assert_int_equal(soak->link[0].refused_frames, 2);
    soak_rig_end(soak);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(faults_that_change_nothing),
        cmocka_unit_test(a_fault_without_a_place),
        cmocka_unit_test(a_power_cycle_before_the_first_frame),
        cmocka_unit_test(faults_beside_a_drop),
        cmocka_unit_test(faults_beside_a_refused_frame),
        cmocka_unit_test(nothing_overtakes),
        cmocka_unit_test(what_came_last),
        cmocka_unit_test(acts_after_the_end_of_a_session),
        cmocka_unit_test(clients_are_turned_away),
        cmocka_unit_test(a_refused_frame_is_missing),
    };
    return cmocka_run_group_tests_name("soak, hidden", tests, NULL, NULL);
}
