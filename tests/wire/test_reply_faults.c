/* SPDX-License-Identifier: MIT */
/* Answers of SCIP and CoLa that go wrong on request: none, another one, a late one, an echo before it. The counts of
 * answers, and of units of the stream, are checked. */
#include "tests/wire/room.h"
#include "tests/wire/unit_faults.h"

static const char FAULTS[] = "faults:\n"
                             "  - {kind: drop}\n"
                             "  - {kind: echo, at: 1}\n"
                             "  - {kind: wrong_reply, at: 3}\n"
                             "  - {kind: no_reply, at: 4}\n"
                             "  - {kind: late_reply, at: 5, for_ms: 300}\n";

static struct head start(struct wire *wire, const char *profile, const char *protocol)
{
    static char scenario[352], truth[352];
    char config[1024];
    room_write(wire);
    snprintf(config, sizeof config,
             "head: {profile: %s, start: on, frames: 0}\nscene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
             "stations: [{position_m: [0.31, -0.42, 0.17]}]\nlinks: [{type: tcp, protocol: %s, port: 0}]\n",
             profile, protocol);
    snprintf(scenario, sizeof scenario, "%s", wire_write_text(wire, "faults.yaml", FAULTS));
    snprintf(truth, sizeof truth, "%s", wire_path(wire, "truth.json"));
    const char *const args[] = {"--scenario", scenario, "--truth", truth, NULL};
    return head_start(wire, wire_write_text(wire, "config.yaml", config), args);
}

/* A line that is sent at once, and the exact answer. */
struct step {
    const char *request, *answer;
    int late_ms; /* not before */
};

static void play(int fd, const struct step *step)
{
    char got[512];
    for (; step->request != NULL; step++) {
        const int64_t sent_ms = wire_now_ms();
        raw_send(fd, step->request, strlen(step->request));
        const size_t len = strlen(step->answer);
        for (size_t n = 0; n < len;) {
            struct pollfd slot = {.fd = fd, .events = POLLIN};
            if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("%.*s for %s", (int)n, got, step->request);
            const ssize_t more = read(fd, got + n, len - n);
            assert_true(more > 0);
            n += (size_t)more;
        }
        if (memcmp(got, step->answer, len) != 0) fail_msg("\"%.*s\" for \"%s\"", (int)len, got, step->request);
        assert_true(wire_now_ms() - sent_ms >= step->late_ms);
    }
}

static void check_truth(struct wire *wire)
{
    static const char *const kinds[] = {"echo", "wrong_reply", "no_reply", "late_reply"};
    static const uint64_t numbers[] = {1, 3, 4, 5};
    uint32_t n, k = 0, n_dropped = 0;
    struct truth_note *note = truth_read(wire_path(wire, "truth.json"), 1, &n);
    for (uint32_t i = 0; i < n; i++) {
        if (strcmp(note[i].kind, "drop") == 0) {
            assert_string_equal(note[i].of, "stream");
            assert_int_equal(note[i].number, ++n_dropped);
            continue;
        }
        assert_true(k < 4);
        assert_string_equal(note[i].of, "replies");
        assert_string_equal(note[i].kind, kinds[k]);
        assert_int_equal(note[i].number, numbers[k++]);
    }
    assert_int_equal(k, 4);
    assert_true(n_dropped > 0);
    free(note);
}

/* Asks until the truth has a unit of the stream. Each answer comes from the head, so this is no busy loop. */
static void wait_for_units(struct wire *wire, int fd, const struct step *question)
{
    for (uint32_t n_dropped = 0, n; n_dropped == 0;) {
        struct truth_note *note = truth_read(wire_path(wire, "truth.json"), 1, &n);
        n_dropped = truth_count(note, n, "drop");
        free(note);
        play(fd, question);
    }
}

static void check(struct wire *wire, const char *profile, const char *protocol, const struct step *steps,
                  const struct step *question)
{
    struct head head = start(wire, profile, protocol);
    const int fd = raw_connect(head_link(&head, 0));
    play(fd, steps);
    wait_for_units(wire, fd, question);
    close(fd);
    head_end(&head, SIGTERM);
    check_truth(wire);
}

/* GD has its scan after a turn, or the status 0A after 2 s. The scan is a unit of the stream, and dropped here. The
 * head has booted before the late answer comes. Answers keep their order. (299: 300 ms, rounded down twice.) */
static void test_scip(void **state)
{
    static const struct step steps[] = {
        {"QT;1\n", "QT;1\nQT;1\n00P\n\n", 0},
        {"QT;2\n", "QT;2\n00P\n\n", 0},
        {"QT;3\n", "QT;2\n00P\n\n", 0},
        {"QT;4\nQT;5\nQT;6\n", "QT;5\n00P\n\nQT;6\n00P\n\n", 299},
        {"BM;7\n", "BM;7\n00P\n\n", 0},
        {"GD0000010001\nTM2;8\n", "TM2;8\n03S\n\n", 0},
        {NULL, NULL, 0},
    };
    static const struct step question[] = {{"TM2;9\n", "TM2;9\n03S\n\n", 0}, {NULL, NULL, 0}};
    check(*state, "hokuyo-utm-30lx", "scip", steps, question);
}

/* An event is confirmed by an answer, and comes in units of the stream. */
static void test_cola(void **state)
{
    static const struct step steps[] = {
        {"\2sRN ODpwrc\3", "\2sRN ODpwrc\3\2sRA ODpwrc 1\3", 0},
        {"\2sRN LCMstate\3", "\2sRA LCMstate 0\3", 0},
        {"\2sRN EIHstCola\3", "\2sRA LCMstate 0\3", 0},
        {"\2sRN ODpwrc\3\2sRN EIHstCola\3\2sRN LCMstate\3", "\2sRA EIHstCola 0\3\2sRA LCMstate 0\3", 299},
        {"\2sEN LMDscandata 1\3", "\2sEA LMDscandata 1\3", 0},
        {NULL, NULL, 0},
    };
    static const struct step question[] = {{"\2sRN ODpwrc\3", "\2sRA ODpwrc 1\3", 0}, {NULL, NULL, 0}};
    check(*state, "sick-tim571", "cola", steps, question);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_scip, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_cola, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
