/* SPDX-License-Identifier: MIT */
/* The sheet of a soak: each figure stands under its name, in JSON and in text, and each reason for a bad verdict is
 * found by itself. All figures differ, so that exchanged ones show. */
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/soak/client.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/app/studio/soak/sheet.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/fault/board.h"
#include "tests/unit/host_rig.h"
#include "tests/unit/output_rig.h"

static struct soak soak;

static void fill_rows(struct soak_link *first, struct soak_link *second)
{
    first->row[FAULT_DROP] = (struct soak_row){11, 12, 13, 14, 15, 16, "it was at the end"};
    first->row[SOAK_RESEALED] = (struct soak_row){.injected = 21, .hidden = 21, .why = "no checksum shows it"};
    second->row[FAULT_N_KINDS - 1] = (struct soak_row){.injected = 31, .noticed = 31, .lost = 32};
}

static void fill(void)
{
    struct soak_link *first = &soak.link[0], *second = &soak.link[1];
    memset(&soak, 0, sizeof soak);
    soak.n_links = 2;
    soak.wall_s = 1.5;
    *first =
        (struct soak_link){.number = 1,
                           .type = "tcp",
                           .endpoint = "tcp:127.0.0.1:7",
                           .usable = 1,
                           .frames = 41,
                           .bytes = 42,
                           .bad_bytes = 43,
                           .refused_frames = 44,
                           .sessions = 45,
                           .closings = 46,
                           .away = 47,
                           .reader_lost = 48,
                           .dropped = 58,
                           .too_far = 59,
                           .lost_plain = 49,
                           .wrong_plain = 50,
                           .unknown = 51,
                           .ask = {.asked = 52, .answered = 53, .timeouts = 54, .wrong = 55, .hurt = 56, .odd = 57},
                           .failed = "no head"};
    *second = (struct soak_link){.number = 2, .type = "null", .not_soaked = "nobody reads it"};
    fill_rows(first, second);
    soak.clean.frames = 61;
    soak.clean.reader_lost = 62;
    soak.stats.counters.lost_pulses = 63;
    soak.stats.have_hash = 1;
    strcpy(soak.clean.idn, "a,b,c,d");
    strcpy(soak.clean.state, "idle");
    strcpy(soak.stats.sha256, "12ab");
    strcpy(soak.clean.sha256, "34cd");
    soak.failures[0] = "first reason";
    soak.failures[1] = "second reason";
    soak.n_failures = 2;
}

static void expect_json(const char *expected)
{
    struct web_body body;
    struct sh_err err;
    assert_int_equal(page_json(soak_put, &soak, &body, &err), 0);
    assert_string_equal(body.bytes, expected);
    free(body.bytes);
}

static void each_key(void **state)
{
    char expected[4096];
    (void)state;
    fill();
    snprintf(expected, sizeof expected,
             "{\"wall_s\":1.5,\"links\":[{\"link\":1,\"type\":\"tcp\",\"endpoint\":\"tcp:127.0.0.1:7\","
             "\"not_soaked\":null,\"faults\":["
             "{\"fault\":\"drop\",\"injected\":11,\"noticed\":12,\"hidden\":13,\"missed\":14,\"lost\":15,"
             "\"wrongly_accepted\":16,\"hidden_because\":\"it was at the end\"},"
             "{\"fault\":\"flip, resealed\",\"injected\":21,\"noticed\":0,\"hidden\":21,\"missed\":0,\"lost\":0,"
             "\"wrongly_accepted\":0,\"hidden_because\":\"no checksum shows it\"}],"
             "\"frames\":41,\"bytes\":42,\"bad_bytes\":43,\"refused_frames\":44,\"sessions\":45,\"closed\":46,"
             "\"away_frames\":47,\"reader_lost_frames\":48,\"dropped_frames\":58,\"reports_too_far_ahead\":59,"
             "\"lost_without_fault\":49,\"wrong_without_fault\":50,"
             "\"not_compared\":51,\"questions\":52,\"right_answers\":53,\"timeouts\":54,\"wrong_answers\":55,"
             "\"replies_hurt_beside_frames\":56,\"replies_wrong_without_fault\":57,\"gave_up\":\"no head\"},"
             "{\"link\":2,\"type\":\"null\",\"endpoint\":\"\",\"not_soaked\":\"nobody reads it\",\"faults\":["
             "{\"fault\":\"%s\",\"injected\":31,\"noticed\":31,\"hidden\":0,\"missed\":0,\"lost\":32,"
             "\"wrongly_accepted\":0}]}],"
             "\"head\":{\"clean_frames\":61,\"clean_reader_lost_frames\":62,\"lost_pulses\":63,"
             "\"identity\":\"a,b,c,d\",\"state\":\"idle\",\"stream_sha256\":\"12ab\",\"clean_sha256\":\"34cd\"},"
             "\"injected\":63,\"noticed\":43,\"hidden\":34,\"missed\":14,\"lost\":47,\"wrongly_accepted\":16,"
             "\"good\":false,\"failures\":[\"first reason\",\"second reason\"]}\n",
             fault_names[FAULT_N_KINDS - 1]);
    expect_json(expected);
}

