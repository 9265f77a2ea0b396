/* SPDX-License-Identifier: MIT */
/* The checks of a verdict: what was seen of a client gives each check its result and its sentence, with the figures in
 * it; and the sheet as text, JSON and JUnit. No two figures are the same, so exchanged ones show. */
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/verdict/checks.h"

#define S         INT64_C(1000000000)
#define EXITED(n) ((n) << 8) /* as waitpid has it */
#define NO        VERDICT_NOT_JUDGED
#define YES       VERDICT_PASSED
#define FOUND     VERDICT_FOUND

static const struct verdict_options OPTIONS = {.limit_s = 5, .grace_s = 7};
static struct watch_break broken[3];
static struct watch watch;
static struct client client;
static struct checks checks;
static struct verdict v;

/* A client without a fault connected after 2 s. It was asked to end 30 s after its start, and ended 0.25 s later. */
static void begin(void)
{
    watch = (struct watch){.first_open_ns = 12 * S, .n_span = 3, .injected = 4, .heard_bytes = 55, .wrong_state = 6};
    watch.broken = broken;
    client = (struct client){.ended_ns = 40 * S + S / 4, .status = EXITED(0)};
    checks = (struct checks){.options = &OPTIONS,
                             .watch = &watch,
                             .client = &client,
                             .has_sessions = 1,
                             .is_open = 1,
                             .scans = 1,
                             .start_ns = 10 * S,
                             .ended_ns = 40 * S,
                             .was_there = 1};
    v = (struct verdict){.scenario = "some"};
}

static void expect(enum verdict_check check, enum verdict_state state, const char *text)
{
    if (v.check[check].state != state || strcmp(v.check[check].text, text) != 0)
        fail_msg("%s: %d '%s', not %d '%s'", verdict_names[check], v.check[check].state, v.check[check].text, state,
                 text);
}

static void judge(enum verdict_check check, enum verdict_state state, const char *text)
{
    checks_judge(&checks, &v);
    expect(check, state, text);
}

static void a_right_client(void **state)
{
    (void)state;
    begin();
    judge(VERDICT_CONNECTS, YES, "after 2.00 s");
    expect(VERDICT_COMES_BACK, NO, "no fault ended a connection");
    expect(VERDICT_LETS_GO, NO, "no fault ended a connection");
    expect(VERDICT_ASKS_RIGHT, YES, "55 bytes; refused for the head's state: 6");
    expect(VERDICT_SCANS, YES, "points came until the end");
    expect(VERDICT_KEEPS_UP, YES, "no frame was left out");
    expect(VERDICT_LIVES, YES, "for 30.0 s");
    expect(VERDICT_ENDS, YES, "0.25 s after SIGTERM: exit status 0");
    assert_int_equal(verdict_count(&v, FOUND), 0);
    assert_true(v.figures.sessions == 3 && v.figures.injected == 4 && v.figures.connected_s == 2.0);
    assert_true(v.figures.heard_bytes == 55 && v.figures.refused == 0 && v.figures.refused_by_state == 6);
    assert_true(v.figures.breaks == 0 && isnan(v.figures.back_mean_s) && isnan(v.figures.back_max_s));
    assert_string_equal(v.figures.exit, "exit status 0");
}

static void connections(void **state)
{
    (void)state;
    begin();
    watch.first_open_ns = 0;
    judge(VERDICT_CONNECTS, FOUND, "it did not connect within 5 s");
    expect(VERDICT_KEEPS_UP, NO, "it did not connect");
    assert_true(isnan(v.figures.connected_s));
    checks.was_there = 0;
    judge(VERDICT_CONNECTS, NO, "it ended before; the limit is 5 s");
    begin();
    checks.has_sessions = 0;
    judge(VERDICT_CONNECTS, NO, "the link sends to whoever is there");
    expect(VERDICT_KEEPS_UP, NO, "the link does not wait");
    assert_true(v.figures.sessions == 0 && isnan(v.figures.connected_s));
    begin();
    checks.is_open = 0;
    judge(VERDICT_COMES_BACK, FOUND, "it closed its connection by itself, and had none at the end");
}

