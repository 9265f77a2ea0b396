/* SPDX-License-Identifier: MIT */
/* Events of errors: their number is limited, and none is forgotten. */
#include "tests/unit/device_rig.h"

/* A tick holds 24 events. The errors of a client that sends them all the time must not displace the scan's end. */
static void the_last_events_are_said_however_many(void **state)
{
    (void)state;
    struct rig *rig = rig_open(&(struct device_options){.start = 1, .one_scan = 1}, NULL, 0);
    struct command_result result;
    rig_go_to(rig, 230 + 499);
    for (int i = 0; i < 100; i++)
        device_command(rig->device, 1, "nonsense", rig->next, &result);
    uint64_t single = 0, held = 0, ends = 0;
    while (rig_claim(rig))
        for (uint32_t i = 0; i < rig->work.n_events; i++) {
            const struct native_event *event = &rig->work.event[i];
            ends += event->code == NATIVE_EV_SCAN_END;
            if (event->code != NATIVE_EV_ERROR) continue;
            assert_true(event->b == 1 && (int64_t)event->a == CMD_E_HEADER);
            single += event->c == 0;
            held += event->c;
        }
    assert_int_equal(single, 10);
    assert_int_equal(held, 90); /* reported though the second was not over */
    assert_int_equal(ends, 1);
    rig_close(rig);
}

/* Each session has ten in a second of its own. A second later the held back ones are counted, and ten more have
 * room. */
static void errors_are_held_back_by_session(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    struct command_result result;
    uint64_t single[3] = {0}, held[3] = {0}, events = 0;
    for (uint64_t tick = 0; tick < 3500; tick++) {
        for (uint32_t session = 1; session <= 2 && tick < 2000; session++)
            if (session == 1 || tick % 150 == 0) device_command(rig->device, session, "nonsense", tick, &result);
        assert_true(rig_claim(rig));
        for (uint32_t i = 0; i < rig->work.n_events; i++) {
            const struct native_event *event = &rig->work.event[i];
            if (event->code != NATIVE_EV_ERROR) continue;
            assert_in_range(event->b, 1, 2);
            single[event->b] += event->c == 0;
            held[event->b] += event->c;
            events++;
        }
    }
    assert_true(single[2] == 14 && held[2] == 0); /* a session with few errors is not affected, however long */
    assert_int_equal(single[1] + held[1], 2000);
    assert_in_range(events - 14, 2 * 11, 3 * 11);
    rig_close(rig);
}

static void keep_warning(void *ctx, const char *text)
{
    strcpy(ctx, text); /* sh_warn has 512 bytes */
}

/* A journal has commands that had an effect. Where the head refuses some, the session is another one, and that is said
 * once, with the first of them. */
static void a_replay_says_what_it_refused(void **state)
{
    (void)state;
    static const struct {
        const char *lines, *says; /* says NULL: nothing */
    } cases[] = {{"300 300000000 1 HEAD:LINES 50\n", NULL},
                 {"300 300000000 1 HEAD:LINES 50\n301 301000000 1 HEAD:LINES 99999\n302 302000000 2 BLAH\n",
                  ":3: HEAD:LINES 99999: ERR -222"},
                 {"300 300000000 1 SITE:POSE 1, 0,0,-1.9,0,0,0\n", /* only planning shows that it can't stand there */
                  ":2: SITE:POSE 1, 0,0,-1.9,0,0,0: ERR -221"}};
    static const char *const sets[] = {"stations[0].tripod.leg_m=2.5", "stations[0].tripod.head_above_m=0.2"};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char warned[512] = "";
        const struct sh_report report = {.ctx = warned, .warn = keep_warning};
        FILE *f = fopen(journal_path, "w");
        assert_non_null(f);
        fprintf(f, "# scanhead journal 1\n%s", cases[i].lines);
        assert_int_equal(fclose(f), 0);
        struct rig *rig = rig_open(&(struct device_options){.replay = journal_path, .report = &report}, sets, 2);
        rig_go_to(rig, 400);
        rig_close(rig);
        if (cases[i].says == NULL ? warned[0] != '\0' : strstr(warned, cases[i].says) == NULL) fail_msg("%s", warned);
        if (i == 1) assert_non_null(strstr(warned, "of 3 replayed commands the head refused 2"));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_last_events_are_said_however_many),
        cmocka_unit_test(errors_are_held_back_by_session),
        cmocka_unit_test(a_replay_says_what_it_refused),
    };
    return cmocka_run_group_tests_name("device errors", tests, make_folder, remove_folder);
}
