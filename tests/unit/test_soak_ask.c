/* SPDX-License-Identifier: MIT */
/* The questions of a soak's client, to a head that the test plays: which is asked when, which answer is right, and
 * which fault of a reply counts as noticed, hidden or missed. The clock is the test's, so bounds are met exactly. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/host/scanhead.h"
#include "firmware_sim/app/studio/soak/ask.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/command/head.h"
#include "tests/unit/clock_rig.h"
#include "tests/unit/lock_rig.h"

#define MS           INT64_C(1000000)
#define IDN          "a,b,c,scanhead native 1"
#define IDN_OF_OTHER "a,b,d,scanhead native 1"

/* The head's next answers, and the notes of faults that come while the first of them is awaited. */
struct answer_is {
    int rc;
    const char *reply;
    int64_t after_ns;
};
static struct answer_is script[2];
static struct fault_note notes[SOAK_MAX_REPLY_NOTES];
static uint32_t n_notes, n_echoes;
static uint64_t n_bad_bytes, n_others;
static char asked[256], state[64];
static int n_asked;
static struct soak_link link;

int scanhead_command(struct scanhead *sh, const char *command, char *reply, size_t reply_len, int timeout_ms)
{
    assert_ptr_equal(sh, link.sh);
    assert_int_equal(timeout_ms, 5000);
    assert_int_equal(reply_len, SOAK_REPLY_LEN);
    assert_int_equal(link.ask.active, 1);
    assert_true(link.ask.n == 0 && link.ask.echoes == 0 && link.ask.others == 0 && link.ask.bad_bytes == 0);
    assert_int_equal(lock_rig_held, 0); /* faults are noted meanwhile */
    if (n_asked == 0) {
        memcpy(link.ask.note, notes, sizeof notes);
        link.ask.n = n_notes;
        link.ask.echoes = n_echoes;
        link.ask.bad_bytes = n_bad_bytes;
        link.ask.others = n_others;
    }
    const struct answer_is *is = &script[n_asked++];
    snprintf(asked + strlen(asked), sizeof asked - strlen(asked), "%s ", command);
    clock_rig_ns += is->after_ns;
    if (is->rc == SCANHEAD_OK) snprintf(reply, reply_len, "%s", is->reply);
    return is->rc;
}

void soak_saw_state(struct soak_link *at, const char *text)
{
    assert_ptr_equal(at, &link);
    snprintf(state, sizeof state, "%s", text);
}

static void begin(int rc, const char *reply, int64_t after_ns)
{
    memset(&link, 0, sizeof link);
    pthread_mutex_init(&link.lock, NULL);
    link.sh = (struct scanhead *)&link;
    link.ask.n = link.ask.echoes = 1; /* left from a question before */
    link.ask.others = link.ask.bad_bytes = 1;
    clock_rig_ns = 1000 * 1000 * MS;
    script[0] = (struct answer_is){rc, reply, after_ns};
    n_notes = n_echoes = 0;
    n_bad_bytes = n_others = 0;
    asked[0] = state[0] = '\0';
    n_asked = 0;
}

static void again(int rc, const char *reply)
{
    n_asked = 0;
    asked[0] = '\0';
    script[0] = (struct answer_is){rc, reply, 0};
}

static void ask(void)
{
    TAKES(2, (soak_ask_next(&link), 0));
    assert_int_equal(link.ask.active, 0);
}

static void expect_counts(unsigned n, unsigned answered, unsigned timeouts, unsigned wrong, unsigned odd)
{
    assert_int_equal(link.ask.asked, n);
    assert_int_equal(link.ask.answered, answered);
    assert_int_equal(link.ask.timeouts, timeouts);
    assert_int_equal(link.ask.wrong, wrong);
    assert_int_equal(link.ask.odd, odd);
}