/* The client was back after 1 s and after 3 s, within the limit of 5 s. */
static void absences(void **state)
{
    (void)state;
    begin();
    broken[0] = (struct watch_break){.link = 1, .kind = FAULT_DISCONNECT, .over_ns = 20 * S, .back_ns = 21 * S};
    broken[1] = (struct watch_break){.link = 2, .kind = FAULT_UNPLUG, .over_ns = 22 * S, .back_ns = 25 * S};
    watch.n_broken = 2;
    judge(VERDICT_COMES_BACK, YES, "2 times, after 2.00 s on average and 3.00 s at most (unplug)");
    expect(VERDICT_LETS_GO, YES, "each time");
    assert_true(v.figures.breaks == 2 && v.figures.back_mean_s == 2.0 && v.figures.back_max_s == 3.0);
    assert_string_equal(v.broken[0].kind, "disconnect");
    assert_true(v.broken[0].link == 1 && v.broken[0].back_s == 1.0 && v.broken[1].link == 2);
    assert_true(v.broken[2].kind == NULL && v.broken[2].link == 0);
    broken[1].back_ns = 27 * S; /* just the limit */
    judge(VERDICT_COMES_BACK, YES, "2 times, after 3.00 s on average and 5.00 s at most (unplug)");
    broken[1].back_ns = 28 * S;
    judge(VERDICT_COMES_BACK, FOUND, "it came back 6.0 s after unplug; the limit is 5 s");
    broken[0].back_ns = 19 * S; /* before the fault was over: at once */
    broken[1].back_ns = 22 * S;
    judge(VERDICT_COMES_BACK, YES, "2 times, after 0.00 s on average and 0.00 s at most (disconnect)");
}

static void missing_clients(void **state)
{
    (void)state;
    begin();
    broken[0] = (struct watch_break){.kind = FAULT_DISCONNECT, .over_ns = 20 * S, .back_ns = 21 * S};
    broken[1] = (struct watch_break){.kind = FAULT_UNPLUG, .over_ns = 22 * S};
    broken[2] = (struct watch_break){.kind = FAULT_REFUSE, .over_ns = 30 * S};
    watch.n_broken = 3;
    judge(VERDICT_COMES_BACK, FOUND, "it did not come back after unplug, for 18.0 s until the end; the limit is 5 s");
    expect(VERDICT_LETS_GO, YES, "each time");
    assert_true(isnan(v.broken[2].back_s) && v.figures.back_mean_s == 1.0);
    watch.n_broken = 2; /* one absence without an end is enough */
    judge(VERDICT_COMES_BACK, FOUND, "it did not come back after unplug, for 18.0 s until the end; the limit is 5 s");
    watch.n_broken = 3;
    checks.holds = 1;
    judge(VERDICT_COMES_BACK, NO, "it still has the connection from before unplug");
    expect(VERDICT_LETS_GO, FOUND, "18.0 s after unplug it still had the connection from before");
    checks.was_there = 0;
    judge(VERDICT_COMES_BACK, NO, "it had ended");
    expect(VERDICT_LETS_GO, YES, "each time");
    broken[0] = broken[1];
    watch.n_broken = 1;
    judge(VERDICT_LETS_GO, NO, "it did not come back");
}

static void requests_and_scans(void **state)
{
    (void)state;
    begin();
    watch.wrong = 4;
    strcpy(watch.refused[0], "A -> 1");
    strcpy(watch.refused[2], "C -> 3");
    judge(VERDICT_ASKS_RIGHT, FOUND, "4 refused; the first: A -> 1");
    assert_true(v.figures.refused == 4);
    assert_string_equal(v.figures.wrong_lines[0], "A -> 1");
    assert_string_equal(v.figures.wrong_lines[2], "C -> 3");
    begin();
    watch.heard_bytes = 0;
    judge(VERDICT_ASKS_RIGHT, NO, "it asked nothing");
    checks.scans = 0;
    judge(VERDICT_SCANS, FOUND, "no points for 5 s after the last fault: nothing started a scan");
    checks.is_open = 0;
    judge(VERDICT_SCANS, NO, "it was not there to start one");
    checks.has_sessions = 0;
    judge(VERDICT_SCANS, FOUND, "no points for 5 s after the last fault: nothing started a scan");
    checks.was_there = 0;
    judge(VERDICT_SCANS, NO, "it was not there to start one");
    begin();
    v.figures.left_out = 9;
    judge(VERDICT_KEEPS_UP, FOUND, "9 frames were left out, since it read too slowly");
    watch.stalls = 1;
    judge(VERDICT_KEEPS_UP, NO, "the head stalled on request");
}