static void each_line(void **state)
{
    char expected[4096], *text;
    size_t len;
    (void)state;
    fill();
    FILE *file = open_memstream(&text, &len);
    soak_print(&soak, file);
    assert_int_equal(fclose(file), 0);
    snprintf(
        expected, sizeof expected,
        "link                   fault            injected  noticed     lost accepted\n"
        "1 tcp                  drop                   11       12       15       16  14 NOT NOTICED; "
        "13 can't be noticed: it was at the end\n"
        "1 tcp                  flip, resealed         21        -        0        0  no checksum shows it\n"
        "1 tcp                  41 frames in 45 sessions, 52 questions; 47 frames came while there was no session; "
        "48 left out, the client was too slow; 58 dropped by its library; 59 reports were too far ahead of it; 56 replies were lost or wrong beside another fault, or just "
        "after a session; 51 frames the clean reader did not get; gave up: no head\n"
        "2 null                 %-16s       31       31       32        0  \n"
        "2 null                 not soaked: nobody reads it\n"
        "all                                           63       43       47       16  34 can't be noticed, 14 not "
        "noticed\n"
        "verdict: bad: first reason\nverdict: bad: second reason\n",
        fault_names[FAULT_N_KINDS - 1]);
    assert_string_equal(text, expected);
    free(text);
}

/* Without a failure the verdict is good, and has the number of accepted frames. */
static void a_good_verdict(void **state)
{
    char *text;
    size_t len;
    (void)state;
    fill();
    soak.n_failures = 0;
    FILE *file = open_memstream(&text, &len);
    soak_print(&soak, file);
    assert_int_equal(fclose(file), 0);
    const char *verdict = strstr(text, "verdict: ");
    assert_non_null(verdict);
    assert_string_equal(verdict, "verdict: good; frames wrongly accepted: 16, all of them resealed flips\n");
    free(text);
}

static void progress(void **state)
{
    static const struct fault_list none;
    const struct fault_note note = {.fault = 1, .number = 1};
    _Atomic uint64_t lost = 0;
    struct output output;
    struct sh_err err;
    (void)state;
    fill();
    soak.link[1].frames = 4;
    soak.link[1].row[FAULT_N_KINDS - 1].missed = 3;
    for (int i = 0; i < 2; i++)
        pthread_mutex_init(&soak.link[i].lock, NULL);
    assert_int_equal(fault_board_create(&none, NULL, &lost, &soak.board, &err), SH_OK);
    for (int i = 0; i < 7; i++)
        fault_board_note(soak.board, &note);
    output_take(&output, stderr);
    soak_say_progress(&soak, 8.6);
    char *said = output_give(&output);
    assert_string_equal(said, "scanhead: soak: 9 s, 7 faults injected, 45 frames received, 17 faults not noticed\n");
    free(said);
    fault_board_free(soak.board);
}

/* ---- the verdict */

static void make_good(void)
{
    memset(&soak, 0, sizeof soak);
    soak.n_links = 2;
    for (int i = 0; i < 2; i++)
        soak.link[i] = (struct soak_link){.usable = 1,
                                          .frames = 1,
                                          .in_session = 1,
                                          .bad_bytes = 5,
                                          .expected_bad_min = 5,
                                          .expected_bad_max = 5,
                                          .lost_plain = 7,
                                          .reader_lost = 7};
    soak.link[0].row[FAULT_DROP] = (struct soak_row){.injected = 9, .noticed = 2, .hidden = 3, .accepted = 4};
    strcpy(soak.clean.idn, "a,b,c,d");
    strcpy(soak.clean.state, "scanning");
    soak.stats.have_hash = 1;
}