static void three_questions_take_turns(void **unused)
{
    static const char *const questions[] = {"*IDN? ", "SYST:ERR:COUN? ", "SYST:VERS? "}, *const answers[] = {IDN, "7",
                                                                                                             "1999.0"};
    (void)unused;
    begin(SCANHEAD_OK, "", 0);
    for (unsigned i = 0; i < 7; i++) {
        again(SCANHEAD_OK, answers[i % 3]);
        ask();
        assert_string_equal(asked, questions[i % 3]);
        assert_string_equal(link.ask.before, answers[i % 3]);
        expect_counts(i + 1, i + 1, 0, 0, 0);
        assert_string_equal(link.idn, IDN);
    }
}

/* An identity has four parts, of which the last names the stream. A count of errors has one or two digits, and the
 * version is that of SCPI. */
static void answers_are_right_or_wrong(void **unused)
{
    static const struct {
        uint32_t question;
        const char *reply;
        unsigned right;
    } rows[] = {{0, "Maker,Model,1,scanhead native 1", 1},
                {0, ",,,scanhead native 2", 1},
                {0, "1 drop, 2 burst, 3 late_reply, 4 echo", 0},
                {0, "Maker,Model,1,scanhead native", 0},
                {0, "Maker,Mo,del,1,scanhead native 1", 0},
                {0, ",,,", 0},
                {0, "Maker,Model,1", 0},
                {0, "Maker,Model,1,2.0,", 0},
                {0, "", 0},
                {1, "0", 1},
                {1, "99", 1},
                {1, "100", 0},
                {1, "", 0},
                {1, "-1", 0},
                {1, "1 ", 0},
                {1, "a", 0},
                {2, "1999.0", 1},
                {2, "1999.1", 0},
                {2, "1999.00", 0},
                {2, "", 0}};
    (void)unused;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        begin(SCANHEAD_OK, rows[i].reply, 0);
        link.ask.next = rows[i].question;
        strcpy(link.idn, "before");
        ask();
        expect_counts(1, rows[i].right, 0, !rows[i].right, !rows[i].right);
        assert_int_equal(link.ask.settling, 0);
        assert_string_equal(link.idn, rows[i].question == 0 && rows[i].right ? rows[i].reply : "before");
    }
    begin(SCANHEAD_ETIMEOUT, "", 0);
    strcpy(link.ask.before, "7");
    ask();
    expect_counts(1, 0, 1, 0, 1);
    assert_int_equal(link.ask.settling, 1); /* the library resynchronises before the next question */
    assert_string_equal(link.ask.before, "7");
    begin(SCANHEAD_ECLOSED, "", 0); /* there is no answer to judge */
    link.ask.settling = 1;
    ask();
    expect_counts(1, 0, 0, 0, 0);
    assert_int_equal(link.ask.settling, 0);
}

/* A head that is idle is started, and one in fault is reset. */
static void a_scan_is_started(void **unused)
{
    static const struct {
        const char *state, *then, *answer;
        unsigned right;
    } rows[] = {{"idle", "SCAN:STARt ", "OK", 1},
                {"fault", "*RST ", "OK", 1},
                {"idle", "SCAN:STARt ", "ERR -203,\"Command protected\"", 1},
                {"fault", "*RST ", "ERR -221,\"Settings conflict\"", 1},
                {"idle", "SCAN:STARt ", "ERR -202,\"\"", 0},
                {"idle", "SCAN:STARt ", "ERR -231,\"\"", 0},
                {"idle", "SCAN:STARt ", "OK ", 0},
                {"idle", "SCAN:STARt ", "", 0}};
    char expected[64];
    (void)unused;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        begin(SCANHEAD_OK, rows[i].state, 0);
        script[1] = (struct answer_is){SCANHEAD_OK, rows[i].answer, 0};
        TAKES(4, (soak_ask_scan(&link), 0));
        assert_int_equal(link.ask.active, 0);
        snprintf(expected, sizeof expected, "HEAD:STATe? %s", rows[i].then);
        assert_string_equal(asked, expected);
        assert_string_equal(state, rows[i].state);
        expect_counts(2, 1 + rows[i].right, 0, !rows[i].right, !rows[i].right);
    }
    for (int i = 0; i < HEAD_N_STATES; i++) {
        const char *name = head_state_name((enum head_state)i);
        if (strcmp(name, "idle") == 0 || strcmp(name, "fault") == 0) continue;
        begin(SCANHEAD_OK, name, 0);
        soak_ask_scan(&link);
        assert_string_equal(asked, "HEAD:STATe? ");
        assert_string_equal(state, name);
        expect_counts(1, 1, 0, 0, 0);
    }
    begin(SCANHEAD_OK, "idles", 0);
    soak_ask_scan(&link);
    assert_string_equal(asked, "HEAD:STATe? ");
    assert_string_equal(state, "");
    expect_counts(1, 0, 0, 1, 1);
}