static void ends(void **state)
{
    static const struct {
        int status, killed, was_there;
        enum verdict_check check;
        enum verdict_state state;
        const char *text;
    } row[] = {
        {EXITED(3), 0, 0, VERDICT_LIVES, FOUND, "it ended by itself 30.25 s after its start: exit status 3"},
        {EXITED(3), 0, 0, VERDICT_ENDS, NO, "it had ended"},
        {SIGSEGV, 0, 0, VERDICT_LIVES, FOUND, "it ended by itself 30.25 s after its start: SIGSEGV"},
        {SIGTERM, 0, 1, VERDICT_ENDS, YES, "0.25 s after SIGTERM: SIGTERM"},
        {EXITED(128), 0, 1, VERDICT_ENDS, YES, "0.25 s after SIGTERM: exit status 128"},
        {EXITED(128 + SIGABRT), 0, 1, VERDICT_ENDS, FOUND, "it died after SIGTERM: SIGABRT"}, /* as a shell says it */
        {SIGSEGV, 0, 1, VERDICT_ENDS, FOUND, "it died after SIGTERM: SIGSEGV"},
        {SIGBUS, 0, 1, VERDICT_ENDS, FOUND, "it died after SIGTERM: SIGBUS"},
        {SIGILL, 0, 1, VERDICT_ENDS, FOUND, "it died after SIGTERM: SIGILL"},
        {SIGFPE, 0, 1, VERDICT_ENDS, FOUND, "it died after SIGTERM: SIGFPE"},
        {SIGKILL, 1, 1, VERDICT_ENDS, FOUND, "it went on for 7 s after SIGTERM, and was killed"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        begin();
        client.status = row[i].status;
        client.had_to_be_killed = row[i].killed;
        checks.was_there = row[i].was_there;
        judge(row[i].check, row[i].state, row[i].text);
    }
}

/* ---- points */

static const double UNKNOWN[3] = {1.5, 2.5, -3.5};

static void points(void **state)
{
    struct verdict_points m = {
        .empty = 1, .n = 20, .sent = 30, .again = 14, .frame = "head", .unit_m = 0.001, .within_m = 0.002};
    (void)state;
    begin();
    checks_points(&v, &m, UNKNOWN);
    expect(VERDICT_POINTS_READ, YES, "20 points, of 30 that were sent; 1 shots without echo");
    expect(VERDICT_POINTS_KNOWN, YES, "all of them (frame: head, within 2 mm)");
    expect(VERDICT_POINTS_ONCE, YES, "none is repeated");
    m.again = 15;
    checks_points(&v, &m, UNKNOWN);
    expect(VERDICT_POINTS_ONCE, YES,
           "none is repeated; but most were sent close to another one, so a repeated one can go unseen");
    m.repeated = 4;
    m.unknown = 10; /* half of them */
    m.first_unknown = 6;
    checks_points(&v, &m, UNKNOWN);
    expect(
        VERDICT_POINTS_KNOWN, FOUND,
        "10 of 20 points are not known: no pulse had them (frame: head, within 2 mm); the first is number 7: 1.5 2.5 "
        "-3.5");
    expect(VERDICT_POINTS_ONCE, FOUND, "4 more than were sent");
    m.unknown = 11;
    checks_points(&v, &m, UNKNOWN);
    expect(VERDICT_POINTS_ONCE, NO, "most of its points are unknown");
    const struct verdict_points *p = &v.points;
    assert_true(p->n == 20 && p->empty == 1 && p->unknown == 11 && p->repeated == 4 && p->sent == 30);
    assert_true(p->unit_m == 0.001 && p->within_m == 0.002);
    checks_no_points(&v, FOUND, "it has no point");
    expect(VERDICT_POINTS_READ, FOUND, "it has no point");
    expect(VERDICT_POINTS_KNOWN, NO, "its points can't be read");
    expect(VERDICT_POINTS_ONCE, NO, "its points can't be read");
    checks_no_points(&v, NO, "no --client-file");
    expect(VERDICT_POINTS_KNOWN, NO, "no --client-file");
    expect(VERDICT_POINTS_ONCE, NO, "no --client-file");
}

/* ---- the sheet */

static void make_sheet(void)
{
    v = (struct verdict){.scenario = "so<me",
                         .log = "a.log",
                         .points = {.n = 1,
                                    .empty = 2,
                                    .unknown = 3,
                                    .repeated = 4,
                                    .sent = 5,
                                    .unit_m = 6.5,
                                    .within_m = 7.5,
                                    .frame = "head"},
                         .figures = {.wall_s = 11.5,
                                     .connected_s = 12.5,
                                     .back_mean_s = 13.5,
                                     .back_max_s = 14.5,
                                     .sessions = 15,
                                     .breaks = 2,
                                     .injected = 16,
                                     .heard_bytes = 17,
                                     .refused = 18,
                                     .refused_by_state = 19,
                                     .left_out = 20,
                                     .lost_pulses = 21,
                                     .exit = "SIGTERM",
                                     .wrong_lines = {"first", "", "third"}},
                         .broken = {{"unplug", 1, 22.5}, {"refuse", 2, NAN}}};
    for (int i = 0; i < VERDICT_N_CHECKS; i++) {
        v.check[i].state = (enum verdict_state)(i % 4);
        snprintf(v.check[i].text, sizeof v.check[i].text, "text %d", i);
    }
}

static void put(struct json *json, const void *ctx)
{
    verdict_put(ctx, json);
}

static void the_sheet(void **state)
{
    static const char *const keys[] = {"not_judged", "passed", "finding", "allowed"}, *const words[] = {"-", "passed",
                                                                                                        "FINDING",
                                                                                                        "allowed"};
    struct web_body body;
    struct sh_err err;
    char expected[4096], *text;
    size_t len = 0, text_len;
    (void)state;
    make_sheet();
    assert_int_equal(page_json(put, &v, &body, &err), 0);
    len += (size_t)snprintf(
        expected, sizeof expected,
        "{\"scenario\":\"so<me\",\"log\":\"a.log\",\"wall_s\":11.5,\"injected\":16,\"connections\":15,"
        "\"ended_by_faults\":2,\"connected_s\":12.5,\"back_mean_s\":13.5,\"back_max_s\":14.5,\"heard_bytes\":17,"
        "\"refused\":18,\"refused_by_state\":19,\"left_out_frames\":20,\"lost_pulses\":21,"
        "\"refused_lines\":[\"first\",\"third\"],\"exit\":\"SIGTERM\",\"disturbances\":["
        "{\"kind\":\"unplug\",\"link\":1,\"back_s\":22.5},{\"kind\":\"refuse\",\"link\":2,\"back_s\":null}],"
        "\"points\":{\"points\":1,\"empty\":2,\"sent\":5,\"unknown\":3,\"repeated\":4,\"frame\":\"head\","
        "\"file_unit_m\":6.5,\"match_m\":7.5},\"checks\":[");
    for (int i = 0; i < VERDICT_N_CHECKS; i++)
        len += (size_t)snprintf(expected + len, sizeof expected - len,
                                "%s{\"check\":\"%s\",\"result\":\"%s\",\"text\":\"text %d\"}", i > 0 ? "," : "",
                                verdict_names[i], keys[i % 4], i);
    snprintf(expected + len, sizeof expected - len, "],\"findings\":3}\n"); /* 2, 6 and 10 of 11 */
    assert_string_equal(body.bytes, expected);
    free(body.bytes);
    FILE *out = open_memstream(&text, &text_len);
    verdict_print(&v, out);
    fclose(out);
    len =
        (size_t)snprintf(expected, sizeof expected, "so<me: 11.5 s, 16 faults injected, 15 connections; log: a.log\n");
    for (int i = 0; i < VERDICT_N_CHECKS; i++)
        len += (size_t)snprintf(expected + len, sizeof expected - len, "  %-13s %-8s text %d\n", verdict_names[i],
                                words[i % 4], i);
    snprintf(expected + len, sizeof expected - len, "  this machine was too slow for the head: it lost 21 pulses\n");
    assert_string_equal(text, expected);
    free(text);
}

static void junit(void **state)
{
    char *got, expected[8192];
    size_t got_len;
    struct verdict both[2];
    (void)state;
    make_sheet();
    v.check[2].text[0] = '\n';
    both[0] = both[1] = v;
    FILE *out = open_memstream(&got, &got_len);
    verdict_put_junit(both, 2, out);
    fclose(out);
    size_t len =
        (size_t)snprintf(expected, sizeof expected,
                         "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites tests=\"22\" failures=\"6\">\n");
    for (int s = 0; s < 2; s++) {
        len +=
            (size_t)snprintf(expected + len, sizeof expected - len,
                             "  <testsuite name=\"so&#60;me\" tests=\"11\" failures=\"3\" skipped=\"5\" errors=\"0\" "
                             "time=\"11.500\">\n");
        for (int i = 0; i < VERDICT_N_CHECKS; i++) {
            char inner[256] = "/>\n";
            if (i % 4 == 2)
                snprintf(inner, sizeof inner, ">\n      <failure message=\"%sext %d\" type=\"%s\"/>\n    </testcase>\n",
                         i == 2 ? "?" : "t", i, verdict_asks[i]);
            else if (i % 4 != 1)
                snprintf(inner, sizeof inner, ">\n      <skipped message=\"text %d\"/>\n    </testcase>\n", i);
            len += (size_t)snprintf(expected + len, sizeof expected - len,
                                    "    <testcase classname=\"so&#60;me\" name=\"%s\" time=\"0\"%s", verdict_names[i],
                                    inner);
        }
        len += (size_t)snprintf(expected + len, sizeof expected - len, "  </testsuite>\n");
    }
    snprintf(expected + len, sizeof expected - len, "</testsuites>\n");
    assert_string_equal(got, expected);
    free(got);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_right_client),  cmocka_unit_test(connections),        cmocka_unit_test(absences),
        cmocka_unit_test(missing_clients), cmocka_unit_test(requests_and_scans), cmocka_unit_test(ends),
        cmocka_unit_test(points),          cmocka_unit_test(the_sheet),          cmocka_unit_test(junit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