/* Values at their limits are good. On a link without a client nothing is judged but the sum of its rows. */
static void limits_are_good(void **state)
{
    (void)state;
    make_good();
    soak.link[1].usable = soak.link[1].in_session = 0;
    soak.link[1].frames = soak.link[1].bad_bytes = 0;
    soak.link[0].unknown = soak.clean.reader_lost = 6; /* the clean reader lost these */
    soak_conclude(&soak);
    if (soak.n_failures != 0) fail_msg("%s", soak.failures[0]);
    assert_true(soak.healthy && soak.hash_is_same);
}

static void give_up(struct soak_link *link)
{
    strcpy(link->failed, "away");
}

static void differ(struct soak_link *link)
{
    link->wrong_plain = 1;
}

static void lose(struct soak_link *link)
{
    link->lost_plain = link->reader_lost + 1;
}

/* Each dropped frame counts as lost, but has a reason of its own. */
static void drop_in_the_library(struct soak_link *link)
{
    link->dropped = 2;
    link->lost_plain = link->reader_lost + 2;
}

static void lag_behind_reports(struct soak_link *link)
{
    link->too_far = 1;
}

static void lag_behind_the_clean_reader(struct soak_link *link)
{
    link->unknown = soak.clean.reader_lost + 1;
}

static void answer_oddly(struct soak_link *link)
{
    link->ask.odd = 1;
}

static void be_closed(struct soak_link *link)
{
    link->odd_closings = 1;
}

static void get_nothing(struct soak_link *link)
{
    link->frames = 0;
}

static void have_no_session(struct soak_link *link)
{
    link->in_session = 0;
}

static void have_too_few_bytes(struct soak_link *link)
{
    link->bad_bytes = link->expected_bad_min - 1;
}

static void have_too_many_bytes(struct soak_link *link)
{
    link->bad_bytes = link->expected_bad_max + 1;
}

static void miss(struct soak_link *link)
{
    link->row[FAULT_FLIP] = (struct soak_row){.injected = 1, .missed = 1};
}

static void count_too_few(struct soak_link *link)
{
    link->row[FAULT_FLIP] = (struct soak_row){.injected = 2, .noticed = 1};
}

static void end_the_clean_reader(struct soak_link *link)
{
    (void)link;
    strcpy(soak.clean.failed, "end");
}

static void have_no_identity(struct soak_link *link)
{
    (void)link;
    soak.clean.idn[0] = '\0';
}

static void be_idle(struct soak_link *link)
{
    (void)link;
    strcpy(soak.clean.state, "idle");
}

static void have_no_hash(struct soak_link *link)
{
    (void)link;
    soak.stats.have_hash = 0;
}

static void have_another_hash(struct soak_link *link)
{
    (void)link;
    strcpy(soak.clean.sha256, "1");
}

static void lose_pulses(struct soak_link *link)
{
    (void)link;
    soak.stats.counters.lost_pulses = 1;
}

static const struct {
    void (*change)(struct soak_link *link);
    const char *reason;
} BAD[] = {
    {give_up, "a client gave up"},
    {differ, "a frame that was accepted differs from the clean one, without a fault"},
    {lose, "frames were lost without a fault"},
    {drop_in_the_library, "a client's library dropped frames while the client waited for a reply"},
    {lag_behind_reports, "a client was too far behind the head, so not all could be compared"},
    {lag_behind_the_clean_reader, "a client was too far behind the head, so not all could be compared"},
    {answer_oddly, "a reply was wrong or missing without a fault"},
    {be_closed, "a connection was closed without a fault"},
    {get_nothing, "a client got no frame"},
    {have_no_session, "a client had no connection at the end"},
    {have_too_few_bytes, "the number of bytes outside of frames is not that of the faults"},
    {have_too_many_bytes, "the number of bytes outside of frames is not that of the faults"},
    {miss, "a fault that can be noticed was not noticed"},
    {count_too_few, "the counts of a fault do not add up: injected is not noticed + hidden + missed + accepted"},
    {end_the_clean_reader, "the clean reader ended before the head did"},
    {have_no_identity, "the head is not healthy at the end"},
    {be_idle, "the head is not healthy at the end"},
    {have_no_hash, "the head could not compute its hash fast enough"},
    {have_another_hash, "the clean reader's hash is not that of the head"},
    {lose_pulses, "the head lost pulses"},
};