/* A wrong or missing reply has a reason where another fault is at work, or where a session ended less than a second
 * ago. */
static void replies_that_are_hurt(void **unused)
{
    static const struct {
        uint64_t others;
        int64_t ended_before_ns; /* 0: no session has ended */
        unsigned hurt;
    } rows[] = {{0, 0, 0}, {1, 0, 1}, {0, 1000 * MS - 1, 1}, {0, 1000 * MS, 0}, {0, 1, 1}};
    static const struct answer_is bad[] = {{SCANHEAD_OK, "x", 0}, {SCANHEAD_ETIMEOUT, "", 5000 * MS}};
    (void)unused;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        for (int k = 0; k < 2; k++) {
            begin(bad[k].rc, bad[k].reply, bad[k].after_ns);
            n_others = rows[i].others;
            if (rows[i].ended_before_ns != 0) link.ask.ended_ns = clock_rig_ns - rows[i].ended_before_ns;
            ask();
            assert_int_equal(link.ask.hurt, rows[i].hurt);
            assert_int_equal(link.ask.odd, 1 - rows[i].hurt);
        }
    begin(SCANHEAD_OK, IDN, 0); /* a right reply is not hurt by others */
    n_others = 1;
    ask();
    assert_true(link.ask.hurt == 0 && link.ask.odd == 0);
}

/* ---- faults of the reply at hand */

static const char SAME[] = "the reply before was the same", OVER[] = "the session was over before it",
                  SETTLES[] = "it hit a question by which the library resynchronises";

struct hit {
    enum fault_kind kind;
    struct answer_is answer;
    int noticed;
    const char *why; /* it is hidden; NULL, and not noticed: it is missed */
    int settling;    /* before */
    const char *before;
};

static void expect_hit(const struct hit *h, double for_ms)
{
    begin(h->answer.rc, h->answer.reply, h->answer.after_ns);
    notes[0] = (struct fault_note){.kind = h->kind, .for_ms = for_ms, .n = 6};
    n_notes = 1;
    link.ask.settling = h->settling;
    if (h->before != NULL) strcpy(link.ask.before, h->before);
    ask();
    const struct soak_row *row = &link.row[h->kind];
    assert_int_equal(row->noticed, h->noticed);
    assert_int_equal(row->hidden, h->why != NULL);
    assert_int_equal(row->missed, !h->noticed && h->why == NULL);
    if (h->why != NULL) assert_string_equal(row->why, h->why);
    assert_true(link.ask.hurt == 0 && link.ask.odd == 0); /* the fault is the reason */
}

/* A reply that never comes lets the question be repeated after a second, 100 ms of margin included; a late one comes
 * for_ms later, with 5 ms of margin. */