/* Each reason is tried on either link. */
static void each_reason_is_enough(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof BAD / sizeof BAD[0]; i++)
        for (int k = 0; k < 2; k++) {
            make_good();
            BAD[i].change(&soak.link[k]);
            soak_conclude(&soak);
            if (soak.n_failures != 1) fail_msg("%u reasons instead of: %s", soak.n_failures, BAD[i].reason);
            assert_string_equal(soak.failures[0], BAD[i].reason);
        }
    /* Several reasons stand once each, in the order of the links, also where both links have them. */
    make_good();
    differ(&soak.link[0]);
    differ(&soak.link[1]);
    give_up(&soak.link[1]);
    lose_pulses(NULL);
    soak_conclude(&soak);
    assert_int_equal(soak.n_failures, 3);
    assert_string_equal(soak.failures[0], "a frame that was accepted differs from the clean one, without a fault");
    assert_string_equal(soak.failures[1], "a client gave up");
    assert_string_equal(soak.failures[2], "the head lost pulses");
    /* A clean reader that lost frames has another hash, which says nothing of the head. */
    make_good();
    strcpy(soak.clean.sha256, "1");
    soak.clean.reader_lost = 1;
    soak_conclude(&soak);
    assert_int_equal(soak.n_failures, 0);
}

static void keep_warning(void *ctx, const char *text)
{
    snprintf(ctx, 256, "%s", text);
}

/* From 90 % hidden ones on, a warning says how many they are; the verdict is good all the same. */
static void hidden_faults_are_named(void **state)
{
    static const struct {
        uint64_t injected, hidden;
        const char *warning;
    } rows[] = {{20, 18, "18 of 20 injected faults can't be noticed"}, {20, 17, NULL}, {9, 9, NULL}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char said[256] = "";
        const struct sh_report report = {.ctx = said, .warn = keep_warning};
        const uint64_t n = rows[i].injected, hidden = rows[i].hidden;
        make_good();
        soak.link[0].row[FAULT_DROP] = (struct soak_row){.injected = n, .hidden = hidden, .noticed = n - hidden};
        soak_conclude(&soak);
        assert_int_equal(soak.n_failures, 0);
        soak_warn_hidden(&soak, &report);
        if (rows[i].warning == NULL)
            assert_string_equal(said, "");
        else
            assert_non_null(strstr(said, rows[i].warning));
    }
}

/* Acts, refusals and plugs that nobody noticed by the end are missed. */
static void open_acts_are_missed(void **state)
{
    (void)state;
    make_good();
    struct soak_link *link = &soak.link[0];
    link->n_acts = link->n_refusals = link->plugs.n = 2;
    link->act[0].kind = link->act[1].kind = FAULT_DISCONNECT;
    link->refusal[0].kind = link->refusal[1].kind = FAULT_REFUSE;
    link->plugs.note[0].kind = link->plugs.note[1].kind = FAULT_UNPLUG;
    link->row[FAULT_DISCONNECT].injected = link->row[FAULT_REFUSE].injected = link->row[FAULT_UNPLUG].injected = 2;
    soak_conclude(&soak);
    assert_int_equal(link->row[FAULT_DISCONNECT].missed, 2);
    assert_int_equal(link->row[FAULT_REFUSE].missed, 2);
    assert_int_equal(link->row[FAULT_UNPLUG].missed, 2);
    assert_int_equal(soak.n_failures, 1); /* the counts add up */
}

/* Once the clients have ended, the sheet has the number of frames that the head says it left out. */
static void left_out_frames_are_those_of_the_head(void **state)
{
    struct scanhead_frame frame;
    int fd;
    (void)state;
    make_good();
    soak.link[1].sh = open_pair(&fd);
    put_event(fd, NATIVE_EV_READER_LOST, 1, 2, 77, 0);
    expect_frame(soak.link[1].sh, SCANHEAD_EVENT, &frame);
    soak_clients_join(&soak);
    assert_int_equal(soak.link[0].reader_lost, 7); /* it has no client */
    assert_int_equal(soak.link[1].reader_lost, 77);
    scanhead_close(soak.link[1].sh);
    close(fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_key),
        cmocka_unit_test(each_line),
        cmocka_unit_test(a_good_verdict),
        cmocka_unit_test(progress),
        cmocka_unit_test(limits_are_good),
        cmocka_unit_test(each_reason_is_enough),
        cmocka_unit_test(hidden_faults_are_named),
        cmocka_unit_test(open_acts_are_missed),
        cmocka_unit_test(left_out_frames_are_those_of_the_head),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