static void faults_of_replies(void **unused)
{
    static const struct hit rows[] = {
        {FAULT_NO_REPLY, {SCANHEAD_ETIMEOUT, "", 0}, 1, NULL, 0, NULL},
        {FAULT_NO_REPLY, {SCANHEAD_OK, IDN, 900 * MS}, 1, NULL, 0, NULL},
        {FAULT_NO_REPLY, {SCANHEAD_OK, IDN, 899 * MS}, 0, NULL, 0, NULL},
        {FAULT_NO_REPLY, {SCANHEAD_OK, IDN, 899 * MS}, 0, SETTLES, 1, NULL},
        {FAULT_NO_REPLY, {SCANHEAD_ECLOSED, "", 899 * MS}, 0, OVER, 1, NULL},
        {FAULT_LATE_REPLY, {SCANHEAD_ETIMEOUT, "", 0}, 1, NULL, 0, NULL},
        {FAULT_LATE_REPLY, {SCANHEAD_OK, IDN, 95 * MS}, 1, NULL, 0, NULL},
        {FAULT_LATE_REPLY, {SCANHEAD_OK, IDN, 94 * MS}, 0, NULL, 0, IDN},
        {FAULT_LATE_REPLY, {SCANHEAD_ELOST, "", 94 * MS}, 0, OVER, 0, NULL},
        {FAULT_WRONG_REPLY, {SCANHEAD_ETIMEOUT, "", 0}, 1, NULL, 0, NULL},
        {FAULT_WRONG_REPLY, {SCANHEAD_OK, "1999.0", 0}, 1, NULL, 0, NULL},
        {FAULT_WRONG_REPLY, {SCANHEAD_OK, IDN, 0}, 0, SAME, 0, IDN},
        {FAULT_WRONG_REPLY, {SCANHEAD_OK, IDN, 0}, 0, NULL, 0, IDN_OF_OTHER},
        {FAULT_WRONG_REPLY, {SCANHEAD_OK, IDN, 0}, 0, SETTLES, 1, IDN_OF_OTHER},
        {FAULT_ECHO, {SCANHEAD_OK, IDN, 0}, 0, NULL, 0, IDN},
    };
    (void)unused;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        expect_hit(&rows[i], 100.0);
}

/* An echo shows by itself, or as bytes that belong to no frame. Such bytes may have taken a reply with them. */
static void echoes(void **unused)
{
    static const struct {
        uint32_t echoes;
        uint64_t bad_bytes;
        unsigned noticed;
    } rows[] = {{1, 0, 1}, {0, 6, 1}, {0, 7, 1}, {0, 5, 0}, {0, 0, 0}};
    (void)unused;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        begin(SCANHEAD_OK, IDN, 0);
        notes[0] = (struct fault_note){.kind = FAULT_ECHO, .n = 6};
        n_notes = 1;
        n_echoes = rows[i].echoes;
        n_bad_bytes = rows[i].bad_bytes;
        ask();
        assert_int_equal(link.row[FAULT_ECHO].noticed, rows[i].noticed);
        assert_int_equal(link.row[FAULT_ECHO].missed, 1 - rows[i].noticed);
        assert_int_equal(link.expected_bad_max, rows[i].bad_bytes != 0 ? SOAK_REPLY_LEN : 0);
    }
}

/* Each fault of a reply is judged by itself. */
static void several_faults_at_once(void **unused)
{
    (void)unused;
    begin(SCANHEAD_OK, IDN, 500 * MS);
    for (n_notes = 0; n_notes < SOAK_MAX_REPLY_NOTES; n_notes++)
        notes[n_notes] = (struct fault_note){.kind = FAULT_LATE_REPLY, .for_ms = n_notes < 10 ? 100.0 : 600.0};
    notes[15].kind = FAULT_WRONG_REPLY;
    ask();
    assert_int_equal(link.row[FAULT_LATE_REPLY].noticed, 10);
    assert_int_equal(link.row[FAULT_LATE_REPLY].missed, 5);
    assert_int_equal(link.row[FAULT_WRONG_REPLY].missed, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(three_questions_take_turns), cmocka_unit_test(answers_are_right_or_wrong),
        cmocka_unit_test(a_scan_is_started),          cmocka_unit_test(replies_that_are_hurt),
        cmocka_unit_test(faults_of_replies),          cmocka_unit_test(echoes),
        cmocka_unit_test(several_faults_at_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
